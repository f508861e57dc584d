"""What kernels are built for: plain strings and bools, the key of every kernel factory."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from gpudem.contact.coefficients import coefficient_names
from gpudem.contact.law import AdhesiveLaw, Law, RollingLaw
from gpudem.contact.names import LawNames
from gpudem.scene.size_classes import class_radii

if TYPE_CHECKING:
    from gpudem.scene import Scene


@dataclasses.dataclass(frozen=True)
class Spec:
    """One specialisation of the kernels; two scenes with equal Specs share compiled code."""

    precision: str = "float64"
    normal: str = "hertz"
    tangential: str = "off"
    """Name of a tangential law, or "off"."""
    rolling: str = "off"
    cohesion: str = "off"
    tangential_reduce: bool = False
    """The limits of friction and rolling torque count with cohesion."""
    torsion: bool = False
    """Rolling laws resist the spin along the normal too."""
    wall_laws: tuple[LawNames, ...] = ()
    """The laws of walls that have others than particles."""
    limit_force: bool = False
    integrator: str = "half_step"
    """"half_step" or "path"."""
    rotation: bool = False
    gravity: bool = False
    walls: tuple[str, ...] = ()
    """Kinds of the walls but meshes, in order of name; () without walls."""
    meshes: str = ""
    """The rule of mesh contacts, "unique" or "liggghts"; "" without meshes."""
    moving_walls: bool = False
    fast_floors: bool = False
    wall_forces: bool = False
    """Forces on walls are output."""
    servo: bool = False
    """A wall follows the force on it: forces on walls are needed in every step."""
    turning_walls: bool = False
    """A wall has motions: it may turn, and its velocity is not the same everywhere and at every step."""
    long_range: bool = False
    """The normal law acts across a gap."""
    periodic: tuple[bool, bool, bool] = (False, False, False)
    multi_material: bool = False
    polydisperse: bool = False
    size_classes: bool = False
    """Radii of several size classes: each class has its own cells."""
    held: bool = False
    """Particles of groups: contacts do not move them."""
    moved_groups: bool = False
    """Groups with a motion."""
    half_list: bool = False
    """Each pair of a block once; for devices that take the particles of a launch one after the other."""

    @classmethod
    def of(cls, scene: Scene, half_list: bool = False) -> Spec:
        """The least that a scene needs."""
        needs = scene.needs
        return cls(
            precision=scene.solver.precision,
            **scene.acting_laws._asdict(),
            wall_laws=tuple(dict.fromkeys(scene.wall_laws.values())),
            tangential_reduce=scene.contact.tangential_reduce and needs.cohesion,
            torsion=scene.contact.torsion and needs.rolling,
            limit_force=scene.contact.limit_force,
            # without damping or friction no force depends on velocity: both integrators are the same
            integrator=scene.solver.integrator if needs.damping or needs.tangential else "half_step",
            rotation=needs.rotation,
            gravity=needs.gravity,
            walls=tuple(sorted({wall.kind for wall in scene.wall_elements} - {"mesh"})),
            meshes=scene.contact.mesh_contacts if scene.meshes else "",
            moving_walls=needs.vibration,
            fast_floors=any(wall.fast_floor for wall in scene.wall_elements),
            wall_forces=bool(scene.output.wall_forces or scene.output.wall_stress or scene.servos),
            servo=bool(scene.servos),
            turning_walls=any(
                w.motion or w.surface_velocity for at in scene.phase_scenes for w in at.wall_elements
            ),
            long_range=scene.contact_range > 0,
            periodic=scene.domain.periodic,
            multi_material=needs.several_materials,
            polydisperse=needs.several_radii,
            size_classes=len(class_radii(scene.state.radius, scene.skin + scene.contact_range)) > 1,
            held=needs.held,
            moved_groups=any(group.motion for group in scene.groups),
            half_list=half_list,
        )

    @property
    def generic(self) -> Spec:
        """The same with everything that any scene may have, to measure what specialisation saves.

        Springs of friction 0, rolling torques of 0, a radius, mass and material for each particle of one
        kind: the motion is the same but for rounding. The normal law, walls and periodic sides stay.
        """
        return dataclasses.replace(
            self, tangential="history", rolling="epsd2", rotation=True, gravity=True,
            multi_material=True, polydisperse=True,
        )  # fmt: skip

    @property
    def laws(self) -> tuple[Law, ...]:
        """The laws between particles, in order of the slots."""
        return self.law_names[0].laws

    @property
    def law_names(self) -> tuple[LawNames, ...]:
        """The laws between particles, and those of walls that have others."""
        return (LawNames(self.normal, self.tangential, self.rolling, self.cohesion), *self.wall_laws)

    @property
    def coefficients(self) -> tuple[str, ...]:
        """Fields of the device struct `Pair`."""
        return coefficient_names(law for names in self.law_names for law in names.laws)

    @property
    def path(self) -> bool:
        """Velocities predicted half a step ahead are stored beside those half a step behind."""
        return self.integrator == "path"  # mutate: predicts_velocities

    @property
    def has_walls(self) -> bool:
        """There are walls of any kind."""
        return bool(self.walls) or bool(self.meshes)

    @property
    def list_slice(self) -> int:
        """Particles whose list entries lie side by side in memory (`gpudem.solver.list_layout`)."""
        return 1 if self.half_list else 32

    @property
    def mesh_images(self) -> int:
        """Entries that one triangle may have in a list: an image to each side of every periodic direction."""
        return 3 ** sum(self.periodic)

    @property
    def spring_history(self) -> bool:
        """Shear springs are stored from step to step."""
        return any(names.history for names in self.law_names)

    @property
    def rolling_history(self) -> bool:
        """Rolling torques are stored from step to step."""
        return any(names.rolling_history for names in self.law_names)

    @property
    def rolling_inertia(self) -> bool:
        """A rolling law reads `inertia_eff` of contacts."""
        laws = (law for names in self.law_names for law in names.laws)
        return any(isinstance(law, RollingLaw) and law.uses_inertia for law in laws)

    @property
    def adhesive(self) -> bool:
        """Contacts begin at touch and break at a gap (all have the same normal law then)."""
        return isinstance(self.law_names[0].normal_law, AdhesiveLaw)

    @property
    def contact_history(self) -> bool:
        """Anything of a contact is stored from step to step: lists mark the contacts of the last step.

        LIGGGHTS' rule for meshes and laws with adhesion ask for them by themselves.
        """
        stored = self.spring_history or self.rolling_history
        return stored or self.meshes == "liggghts" or self.adhesive

    @property
    def per_particle_mass(self) -> bool:
        """Mass differs from particle to particle."""
        return self.multi_material or self.polydisperse
