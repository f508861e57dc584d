"""Unequal masses and radii wherever one value could stand for all: laws, walls, histories, guards, warnings.

Detects: the mass, radius or moment of inertia of the first or the largest particle taken for all; a centre of
mass that is a mean position; an overlap at a wall counted by another radius; a speed limit by the largest.
"""

from collections.abc import Sequence

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.errors import SimulationError
from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from tests.gpudem.beds import finish
from tests.gpudem.test_needs_of_walls import agrees, one_of_each
from tests.reference.emulator import emulate
from tests.reference.scenes import BALL, FLOOR, STIFFNESS, WALL

LAWS = {
    "hertz": {},
    "limit_force": {"limit_force": True},
    "hooke": {"normal": "hooke", "characteristic_velocity": 0.5},
    "hertz/stiffness": {"normal": "hertz/stiffness"},
    "no_history": {"tangential": "no_history"},
    "cdt": {"rolling": "cdt"},
    "epsd2": {"rolling": "epsd2"},
}
FULL_TOO = ("hooke", "hertz/stiffness", "epsd2")


def unlike(law: str) -> Scene:
    """Spheres of two radii and materials meet each other and a floor, spinning."""
    pair = {"restitution": 0.6, "friction": 0.3, "rolling_friction": 0.05 if "rolling" in LAWS[law] else 0.0}
    pair |= STIFFNESS if law == "hertz/stiffness" else {}
    special = {("a", "b"): {"friction": 0.2, "restitution": 0.5}, ("b", "wall"): {"friction": 0.1}}
    return one_of_each(pair, special, spin=20.0, contact=LAWS[law], gravity=(0.0, 0.0, -9.81))


@pytest.mark.parametrize("law", LAWS)
def test_every_law(law):
    """Effective mass and radius, lever arms, moments of inertia; agreement to rounding."""
    trace = agrees(unlike(law))
    assert np.abs(trace["velocity"][-1] - trace["velocity"][0]).min(axis=1).max() > 0.01


@pytest.mark.parametrize("law", FULL_TOO)
def test_every_law_in_the_full_list(law):
    """The kernel of CUDA devices."""
    scene, theirs = unlike(law), emulate(unlike(law))
    ours = finish(Solver(scene, half_list=False))
    for column in ("position", "velocity", "angular_velocity"):
        scale = np.abs(theirs[column]).max()
        assert np.abs(ours[column] - theirs[column][-1]).max() < 1e-12 * scale, column


def test_histories():
    """Every column from positions, velocities and spins of the trace and from density and radius alone."""
    done = simulate(unlike("hertz").replace(output={"history_every": 1e-5}))
    trace, table = done.trace, done.history
    assert trace is not None
    assert table is not None
    density = np.array([1768.0, 900.0, 1768.0, 900.0])
    radius = np.array([0.003, 0.0025, 0.003, 0.0025])
    mass = density * 4 / 3 * np.pi * radius**3
    x, v, w = (trace[k] for k in ("position", "velocity", "angular_velocity"))
    wanted = {
        "time": trace["time"],
        "kinetic_energy": 0.5 * (mass * (v**2).sum(axis=2)).sum(axis=1),
        "rotational_energy": 0.5 * (0.4 * mass * radius**2 * (w**2).sum(axis=2)).sum(axis=1),
        "potential_energy": 9.81 * (mass * x[:, :, 2]).sum(axis=1),
        **{f"centre_{c}": (mass * x[:, :, k]).sum(axis=1) / mass.sum() for k, c in enumerate("xyz")},
    }
    for column, values in wanted.items():
        found = table[column].to_numpy()
        assert np.allclose(found, values, rtol=1e-13, atol=1e-13 * np.abs(values).max()), column
    assert np.ptp(wanted["rotational_energy"]) > 0.1 * wanted["rotational_energy"].max()
    touching = np.any(trace["force"] - mass[:, None] * np.array([0, 0, -9.81]), axis=2)
    contacts = touching[:, 0].astype(int) + touching[:, 2] + touching[:, 3]
    assert np.array_equal(table["contacts"], contacts)
    assert contacts.max() == 3


