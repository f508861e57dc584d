"""The statement of a simulation: `Scene` and its sections. No Warp here."""

from gpudem.errors import SceneError
from gpudem.scene.groups import Group
from gpudem.scene.insertion import InsertList
from gpudem.scene.mesh import Mesh
from gpudem.scene.model import Scene
from gpudem.scene.phases import PairChange, Phase
from gpudem.scene.round_walls import Cone, Cylinder
from gpudem.scene.sections import (
    Contact,
    Domain,
    Explicit,
    FlowPlane,
    FromFile,
    Lattice,
    Material,
    Needs,
    Output,
    Pair,
    RadiusShare,
    Solver,
    Time,
)
from gpudem.scene.types import Side
from gpudem.scene.wall_phases import WallChange
from gpudem.scene.walls import Box, Plane, Vibration, WallContact

__all__ = [
    "Box",
    "Cone",
    "Contact",
    "Cylinder",
    "Domain",
    "Explicit",
    "FlowPlane",
    "FromFile",
    "Group",
    "InsertList",
    "Lattice",
    "Material",
    "Mesh",
    "Needs",
    "Output",
    "Pair",
    "PairChange",
    "Phase",
    "Plane",
    "RadiusShare",
    "Scene",
    "SceneError",
    "Side",
    "Solver",
    "Time",
    "Vibration",
    "WallChange",
    "WallContact",
]
