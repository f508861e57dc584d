"""gpudem: a discrete element solver on NVIDIA Warp, built to be verified."""
