"""Random insertions: packs, rates and streams, resolved before the run without overlap."""

from __future__ import annotations

import hashlib
import itertools
from typing import Any

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.output.directory import load_scene, save_scene
from gpudem.scene import InsertList, Scene, checks
from gpudem.scene.insertion import _flight
from gpudem.scene.regions import Block

MATERIALS = {
    "glass": {"young": 5e7, "poisson": 0.3, "density": 2500.0},
    "steel": {"young": 5e7, "poisson": 0.3, "density": 7800.0},
}
PAIRS = [
    {"materials": pair, "restitution": 0.7, "friction": 0.4}
    for pair in itertools.combinations_with_replacement(MATERIALS, 2)
]
REGION = {"kind": "block", "lo": (0, 0, 0.1), "hi": (0.1, 0.1, 0.2)}
VOLUME = 1e-3
STEP = 1e-5
PACK: dict[str, Any] = {"kind": "pack", "region": REGION, "count": 300, "radius": 0.004, "material": "glass"}
RATE: dict[str, Any] = {
    "kind": "rate", "region": REGION, "number_rate": 5000.0, "every": 0.01, "radius": 0.003,
    "material": "glass", "velocity": (0, 0, -3.0),
}  # fmt: skip
FACE = {"kind": "disc", "center": (0.05, 0.05, 0.19), "axis": (0, 0, 1), "radius": 0.03}
STREAM: dict[str, Any] = {
    "kind": "stream", "face": FACE, "number_rate": 4000.0, "material": "glass", "velocity": (0, 0, -2.0),
    "radius": {"kind": "uniform", "lo": 0.002, "hi": 0.004},
}  # fmt: skip
MIXTURE = [
    {"material": "glass", "radius": 0.004, "share": 0.5},
    {"material": "steel", "radius": {"kind": "normal", "mean": 0.003, "sigma": 3e-4}, "share": 0.5},
]


