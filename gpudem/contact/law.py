"""What a contact law is: one object that holds all that is known of it. No arrays, no neighbor list.

A law fills one slot (normal, tangential, rolling, cohesion). Its file holds the device function, the
coefficients it needs from primary inputs, the parameters it reads from the scene, its time scales and its
words in LIGGGHTS. `gpudem.contact.registry` finds laws by slot and name; other packages add theirs through
the entry-point group `gpudem.laws`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, Literal

if TYPE_CHECKING:
    from gpudem.scene.sections import Contact, Material, Pair

Slot = Literal["normal", "tangential", "rolling", "cohesion"]


@dataclasses.dataclass(frozen=True)
class Parameter:
    """A number that a law reads from the scene beyond the fields that every pair or contact has.

    `where` = "pair": a key of `[[pairs]]`; "contact": a key of `[contact]`.
    """

    name: str
    unit: str
    lo: float = -math.inf
    hi: float = math.inf
    open_lo: bool = False
    """`lo` itself is not allowed."""
    default: float | None = None
    """None: must be stated."""
    where: Literal["pair", "contact"] = "pair"

    def of(self, section: Pair | Contact) -> float:
        """Its value in a section: as stated, or the default. Raises ValueError: missing."""
        stated = (section.model_extra or {}).get(self.name, self.default)
        if stated is None:
            raise ValueError(f"{self.name}: missing [{self.unit}]")
        return float(stated)

    def or_zero(self, section: Pair | Contact) -> float:
        """The same; 0 where it is missing, of a section in which the law does not act."""
        return self.of(section) if self.name in (section.model_extra or {}) else self.default or 0.0


@dataclasses.dataclass(frozen=True)
class PairInputs:
    """The primary inputs of one pair of materials, from which a law derives its coefficients."""

    a: Material
    b: Material
    pair: Pair
    contact: Contact

    def value(self, parameter: Parameter) -> float:
        """A parameter that the law declares: as stated, or its default. Raises ValueError: missing."""
        return parameter.of(self.pair if parameter.where == "pair" else self.contact)


@dataclasses.dataclass(frozen=True)
class LiggghtsWords:
    """How a law is stated in a LIGGGHTS deck: its word, and the global properties that it reads, in order.

    Each property is (kind, name, value, filler): kind "per_material" with value(material), "per_pair" with
    value(pair) and the filler of pairs that cannot touch, "common" with value(pair), one number for all pairs
    that have the law, or "scalar" with value(contact).
    """

    word: str
    properties: tuple[tuple[str, str, Callable[[Any], Any], float], ...] = ()


class Law:
    """Base of all laws. Subclasses set the class attributes and pass the device functions to `__init__`."""

    slot: ClassVar[Slot]
    name: ClassVar[str]
    """The name in `[contact]` of a scene."""
    reads: ClassVar[tuple[str, ...]] = ()
    """Fields of `Material`, `Pair` and `Contact` that act with this law."""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    """Further keys that this law adds to `[[pairs]]` and `[contact]`."""
    coefficients: ClassVar[tuple[str, ...]] = ()
    """Fields that this law adds to the device struct of a material pair."""
    liggghts: ClassVar[LiggghtsWords | None] = None
    """None: LIGGGHTS has no such law, and a scene with it is refused by name."""

    def coefficients_of(self, inputs: PairInputs) -> dict[str, float]:
        """Value of each name in `coefficients`, from primary inputs, in float64."""
        raise NotImplementedError

    def acts(self, inputs: PairInputs) -> bool:
        """Whether the law acts in contacts of this pair; if it acts in none, its code is left out."""
        return True

    def missing(self, inputs: PairInputs) -> list[str]:
        """Names of the inputs of a pair that this law needs and that are not stated."""
        if not self.acts(inputs):
            return []
        stated = inputs.pair.model_extra or {}
        needed = [p for p in self.parameters if p.where == "pair" and p.default is None]
        return [p.name for p in needed if p.name not in stated]


class NormalLaw(Law):
    """Normal force F_n = k_n overlap - c_n v_n [N], positive when repulsive; v_n > 0 separating.

    stiffness(contact, pair) -> (k_n, k_t [N/m], c_n, c_t [N s/m]), a `wp.func`; the tangential law uses k_t
    and c_t.
    damping_integral(contact, pair, overlap) -> integral of c_n over the overlap from 0 [N s], a `wp.func`;
    the `path` integrator uses it.
    """

    slot = "normal"
    coefficients = ("k_normal", "k_tangential", "c_normal", "c_tangential")
    uses_moduli: ClassVar[bool] = True
    """The materials' moduli act, so that the Rayleigh time limits the step."""

    def __init__(self, stiffness: Any, damping_integral: Any):
        self.stiffness, self.damping_integral = stiffness, damping_integral

    def range(self, inputs: PairInputs, radius: float) -> float:
        """Largest gap [m] at which the law acts, of an effective radius [m] at most; 0: in contact only."""
        return 0.0

    def contact_time(self, inputs: PairInputs, radius: float, mass: float, speed: float) -> float:
        """Duration [s] of an undamped contact: effective radius [m], effective mass [kg], speed [m/s]."""
        raise NotImplementedError

    def release_speed(self, inputs: PairInputs, radius: float, mass: float, overlap: float) -> float:
        """Speed [m/s] at which an overlap [m] drives two bodies apart, without damping."""
        raise NotImplementedError

    def restitution(self, inputs: PairInputs, radius: float, mass: float, speed: float) -> float:
        """Coefficient of restitution [1] of an impact at `speed` [m/s]; as stated, where it is an input."""
        return inputs.pair.restitution

    def dissipates(self, inputs: PairInputs) -> bool:
        """Whether the normal force depends on the velocity."""
        return self.coefficients_of(inputs)["c_normal"] > 0


