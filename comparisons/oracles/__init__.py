"""Exact answers to hold both codes against, derived from a scene's primary inputs alone.

One is not exact: hard disks by time steps, to hold the event-driven engine against. Nothing here imports
`gpudem.contact`: a modulus or a damping constant shared with the solver would hide its error.
"""
