"""A drum of flat facets with smooth ends, half filled with balls, and measures of its runs."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Any, get_args

import numpy as np

from comparisons.cases.side_by_side import plane
from comparisons.metrics import mixing, pile
from comparisons.oracles import drum as oracle
from comparisons.oracles import linear
from gpudem.output.run import Run
from gpudem.scene import Contact, Domain, Explicit, Material, Output, Pair, Scene, Time
from gpudem.scene.mesh import Mesh
from gpudem.scene.motion import Rotate

RADIUS, DENSITY, POISSON = 0.003, 2500.0, 0.3
MASS = 4 / 3 * math.pi * RADIUS**3 * DENSITY
#: Of the cylinder that the facets touch, and along the axis [m].
DRUM_RADIUS, LENGTH = 6 * 2 * RADIUS, 3.5 * 2 * RADIUS
COUNT = 212
GRAVITY = 9.81
#: Of one turn [s]: omega^2 R/g = 0.14, where the bed rolls; below 0.1 it slumps.
PERIOD = 1.0
SPIN = 2 * math.pi / PERIOD
#: Contact time of two balls [s]: the bed sinks in by some 1 % of a diameter.
CONTACT_TIME, SPEED = 2.4e-3, 1.0
RESTITUTION, FRICTION = 0.6, 0.5
#: 24 facets turn by 15 degrees from one to the next: below the merge angle, a curve for rule "unique".
FACETS = 24
#: When the two halves are told apart, and from when on means are taken [s].
LABELED, STEADY = 0.24, 0.48
#: Time from the start [s] over which the codes must agree.
EARLY = 0.1


#: The rules of mesh contacts: gpudem's own, and that of the reference code.
OWN_RULE, SAME_RULE = get_args(Contact.model_fields["mesh_contacts"].annotation)


@dataclasses.dataclass(frozen=True)
class Drum:
    """One run."""

    duration: float
    """[s]; the loose balls fall in the first 0.1 s, while the drum already turns."""
    seed: int = 1
    facets: int = FACETS
    rule: Any = OWN_RULE
    steps_per_contact: float = 16

    def scene(self, **output: Any) -> Scene:
        """The whole statement."""
        particles = Explicit(position=start(self.seed), radius=RADIUS, material="glass")
        return self.of(particles, frames_every=LABELED / 2, history_every=1.5e-3, **output)

    def of(self, particles: Explicit, turned: float = 0.0, **output: Any) -> Scene:
        """With these particles; the drum starts turned by an angle [rad]."""
        vertices, triangles = shell(self.facets, turned)
        wall = Mesh(
            name="drum", material="glass", vertices=vertices, triangles=triangles,
            motion=(Rotate(type="rotate", axis=(0, 1, 0), period=PERIOD),),
        )  # fmt: skip
        ends = [
            plane(name, (0, y, 0), (0, side, 0), "end")
            for name, y, side in (("near", 0.0, 1), ("far", LENGTH, -1))
        ]
        material = Material(young=2 * (1 - POISSON**2) * YOUNG_STAR, poisson=POISSON, density=DENSITY)
        outer = 1.01 * DRUM_RADIUS / math.cos(math.pi / self.facets)
        return Scene(
            name="drum",
            title=f"{COUNT} balls, {self.facets} facets, rule {self.rule}, seed {self.seed}",
            materials=dict.fromkeys(("glass", "end"), material),
            pairs=[
                Pair(materials=("glass", "glass"), restitution=RESTITUTION, friction=FRICTION),
                Pair(materials=("glass", "end"), restitution=RESTITUTION),
            ],
            contact=Contact(normal="hooke", characteristic_velocity=SPEED, mesh_contacts=self.rule),
            particles=particles, walls=[wall, *ends], gravity=(0, 0, -GRAVITY),
            domain=Domain(lo=(-outer, -RADIUS, -outer), hi=(outer, LENGTH + RADIUS, outer)),
            time=Time(step=CONTACT_TIME / self.steps_per_contact, duration=self.duration),
            output=Output(wall_forces=("drum",), **output), allow=("unusual_units", "overlap"),
        )  # fmt: skip


#: Stiffness of two balls [N/m], and the E* [Pa] from which `hooke` has it.
STIFFNESS = MASS / 2 * (math.pi / CONTACT_TIME) ** 2
YOUNG_STAR = linear.young_star(STIFFNESS, RADIUS / 2, MASS / 2, SPEED)


def shell(facets: int, turned: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of the drum, turned about y by an angle [rad]; two triangles a facet."""
    angle = 2 * np.pi * np.arange(facets) / facets - turned
    outer, near = DRUM_RADIUS / math.cos(math.pi / facets), np.arange(facets)
    rim = outer * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    following, far = np.roll(near, -1), near + facets
    triangles = [(near, following, following + facets), (near, following + facets, far)]
    vertices = np.concatenate([rim, rim + np.array([0, LENGTH, 0])])
    return vertices, np.stack(triangles, axis=1).transpose(2, 1, 0).reshape(-1, 3)


