"""Walls: one file a kind, each with one function from (wall, point) to (gap, normal)."""
