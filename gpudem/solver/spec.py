"""What kernels are built for: plain strings and bools, the key of every kernel factory."""

from __future__ import annotations

import dataclasses

from gpudem.contact.rolling import KEEPS_TORQUE
from gpudem.scene import Scene


@dataclasses.dataclass(frozen=True)
class Spec:
    """One specialisation of the kernels; two scenes with equal Specs share compiled code."""

    precision: str = "float64"
    normal: str = "hertz"
    tangential: str = "off"
    """"off", "no_history" or "history"."""
    rolling: str = "off"
    limit_force: bool = False
    integrator: str = "half_step"
    """"half_step" or "path"."""
    rotation: bool = False
    gravity: bool = False
    walls: bool = False
    vibration: bool = False
    periodic: tuple[bool, bool, bool] = (False, False, False)
    several_materials: bool = False
    several_radii: bool = False
    half_list: bool = False
    """Each pair of a block once; for devices that take the particles of a launch one after the other."""

    @classmethod
    def of(cls, scene: Scene, half_list: bool = False) -> Spec:
        """The least that a scene needs."""
        needs = scene.needs
        return cls(
            precision=scene.solver.precision,
            normal=scene.contact.normal,
            tangential=scene.contact.tangential if needs.tangential else "off",
            rolling=scene.contact.rolling if needs.rolling else "off",
            limit_force=scene.contact.limit_force,
            # without damping or friction no force depends on velocity: the integrators are one
            integrator=scene.solver.integrator if needs.damping or needs.tangential else "half_step",
            rotation=needs.rotation,
            gravity=needs.gravity,
            walls=needs.walls,
            vibration=needs.vibration,
            periodic=scene.domain.periodic,
            several_materials=needs.several_materials,
            several_radii=needs.several_radii,
            half_list=half_list,
        )

    @property
    def loaded(self) -> Spec:
        """The same with everything that any scene may have, for measuring what leaving out buys.

        Springs of friction that is 0, rolling torques of 0, a radius, mass and material for each particle
        of one kind: the motion is the same but for rounding. The normal law, walls and periodic sides stay.
        """
        return dataclasses.replace(
            self, tangential="history", rolling="epsd2", rotation=True, gravity=True,
            several_materials=True, several_radii=True,
        )  # fmt: skip

    @property
    def path(self) -> bool:
        """Velocities predicted half a step ahead are kept beside those half a step behind."""
        return self.integrator == "path"

    @property
    def history(self) -> bool:
        """Shear springs are kept from step to step."""
        return self.tangential == "history"

    @property
    def rolling_history(self) -> bool:
        """Rolling torques are kept from step to step."""
        return self.rolling in KEEPS_TORQUE

    @property
    def memory(self) -> bool:
        """Anything is kept of a contact from step to step, so that lists and walls remember who touched."""
        return self.history or self.rolling_history

    @property
    def several_masses(self) -> bool:
        """Mass differs from particle to particle."""
        return self.several_materials or self.several_radii
