"""What only one pair of materials has: friction, rolling friction or damping at one wall only, between two
particle materials only; gravity and nothing else.

Detects: needs derived from pairs of particles only, or from walls only, or from the first pair; a coefficient
table without the walls' or the second material's entry; a kernel without gravity where nothing touches. The
emulator works out for itself what acts.
"""

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.output.run import TRACE_COLUMNS
from gpudem.scene import Scene
from tests.reference.emulator import emulate
from tests.reference.scenes import BALL, FLOOR, LINEAR_STIFFNESS, STIFFNESS, WALL, R

LIGHT = {**BALL, "young": 8e6, "density": 900.0}
ALL = (("a", "a"), ("a", "b"), ("b", "b"), ("a", "wall"), ("b", "wall"))
#: Rows: a meets b, another a and another b fall on the floor.
NAMES = ["a", "b", "a", "b"]


def one_of_each(pair: dict | None = None, special: dict | None = None, spin: float = 0.0, **more) -> Scene:
    """Two unlike particles meet obliquely and one of each material hits the floor; `special` gives pairs of
    materials values of their own, `pair` all of them."""
    pairs = [{"materials": p, "restitution": 1.0, **(pair or {}), **(special or {}).get(p, {})} for p in ALL]
    return Scene(**{
        "name": "one_of_each", "materials": {"a": BALL, "b": LIGHT, "wall": WALL}, "pairs": pairs,
        "particles": {
            "source": "explicit", "material": NAMES, "radius": [R, 0.0025, R, 0.0025],
            "position": [(-0.0029, 0, 0.02), (0.0027, 0.001, 0.0205),
                         (-0.015, 0, 0.00301), (0.015, 0, 0.00251)],
            "velocity": [(0.5, 0.3, 0), (-0.5, -0.3, 0.1), (0.3, 0.1, -0.5), (0.3, 0.1, -0.5)],
            "angular_velocity": [(s * spin, -s * spin, 2 * spin) for s in (1, -1, 1, 1)] if spin else None,
        },
        "walls": [FLOOR], "domain": {"lo": (-0.03,) * 3, "hi": (0.03,) * 3},
        "time": {"step": 1e-6, "duration": 7e-4}, "output": {"trace_every": 1e-5},
        **more,
    })  # fmt: skip


def agrees(scene: Scene, **options) -> dict[str, np.ndarray]:
    """Asserts the emulator's motion to rounding; returns it."""
    ours, theirs = simulate(scene, **options).trace, emulate(scene)
    assert ours is not None
    for column in TRACE_COLUMNS:
        scale = max(np.abs(theirs[column]).max(), 1e-300)
        assert np.abs(ours[column] - theirs[column]).max() < 1e-12 * scale, column
    return theirs


#: (pair that has it, rows of the particles that feel it)
ONLY = {
    "a at the wall": (("a", "wall"), [2]),
    "b at the wall": (("b", "wall"), [3]),
    "a with b": (("a", "b"), [0, 1]),
}


@pytest.mark.parametrize("law", ["history", "no_history"])
@pytest.mark.parametrize("only", ONLY)
def test_friction_in_one_pair(only, law):
    """Particles start without spin: only what friction turns needs one. Dashpots of the other pairs are 0 for
    restitution 1."""
    pair, rows = ONLY[only]
    special = {pair: {"friction": 0.4, "restitution": 0.6}}
    spin = np.abs(agrees(one_of_each(special=special, contact={"tangential": law}))["angular_velocity"][-1])
    assert spin[rows].max(axis=1).min() > 1.0
    assert spin[[k for k in range(4) if k not in rows]].max() == 0.0


@pytest.mark.parametrize("law", ["cdt", "epsd2"])
@pytest.mark.parametrize("only", ONLY)
def test_rolling_friction_in_one_pair(only, law):
    """Without friction, so that nothing else changes a spin."""
    pair, rows = ONLY[only]
    scene = one_of_each(special={pair: {"rolling_friction": 0.2}}, spin=30.0, contact={"rolling": law})
    change = np.abs(np.diff(agrees(scene)["angular_velocity"][[0, -1]], axis=0)[0]).max(axis=1)
    assert change[rows].min() > 1e-3
    assert change[[k for k in range(4) if k not in rows]].max() == 0.0


