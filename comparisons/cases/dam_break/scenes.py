"""The dam break of Park, Jun, Sohn and Lee (2014) as scenes of any grain size, and measures of its runs."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np

from comparisons import kit
from comparisons.cases.side_by_side import plane
from comparisons.metrics import pile
from gpudem.output.run import Run
from gpudem.scene import Domain, Lattice, Material, Output, Pair, Scene, Time

#: Box of the experiment [m]: length, depth, height; number, radius [m] and mass [kg] of its balls.
LENGTH, DEPTH, HEIGHT = 0.9, 0.4, 0.5
BALLS, RADIUS, MASS = 120_000, 0.003, 0.2e-3
#: Gate distance [m] -> height of the balls behind it as printed [m].
GATES = {0.2: 0.301, 0.3: 0.206, 0.4: 0.155}
#: First ball at the far wall [s] after the gate is removed: experiment, and the paper's simulation.
MEASURED_ARRIVAL, PAPER_ARRIVAL = 0.49, 0.54
#: Largest height difference between experiment and simulation in the paper [m].
PAPER_HEIGHT_ERROR = 0.008
#: The mass makes the density; the printed 12 kg/m3 would make balls of 1.4 mg.
BALL = Material(young=3.25e9, poisson=0.34, density=MASS / (4 / 3 * math.pi * RADIUS**3))
ACRYLIC = Material(young=3.2e9, poisson=0.37, density=1185.0)
#: Young's modulus of both materials where softened [Pa]: 650 times softer, so that steps can be 25 times
#: longer. Balls sink in by some 1 % of their radius under the bed's weight instead of 0.02 %.
SOFT = 5e6
GRAVITY = 9.81
#: Heights are read every 100 mm, and every 10 mm for the profile [m].
READ_AT = np.arange(0.0, LENGTH + 1e-9, 0.1)
PROFILE_AT = np.arange(0.005, LENGTH, 0.01)
#: Time after the opening [s] at which the flow is measured: well spread, and before the far wall.
IN_FLOW = 0.3
#: Time from the start [s] over which the codes must agree: thousands of contacts, before rounding has grown.
EARLY = 0.07


def printed_restitution(factor: float, mass: float, radius: float, young: float, poisson: float) -> float:
    """Restitution behind a printed damping factor: the paper's equations 11 and 12 (`paper_scenes`), whose
    units do not match, solved for e only to invert the calculation of the authors.
    """
    k = 2 / 3 * young / (1 - poisson**2) * math.sqrt(radius)
    return math.exp(-math.pi / math.sqrt(4 * mass * k / factor**2 - 1))


#: Ball on ball, 0.90: printed factor 6.4817; m' and R_eff of two balls, and the E = 3.2 GPa that the factor
#: fits.
BALL_RESTITUTION = round(printed_restitution(6.4817, MASS / 2, RADIUS / 2, 3.2e9, 0.34), 2)
#: Ball on acrylic: printed factor 1.7586; that m' and R_eff are those of two balls is a guess.
WALL_RESTITUTION = round(printed_restitution(1.7586, MASS / 2, RADIUS / 2, 3.2e9, 0.37), 2)
#: Friction is not printed. Tables give 0.3 (on steel) to 0.5 (on itself) for flat dry polystyrene, 0.4 to 0.5
#: for acrylic on steel; smooth balls lie at the lower end. The wall has WALL_FRICTION times the ball's.
BALL_FRICTION, WALL_FRICTION = 0.3, 0.8


@dataclasses.dataclass(frozen=True)
class Dam:
    """One dam break: the experiment scaled to a grain size, as a slice periodic in depth or whole."""

    gate: float = 0.2
    radius: float = RADIUS
    friction: float = BALL_FRICTION
    seed: int = 1
    opens: float = 0.5
    """Time at which the gate is removed [s]; until then the loose lattice falls and settles."""
    flows: float = 1.0
    """Time simulated after that [s]; the pile is at rest after 0.9 s."""
    slice: bool = True
    """Three diameters and a little deep, periodic; else the whole box with its walls."""
    young: float | None = SOFT
    """Young's modulus [Pa] of both materials; None: their own."""

    @property
    def depth(self) -> float:
        """Depth of the scene [m]."""
        return 3 * 2 * self.radius * 1.06 if self.slice else DEPTH

    @property
    def count(self) -> int:
        """Number of balls: the experiment's volume of balls per depth."""
        return round(BALLS * self.depth / DEPTH * (RADIUS / self.radius) ** 3)

    @property
    def step(self) -> float:
        """Time step [s]: 8 % of the Rayleigh time."""
        return 2.5e-5 * self.radius / RADIUS * math.sqrt(SOFT / self.young) if self.young else 1e-6

    def scene(self) -> Scene:
        """The whole statement."""
        ball, wall = BALL, ACRYLIC
        if self.young:
            ball, wall = (m.model_copy(update={"young": self.young}) for m in (BALL, ACRYLIC))
        margin, mu = 2 * self.radius, self.friction
        planes = {"floor": ((0, 0, 0), (0, 0, 1)), "near": ((0, 0, 0), (1, 0, 0)),
                  "far": ((LENGTH, 0, 0), (-1, 0, 0)), "gate": ((self.gate, 0, 0), (-1, 0, 0))}  # fmt: skip
        sides = (0.0, self.depth)
        if not self.slice:
            sides = (-margin, self.depth + margin)
            planes |= {"front": ((0, 0, 0), (0, 1, 0)), "back": ((0, DEPTH, 0), (0, -1, 0))}
        return Scene(
            name="dam_break",
            title=f"gate at {1e3 * self.gate:g} mm, {self.count} balls of {1e3 * self.radius:g} mm,"
            f" friction {mu:g}, seed {self.seed}",
            materials={"polystyrene": ball, "acrylic": wall},
            pairs=[
                Pair(materials=("polystyrene", "polystyrene"), restitution=BALL_RESTITUTION, friction=mu),
                Pair(materials=("polystyrene", "acrylic"), restitution=WALL_RESTITUTION,
                     friction=WALL_FRICTION * mu),
            ],
            particles=Lattice(
                source="lattice", material="polystyrene", count=self.count, radius=self.radius,
                lo=(0, 0, 0), hi=(self.gate, self.depth, 1.2 * HEIGHT), seed=self.seed,
            ),
            gravity=(0, 0, -GRAVITY),
            walls=[
                plane(name, point, normal, "acrylic", removed_at=self.opens if name == "gate" else None)
                for name, (point, normal) in planes.items()
            ],
            domain=Domain(
                lo=(-margin, sides[0], -margin), hi=(LENGTH + margin, sides[1], 2 * HEIGHT),
                periodic=(False, self.slice, False),
            ),
            time=Time(step=self.step, duration=self.opens + self.flows),
            output=Output(frames_every=0.1, history_every=0.002),
        )  # fmt: skip


