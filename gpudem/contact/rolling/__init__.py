"""Rolling laws: one file each, named after the law."""