@pytest.mark.parametrize("law", ["sjkr", "sjkr2"])
@pytest.mark.parametrize("only", ONLY)
def test_cohesion_in_one_pair(only, law):
    """It changes the speeds of those that have it, and of no others."""
    pair, rows = ONLY[only]
    plain, sticky = (
        agrees(one_of_each(special={pair: {"cohesion_energy_density": k}}, contact={"cohesion": law}))
        for k in (0.0, 2e4)
    )
    change = np.abs(plain["force"] - sticky["force"]).max(axis=(0, 2))
    assert change[rows].min() > 1e-2 * np.abs(plain["force"]).max()
    assert change[[k for k in range(4) if k not in rows]].max() == 0.0


DAMPING = {
    "hertz": ({}, {}, {"restitution": 0.5}),
    "hertz/stiffness": ({"normal": "hertz/stiffness"}, {**STIFFNESS, "gamma_n": 0.0, "gamma_t": 0.0},
                        {"gamma_n": 4e5}),
    "hooke/stiffness": ({"normal": "hooke/stiffness"}, {**LINEAR_STIFFNESS, "gamma_n": 0.0, "gamma_t": 0.0},
                        {"gamma_n": 2e3}),
}  # fmt: skip


@pytest.mark.parametrize("law", DAMPING)
@pytest.mark.parametrize("only", ONLY)
def test_damping_in_one_pair(only, law):
    """It takes energy in both integrators; `path` is another scheme only where something is damped, and then
    it is one: else the wall's damping has made no difference to the choice."""
    pair, rows = ONLY[only]
    contact, every, damped = DAMPING[law]
    scene = one_of_each(every, {pair: damped}, contact=contact)
    trace = agrees(scene)
    masses = scene.masses[:, None]
    energy = [float((masses[rows] * trace["velocity"][k, rows] ** 2).sum()) for k in (0, -1)]
    assert energy[1] < 0.95 * energy[0]
    assert scene.needs.damping
    other = simulate(scene, integrator="path").trace
    assert other is not None
    apart = np.abs(other["velocity"] - trace["velocity"]).max(axis=(0, 2))
    assert apart[rows].min() > 1e-5
    assert apart.max() < 0.05
    undamped = [k for k in range(4) if k not in rows]
    assert apart[undamped].max() < 1e-12


def test_damping_of_pairs_that_never_meet_counts_for_nothing():
    """b meets no b here, but could: it counts. The wall's own pair cannot be met by any particle."""
    pairs = [p.model_dump() for p in one_of_each().pairs]
    walls_own = {"materials": ("wall", "wall"), "restitution": 0.5, "friction": 0.5, "rolling_friction": 0.1}
    needs = one_of_each().replace(pairs=[*pairs, walls_own], contact={"rolling": "cdt"}).needs
    assert not any((needs.damping, needs.tangential, needs.rolling, needs.rotation))
    assert one_of_each(special={("b", "b"): {"restitution": 0.5}}).needs.damping


@pytest.mark.parametrize("materials", [["a"], ["a", "b"]], ids=["one material", "two materials"])
def test_gravity_and_nothing_else(materials):
    """Free flight without contact, friction or wall: x = x0 + v t + g t^2/2, whatever the mass."""
    scene = one_of_each(
        walls=[], gravity=(1.0, -2.0, -9.81), materials={"a": BALL, "b": LIGHT},
        pairs=[{"materials": p} for p in ALL[:3]], time={"step": 1e-5, "duration": 0.002},
        output={"trace_every": 1e-4},
        particles={
            "source": "explicit", "material": [materials[k % len(materials)] for k in range(3)],
            "radius": [R, 0.001, 0.002], "position": [(-0.02, 0, 0), (0, 0, 0), (0.02, 0, 0)],
            "velocity": [(0.1, 0, 1.0), (0, 0.2, -1.0), (0, 0, 0)],
        },
    )  # fmt: skip
    trace = agrees(scene)
    g, t = np.array(scene.gravity), trace["time"][:, None, None]
    x = scene.state.position + scene.state.velocity * t + g * t**2 / 2
    assert np.abs(trace["position"] - x).max() < 1e-14
    assert scene.needs.gravity
    assert scene.needs.several_materials == (len(materials) > 1)
    assert np.allclose(trace["force"], scene.masses[:, None] * g, rtol=1e-14)


