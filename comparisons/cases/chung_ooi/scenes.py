"""Tests 1 to 7 of Chung and Ooi (2011) as scenes, all impacts of a test side by side.

Y. C. Chung, J. Y. Ooi, Benchmark tests for verifying discrete element modelling codes at particle impact
level, Granular Matter 13 (2011) 643-656, doi:10.1007/s10035-011-0277-0. The plane of tests 2 to 6 is rigid.
An infinite modulus cannot be stated, and need not be: sphere and plane of 2 E each, same nu, have the E* =
E/(1 - nu^2) and G* = G/(2 - nu) of the sphere on a rigid plane exactly. (A plane 1e6 times stiffer would be
off by 1e-6, and above the moduli that codes allow.)
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.cases.side_by_side import Spheres, plane, traced, turned
from comparisons.cases.single_contact.meetings import Meeting, exact, overlap
from comparisons.oracles import closed_forms
from comparisons.oracles.bodies import Bodies, star
from gpudem.output.run import Run
from gpudem.scene import Contact, Material, Pair, Scene

#: Planes by the place of a test's material: the first hits the floor, the second the roof above it.
PLANES = ("floor", "roof")
#: Flight before the touch, as a share of the shortest contact time; room after the longest.
FLIGHT, AFTER = 0.1, 1.3


@functools.cache
def published() -> dict[str, Any]:
    """Digitized curves and experiments, by the names in the file."""
    return json.loads((Path(__file__).parent / "data" / "chung_ooi_2011.json").read_text())


@dataclasses.dataclass(frozen=True)
class Ball:
    """One impact: speeds along the inward normal and a tangent [m/s], spin [rad/s] that adds R w to the
    slip.
    """

    material: str
    restitution: float
    normal: float
    tangential: float = 0.0
    spin: float = 0.0
    what: str = ""
    nominal: float | None = None
    """The restitution of the paper, where another is put in so that it comes out."""

    @property
    def stated(self) -> float:
        """Restitution in the paper."""
        return self.restitution if self.nominal is None else self.nominal

    @property
    def name(self) -> str:
        """Its material in the scene: one for each restitution."""
        return f"{self.material}_e{100 * self.restitution:.0f}"


@dataclasses.dataclass(frozen=True)
class Test:
    """One of the paper's tests; `paired`: two equal spheres of opposite velocity and spin, else a plane."""

    number: int
    materials: dict[str, Material]
    radius: float
    friction: float
    balls: tuple[Ball, ...]
    paired: bool = False

    def bodies(self, ball: Ball) -> Bodies:
        """The two bodies of an impact, from the paper's numbers rather than from a scene."""
        m = self.materials[ball.material]
        young, shear = star(m, m)
        mass = 4 / 3 * math.pi * self.radius**3 * m.density
        other = (mass, self.radius) if self.paired else (math.inf, math.inf)
        factor = 1 if self.paired else 2  # a rigid plane has no compliance of its own
        return Bodies(
            (mass, other[0]), (self.radius, other[1]), factor * young, factor * shear, ball.restitution,
            self.friction,
        )  # fmt: skip

    def contact_time(self, ball: Ball) -> float:
        """Time [s] in contact, of the normal motion."""
        return closed_forms.contact_time(self.bodies(ball), ball.normal * (2 if self.paired else 1))

    @property
    def flight(self) -> float:
        """Time [s] of the touch."""
        return FLIGHT * min(self.contact_time(b) for b in self.balls)

    def meetings(self) -> list[Meeting]:
        """The impacts in the order of `balls`."""
        if self.paired:
            return [Meeting(b.what, 2 * k, 2 * k + 1) for k, b in enumerate(self.balls)]
        planes = dict(zip(self.materials, PLANES, strict=False))
        return [Meeting(b.what, k, planes[b.material]) for k, b in enumerate(self.balls)]

    def axes(self, k: int) -> np.ndarray:
        """Rows n (out of the plane, or to the first sphere), t, t x n of impact k; no two tangents alike."""
        n, t = turned(0.7 * k + 0.3, 0.4 + 0.5 * k if self.paired else 0.0)
        if not self.paired and self.balls[k].material != next(iter(self.materials)):
            n = -n
        return np.array([n, t, np.cross(t, n)])

    def _spheres(self, side: int, pitch: float, height: float) -> Spheres:
        """All spheres `flight` before their touch; impacts `pitch` [m] apart on a square of `side` impacts
        about the origin, where positions have the most digits; planes `height` [m] apart.
        """
        rows = Spheres()
        for k, b in enumerate(self.balls):
            n, t, axis = self.axes(k)
            x, y = pitch * (k % side - (side - 1) / 2), pitch * (k // side - (side - 1) / 2)
            velocity, spin = -b.normal * n + b.tangential * t, b.spin * axis
            if self.paired:
                start, place = np.array([x, y, 0.0]), self.radius * n - self.flight * velocity
                # gross spin about +axis on one side, the same surface velocity on the other
                rows.add(start + place, velocity, spin, material=b.name)
                rows.add(start - place, -velocity, -b.spin * axis, material=b.name)
            else:
                touch = np.array([x, y, self.radius if n[2] > 0 else height - self.radius])
                rows.add(touch - self.flight * velocity, velocity, spin, material=b.name)
        return rows

    def scene(self, dt: float, contact: Contact | None = None) -> Scene:
        """All impacts, `flight` before their touch; spheres fly apart, or at a floor and a ceiling."""
        planes, factor = ([], 1) if self.paired else (list(self.materials), 2)
        known = {n: m.model_copy(update={"young": factor * m.young}) for n, m in self.materials.items()}
        used = {b.name: b for b in self.balls}
        partners = [(a, f"{w}_plane") for a in used for w in planes]
        partners += [(a, c) for k, a in enumerate(used) for c in list(used)[k:]]
        side, pitch = math.ceil(math.sqrt(len(self.balls))), (5 if self.paired else 3.5) * self.radius
        half, height, room = pitch * ((side - 1) / 2 + 1), 10 * self.radius, 0.1 * self.radius
        z = 5 * self.radius if self.paired else 0.0
        return traced(
            f"chung_ooi_{self.number}", self._spheres(side, pitch, height).explicit(radius=self.radius),
            title=f"Chung and Ooi, test {self.number}, step {dt:.3g} s",
            materials={a: known[b.material] for a, b in used.items()}
            | {f"{w}_plane": known[w] for w in planes},
            pairs=[
                Pair(materials=pair, restitution=used[pair[0]].restitution, friction=self.friction)
                for pair in partners
            ],
            contact=contact or Contact(),
            walls=[
                plane(name, (0, 0, k * height), (0, 0, 1 - 2 * k), f"{w}_plane")
                for k, (w, name) in enumerate(zip(planes, PLANES, strict=False))
            ],
            lo=(-half, -half, -z - room), hi=(half, half, max(z, height) + room), step=dt,
            duration=self.flight + AFTER * max(self.contact_time(b) for b in self.balls),
        )  # fmt: skip

    def variants(
        self, prefix: str, steps: Sequence[int], contact: Contact | None = None
    ) -> list[kit.Variant]:
        """The test in steps such that the touch is that many and a half after the start."""
        return [kit.Variant(f"{prefix}{n}", self.scene(self.flight / (n + 0.5), contact)) for n in steps]

    def outcome(self, run: Run) -> np.ndarray:
        """Per impact (v_n', v_t' [m/s], w' [rad/s]) of the (first) sphere, spin counted so that it adds R w
        to the slip. Raises ValueError where a contact has not ended within the run.
        """
        found = []
        for k, m in enumerate(self.meetings()):
            if overlap(run, m)[-1] > 0:
                raise ValueError(f"{m.label}: still in contact at the end of the run")
            velocity, spin = (run.trace[c][-1, m.row] for c in ("velocity", "angular_velocity"))
            n, t, axis = self.axes(k)
            found.append((velocity @ n, velocity @ t, spin @ axis))
        return np.array(found)

    def exact_outcome(self, results: kit.Results, run: Run) -> np.ndarray:
        """The same by the ODE."""

        def compute() -> np.ndarray:
            found = []
            for k, m in enumerate(self.meetings()):
                truth, (n, t, axis) = exact(results, run.scene, m), self.axes(k)
                at = {name: values[0, 0] for name, values in truth.at(np.array([truth.end])).items()}
                found.append((at["velocity"] @ n, at["velocity"] @ t, at["angular_velocity"] @ axis))
            return np.array(found)

        return results.once(("outcome", run.scene.hash), compute)


def _material(young_gpa: float, poisson: float, density: float) -> Material:
    return Material(young=young_gpa * 1e9, poisson=poisson, density=density)


GLASS, LIMESTONE = _material(48, 0.20, 2800), _material(20, 0.25, 2500)
ALLOY, MAGNESIUM = _material(70, 0.30, 2699), _material(40, 0.35, 1800)
OXIDE, IRON = _material(380, 0.23, 4000), _material(100, 0.25, 7000)
ALLOY_33, COPPER = _material(70, 0.33, 2700), _material(120, 0.35, 8900)
STEEL, POLYETHYLENE = _material(208, 0.3, 7850), _material(1.0, 0.4, 1400)
NYLON = _material(2.5, 0.4, 1000)

#: Degrees from the normal; the paper has every fifth from 5 to 85, the others are to read it between.
ANGLES = (2.0, 3.5, 5.0, 7.5, 10.0, 12.5, *(float(a) for a in range(15, 90, 5)))
SPEED_4 = 3.9
#: Tangential speeds of test 5 [m/s].
SPEEDS_5 = (0.1, 0.3, 0.45, 0.6, 0.9, 1.2, 1.5, 1.8, 2.25, 2.7, 3, 3.75, 4.5, 5.25, 6, 7.5, 9, 12, 15, 18, 21)
#: Spins of tests 6 and 7 [rad/s].
SPINS = (0.175, 0.3, 0.42, 0.6, 0.8, 1, 1.2, 1.5, 2, 2.4, 2.8, 3, 3.5, 4, 6, 8, 10, 12, 14, 21, 24)


def _test(
    number: int, materials: dict[str, Material], radius: float, friction: float, values: Sequence[float],
    ball: Callable[[str, float], Ball], paired: bool = False,
) -> Test:  # fmt: skip
    """A test with a ball of each material for each of the values."""
    balls = tuple(ball(name, value) for name in materials for value in values)
    return Test(number, materials, radius, friction, balls, paired)


def _angled(name: str, angle: float) -> Ball:
    a = math.radians(angle)
    return Ball(name, 0.98, SPEED_4 * math.cos(a), SPEED_4 * math.sin(a), what=f"{name}, {angle:g} deg")


def _spun(name: str, spin: float) -> Ball:
    return Ball(name, 0.5, 0.2, 0.0, spin, what=f"{name}, {spin:g} rad/s")


T1 = _test(
    1, {"glass": GLASS, "limestone": LIMESTONE}, 0.010, 0.35, (10.0,),
    lambda name, speed: Ball(name, 1.0, speed, what=name), paired=True,
)  # fmt: skip
T2 = _test(
    2, {"al_alloy": ALLOY, "mg_alloy": MAGNESIUM}, 0.1, 0.0, (0.2,),
    lambda name, speed: Ball(name, 1.0, speed, what=name.replace("_", " ").capitalize()),
)  # fmt: skip
T3 = _test(
    3, {"al_oxide": OXIDE, "cast_iron": IRON}, 0.0025, 0.0, (0.2, 0.4, 0.6, 0.8, 1.0),
    lambda name, e: Ball(name, e, 3.9, what=f"{name}, e = {e:g}"),
)  # fmt: skip
T4 = _test(4, {"al_oxide": OXIDE, "al_alloy": ALLOY_33}, 0.0025, 0.092, ANGLES, _angled)
T5 = _test(
    5, {"steel": STEEL, "polyethylene": POLYETHYLENE}, 1e-5, 0.3, SPEEDS_5,
    lambda name, speed: Ball(name, 1.0, 5.0, speed, what=f"{name}, {speed:g} m/s"),
)  # fmt: skip
T6 = _test(6, {"al_alloy": ALLOY_33, "nylon": NYLON}, 0.1, 0.4, SPINS, _spun)
#: Test 6 with the restitution that makes `limit_force` give the paper's 0.5 instead of 0.55.
_PUT_IN = {"nominal": 0.5, "restitution": closed_forms.restitution_to_put_in(0.5)}
T6_CORRECTED = dataclasses.replace(T6, balls=tuple(dataclasses.replace(b, **_PUT_IN) for b in T6.balls))
T7 = _test(7, {"al_alloy": ALLOY_33, "copper": COPPER}, 0.1, 0.4, SPINS, _spun, paired=True)
