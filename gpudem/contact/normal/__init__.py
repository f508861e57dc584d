"""Normal laws: one file each, named after the law ("/" becomes "_")."""
