"""Laws of cohesion: one file each, named after the law."""
