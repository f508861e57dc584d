"""Groups of particles: gpudem and the binary agree step by step; the deck."""

from __future__ import annotations

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.scene import Scene
from reference import liggghts as code
from reference.liggghts.deck import render
from tests.reference.test_insertion import pouring
from tests.reference.test_removal import running_out

#: Of a diameter: contacts multiply rounding.
TOLERANCE = 1e-9
FROZEN = [(0.03 + 0.02 * (k % 3), 0.03 + 0.02 * (k // 3), 0.006) for k in range(9)]


def on_base(**changes) -> Scene:
    """Balls of two radii fall on nine frozen ones that reach into the floor; one of them is of `wall`."""
    start = {
        "source": "explicit", "position": [*FROZEN, (0.05, 0.05, 0.03), (0.05, 0.055, 0.0445)],
        "radius": [*[0.007, 0.009, 0.008] * 3, 0.008, 0.007],
        "material": [*["ball"] * 8, "wall", "ball", "ball"],
    }  # fmt: skip
    groups = [{"name": "base", "ids": [1, 2, 3, 5, 6, 7, 8], "frozen": True},
              {"name": "rest", "ids": [4, 9], "frozen": True, "reference": (0.05, 0.04, 0.01)}]  # fmt: skip
    output = {
        "trace_every": 1e-4,
        "history_every": 1e-4,
        "frames_every": 0.01,
        "group_forces": ["rest", "base"],
    }
    phases = [{"start": 0.03, "gravity": (1.0, 0, -8.0)}]
    data = {"particles": start, "groups": groups, "count": 20, "output": output, "phases": phases}
    return pouring(**{**data, **changes})


SHAKE = {"type": "oscillate", "amplitude": (0.003, 0, 0.001), "period": 0.02}
ROLLING = {"contact": {"rolling": "epsd"}}


@pytest.mark.liggghts
@pytest.mark.parametrize(
    "options", [{}, {"periodic": True}, {"insert": (), **ROLLING}], ids=["inserted", "periodic", "epsd"]
)
def test_agrees_with_binary(options, tmp_path, liggghts):
    """Detects: another effective mass or inertia, contacts of frozen balls with walls or one another, a force
    or torque on them that is left out, a frozen ball that moves.
    """
    scene = on_base(**options)
    if "contact" in options:
        pairs = [
            pair.model_dump() | {"rolling_friction": 0.1, "rolling_viscous_damping": 0.2}
            for pair in scene.pairs
        ]
        scene = scene.replace(pairs=pairs)
    run, ours = code.run(scene, tmp_path), simulate(scene)
    assert run.trace is not None
    assert ours.trace is not None
    for name in ("position", "velocity", "angular_velocity", "force", "torque"):
        scale = np.nanmax(np.abs(ours.trace[name]))
        assert scale > 0
        assert np.nanmax(np.abs(run.trace[name] - ours.trace[name])) < TOLERANCE * scale, name
    held = scene.held != 0
    assert np.abs(ours.trace["torque"][:, : len(held)][:, held]).max() > 0
    assert run.history is not None
    assert ours.history is not None
    assert np.array_equal(run.history.contacts, ours.history.contacts)
    assert ours.history.contacts.max() >= 2
    held = [f"{what}_{name}_{a}" for name in ("rest", "base") for what in ("force", "torque") for a in "xyz"]
    assert list(ours.history.columns[-12:]) == list(run.history.columns[-12:]) == held
    for name in held:
        scale = float(np.abs(ours.history[name].to_numpy()).max())
        assert scale > 0 or "rest" in name
        off = np.abs(run.history[name] - ours.history[name]).max()
        assert off <= TOLERANCE * scale + 1e-15, name  # their weight, 0.1 N, is taken off
    theirs = list(run.frames)[-1]
    assert np.array_equal(theirs["force"], run.trace["force"][-1])
    assert np.array_equal(theirs["torque"], run.trace["torque"][-1])


@pytest.mark.liggghts
@pytest.mark.parametrize(
    "motion",
    [
        {"type": "oscillate", "amplitude": (0.001, 0, 0.002), "period": 0.02},
        {"type": "rotate", "axis": (0.02, 0, 1), "point": (0.05, 0.05, 0.0), "period": 0.3},
        {"type": "linear", "velocity": (0, 0.02, 0.05)},
    ],
    ids=lambda motion: motion["type"],
)
def test_motion_agrees_with_binary(motion, tmp_path, liggghts):
    """Detects: a place, velocity or spin of a group at another step, the effective mass of a frozen one."""
    scene = on_base()
    groups = [group.model_dump() for group in scene.groups]
    groups[0] |= {"frozen": False, "motion": [motion]}
    scene = scene.replace(groups=groups)
    run, ours = code.run(scene, tmp_path), simulate(scene)
    assert run.trace is not None
    assert ours.trace is not None
    for name in ("position", "velocity", "angular_velocity", "force", "torque"):
        scale = np.nanmax(np.abs(ours.trace[name]))
        assert np.nanmax(np.abs(run.trace[name] - ours.trace[name])) < TOLERANCE * scale, name
    assert run.history is not None
    assert ours.history is not None
    assert list(run.history.columns) == list(ours.history.columns)
    for name in [*ours.history.columns[-6:], "work_base"]:
        scale = float(np.abs(ours.history[name].to_numpy()).max())
        assert scale > 1e-6, name
        assert np.abs(run.history[name] - ours.history[name]).max() < TOLERANCE * scale, name


@pytest.mark.liggghts
@pytest.mark.parametrize("held", [{"frozen": True}, {"motion": [SHAKE]}], ids=["frozen", "moved"])
def test_open_side_agrees_with_binary(held, tmp_path, liggghts):
    """Balls run out over a base, through an open side.

    Detects: rows of a group that shift when others have left, a force of one that has left on a base, a base
    that leaves.
    """
    stated = on_base().model_dump()["particles"]
    columns = {key: np.roll(stated[key], 2, axis=0) for key in ("position", "radius", "material")}
    start = stated | columns  # two free balls first, which leave
    output = {"trace_every": 1e-4, "history_every": 1e-4, "frames_every": 0.01, "group_forces": ["base"]}
    groups = [{"name": "base", "ids": np.arange(3, 12), **held}]
    scene = running_out(particles=start, groups=groups, output=output)
    run, ours = code.run(scene, tmp_path), simulate(scene)
    assert run.trace is not None
    assert ours.trace is not None
    gone = np.isnan(ours.trace["position"][-1, :, 0])
    assert gone.sum() > 5
    assert gone[:2].all()
    assert not gone[2:11].any()
    for name in ("position", "velocity", "angular_velocity", "force", "torque"):
        scale = np.nanmax(np.abs(ours.trace[name]))
        assert np.array_equal(np.isnan(run.trace[name]), np.isnan(ours.trace[name])), name
        assert np.nanmax(np.abs(run.trace[name] - ours.trace[name])) < TOLERANCE * scale, name
    assert run.history is not None
    assert ours.history is not None
    for name in [
        column for column in ours.history.columns if column.endswith(("base_x", "base_z", "work_base"))
    ]:
        scale = float(np.abs(ours.history[name].to_numpy()).max())
        assert scale > 1e-6, name
        assert np.abs(run.history[name] - ours.history[name]).max() < TOLERANCE * scale, name


def test_deck():
    """Detects: a group of other particles, walls or an integration that act on held ones."""
    text = render(on_base()).text
    lines = text.splitlines()
    members = [line.split(maxsplit=2)[2] for line in lines if line.startswith("group           group_")]
    assert members == ["id <> 1 3", "id <> 5 8", "id <> 4 4", "id <> 9 9"]
    acting = [line.split()[2] for line in lines if "wall/gran" in line or "nve/sphere" in line]
    assert set(acting) == {"mobile"}
    assert "frozen" not in render(pouring()).text
