"""The statement of a simulation: `Scene` and its sections. No Warp here."""

from gpudem.errors import SceneError
from gpudem.scene.model import Scene
from gpudem.scene.sections import (
    Box,
    Contact,
    Domain,
    Explicit,
    FromFile,
    Lattice,
    Material,
    Needs,
    Output,
    Pair,
    Plane,
    RadiusShare,
    Side,
    Solver,
    Time,
    Vibration,
)

__all__ = [
    "Box",
    "Contact",
    "Domain",
    "Explicit",
    "FromFile",
    "Lattice",
    "Material",
    "Needs",
    "Output",
    "Pair",
    "Plane",
    "RadiusShare",
    "Scene",
    "SceneError",
    "Side",
    "Solver",
    "Time",
    "Vibration",
]
