"""Tangential laws: what those of the literature change beside that of LIGGGHTS."""
