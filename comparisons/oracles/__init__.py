"""Exact answers to hold both codes against, derived from a scene's primary inputs alone.

Nothing here imports `gpudem.contact`: a modulus or a damping constant shared with the solver would hide its
error.
"""