def beside(radii: Sequence[float], depth: Sequence[float], **more) -> Scene:
    """Two spheres apart from each other, each a depth inside the floor [m], at rest without gravity."""
    return Scene(**{
        "name": "beside", "materials": {"ball": BALL, "wall": WALL},
        "pairs": [{"materials": ("ball", "ball")}, {"materials": ("ball", "wall")}],
        "particles": {
            "source": "explicit", "material": "ball", "radius": list(radii),
            "position": [(0.0, 0, radii[0] - depth[0]), (0.02, 0, radii[1] - depth[1])],
            "velocity": more.pop("velocity", None),
        },
        "walls": [FLOOR], "domain": {"lo": (-0.03,) * 3, "hi": (0.05,) * 3},
        "time": {"step": 1e-8, "duration": 3e-8}, **more,
    })  # fmt: skip


@pytest.mark.parametrize("order", [1, -1], ids=["large first", "small first"])
def test_overlap_at_a_wall_counts_by_that_radius(order):
    """0.44 of the large radius is 2.2 of the small one and passes; 0.6 of the small one is 0.12 of the large
    one and ends the run. They fall in, so that the start itself is allowed."""
    speed, radii = 50.0, (0.005, 0.001)[::order]

    def dropped(ends: tuple[float, float]) -> Scene:
        # soft enough that nothing brakes them; the overlap is looked at where a rebuild is due
        down = [(0, 0, -speed)] * 2
        steps, step = 40, 2e-6
        start = tuple(end - speed * steps * step for end in ends)
        soft = {k: {**m, "young": 5e3} for k, m in (("ball", BALL), ("wall", WALL))}
        return beside(
            radii, start[::order], velocity=down, materials=soft, solver={"skin": 1e-4},
            time={"step": step, "duration": steps * step}, allow=["time_step", "unusual_units"],
        )  # fmt: skip

    assert simulate(dropped((0.0022, 0.0))).timing.steps == 40
    small = 1 if order == -1 else 2
    with pytest.raises(
        SimulationError, match=f"particle {small} overlaps wall floor by more than 0.5 of the"
    ):
        simulate(dropped((0.0, 0.0008)))


def test_speed_is_limited_by_the_smallest_radius():
    """Both orders of the particles: a move of 1.5 small radii in a step, 0.3 large ones, ends the run."""
    for radii in ((0.005, 0.001), (0.001, 0.005)):
        up = [(0, 0, 150.0), (0, 0, 0.0)]
        scene = beside(radii, (-0.001, -0.001), velocity=up, time={"step": 1e-5, "duration": 1e-4},
                       allow=["time_step"])  # fmt: skip
        with pytest.raises(
            SimulationError, match=r"particle 1 moves faster than 100 m/s, the smallest radius"
        ):
            simulate(scene)


def test_energy_warning_weighs_every_particle():
    """A heavy ball falls while a light one is thrown up: no energy grows, whatever the mean height does."""
    for radii in ((0.005, 0.001), (0.001, 0.005)):
        thrown = [(0, 0, 0.3 if r < 0.002 else 0.0) for r in radii]
        scene = beside(
            radii, (-0.01, -0.01), velocity=thrown, gravity=(0, 0, -9.81),
            pairs=[{"materials": ("ball", k), "restitution": 0.5} for k in ("ball", "wall")],
            time={"step": 1e-5, "duration": 0.02}, output={"history_every": 1e-3},
        )  # fmt: skip
        done = simulate(scene)
        assert not [w for w in done.warnings if "energy" in w]
        assert done.history is not None
        total = done.history[["kinetic_energy", "potential_energy"]].sum(axis=1).to_numpy()
        assert np.ptp(total) < 1e-9 * total.max()
        assert np.ptp(done.history["potential_energy"]) > 0.05 * total.max()
