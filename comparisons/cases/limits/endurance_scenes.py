"""Long or large scenes: a bed at rest, a column of 1000 balls, a gas of millions of collisions."""

from __future__ import annotations

import math

import numpy as np

from comparisons.cases.gas import scenes as gases
from comparisons.cases.side_by_side import floor, traced
from comparisons.kit import Tier
from comparisons.oracles import closed_forms, gas
from comparisons.oracles.bodies import bodies, of_material
from comparisons.oracles.chain import Chain
from gpudem.output.run import Run
from gpudem.scene import Box, Contact, Domain, Explicit, Lattice, Material, Output, Pair, Scene, Time

RADIUS, GRAVITY = 0.003, 9.81
SOFT = Material(young=5e6, poisson=0.34, density=1768.0)
STIFF = SOFT.model_copy(update={"young": 5e8})


#: Time of the beds [s], collisions of the gas, balls in a column.
REST_TIME: dict[Tier, float] = {"quick": 2.0, "standard": 3.0, "full": 60.0}
COLLISIONS: dict[Tier, float] = {"quick": 2e4, "standard": 1.5e5, "full": 1e7}
COLUMN: dict[Tier, int] = {"quick": 100, "standard": 400, "full": 1000}

# -- a bed at rest -------------------------------------------------------------------------------------------

BALLS, SIDE, BED_STEP = 200, 0.03, 2.5e-5
#: Rows of a bed's history and trace.
ROWS, PLACES = 300, 20


def bed(friction: float, duration: float) -> Scene:
    """BALLS fall into a box ten radii wide and come to rest; restitution 0.5 to be there soon."""
    return Scene(
        name="bed", materials={"ball": SOFT},
        pairs=[Pair(materials=("ball", "ball"), restitution=0.5, friction=friction)],
        contact=Contact(tangential="history" if friction else "off"),
        particles=Lattice(
            source="lattice", material="ball", count=BALLS, radius=RADIUS, lo=(0, 0, 0),
            hi=(SIDE, SIDE, 0.5), seed=1,
        ),
        walls=[Box(kind="box", name="box", material="ball", sides=("xlo", "xhi", "ylo", "yhi", "zlo"),
                   lo=(0, 0, 0), hi=(SIDE, SIDE, 0.5))],
        gravity=(0, 0, -GRAVITY),
        domain=Domain(lo=(-RADIUS, -RADIUS, -RADIUS), hi=(SIDE + RADIUS, SIDE + RADIUS, 0.5)),
        time=Time(step=BED_STEP, duration=duration),
        output=Output(history_every=duration / ROWS, trace_every=duration / PLACES),
    )  # fmt: skip


#: The whole bed's weight by a diameter [J].
SCALE = BALLS * SOFT.density * 4 / 3 * math.pi * RADIUS**3 * GRAVITY * 2 * RADIUS