def opening(run: Run) -> float:
    """Time [s] at which the gate is removed."""
    return next(p.removed_at for p in run.scene.planes if p.removed_at is not None)


def gate(run: Run) -> float:
    """Distance of the gate from the near wall [m]."""
    return next(plane.point[0] for plane in run.scene.planes if plane.name == "gate")


def _period(run: Run) -> float | None:
    domain = run.scene.domain
    return domain.hi[1] - domain.lo[1] if domain.periodic[1] else None


def _depth(run: Run) -> tuple[float, float]:
    domain = run.scene.domain
    return (domain.lo[1], domain.hi[1]) if domain.periodic[1] else (0.0, DEPTH)


def heights(results: kit.Results, label: str, code: str, at: np.ndarray = PROFILE_AT) -> np.ndarray:
    """Heights [m] at places along x, at the end."""
    run = results[label, code]

    def compute() -> np.ndarray:
        frame = run.frames[-1]
        return pile.height(frame["position"], frame["radius"], at, _depth(run), _period(run))

    return results.once(("heights", label, code, len(at)), compute)


#: Strips along the depth of the whole box: each is a pile of its own, and their scatter that of a single run.
STRIPS = 8


def strip_heights(position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """(strips, places) heights [m] in the whole box, every 100 mm, of each strip along the depth."""
    rows = []
    for lo, hi in itertools.pairwise(np.linspace(0.0, DEPTH, STRIPS + 1)):
        inside = (position[:, 1] >= lo) & (position[:, 1] < hi)
        rows.append(pile.height(position[inside], radius[inside], READ_AT, (lo, hi)))
    return np.array(rows)


def arrival(run: Run) -> float:
    """Time after the opening [s] at which the first ball touches the far wall, from the dense history."""
    time, front = (run.history[name].to_numpy() for name in ("time", "front_x"))
    return pile.arrival(time, front, LENGTH - run.scene.state.radius.max()) - opening(run)


def kinetic(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """(time after the opening [s], kinetic energy with rotation [J])."""
    energy = run.history["kinetic_energy"] + run.history["rotational_energy"]
    return run.history["time"].to_numpy() - opening(run), energy.to_numpy()


def measures(results: kit.Results, label: str, code: str) -> dict[str, float]:
    """Every metric of one run, by name with its unit: heights at rest, others in the flow or over time."""

    def compute() -> dict[str, float]:
        run, read = results[label, code], heights(results, label, code, READ_AT)
        flow, (time, energy) = run.frames.at(opening(run) + IN_FLOW), kinetic(run)
        centers = [pile.centre_of_mass(f["position"], f["radius"]) for f in (flow, run.frames[-1])]
        return {f"height at {1e3 * x:.0f} mm [mm]": 1e3 * h for x, h in zip(READ_AT, read, strict=True)} | {
            "run-out in flow [mm]": 1e3 * pile.run_out(flow["position"], flow["radius"], _period(run))[0],
            "center of mass x in flow [mm]": 1e3 * centers[0][0],
            "center of mass x at rest [mm]": 1e3 * centers[1][0],
            "center of mass z at rest [mm]": 1e3 * centers[1][2],
            "time to the far wall [ms]": 1e3 * arrival(run),
            "largest kinetic energy [mJ]": 1e3 * float(energy[time >= 0].max()),
        }

    return results.once(("measures", label, code), compute)


def unrest(run: Run) -> float:
    """Kinetic energy with rotation in the last row before the opening, by the fall of the flow [1]."""
    (time, energy), potential = kinetic(run), run.history["potential_energy"].to_numpy()
    return float(energy[time < 0][-1] / (potential[time < 0][-1] - potential[time >= 0].min()))


def bed(run: Run) -> dict[str, float]:
    """The column just before the opening: mean height [m], solid fraction and contacts per ball inside it."""
    frame, end = run.frames.at(opening(run)), gate(run)
    position, radius, size = frame["position"], frame["radius"], 2 * float(frame["radius"].max())
    places = np.linspace(2 * size, end - 2 * size, 5)
    top = float(pile.height(position, radius, places, _depth(run), _period(run)).mean())
    (front, back), inset = _depth(run), 0.0 if _period(run) else 2 * size
    lo, hi = (2 * size, front + inset, 2 * size), (end - 2 * size, back - inset, top - 2 * size)
    return {
        "height": top,
        "solid fraction": pile.packing_fraction(position, radius, lo, hi),
        "contacts": pile.coordination(position, radius, _period(run)),
    }
