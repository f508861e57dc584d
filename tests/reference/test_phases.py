"""Phases of a run: gpudem and the binary agree step by step; the deck."""

from __future__ import annotations

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.scene import Scene
from reference import liggghts as code
from reference.liggghts.deck import render
from tests.reference.test_insertion import pouring

#: Of the largest value: contacts multiply rounding.
TOLERANCE = 1e-10
PHASES = [
    {"start": 0.02, "gravity": (3.0, 0, -9.0)},
    {"start": 0.025, "pairs": [{"materials": ("wall", "ball"), "restitution": 0.3, "friction": 0.05},
                               {"materials": ("ball", "ball"), "friction": 1.0}]},
    {"start": 0.03, "gravity": (0, 0, 0)},
    {"start": 0.04, "gravity": (0, -5.0, 0), "pairs": [{"materials": ("ball", "wall"), "friction": 0.0}]},
]  # fmt: skip


def tilted(**changes) -> Scene:
    """Balls in a box that is tilted, while more come; a gate goes together with the start of a phase."""
    position = [
        (0.02 + 0.015 * (k % 3), 0.02 + 0.015 * (k // 3 % 3), 0.008 + 0.016 * (k // 9)) for k in range(18)
    ]
    start = {"source": "explicit", "position": position, "radius": 0.0078,
             "material": ["ball"] * 17 + ["wall"]}  # fmt: skip
    gate = {"kind": "plane", "name": "gate", "material": "wall", "point": (0.07, 0, 0), "normal": (-1, 0, 0),
            "removed_at": 0.03}  # fmt: skip
    scene = pouring(insert=(), particles=start)
    walls = [*scene.model_dump()["walls"], gate]
    pairs = [*[pair.model_dump() for pair in scene.pairs]]
    return scene.replace(walls=walls, pairs=pairs, phases=PHASES, **changes)


@pytest.mark.liggghts
def test_agrees_with_binary(tmp_path, liggghts):
    """Detects: a phase a step apart, without a set-up or without its springs, coefficients of another one."""
    scene = tilted()
    run, ours = code.run(scene, tmp_path), simulate(scene)
    assert run.trace is not None
    assert ours.trace is not None
    for name in ("position", "velocity", "angular_velocity", "force", "torque"):
        scale = np.nanmax(np.abs(ours.trace[name]))
        assert np.nanmax(np.abs(run.trace[name] - ours.trace[name])) < TOLERANCE * scale, name
    without = simulate(scene.replace(phases=[*PHASES[:1], *PHASES[2:]])).trace
    assert without is not None
    assert np.abs(without["position"] - ours.trace["position"]).max() > 1e-4
    assert run.history is not None
    assert ours.history is not None
    for name in ours.history.columns:
        scale = np.nanmax(np.abs(ours.history[name]))
        assert np.nanmax(np.abs(run.history[name] - ours.history[name])) <= TOLERANCE * scale, name


def test_deck():
    """Detects: a property stated under another number, a gravity without direction."""
    deck = render(tilted())
    head, tail = deck.text.split("run ", 1)
    assert "gravity all gravity 9.81 vector 0.0 0.0 -9.81" in head
    assert [" ".join(line.split()[1:]) for line in ("run " + tail).splitlines() if "unfix" not in line] == [
        "2000",
        "gravity all gravity 9.486832980505138 vector 3.0 0.0 -9.0",
        "500",
        "property_3 all property/global coefficientRestitution peratomtypepair 2 0.8 0.3 0.3 0.8",
        "property_4 all property/global coefficientFriction peratomtypepair 2 1.0 0.05 0.05 0.4",
        "500",
        "gravity all gravity 0.0 vector 0.0 0.0 -1.0",
        "1000",
        "gravity all gravity 5.0 vector 0.0 -5.0 0.0",
        "property_4 all property/global coefficientFriction peratomtypepair 2 1.0 0.0 0.0 0.4",
        "1000",
    ]