def start(seed: int) -> np.ndarray:
    """Centers [m] of the balls on a loose lattice that fills the drum from below, jittered at random."""
    apart = 1.06 * 2 * RADIUS
    jitter = (apart / 2 - RADIUS) * 0.99
    k = np.arange(-7, 8)
    sites = np.stack(np.meshgrid(k, np.arange(3) + 0.5, k, indexing="ij"), axis=-1).reshape(-1, 3)
    sites = sites * [apart, LENGTH / 3, apart]
    inside = sites[np.hypot(sites[:, 0], sites[:, 2]) < DRUM_RADIUS - RADIUS - math.sqrt(2) * jitter]
    lowest = inside[np.argsort(inside[:, 2], kind="stable")[:COUNT]]
    return lowest + np.random.default_rng(seed).uniform(-jitter, jitter, lowest.shape)


def theory(turned: float) -> oracle.Drum:
    """The drum, turned by an angle [rad] at the start, from primary inputs.

    R* = R/2 and m* = m/2 of two balls, R and m at the wall.
    """
    pair = STIFFNESS
    wall = pair * 2**0.6  # k is proportional to R*^0.4 m*^0.2
    springs = [
        oracle.Spring(k, linear.damping(k, m, RESTITUTION), FRICTION)
        for k, m in ((pair, MASS / 2), (wall, MASS))
    ]
    first = -turned + math.pi / FACETS
    return oracle.Drum(DRUM_RADIUS, FACETS, SPIN, first, LENGTH, RADIUS, MASS, *springs)


def history(run: Run, since: float = 0.0) -> dict[str, np.ndarray]:
    """Columns of the history from a time [s] on."""
    assert run.history is not None
    rows = {str(name): run.history[name].to_numpy() for name in run.history}
    late = rows["time"] > since - 1e-9
    return {name: values[late] for name, values in rows.items()}


def center_angle(rows: dict[str, np.ndarray]) -> np.ndarray:
    """Angle of the center of mass from straight below the axis [deg], in time."""
    return np.degrees(np.arctan2(-rows["centre_x"], -rows["centre_z"]))


def surface_angle(frame: dict[str, np.ndarray]) -> float:
    """Slope of the surface [deg]: straight line through the heights over the middle of the drum."""
    at = np.linspace(-0.6, 0.6, 13) * DRUM_RADIUS
    height = pile.height(frame["position"], frame["radius"], at, (0.0, LENGTH))
    return -math.degrees(math.atan(np.polyfit(at, height, 1)[0]))


def frames(run: Run, since: float) -> Iterator[tuple[float, dict[str, np.ndarray]]]:
    """(time [s], frame) from a time on."""
    times = run.frames.times
    return ((float(t), run.frames[k]) for k, t in enumerate(times) if t > since - 1e-9)


def halves(run: Run) -> np.ndarray:
    """Whether each ball was in the upper half of the bed, along its surface, when the halves were labeled."""
    x = run.frames.at(LABELED)["position"]
    center = x.mean(axis=0)
    along = (x - center) @ np.array([center[2], 0.0, -center[0]])  # across the line from the axis
    return along > np.median(along)


def mixed(run: Run) -> np.ndarray:
    """(time [s], Lacey index) at each frame from the labeling on."""
    labels = halves(run)
    return np.array([(t, mixing.lacey(f["position"], labels)) for t, f in frames(run, LABELED)]).T
