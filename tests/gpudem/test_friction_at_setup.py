"""A contact without friction has no tangential force, also at a set-up, whatever the other pairs have.

A set-up finds springs at rest, so that every contact sticks, and the dashpot acts without regard to mu |F_n|.
Where friction is 0 that is a force along a frictionless surface, at the start and at each gate's removal.
Detects: a tangential dashpot of a pair or wall without friction; one cut where there is friction.
"""

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.scene import Scene
from tests.reference.scenes import BALL, FLOOR, STIFFNESS, WALL, R

LAWS = {
    "hertz": {},
    "hooke": {"normal": "hooke", "characteristic_velocity": 0.5},
    "hertz/stiffness": {"normal": "hertz/stiffness"},
}
GATE = {"kind": "plane", "name": "gate", "material": "wall", "point": (0.029, 0, 0), "normal": (-1, 0, 0),
        "removed_at": 5e-6}  # fmt: skip
HEAVY = {**BALL, "density": 3000.0}
PRESSED = R - 2e-5


def sliding(contact: dict, friction: dict[tuple[str, str], float], **more) -> Scene:
    """Two touching pairs of particles, of materials a-a and a-b, and two balls a and b on a floor; all slide
    sideways at 0.1 m/s."""
    names, position, velocity = [], [], []
    for k, (one, other) in enumerate((("a", "a"), ("a", "b"))):
        names += [one, other]
        position += [(0.02 * k - 0.01, -PRESSED, 0.02), (0.02 * k - 0.01, PRESSED, 0.02)]
        velocity += [(0.1, 0, 0), (-0.1, 0, 0)]
    for k, one in enumerate("ab"):
        names.append(one)
        position.append((0.02 * k - 0.01, 0, PRESSED))
        velocity.append((0.1, 0, 0))
    constants = STIFFNESS if contact.get("normal") == "hertz/stiffness" else {}
    pairs = [
        {"materials": p, "restitution": 0.5, "friction": friction.get(p, 0.0), **constants}
        for p in (("a", "a"), ("a", "b"), ("b", "b"), ("a", "wall"), ("b", "wall"))
    ]
    return Scene(**{
        "name": "sliding", "materials": {"a": BALL, "b": HEAVY, "wall": WALL},
        "pairs": pairs, "contact": contact,
        "particles": {"source": "explicit", "radius": R, "material": names, "position": position,
                      "velocity": velocity},
        "walls": [FLOOR], "domain": {"lo": (-0.03,) * 3, "hi": (0.03,) * 3},
        "time": {"step": 1e-6, "duration": 1e-5}, "output": {"trace_every": 1e-6},
        **more,
    })  # fmt: skip


#: What has friction -> rows of the particles that must feel none.
MIXED = {
    "a wall": ({("a", "wall"): 0.5}, [0, 1, 2, 3, 5]),
    "a pair": ({("a", "a"): 0.5}, [2, 3, 4, 5]),
    "a pair of two materials": ({("a", "b"): 0.5}, [0, 1, 4, 5]),
    "a pair that does not meet here": ({("b", "b"): 0.5}, [0, 1, 2, 3, 4, 5]),
}


def turning(scene: Scene, rows: list[int], **options) -> tuple[float, float]:
    """Tangential force at t = 0 [N] and angular velocity at any step [rad/s], the largest of these particles.

    The pairs turn as they slide, so that later the normal force has a part along x; without friction nothing
    makes them spin.
    """
    trace = simulate(scene, **options).trace
    assert trace is not None
    assert np.linalg.norm(trace["force"][0, rows], axis=1).min() > 1e-3
    others = [k for k in range(6) if k not in rows]
    if others:
        assert np.abs(trace["force"][1, others, 0]).max() > 1e-4  # friction is there, for those that have it
    force, spin = trace["force"][0, rows, 0], trace["angular_velocity"][:, rows]
    return float(np.abs(force).max()), float(np.abs(spin).max())


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("what", MIXED)
def test_at_the_start(law, what):
    friction, rows = MIXED[what]
    force, spin = turning(sliding(LAWS[law], friction), rows)
    assert force == 0.0
    assert spin == 0.0


@pytest.mark.parametrize("options", [{"integrator": "path"}, {"precision": "mixed"}], ids=["path", "mixed"])
def test_for_every_way_to_step(options):
    friction, rows = MIXED["a wall"]
    force, spin = turning(sliding({}, friction), rows, **options)
    assert force == 0.0
    assert spin == 0.0


def test_at_the_removal_of_a_gate():
    """The second set-up finds the same contacts, in motion."""
    friction, rows = MIXED["a wall"]
    force, spin = turning(sliding({}, friction, walls=[FLOOR, GATE]), rows)
    assert force == 0.0
    assert spin == 0.0


def test_without_history_there_is_none():
    """`no_history` cuts its dashpot at mu |F_n|, at set-ups too."""
    friction, rows = MIXED["a wall"]
    force, spin = turning(sliding({"tangential": "no_history"}, friction), rows)
    assert force == 0.0
    assert spin == 0.0


def test_with_friction_the_dashpot_acts_at_the_start():
    """What a fix must leave: the same contacts with friction have it, to the formula's value."""
    everywhere = dict.fromkeys([("a", "a"), ("a", "b"), ("a", "wall"), ("b", "wall")], 0.5)
    trace = simulate(sliding({}, everywhere)).trace
    assert trace is not None
    assert np.abs(trace["force"][0, :, 0]).min() > 1e-3
