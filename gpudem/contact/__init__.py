"""The contact laws: one file a law, in the folder of its slot."""