def scene(*insert: dict[str, Any], **changes: Any) -> Scene:
    data: dict[str, Any] = {
        "name": "filling", "materials": MATERIALS, "pairs": PAIRS, "gravity": (0, 0, -9.81),
        "insert": [*insert],
        "walls": [{"kind": "box", "name": "box", "material": "glass"}],
        "domain": {"lo": (0, 0, 0), "hi": (0.1, 0.1, 0.2)}, "time": {"step": STEP, "duration": 0.1},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def without(stated: dict[str, Any], *keys: str, **more: Any) -> dict[str, Any]:
    return {k: v for k, v in stated.items() if k not in keys} | more


def largest_overlap(made: Scene) -> float:
    """Largest overlap [m] at an insertion, of what is inserted and what has come; all pairs."""
    state, steps, g = made.state, made.arrival_steps, np.array(made.gravity)
    worst = -np.inf
    for step in made.insertion_steps:
        t = (step - steps)[:, None] * STEP
        x = state.position + state.velocity * t + g * (t * t + t * STEP) / 2
        new, old = np.flatnonzero(steps == step), np.flatnonzero(steps < step)
        for a, b in ((new, new), (new, old)):
            gap = np.linalg.norm(x[a][:, None] - x[b], axis=2) - state.radius[a][:, None] - state.radius[b]
            if a is b:
                np.fill_diagonal(gap, np.inf)
            worst = max(worst, -gap.min(initial=np.inf))
    return worst


EVERY = {
    "pack": PACK, "rate": RATE, "stream": STREAM,
    "full": {**PACK, "count": 3000, "attempts": 200},
    "sizes": without(PACK, "radius", "material", mixture=MIXTURE),
    "repeated": {**PACK, "count": 1500, "attempts": 50, "every": 0.02, "velocity": (0, 0, -3.0),
        "velocity_spread": 0.1},
    "slow": {**PACK, "count": 1500, "every": 0.02, "attempts": 50},
    "rising": {**STREAM, "velocity": (0, 0, 2.0), "face": {**FACE, "center": (0.05, 0.05, 0.02)}},
    "oblique": {**STREAM, "velocity": (1.0, 0, -1.5), "velocity_spread": 0.05},
}  # fmt: skip


@pytest.mark.parametrize("name", EVERY)
def test_no_overlap(name):
    """Detects: particles in one place, in each other's way, or in that of earlier ones that fall slowly."""
    made = scene(EVERY[name])
    assert len(made.state) > 100
    assert largest_overlap(made) <= 0
    low = made.state.position[:, 2] - made.state.radius
    if "region" in EVERY[name]:
        assert low.min() >= 0.1
        assert (made.state.position - made.state.radius[:, None]).min() >= 0


def test_a_number_a_mass_a_fraction():
    """Detects: another target than stated; a mass that is not the nearest possible."""
    assert len(scene(PACK).state) == 300
    ball = 4 / 3 * np.pi * 0.004**3
    for mass in (0.1004, 0.1006):  # a particle has 0.67 g
        made = scene(without(PACK, "count", mass=mass))
        assert abs(made.masses.sum() - mass) <= 0.5 * ball * 2500
    fraction = scene(without(PACK, "count", volume_fraction=0.2))
    assert abs(len(fraction.state) * ball - 0.2 * VOLUME) <= 0.5 * ball
    two = scene(
        without(PACK, "count", "radius", "material", volume_fraction=0.15, mixture=MIXTURE, share_by="mass")
    )
    volumes = 4 / 3 * np.pi * two.state.radius**3
    assert abs(volumes.sum() - 0.15 * VOLUME) <= 0.5 * ball


@pytest.mark.parametrize("by", ["number", "mass"])
def test_shares_of_a_mixture(by):
    """Detects: shares of mass taken for shares of number; a radius of the other material."""
    big = {"kind": "block", "lo": (0, 0, 0), "hi": (0.1, 0.1, 0.2)}
    made = scene(without(PACK, "radius", "material", mixture=MIXTURE, share_by=by, count=1500, region=big))
    steel = made.state.material == 1
    share = steel.mean() if by == "number" else made.masses[steel].sum() / made.masses.sum()
    assert share == pytest.approx(0.5, abs=0.06)  # 4 standard deviations of a share of 1500
    assert (made.state.radius[~steel] == 0.004).all()
    assert np.ptp(made.state.radius[steel]) > 5e-4


def test_fillings_until_the_target():
    """Detects: particles lost between fillings, a size that comes less often since it fits less often."""
    region = {**REGION, "lo": (0, 0, 0.15)}
    stated = {**without(PACK, "radius", "material"), "mixture": MIXTURE, "region": region, "attempts": 50}
    made = scene({**stated, "count": 800, "every": 0.02, "velocity": (0, 0, -3.0)})
    assert made.insertion_steps == [1, 2000, 4000]
    assert len(made.state) == 800
    for step in made.insertion_steps[:2]:
        come = made.arrival_steps == step
        assert 200 < come.sum() < 400
        assert (made.state.material[come] == 1).mean() == pytest.approx(0.5, abs=0.12)  # 4 deviations
    assert not made.inserted.warnings


def test_what_does_not_fit_is_reported():
    """Detects: particles left out without a word, or a wrong number of them."""
    made = scene({**PACK, "count": 2000, "attempts": 200})
    left = 2000 - len(made.state)
    assert 500 < left < 1500
    found = checks.scene_warnings(made)
    assert any(f"insert[0]: {left} of 2000 particles did not fit, of radius 0.004 m" in w for w in found), (
        found
    )
    assert 0.2 < made.masses.sum() / 2500 / VOLUME < 0.38


def test_a_rate_in_number_and_mass():
    """Detects: a rate that is missed, by the interval or by rounding that adds up."""
    made = scene({**RATE, "number_rate": 4730.0, "start": 0.02, "end": 0.08})
    assert made.insertion_steps == [2000, 3000, 4000, 5000, 6000, 7000]
    assert len(made.state) == int(4730 * 0.06)
    for stated in (RATE, STREAM):
        made = scene(without(stated, "number_rate", mass_rate=1.0))
        steps, mass = made.arrival_steps, made.masses
        interval = np.diff(made.insertion_steps)[0] * STEP
        for step in made.insertion_steps:
            brought = mass[steps <= step].sum()
            assert abs(brought - 1.0 * (step * STEP + interval)) <= 1.2 * mass.max() + 1e-3 * interval


def test_a_stream_keeps_its_rate_and_its_pitch():
    """Detects: layers that come too soon or too late, a rate that is not that of the statement."""
    made = scene(STREAM)
    steps = np.array(made.insertion_steps)
    assert np.all(np.diff(steps) * STEP * 2.0 >= 2 * 0.004)
    assert np.all(np.diff(steps) * STEP * 2.0 < 2 * 0.004 * 1.01)
    assert len(made.state) == pytest.approx(4000 * 0.1, rel=0.05)
    assert np.abs(made.state.position[:, 2] - 0.19).max() < 1e-15
    slow = scene({**STREAM, "number_rate": 60.0})
    assert 5 <= len(slow.state) <= 6
    assert len(slow.insertion_steps) == len(slow.state)


def test_the_start_and_other_insertions_are_in_the_way():
    """Detects: a pack into the particles at the start, or into those of another insertion of the step."""
    start = {"source": "lattice", "material": "glass", "count": 200, "lo": (0, 0, 0.1), "hi": (0.1, 0.1, 0.2),
             "radius": 0.005, "jitter": 0.0}  # fmt: skip
    made = scene({**PACK, "time": 0.0}, {**PACK, "count": 100}, particles=start)
    assert made.start_count == 200
    x, r = made.state.position, made.state.radius
    gap = np.linalg.norm(x[:, None] - x, axis=2) - r[:, None] - r
    np.fill_diagonal(gap, 1)
    assert gap.min() > 0
    listed = {
        "kind": "list",
        "time": 0.0,
        "position": [(0.05, 0.05, 0.15)],
        "radius": 0.03,
        "material": "glass",
    }
    made = scene(listed, PACK)
    gap = np.linalg.norm(made.state.position[1:] - made.state.position[0], axis=1) - 0.034
    assert 0 < gap.min() < 0.005


def test_flight_through_phases_of_gravity():
    """Where free flight takes particles is where a run takes them, through changes of gravity.

    Detects: gravity of the start only, a change a step apart, the half kick of the step of insertion left
    out; the pitch of a stream by the gravity of another phase.
    """
    phases = [{"start": 0.004, "gravity": (3.0, 0, 5.0)}, {"start": 0.007, "gravity": (0, -4.0, 0)}]
    listed = {"kind": "list", "time": [0.001, 0.004, 0.00401, 0.008], "radius": 0.003, "material": "glass",
              "position": [(0.02 * k, 0.05, 0.1) for k in range(1, 5)],
              "velocity": [(0, 0, -0.5)] * 4}  # fmt: skip
    made = scene(
        listed, phases=phases, walls=[], time={"step": STEP, "duration": 0.01}, output={"trace_every": 0.01}
    )
    trace = simulate(made).trace
    assert trace is not None
    flight = _flight(made, made.insertion_lists)
    place, _ = flight.near(Block(kind="block", lo=(0, 0, 0), hi=(0.1, 0.1, 0.2)), 0.0, 0.01)
    assert np.abs(place - trace["position"][-1]).max() < 1e-14  # rounding of 1000 steps
    slow = STREAM | {"velocity": (0, 0, -0.6), "number_rate": 1000.0}
    heavy = [{"start": 0.05, "gravity": (0, 0, 9.81)}]
    pitch = [len(scene(slow, phases=p).insertion_steps) for p in ((), heavy)]
    assert pitch[0] > pitch[1]
    late = scene(slow | {"end": 0.05}, phases=heavy)
    assert len(late.insertion_steps) == pytest.approx(pitch[0] / 2, abs=1)


def test_through_periodic_sides():
    """Detects: particles that fly through a side and are not in the way on the other one."""
    region = {**REGION, "lo": (0.04, 0, 0.1)}
    flying = {**PACK, "every": 0.01, "count": 900, "velocity": (4.0, 0, 0), "region": region, "attempts": 20}
    domain = {"lo": (0, 0, 0), "hi": (0.1, 0.1, 0.2), "periodic": (True, False, False)}
    made = scene(flying, walls=[], gravity=(0, 0, 0), domain=domain)
    state, steps = made.state, made.arrival_steps
    assert len(made.insertion_steps) > 3
    for step in made.insertion_steps[1:]:
        x = state.position + state.velocity * ((step - steps) * STEP)[:, None]
        new, old = steps == step, steps < step
        d = x[new][:, None] - x[old]
        d[..., 0] -= 0.1 * np.rint(d[..., 0] / 0.1)
        assert np.linalg.norm(d, axis=2).min(initial=1.0) > 0.008


def test_spread_of_velocities():
    """Detects: a spread of one component only, or of twice the size."""
    made = scene({**PACK, "count": 900, "velocity": (0, 0, -1.0), "velocity_spread": 0.1})
    v = made.state.velocity - (0, 0, -1.0)
    assert np.abs(v.mean(axis=0)).max() < 0.1 / 30 * 4
    assert v.std(axis=0) == pytest.approx([0.1] * 3, rel=0.1)
    assert np.abs(np.corrcoef(v.T) - np.eye(3)).max() < 0.14


def digest(made: Scene) -> str:
    state = made.state
    columns = (state.position, state.velocity, state.radius, made.arrival_steps)
    return hashlib.sha256(b"".join(np.ascontiguousarray(c).tobytes() for c in columns)).hexdigest()


def test_seeds():
    """Detects: numbers that a repetition, another seed or another insertion does not change as it should."""
    stated = without(PACK, "radius", "material", mixture=MIXTURE, velocity_spread=0.1)
    one, again = scene(stated), scene(stated)
    assert one == again
    assert digest(one) == digest(again)
    assert digest(scene({**stated, "seed": 1})) != digest(one)
    two = scene({**stated, "count": 100}, {**stated, "count": 100})
    assert np.abs(two.state.position[:100] - two.state.position[100:]).min() > 0


def test_the_same_bits_on_every_machine():
    """Detects: drawn numbers that depend on the machine or a version of NumPy: recorded once, in 2026."""
    stated = without(PACK, "radius", "material", mixture=MIXTURE, velocity_spread=0.1)
    assert [digest(scene(one))[:16] for one in (stated, STREAM)] == ["ce52fca0d978ddf6", "ea82082a12c26061"]


def test_a_folder_has_what_was_run(tmp_path):
    """Detects: a folder whose particles follow from the statement anew, with another version of a library."""
    made = scene(PACK, RATE)
    assert Scene.from_json(made.to_json()) == made
    save_scene(tmp_path, made)
    read = load_scene(tmp_path)
    assert all(isinstance(insert, InsertList) for insert in read.insert)
    assert read.hash == made.hash


def test_with_an_automatic_step():
    """Detects: steps of insertions that are those of the placeholder of the step."""
    time = {"step": "auto", "accuracy": 1e-3, "duration": 0.1}
    made = scene(RATE, time=time)
    assert made.time.step < 1e-4
    assert made.insertion_steps == [max(1, round(0.01 * k / made.time.step)) for k in range(10)]
    listed = {
        "kind": "list",
        "time": 0.05,
        "position": [(0.05, 0.05, 0.15)],
        "radius": 0.004,
        "material": "glass",
    }
    made = scene(listed, time=time)
    assert made.insertion_steps == [round(0.05 / made.time.step)]
