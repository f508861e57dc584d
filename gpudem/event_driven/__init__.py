"""Event-driven hard disks and spheres: the exact limit of infinitely stiff contacts.

    run = gpudem.event_driven.run(scene, "runs/gas")

Takes the scene of the time-stepping solver and refuses by name what hard spheres do not support.
"""

from gpudem.event_driven.driver import run

__all__ = ["run"]