class AdhesiveLaw(NormalLaw):
    """A normal law with adhesion: a contact begins at touch, and lasts until a gap at which it breaks.

    stiffness(contact, pair) -> (F_e, k_n, k_t, c_n, c_t), a `wp.func`, F_e the elastic force [N] with
    adhesion; F_n = F_e - c_n v_n. The overlap of the contact may be negative.
    load(contact, pair, F_n) -> what limits friction and rolling torque in the place of F_n [N].
    gap(pair, effective radius) -> gap at which a contact breaks [m]; `range` is its upper bound.
    """

    def __init__(self, stiffness: Any, load: Any, gap: Any):
        super().__init__(stiffness, None)
        self.load, self.gap = load, gap


class TangentialLaw(Law):
    """Tangential force on i [N] and the shear spring after the step [m].

    force(contact, pair, k_t, c_t, F_n, spring) -> (force, spring), a `wp.func`.
    """

    slot = "tangential"
    history: ClassVar[bool] = False
    """The spring is stored from step to step."""
    acts_by: ClassVar[tuple[str, ...]] = ()
    """Those of k_tangential and c_tangential without which there is no force; (): it needs neither."""

    def __init__(self, force: Any):
        self.force = force


class RollingLaw(Law):
    """Resisting torque [N m], subtracted from i and added to j.

    torque(contact, pair, k_n, k_t, F_n, torque of the last step, dt) -> torque, a `wp.func`; with `damped`
    -> (torque, what is stored of it).
    """

    slot = "rolling"
    history: ClassVar[bool] = False
    """The torque is stored from step to step."""
    damped: ClassVar[bool] = False
    """A part of the torque is not stored."""
    uses_inertia: ClassVar[bool] = False
    """The law reads `inertia_eff` of a contact."""

    def __init__(self, torque: Any, with_torsion: Any = None):
        self.torque = torque
        self.with_torsion = with_torsion
        """The same without the projection onto the tangent plane (`torsion`); None: there is none."""


class CohesionLaw(Law):
    """Attraction F_c [N] >= 0 of bodies that overlap, subtracted from the normal force.

    attraction(contact, pair) -> F_c, a `wp.func`. The law may read `inverse_reach` of a contact. The limits
    of friction and rolling torque leave F_c out, unless `tangential_reduce` of the contact is set.
    """

    slot = "cohesion"

    def __init__(self, attraction: Any):
        self.attraction = attraction


#: What laws of constants stated for a pair read, and their words in LIGGGHTS.
CONSTANTS = ("kn", "kt", "gamma_n", "gamma_t")
CONSTANT_WORDS = (
    ("per_pair", "kn", lambda p: p.kn or 0.0, 0.0),
    ("per_pair", "kt", lambda p: p.kt or 0.0, 0.0),
    ("per_pair", "gamman", lambda p: p.gamma_n or 0.0, 0.0),
    ("per_pair", "gammat", lambda p: p.gamma_t or 0.0, 0.0),
)


class StatedConstants(NormalLaw):
    """Stiffness and damping constants are stated for each pair; the moduli do not act."""

    reads = CONSTANTS
    uses_moduli = False

    def coefficients_of(self, inputs: PairInputs) -> dict[str, float]:  # noqa: D102
        if missing := self.missing(inputs):
            raise ValueError(f"pair {inputs.pair.materials}: {self.name} needs {', '.join(missing)}")
        values = [getattr(inputs.pair, name) for name in CONSTANTS]
        return dict(zip(self.coefficients, values, strict=True))

    def missing(self, inputs: PairInputs) -> list[str]:  # noqa: D102
        return [name for name in CONSTANTS if getattr(inputs.pair, name) is None]

    def dissipates(self, inputs: PairInputs) -> bool:  # noqa: D102
        return (inputs.pair.gamma_n or 0.0) > 0


#: What `sjkr` and `sjkr2` read of a pair, and its words in LIGGGHTS.
DENSITY = Parameter("cohesion_energy_density", "J/m3", 0, default=0.0)
DENSITY_WORDS = (("per_pair", "cohesionEnergyDensity", DENSITY.or_zero, 0.0),)


class AreaCohesion(CohesionLaw):
    """An attraction in proportion to an area: k of the pair is the cohesion energy density [J/m3]."""

    parameters = (DENSITY,)
    coefficients = ("cohesion",)

    def acts(self, inputs: PairInputs) -> bool:  # noqa: D102
        return inputs.value(DENSITY) > 0

    def coefficients_of(self, inputs: PairInputs) -> dict[str, float]:  # noqa: D102
        return {"cohesion": inputs.value(DENSITY)}