def test_each_wall_has_the_coefficients_of_its_material_and_the_particles():
    """Two materials of balls on two walls of other materials: each rebounds with the restitution of its pair.

    Detects: coefficients taken by the wall only, by the particle's material only, or of the first wall.
    """
    restitution = {("a", "floor"): 0.9, ("b", "floor"): 0.7, ("a", "side"): 0.5, ("b", "side"): 0.3}
    material = {"young": 5e6, "poisson": 0.3, "density": 2500.0}
    others = [("a", "a"), ("a", "b"), ("b", "b")]
    scene = Scene(
        name="walls", materials=dict.fromkeys(("a", "b", "floor", "side"), material),
        pairs=[{"materials": p, "restitution": e} for p, e in restitution.items()]
        + [{"materials": p, "restitution": 1.0} for p in others],
        particles={
            "source": "explicit", "radius": 0.003, "material": ("a", "b", "a", "b"),
            "position": [(0.05, 0.02, 0.0031), (0.05, 0.05, 0.0031), (0.0031, 0.02, 0.05),
                         (0.0031, 0.05, 0.05)],
            "velocity": [(0, 0, -0.2), (0, 0, -0.2), (-0.2, 0, 0), (-0.2, 0, 0)],
        },
        walls=[
            {"kind": "plane", "name": "floor", "material": "floor", "point": (0, 0, 0), "normal": (0, 0, 1)},
            {"kind": "plane", "name": "side", "material": "side", "point": (0, 0, 0), "normal": (1, 0, 0)},
        ],
        domain={"lo": (0, 0, 0), "hi": (0.1, 0.1, 0.1)}, time={"step": 2e-6, "duration": 8e-3},
        output={"trace_every": 8e-3},
    )  # fmt: skip
    trace = simulate(scene).trace
    assert trace is not None
    rebound = np.abs(trace["velocity"][-1]).max(axis=1) / 0.2
    assert rebound == pytest.approx(list(restitution.values()), abs=5e-3)


def test_a_gate_that_is_stated_before_other_walls_is_the_one_that_goes():
    """A ball flies through where the gate was, and rebounds from the wall behind it.

    Detects: walls taken by their place among those present, so that another one is removed.
    """
    step = 2e-6
    scene = Scene(
        name="first", materials={"ball": BALL, "wall": WALL},
        pairs=[{"materials": ("ball", p), "restitution": 1.0} for p in ("ball", "wall")],
        particles={"source": "explicit", "material": "ball", "radius": R, "position": [(0.01, 0, 0)],
                   "velocity": [(0.5, 0, 0)]},
        walls=[
            {"kind": "plane", "name": "gate", "material": "wall", "point": (0.02, 0, 0), "normal": (-1, 0, 0),
             "removed_at": 4e-3},
            {"kind": "plane", "name": "end", "material": "wall", "point": (0.03, 0, 0), "normal": (-1, 0, 0)},
        ],
        domain={"lo": (0, -0.01, -0.01), "hi": (0.031, 0.01, 0.01)}, time={"step": step, "duration": 0.05},
        output={"trace_every": 1e-3},
    )  # fmt: skip
    trace = simulate(scene).trace
    assert trace is not None
    assert 0.02 < trace["position"][:, 0, 0].max() < 0.03 - R + 2e-4
    assert trace["velocity"][-1, 0, 0] == pytest.approx(-0.5, rel=1e-3)
