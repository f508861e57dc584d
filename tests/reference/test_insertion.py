"""Particles inserted within a run: gpudem and the binary agree step by step; the deck; what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.scene import Scene
from reference import liggghts as code
from reference.liggghts.deck import render
from reference.liggghts.errors import LiggghtsCannotState
from tests.gpudem.beds import MATERIALS, PAIRS

#: Of a diameter: places within blocks are rounded once more; contacts multiply rounding.
TOLERANCE = 1e-9


#: Two sizes of two materials, from above, in three fillings; and a stream.
PACK = {
    "kind": "pack", "region": {"kind": "block", "lo": (0.0, 0.0, 0.07), "hi": (0.1, 0.1, 0.095)}, "count": 60,
    "velocity": (0, 0, -3.0), "velocity_spread": 0.1, "angular_velocity": (5.0, 0, 1.0), "attempts": 50,
    "every": 0.012, "seed": 1,
    "mixture": [
        {"material": "ball", "radius": 0.007, "share": 0.5},
        {"material": "wall", "radius": {"kind": "normal", "mean": 0.006, "sigma": 0.0005}, "share": 0.5},
    ],
}  # fmt: skip
STREAM = {
    "kind": "stream", "face": {"kind": "disc", "center": (0.05, 0.05, 0.15), "axis": (0, 0, 1),
    "radius": 0.04}, "number_rate": 1500.0, "radius": 0.006, "material": "ball", "velocity": (0, 0, -4.0),
}  # fmt: skip
#: Where the start and one another are: the first fills the box around the balls that are there, the second
#: comes from above while they fall, as many as fit.
AROUND = {**PACK, "region": {"kind": "block", "lo": (0.0, 0.0, 0.0), "hi": (0.1, 0.1, 0.1)}, "count": 80}
BETWEEN = {
    **PACK, "region": {"kind": "block", "lo": (0.0, 0.0, 0.05), "hi": (0.1, 0.1, 0.14)}, "time": 0.004,
    "every": 0.009, "count": 150, "seed": 2,
}  # fmt: skip


def pouring(at_start: bool = True, periodic: bool = False, count: int = 30, **changes) -> Scene:
    """Balls of two radii and materials are thrown one after the other into a box, with spin."""
    rng = np.random.default_rng(4)
    place = np.arange(count) % 9
    jitter = 0.002 * rng.uniform(-1, 1, (count, 2))
    x, y = 0.02 + 0.03 * (place % 3) + jitter[:, 0], 0.02 + 0.03 * (place // 3) + jitter[:, 1]
    start = {"source": "explicit", "position": [(0.05, 0.05, 0.02), (0.05, 0.055, 0.0345)], "radius": 0.008,
             "material": "ball"}  # fmt: skip
    walls = [
        {
            "kind": "box",
            "name": "box",
            "material": "wall",
            "sides": ["ylo", "yhi", "zlo", "zhi", *([] if periodic else ["xlo", "xhi"])],
        }
    ]
    pairs = [*PAIRS, {**PAIRS[0], "materials": ("wall", "wall")}]
    data = {
        "name": "pouring", "materials": MATERIALS, "pairs": pairs,
        "particles": start if at_start else None,
        "insert": [{
            "kind": "list", "time": 0.0005 + 7e-4 * np.arange(count),
            "position": np.stack([x, y, np.full(count, 0.15)], axis=1),
            "radius": np.where(np.arange(count) % 2, 0.005, 0.007),
            "material": ["wall" if k % 3 == 0 else "ball" for k in range(count)],
            "velocity": np.tile((0.5 * periodic, 0, -3.0), (count, 1)),
            "angular_velocity": np.tile((5.0, 0, 1.0), (count, 1)),
        }],
        "gravity": (0, 0, -9.81), "walls": walls,
        "domain": {"lo": (0, 0, 0), "hi": (0.1, 0.1, 0.2), "periodic": (periodic, False, False)},
        "time": {"step": 1e-5, "duration": 0.05},
        "output": {"trace_every": 1e-4, "history_every": 1e-4, "frames_every": 0.01},
    }  # fmt: skip
    return Scene(**{**data, **changes})


@pytest.mark.liggghts
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"at_start": False},
        {"periodic": True},
        {"insert": [PACK], "at_start": False},
        {"insert": [STREAM]},
        {"insert": [AROUND, BETWEEN], "time": {"step": 1e-5, "duration": 0.03}},
    ],
    ids=["bed", "none at the start", "periodic", "pack", "stream", "two in one place"],
)
def test_agrees_with_binary(options, tmp_path, liggghts):
    """Detects: an insertion a step apart, as a set-up, at a rounded place, with another kick, other ids."""
    scene = pouring(**options)
    run, ours = code.run(scene, tmp_path), simulate(scene)
    assert run.trace is not None
    assert ours.trace is not None
    assert np.array_equal(np.isnan(run.trace["position"]), np.isnan(ours.trace["position"]))
    for name, scale in (("position", 0.01), ("velocity", 3.0), ("angular_velocity", 100.0)):
        difference = np.abs(run.trace[name] - ours.trace[name])
        assert np.nanmax(difference) < TOLERANCE * scale, name
    begun = [np.flatnonzero(np.isfinite(ours.trace["position"][:, i, 0]))[0] for i in range(len(scene.state))]
    exact = [
        np.abs((run.trace["position"] - ours.trace["position"])[k, i]).max() for i, k in enumerate(begun)
    ]
    assert max(exact) < 1e-15
    assert run.history is not None
    assert ours.history is not None
    for name in ours.history.columns:
        scale = np.nanmax(np.abs(ours.history[name]))
        assert np.array_equal(run.history[name].isna(), ours.history[name].isna()), name
        assert np.nanmax(np.abs(run.history[name] - ours.history[name])) <= 1e-9 * scale, name
    assert ours.history.contacts.max() > 5
    assert [len(f["id"]) for f in run.frames] == [
        scene.count_at(s) for s in range(0, scene.n_steps + 1, 1000)
    ]


def test_deck():
    """Detects: an insertion of another step, kind or order, a data file that holds what comes later."""
    deck = render(pouring(count=4))
    assert "2 atoms" in deck.data
    lines = deck.text.splitlines()
    templates = [line for line in lines if line.startswith("fix") and "particletemplate" in line]
    assert len(templates) == len({line.split(" density ")[1] for line in templates}) == 4
    starts = [
        line.split(" start ")[1].split()[0]
        for line in lines
        if line.startswith("fix") and "insert/pack" in line
    ]
    assert starts == ["50", "120", "190", "260"]
    assert "create_box      2 domain" in render(pouring(at_start=False, count=4)).text


def test_no_variable_reads_a_column_without_particles():
    """Detects a deck that ends LIGGGHTS now and then by SIGSEGV: without particles there is no array."""
    text = render(pouring(at_start=False)).text
    assert "variable        moment_x atom mass*c_unwrapped_x\n" in text
    assert not re.search(r"^variable .*\bc_\w+\[", text, re.MULTILINE)


def test_what_is_refused():
    """Detects: ranks that draw other places, a deck of a fix for each of many thousand particles."""
    with pytest.raises(LiggghtsCannotState, match="insert: on 2 MPI ranks LIGGGHTS draws other places"):
        render(pouring(), ranks=2)
    places = np.tile((0.05, 0.05, 0.15), (20_001, 1))
    many = {"kind": "list", "time": 1e-4 * np.arange(1, 20_002), "position": places,
            "radius": 0.001, "material": "ball"}  # fmt: skip
    with pytest.raises(LiggghtsCannotState, match="insert: 20001 particles; each is a fix of its own"):
        render(pouring(insert=[many]))