def kinetic(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """(time [s], kinetic + rotational energy by that of the whole bed's weight falling a diameter [1])."""
    table = run.history
    energy = (table["kinetic_energy"] + table["rotational_energy"]).to_numpy()
    return table["time"].to_numpy(), energy / SCALE


def fall(run: Run) -> float:
    """Distance by which the center of the bed sank / diameter, by its potential energy."""
    potential = run.history["potential_energy"].to_numpy()
    return float(potential[0] - potential[-1]) / SCALE


def creep(run: Run) -> float:
    """Largest displacement of a ball over the last half of the run / its radius."""
    x = run.trace["position"]
    half = x[len(x) // 2 :]
    return float(np.linalg.norm(half - half[-1], axis=2).max() / RADIUS)


# -- a tall column -------------------------------------------------------------------------------------------

#: The step is 7 % of the Rayleigh time; a wave travels down the column and half way back.
COLUMN_STEP, COLUMN_TIME, PUSH = 2e-6, 8e-5, 1e-3


def column(count: int) -> Scene:
    """Two elastic columns at their closed form's rest; the topmost ball of the second is pushed down."""
    stated = _columns([(0.0, 0.0, RADIUS)], [(0.0, 0.0, 0.0)], 1e-5)
    chain = chain_of(stated, count)
    position, velocity = np.zeros((2, count, 3)), np.zeros((2, count, 3))
    position[:, :, 2] = chain.height
    position[1, :, 0] = 4 * RADIUS
    velocity[1, -1, 2] = -PUSH
    return _columns(position.reshape(-1, 3), velocity.reshape(-1, 3), COLUMN_TIME * count)


def _columns(position, velocity, duration: float) -> Scene:
    top = float(np.max(np.array(position)[:, 2])) + 4 * RADIUS
    return traced(
        "column", Explicit(position=position, velocity=velocity, radius=RADIUS, material="ball"),
        step=COLUMN_STEP, duration=duration, every=duration, materials={"ball": STIFF},
        pairs=[Pair(materials=("ball", "ball"))], walls=[floor("ball")], gravity=(0, 0, -GRAVITY),
        lo=(-4 * RADIUS, -4 * RADIUS, -RADIUS), hi=(8 * RADIUS, 4 * RADIUS, top),
    )  # fmt: skip


def chain_of(scene: Scene, count: int | None = None) -> Chain:
    """The closed form of a column."""
    n = len(scene.state) // 2 if count is None else count
    return Chain(n, bodies(scene, 0, "floor"), of_material(STIFF, RADIUS, wall=False), GRAVITY)


def column_errors(run: Run) -> tuple[float, float]:
    """(Largest displacement in the column at rest, error in the other) / largest of the wave, at the end."""
    chain, n = chain_of(run.scene), len(run.scene.state) // 2
    start = run.scene.state
    want = chain.motion(start.velocity[n:, 2], run.scene.n_steps * run.scene.time.step)[0]
    way, scale = run.trace["position"][-1] - start.position, float(np.abs(want).max())
    return float(np.abs(way[:n]).max() / scale), float(np.abs(way[n:, 2] - want).max() / scale)


# -- a gas ---------------------------------------------------------------------------------------------------

COUNT, SHARE, STEPS, GAS_ROWS = 1000, 0.3, 25, 200
#: Contact time [s], a third of the mean free time; it takes a seventh of the collisions away, and the room
#: for fewer is generous.
CONTACT, MORE = 8e-5, 1.25
STIFFNESS = gases.stiffness(CONTACT)


def _gas_box(name: str, count: int, share: float, young: float, contact: Contact, **more) -> Scene:
    """An elastic gas without friction."""
    ball = Material(young=young, poisson=gases.POISSON, density=gases.DENSITY)
    return gases.gas_box(
        name, count, share, 1, materials={"ball": ball}, pairs=[Pair(materials=("ball", "ball"))],
        contact=contact, **more,
    )  # fmt: skip


def gas_of(collisions: float) -> Scene:
    """A gas with linear springs, as long as so many collisions take by Enskog's rate."""
    density = 6 * SHARE / (math.pi * (2 * gases.RADIUS) ** 3)
    rate = gas.collision_rate(2 * gases.RADIUS, density, 1.0, gas.contact_value(SHARE))
    step = CONTACT / STEPS
    rows = max(1, round(MORE * 2 * collisions / (COUNT * rate) / step / GAS_ROWS))
    return _gas_box(
        "gas", COUNT, SHARE, gases.spring_young(CONTACT, 1.0),
        Contact(normal="hooke", characteristic_velocity=1.0, tangential="off"),
        time=Time(step=step, duration=rows * GAS_ROWS * step), allow=("time_step",),
        output=Output(trace_every=rows * step, history_every=rows * step),
    )  # fmt: skip


#: Contact time [s] at twice the rms speed, and steps in it, of the gas whose energy is to stay.
SHORT, FINE, FINE_STEPS = 5e-6, 200, 100_000


def fine_gas() -> Scene:
    """125 elastic Hertz spheres for FINE_STEPS steps, some 350 collisions."""
    reach, speed = gases.RADIUS / 2, 2.0
    star = math.sqrt((closed_forms.HERTZ_TIME / SHORT) ** 5 * (gases.MASS / 2) ** 2 / (reach * speed))
    step = SHORT / FINE
    return _gas_box(
        "fine_gas", 125, 0.2, 2 * (1 - gases.POISSON**2) * star, Contact(tangential="off"),
        time=Time(step=step, duration=FINE_STEPS * step), output=Output(history_every=100 * step),
    )  # fmt: skip


def fine_energy(run: Run) -> np.ndarray:
    """Kinetic energy / that at the start - 1, at the rows without contacts, where it is the whole energy."""
    energy = run.history["kinetic_energy"].to_numpy()
    apart = run.history["contacts"].to_numpy() == 0
    return energy[apart] / energy[0] - 1


def collisions(run: Run) -> float:
    """Collisions of the run: contacts at a time / contact time * time."""
    contacts = run.history["contacts"].to_numpy()
    return float(contacts[len(contacts) // 10 :].mean() / CONTACT * run.history["time"].to_numpy()[-1])


def gas_energy(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """(time [s], energy / that at the start - 1): kinetic, and k overlap^2/2 of every contact."""
    edge = run.scene.domain.hi[0]
    overlaps = [gases.overlaps(x, edge) for x in run.trace["position"]]
    stored = [float((STIFFNESS * d**2 / 2).sum()) for d in overlaps]
    kinetic = gases.MASS / 2 * (run.trace["velocity"] ** 2).sum(axis=(1, 2))
    energy = kinetic + np.array(stored)
    return run.trace["time"], energy / energy[0] - 1
