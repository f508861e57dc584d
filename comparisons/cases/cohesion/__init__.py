"""Attraction between particles and at walls: cohesion as LIGGGHTS has it, adhesion against closed forms."""
