"""Settings without effect, rounded and extended times: the sentence for each, and none for sound scenes.

The list of warnings is exact in each row: one that stops coming fails the test, and so does one too many.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from comparisons import cli
from gpudem import driver, event_driven
from gpudem.output.run import Run
from gpudem.scene import Scene, checks

STIFFNESS = {"kn": 1e6, "kt": 1e6, "gamma_n": 1e3, "gamma_t": 1e3}
#: A ball rolls along a floor.
SOUND: dict[str, Any] = {
    "name": "rolling",
    "gravity": [0.0, 0.0, -9.81],
    "materials": {"ps": {"young": 5e6, "poisson": 0.34, "density": 1050.0}},
    "pairs": [{"materials": ["ps", "ps"], "restitution": 0.5, "friction": 0.5}],
    "contact": {},
    "particles": {
        "source": "explicit", "position": [[0.0, 0.0, 0.003]], "velocity": [[0.1, 0.0, 0.0]], "radius": 0.003,
        "material": "ps",
    },
    "walls": [{"kind": "plane", "name": "floor", "material": "ps", "point": [0, 0, 0], "normal": [0, 0, 1]}],
    "domain": {"lo": [-0.1, -0.1, 0.0], "hi": [0.3, 0.1, 0.2]},
    "time": {"step": 1e-5, "duration": 0.1},
    "output": {"trace_every": 0.05},
}  # fmt: skip
LATTICE = {
    "source": "lattice", "material": "ps", "count": 8, "lo": [0, 0, 0.01], "hi": [0.1, 0.05, 0.1],
    "radius": 0.003,
}  # fmt: skip


def scene(pair: dict | None = None, **sections: Any) -> Scene:
    """The sound scene with changes of sections; `pair` changes its pair."""
    data = {k: v if k in sections else SOUND[k] for k, v in SOUND.items()}
    for key, value in sections.items():
        merged = key in ("particles", "time", "output") and "source" not in value
        data[key] = {**SOUND[key], **value} if merged else value
    if pair is not None:
        data["pairs"] = [{**SOUND["pairs"][0], **pair}]
    return Scene(**data)


def gate(**more: Any) -> dict[str, Any]:
    """Walls with a gate in front of the ball."""
    plane = {"kind": "plane", "name": "gate", "material": "ps", "point": [0.05, 0, 0], "normal": [-1, 0, 0]}
    return {"walls": [*SOUND["walls"], {**plane, **more}]}


TWO = {"materials": {**SOUND["materials"], "steel": {"young": 2e7, "poisson": 0.3, "density": 7800}}}

# fmt: off
ROWS: list[tuple[str, dict[str, Any], list[str]]] = [
    ("sound", {}, []),
    # pairs and contact
    ("rolling friction without a law", {"pair": {"rolling_friction": 0.3}},
        ["pairs ps / ps: rolling_friction = 0.3: no effect with contact.rolling = 'off'"]),
    ("rolling friction with a law", {"pair": {"rolling_friction": 0.3}, "contact": {"rolling": "cdt"}}, []),
    ("rolling law without friction", {"contact": {"rolling": "epsd2"}},
        ["contact.rolling = 'epsd2': no effect, no pair has rolling_friction"]),
    ("cohesion without density", {"contact": {"cohesion": "sjkr"}},
        ["contact.cohesion = 'sjkr': no effect, no pair has cohesion_energy_density"]),
    ("cohesion", {"pair": {"cohesion_energy_density": 1e3}, "contact": {"cohesion": "sjkr"}}, []),
    ("cohesion that a wall has off",
        {"pair": {"cohesion_energy_density": 1e3}, "contact": {"cohesion": "sjkr"},
         "walls": [{**SOUND["walls"][0], "contact": {"cohesion": "off"}}]}, []),
    ("cohesion of a wall without density",
        {"walls": [{**SOUND["walls"][0], "contact": {"cohesion": "sjkr"}}]},
        ["walls: floor.contact.cohesion = 'sjkr': no effect, no pair has cohesion_energy_density"]),
    ("limits with cohesion that is not there", {"contact": {"tangential_reduce": True}},
        ["contact.tangential_reduce = true: no effect without cohesion"]),
    ("twisting friction without rolling", {"contact": {"torsion": True}},
        ["contact.torsion = true: no effect without rolling friction"]),
    ("friction without a law", {"contact": {"tangential": "off"}},
        ["pairs ps / ps: friction = 0.5: no effect with contact.tangential = 'off'"]),
    ("dashpot that is off", {"contact": {"tangential": "no_history", "tangential_damping": False}},
        ["pairs ps / ps: friction = 0.5: no effect with contact.tangential = 'no_history',"
         " a dashpot, which is zero with contact.tangential_damping = false"]),
    ("dashpot of elastic pairs", {"pair": {"restitution": 1.0}, "contact": {"tangential": "no_history"}},
        ["pairs ps / ps: friction = 0.5: no effect with contact.tangential = 'no_history',"
         " a dashpot, which is zero with restitution = 1"]),
    ("dashpot without constant",
        {"pair": {**STIFFNESS, "gamma_t": 0, "restitution": 1.0},
         "contact": {"normal": "hertz/stiffness", "tangential": "no_history"}},
        ["pairs ps / ps: friction = 0.5: no effect with contact.tangential = 'no_history',"
         " a dashpot, which is zero with gamma_t = 0"]),
    ("neither spring nor dashpot",
        {"pair": {**STIFFNESS, "kt": 0, "gamma_t": 0, "restitution": 1.0},
         "contact": {"normal": "hertz/stiffness"}},
        ["pairs ps / ps: friction = 0.5: no effect without tangential stiffness and damping"]),
    ("neither spring nor dashpot of another law with history",
        {"pair": {**STIFFNESS, "kt": 0, "gamma_t": 0, "restitution": 1.0},
         "contact": {"normal": "hertz/stiffness", "tangential": "history_capped"}},
        ["pairs ps / ps: friction = 0.5: no effect without tangential stiffness and damping"]),
    ("spring of elastic pairs", {"pair": {"restitution": 1.0}}, []),
    ("constants with hertz", {"pair": {"kn": 1e6, "gamma_t": 3.0}},
        ["pairs ps / ps: kn = 1e+06, gamma_t = 3: no effect with contact.normal = 'hertz'"]),
    ("constants with hooke",
        {"pair": {"kt": 0.0}, "contact": {"normal": "hooke", "characteristic_velocity": 1.0}},
        ["pairs ps / ps: kt = 0: no effect with contact.normal = 'hooke'"]),
    ("restitution with constants", {"pair": STIFFNESS, "contact": {"normal": "hertz/stiffness"}},
        ["pairs ps / ps: restitution = 0.5: no effect with contact.normal = 'hertz/stiffness'"]),
    ("characteristic velocity", {"contact": {"characteristic_velocity": 2.0}},
        ["contact.characteristic_velocity = 2 m/s: no effect with contact.normal = 'hertz'"]),
    ("limit without damping", {"pair": {"restitution": 1.0}, "contact": {"limit_force": True}},
        ["contact.limit_force = true: no effect, a normal force without damping does not attract"]),
    ("limit with damping", {"contact": {"limit_force": True}}, []),
    ("damping off without friction", {"pair": {"friction": 0.0}, "contact": {"tangential_damping": False}},
        ["contact.tangential_damping = false: no effect, no pair has friction"]),
    ("damping off without a law",
        {"contact": {"tangential": "off", "tangential_damping": False}},
        ["pairs ps / ps: friction = 0.5: no effect with contact.tangential = 'off'",
         "contact.tangential_damping = false: no effect, contact.tangential = 'off'"]),
    # materials
    ("unused material", TWO,
        ["materials.steel: no effect, nor have its pairs: no particle and no wall is made of it"]),
    ("four pairs at once",
        {**TWO, "particles": {"position": [[0, 0, 0.003], [0, 0.05, 0.003]], "material": ["ps", "steel"],
                              "velocity": [[0, 0, 0]] * 2},
         "pairs": [{"materials": p, "kn": 1.0} for p in (("ps", "ps"), ("ps", "steel"), ("steel", "steel"))]},
        ["pairs ps / ps, ps / steel, steel / steel: kn: no effect with contact.normal = 'hertz'"]),
    # particles
    ("jitter without a gap", {"particles": {**LATTICE, "spacing": 1.0}},
        ["particles.jitter = 0.9: no effect with spacing = 1, which leaves no gap; state jitter = 0"]),
    ("seed of nothing", {"particles": {**LATTICE, "jitter": 0.0, "seed": 3}},
        ["particles.seed = 3: no effect, nothing is random without jitter, several radii or velocity_rms"]),
    ("seed of velocities", {"particles": {**LATTICE, "jitter": 0.0, "seed": 3, "velocity_rms": 0.1}}, []),
    ("radius of no particle",
        {"particles": {**LATTICE,
                       "radius": [{"radius": 0.003, "share": 1}, {"radius": 0.002, "share": 1e-9}]}},
        ["particles.radius[1] = 0.002 m: none of the 8 particles has it; its share is 1e-09"]),
    # solver and time
    ("accuracy beside a step", {"time": {"accuracy": 0.01}},
        ["time.accuracy = 0.01: no effect beside time.step = 1e-05 s; step = 'auto' would give "]),
    ("accuracy of a step", {"time": {"step": "auto", "accuracy": 0.01}}, []),
    ("path without damping",
        {"pair": {"restitution": 1.0, "friction": 0.0}, "solver": {"integrator": "path"}},
        ["solver.integrator = 'path': no effect, without damping and friction it is 'half_step'"]),
    ("extended duration", {"output": {"frames_every": 1.0}},
        ["time.duration = 0.1 s: the run takes 1 s, extended to whole frames, one every 1 s"]),
    ("duration of three frames and a bit", {"output": {"frames_every": 0.03}},
        ["time.duration = 0.1 s: the run takes 0.12 s, extended to whole frames, one every 0.03 s"]),
    ("duration of a step and a bit",
        {"time": {"step": 1e-5, "duration": 1.4e-5}, "output": {"trace_every": None}},
        ["time.duration = 1.4e-05 s: the run takes 1e-05 s, rounded to whole steps"]),
    ("interval of a step and a bit", {"output": {"trace_every": 1.4e-5}},
        ["output.trace_every = 1.4e-05 s: rounded to 1 step, 1e-05 s"]),
    ("interval below a step", {"output": {"history_every": 1e-9}},
        ["output.history_every = 1e-09 s: rounded to 1 step, 1e-05 s"]),
    ("frames of seven steps and a half", {"output": {"frames_every": 7.4e-5}},
        ["output.frames_every = 7.4e-05 s: rounded to 7 steps, 7e-05 s"]),
    ("interval rounded by a thousandth", {"output": {"trace_every": 1.0004e-2}}, []),
    ("interval beyond the end", {"output": {"trace_every": 0.11, "history_every": 0.1, "restart_every": 0.1}},
        ["output.trace_every = 0.11 s: only the start is recorded, the run takes 0.1 s",
         "output.restart_every = 0.1 s: no restart file is written, the run takes 0.1 s"]),
    ("gate of less than half a step", gate(removed_at=4e-6),
        ["walls: gate.removed_at = 4e-06 s: less than half a time step; the wall is never there"]),
    ("gate that stays", gate(removed_at=0.2),
        ["walls: gate.removed_at = 0.2 s: the run takes 0.1 s; the wall is never removed"]),
    ("gate removed with the last step", gate(removed_at=0.1),
        ["walls: gate.removed_at = 0.1 s: the run takes 0.1 s; the wall is never removed"]),
    ("gate of a step and a bit", gate(removed_at=1.4e-5),
        ["walls: gate.removed_at = 1.4e-05 s: rounded to step 1, 1e-05 s"]),
    ("gate", gate(removed_at=0.05), []),
    ("usual step", {"time": {"step": 5e-5}},
        ["time.step = 5e-05 s: above the usual 0.05 of the Hertz contact time, "]),
    ("group of inserted particles", {
        "groups": [{"name": "base", "region": {"kind": "sphere", "center": [0.03, 0, 0.05], "radius": 0.06},
                    "frozen": True}],
        "particles": {"position": [[0.03, 0, 0.05], [-0.08, 0, 0.05]], "velocity": None},
        "insert": [{"kind": "list", "time": 0.01, "position": [[0.04, 0, 0.08]], "radius": 0.003,
                    "material": "ps"}]},
        ["groups[0]: no effect on 1 particles that are inserted during the run and would be in 'base'"]),
    # what else
    ("nothing moves", {"gravity": [0, 0, 0], "particles": {"velocity": None}},
        ["no gravity and no start velocity: nothing moves unless particles overlap"]),
    ("only a spin",
        {"gravity": [0, 0, 0], "particles": {"velocity": None, "angular_velocity": [[0, 1, 0]]}}, []),
    ("no wall", {"walls": []}, ["gravity and no wall: particles leave the domain, which ends the run"]),
    ("frames fill the disk",
        {"particles": {**LATTICE, "count": 64}, "time": {"duration": 10.0}, "output": {"frames_every": 4e-5}},
        ["output.frames_every: the frames take about 2.4 GB"]),
]
# fmt: on


@pytest.mark.parametrize(("changes", "expected"), [row[1:] for row in ROWS], ids=[row[0] for row in ROWS])
def test_warnings(changes: dict[str, Any], expected: list[str]) -> None:
    one = scene(**changes)
    found = checks.warnings(one)
    assert len(found) == len(expected), found
    for sentence, start in zip(found, expected, strict=True):
        assert sentence.startswith(start), found
    assert checks.warnings(Scene.from_json(one.to_json())) == found, (
        "of what the scene is, not how it was stated"
    )


def test_warnings_of_a_file(tmp_path: Path) -> None:
    """Material and radius stated beside a file that has both, and points that a filter has moved."""
    position = np.array([[0, 0, 0.01], [0.01, 0, 0.01]])
    np.savez(
        tmp_path / "p.npz", position=position, points=position + 0.001, radius=[3e-3, 3e-3], material=[1, 0]
    )
    pairs = [{"materials": p} for p in (("ps", "ps"), ("ps", "steel"), ("steel", "steel"))]
    file = {"source": "file", "path": str(tmp_path / "p.npz"), "material": "ps", "radius": 0.001}
    found = checks.warnings(scene(**TWO, pairs=pairs, particles=file))
    assert [w.split(":")[0] for w in found] == [
        "particles.path", "particles.radius = 0.001 m", "particles.material = 'ps'"
    ]  # fmt: skip


def test_warnings_of_many_pairs_are_one_sentence() -> None:
    names = [f"m{k}" for k in range(12)]
    many = scene(
        materials=dict.fromkeys(names, SOUND["materials"]["ps"]), walls=[], gravity=[0, 0, 0],
        pairs=[{"materials": (a, b), "gamma_n": 1.0} for k, a in enumerate(names) for b in names[k:]],
        particles={"position": [[0.01 * k, 0, 0.01] for k in range(12)], "velocity": [[1, 0, 0]] * 12,
                   "material": names},
    )  # fmt: skip
    assert checks.warnings(many) == [
        "pairs m0 / m0, m0 / m1, m0 / m2 and 75 more: gamma_n: no effect with contact.normal = 'hertz'"
    ]


# -- the same sentences everywhere ---------------------------------------------------------------------------

TOML = """
name = "several"
gravity = [0.0, 0.0, -9.81]
materials.ps = {young = 5e6, poisson = 0.34, density = 1050.0}
pairs = [{materials = ["ps", "ps"], kn = 1e6, rolling_friction = 0.1, friction = 0.1}]
contact = {tangential = "off"}
particles = {source = "explicit", position = [[0.0, 0.0, 0.1]], radius = 0.003, material = "ps"}
domain = {lo = [-0.05, -0.05, 0.0], hi = [0.05, 0.05, 0.2]}
time = {step = 1e-5, duration = 1e-4}
output = {frames_every = 1e-3, trace_every = 2.4e-5}
[[walls]]
kind = "plane"
name = "gate"
material = "ps"
point = [0, 0, 0]
normal = [0, 0, 1]
removed_at = 1e-9
"""
EXPECTED = [
    "time.duration = 0.0001 s: the run takes 0.001 s, extended to whole frames, one every 0.001 s",
    "output.trace_every = 2.4e-05 s: rounded to 2 steps, 2e-05 s",
    "walls: gate.removed_at = 1e-09 s: less than half a time step; the wall is never there",
    "pairs ps / ps: friction = 0.1: no effect with contact.tangential = 'off'",
    "pairs ps / ps: rolling_friction = 0.1: no effect with contact.rolling = 'off'",
    "pairs ps / ps: kn = 1e+06: no effect with contact.normal = 'hertz'",
]


def test_validate_run_and_every_code_say_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Catches a sentence that only `validate` has, while the run that is ten times too long says nothing."""
    (tmp_path / "s.toml").write_text(TOML)
    one = Scene(**tomllib.loads(TOML))
    assert checks.warnings(one) == EXPECTED
    assert driver.simulate(one).warnings == EXPECTED
    assert event_driven.run(one).warnings == EXPECTED
    assert cli.main(["validate", str(tmp_path / "s.toml")]) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("warning: ")]
    assert lines == [f"warning: {w}" for w in EXPECTED]
    assert cli.main(["run", str(tmp_path / "s.toml"), "--out", str(tmp_path / "run"), "-q"]) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("warning: ")]
    assert lines == [f"warning: {w}" for w in EXPECTED]
    assert Run.load(tmp_path / "run").warnings == EXPECTED


@pytest.mark.liggghts
def test_liggghts_says_the_same(tmp_path: Path) -> None:
    from reference import liggghts

    one = Scene(**tomllib.loads(TOML)).replace(walls=[])
    expected = [w for w in EXPECTED if not w.startswith("walls")]
    found = liggghts.run(one, tmp_path).warnings
    assert [w for w in found if w in expected] == expected
    assert found[: len(checks.warnings(one))] == checks.warnings(one)
