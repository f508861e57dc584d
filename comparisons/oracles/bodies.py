"""The two bodies of a contact: mass, inertia and the Hertz-Mindlin constants, worked out again from primary
inputs.
"""

from __future__ import annotations

import dataclasses
import math

from gpudem.scene import Material, Scene


@dataclasses.dataclass(frozen=True)
class Bodies:
    """A sphere and what it meets: another sphere, or a plane (infinite mass, no curvature)."""

    mass: tuple[float, float]
    """Masses [kg], 4/3 pi R^3 rho; infinite for a plane."""
    radius: tuple[float, float]
    """Radii [m]; infinite for a plane."""
    young_star: float
    """E* [Pa]: 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2."""
    shear_star: float
    """G* [Pa]: 1/G* = 2 (2 - nu1)(1 + nu1)/E1 + 2 (2 - nu2)(1 + nu2)/E2."""
    restitution: float
    friction: float

    @property
    def is_wall(self) -> bool:
        """Whether the second body is a plane."""
        return math.isinf(self.radius[1])

    @property
    def inertia(self) -> tuple[float, float]:
        """Moments of inertia of solid spheres [kg m2]: 2/5 m R^2."""
        return (0.4 * self.mass[0] * self.radius[0] ** 2, 0.4 * self.mass[1] * self.radius[1] ** 2)

    @property
    def radius_star(self) -> float:
        """R* [m]: 1/R* = 1/R1 + 1/R2."""
        return 1 / (1 / self.radius[0] + 1 / self.radius[1])

    @property
    def mass_star(self) -> float:
        """m* [kg]: 1/m* = 1/m1 + 1/m2."""
        return 1 / (1 / self.mass[0] + 1 / self.mass[1])

    @property
    def normal_constant(self) -> float:
        """K [N/m^1.5] of F = k overlap^1.5: k = 4/3 E* sqrt(R*) (Hertz 1882)."""
        return 4 / 3 * self.young_star * math.sqrt(self.radius_star)

    @property
    def tangential_constant(self) -> float:
        """k_t / sqrt(overlap) [N/m^1.5]: 8 G* sqrt(R*) (Mindlin 1949)."""
        return 8 * self.shear_star * math.sqrt(self.radius_star)

    @property
    def damping_ratio(self) -> float:
        """B [1] of the linear oscillator that keeps e of its speed in half a period: -ln e/sqrt(ln^2 e +
        pi^2).
        """
        log = math.log(self.restitution)
        return -log / math.hypot(log, math.pi)

    def damping(self, stiffness_constant: float) -> float:
        """C [N s/m^1.25] of the dashpot c overlap^(1/4) v beside a spring k overlap^(1/2) per unit length.

        c = sqrt(5) b sqrt(m* k) for the normal spring k = 4/3 E* sqrt(R*) (Antypov and Elliott 2011); the
        tangential dashpot is built on k_t in the same way, with 2 sqrt(5/6) instead of sqrt(5), since
        LIGGGHTS builds both on the derivative S_n = 3/2 k_n and on S_t = k_t (manual, gran model hertz).
        """
        return math.sqrt(5) * self.damping_ratio * math.sqrt(self.mass_star * stiffness_constant)

    @property
    def normal_damping(self) -> float:
        """Normal dashpot c_n [N s/m^1.25]."""
        return self.damping(self.normal_constant)

    @property
    def tangential_damping(self) -> float:
        """Tangential dashpot c_t [N s/m^1.25]: 2 sqrt(5/6) b sqrt(m* k_t)."""
        return math.sqrt(2 / 3) * self.damping(self.tangential_constant)


def star(first: Material, second: Material) -> tuple[float, float]:
    """(E*, G*) [Pa] of two materials; the scalar definitions are on `Bodies`."""
    normal = sum((1 - m.poisson**2) / m.young for m in (first, second))
    shear = sum(2 * (2 - m.poisson) * (1 + m.poisson) / m.young for m in (first, second))
    return 1 / normal, 1 / shear


def of_material(
    material: Material, radius: float, *, wall: bool, restitution: float = 1.0, friction: float = 0.0
) -> Bodies:
    """A sphere and an equal one, or with `wall` a plane, of one material; radius [m]."""
    mass = 4 / 3 * math.pi * radius**3 * material.density
    other = (math.inf, math.inf) if wall else (mass, radius)
    return Bodies((mass, other[0]), (radius, other[1]), *star(material, material), restitution, friction)


def bodies(scene: Scene, i: int, other: int | str) -> Bodies:
    """Particle row `i` of a scene against particle row `other`, or against the plane of that name.

    Raises KeyError for an unknown plane or a pair that the scene does not state.
    """
    names = list(scene.materials)

    def particle(row: int) -> tuple[str, float, float]:
        name, radius = names[scene.state.material[row]], float(scene.state.radius[row])
        return name, radius, 4 / 3 * math.pi * radius**3 * scene.materials[name].density

    first = particle(i)
    if isinstance(other, str):
        plane = next((p for p in scene.planes if p.name == other), None)
        if plane is None:
            raise KeyError(f"no plane {other!r} in scene {scene.name}")
        second = (plane.material, math.inf, math.inf)
    else:
        second = particle(other)
    pair = scene.pair(first[0], second[0])
    if pair is None:
        raise KeyError(f"scene {scene.name} states no pair {first[0]} / {second[0]}")
    young_star, shear_star = star(scene.materials[first[0]], scene.materials[second[0]])
    return Bodies(
        (first[2], second[2]), (first[1], second[1]), young_star, shear_star, pair.restitution, pair.friction
    )
