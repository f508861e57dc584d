"""Beds: a scene run until it has settled, kept as a file of particles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from comparisons.cli import main
from gpudem import bed
from gpudem.errors import GpudemError
from gpudem.scene import Scene
from tests.gpudem.beds import MATERIALS, PAIRS, falling_bed

STEP = 2e-5


def pouring(**changes: Any) -> Scene:
    """A few balls fall in a box, the last of them after the others have come to rest."""
    pack = {
        "kind": "pack", "region": {"kind": "block", "lo": (0, 0, 0.01), "hi": (0.04, 0.04, 0.05)},
        "count": 20, "radius": 0.004, "material": "ball",
    }  # fmt: skip
    late = {
        "kind": "list",
        "time": 0.9,
        "position": [(0.02, 0.02, 0.05)],
        "radius": 0.004,
        "material": "ball",
    }
    data: dict[str, Any] = {
        "name": "pouring", "materials": MATERIALS,
        "pairs": [*PAIRS, {**PAIRS[0], "materials": ("wall", "wall")}],
        "insert": [pack, late], "gravity": (0, 0, -9.81),
        "walls": [{"kind": "box", "name": "box", "material": "wall"}],
        "domain": {"lo": (0, 0, 0), "hi": (0.04, 0.04, 0.06)}, "time": {"step": STEP, "duration": 1.8},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def test_not_before_the_last_phase():
    """Detects a bed that is taken for settled while it is still to be tilted, or by the gravity before."""
    early = pouring().insert[:1]
    tilted = {"start": 0.8, "gravity": (4.0, 0.0, -8.0)}
    made = bed.make(pouring(insert=early, phases=[tilted]), threads=1)
    assert made.settled
    assert 0.85 < made.time < 1.7
    floating = [{"start": 0.8, "gravity": (0.0, 0.0, 0.0)}]
    with pytest.raises(GpudemError, match=r"gravity = \(0\.0, 0\.0, 0\.0\): without gravity"):
        bed.make(pouring(insert=early, phases=floating), threads=1)


def test_until_settled(tmp_path):
    """Detects: an end before the last ball has come, at the top of a bounce, or long after all rest."""
    scene = pouring()
    made = bed.make(scene, threads=1)
    assert made.settled
    assert 0.95 < made.time < 1.7
    assert len(made.radius) == 21
    speed = np.linalg.norm(made.velocity, axis=1)
    assert speed.mean() < np.sqrt(2 * 9.81 * bed.FRACTION * 0.004)
    made.write(tmp_path / "bed.npz")
    start = {"source": "file", "path": str(tmp_path / "bed.npz")}
    again = pouring(particles=start, insert=[])
    for name in ("position", "velocity", "angular_velocity", "radius"):
        assert np.array_equal(getattr(again.state, name), getattr(made, name)), name
    assert np.array_equal(again.state.material, scene.state.material)
    settled = bed.make(again, threads=1)  # without its springs it moves a little once more
    assert settled.settled
    assert settled.time < 0.3
    assert abs(settled.position[:, 2].mean() - made.position[:, 2].mean()) < 0.1 * 0.004


def test_a_bounce_is_no_rest():
    """Detects: one low energy, at the top of a bounce of all balls together, taken for rest."""
    lone = {
        "kind": "list",
        "time": STEP,
        "position": [(0.02, 0.02, 0.03)],
        "radius": 0.004,
        "material": "ball",
    }
    elastic = [{**pair, "restitution": 0.99} for pair in pouring().model_dump()["pairs"]]
    time = {"step": STEP, "duration": 0.6}
    made = bed.make(pouring(insert=[lone], pairs=elastic, time=time), threads=1, fraction=0.3)
    assert not made.settled
    assert made.time == pytest.approx(0.6)


def test_to_the_end():
    """Detects: an end before the stated one."""
    made = bed.make(pouring(time={"step": STEP, "duration": 0.01}), until_settled=False, threads=1)
    assert made.time == pytest.approx(0.01)
    assert not made.settled


def test_what_is_refused(tmp_path):
    """Detects: a bed of nothing, or a file that no scene reads."""
    with pytest.raises(GpudemError, match="without gravity nothing settles"):
        bed.make(falling_bed(20, gravity=(0, 0, 0)), threads=1)
    late = {
        "kind": "list",
        "time": 1.0,
        "position": [(0.02, 0.02, 0.05)],
        "radius": 0.004,
        "material": "ball",
    }
    with pytest.raises(GpudemError, match=r"no particles at 0\.01 s, the end of the run"):
        bed.make(pouring(insert=[late], time={"step": STEP, "duration": 0.01}), threads=1)
    made = bed.make(pouring(time={"step": STEP, "duration": 0.01}), threads=1)
    with pytest.raises(GpudemError, match=r"a bed is written as \.npz"):
        made.write(tmp_path / "bed.csv")


def test_command(tmp_path, capsys):
    """Detects: a command that writes nothing, or says nothing of a bed that still moves."""
    scene = pouring(time={"step": STEP, "duration": 0.02})
    (tmp_path / "scene.json").write_text(scene.to_json())
    out = tmp_path / "bed.npz"
    assert main(["pack", str(tmp_path / "scene.json"), "--out", str(out), "--threads", "1", "-q"]) == 0
    found = capsys.readouterr()
    assert "20 particles at 0.02 s, not settled: mean energy that of a fall of" in found.out
    assert "they still move at the end of the run" in found.err
    assert np.load(out)["position"].shape == (20, 3)
    assert main(["pack", str(tmp_path / "scene.json"), "--out", str(tmp_path / "bed.txt"), "-q"]) == 2
