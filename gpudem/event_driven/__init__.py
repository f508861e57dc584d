"""Hard disks and spheres from collision to collision: the exact limit of infinitely stiff contacts.

    run = gpudem.event_driven.run(scene, "runs/gas")

Takes the scene of the soft solver where the physics is shared, and refuses by name what hard spheres cannot
state.
"""

from gpudem.event_driven.simulation import run

__all__ = ["run"]
