"""Heaps under a tube that is lifted: angle of repose over friction, rolling friction and cohesion."""
