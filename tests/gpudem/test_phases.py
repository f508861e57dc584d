"""Gravity and contact properties that change during a run."""

from typing import Any

import numpy as np
import pytest

from gpudem import Simulation
from gpudem.driver import simulate as run
from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from tests.gpudem.beds import MATERIALS, PAIRS, falling_bed, finish, same
from tests.gpudem.test_restart import stopped_and_resumed

STEP = 1e-5
PHASES = [
    {"start": 0.012, "gravity": (4.0, 0.0, -9.0)},
    {"start": 0.02, "gravity": (0, 3.0, -9.0), "pairs": [{"materials": ("wall", "ball"), "friction": 0.0}]},
    {"start": 0.025, "pairs": [{"materials": ("ball", "ball"), "friction": 1.0, "restitution": 0.3}]},
]


def tilted(count: int = 300, **changes: Any) -> Scene:
    """A bed that is tilted twice, while its friction changes; the gate goes at 30 ms."""
    return falling_bed(count, **{"phases": PHASES, **changes})


def one(**changes: Any) -> Scene:
    """A ball that slides on a floor."""
    data: dict[str, Any] = {
        "name": "one", "materials": MATERIALS, "pairs": PAIRS, "gravity": (0, 0, -10.0),
        "particles": {"source": "explicit", "position": [(0.0, 0, 0.01)], "radius": 0.01, "material": "ball",
                      "velocity": [(3.0, 0, 0)]},
        "walls": [{"kind": "plane", "name": "floor", "material": "wall", "point": (0, 0, 0),
                   "normal": (0, 0, 1)}],
        "domain": {"lo": (-1, -1, -1), "hi": (1, 1, 1)}, "time": {"step": STEP, "duration": 0.1},
        "output": {"trace_every": 10 * STEP, "history_every": 10 * STEP},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def test_gravity_of_each_phase():
    """Detects: a phase a step early or late, a kick of the other gravity, a set-up without a kick."""
    phases = [{"start": 5 * STEP, "gravity": (1.0, 0, 0)}, {"start": 9 * STEP, "gravity": (0, 2.0, 0)}]
    scene = one(walls=[], phases=phases, output={"trace_every": STEP, "history_every": STEP},
                time={"step": STEP, "duration": 20 * STEP})  # fmt: skip
    found = run(scene)
    assert found.trace is not None
    assert found.history is not None
    pull = np.repeat([(0, 0, -10.0), (1.0, 0, 0), (0, 2.0, 0)], [5, 4, 11], axis=0)
    v = scene.state.velocity + STEP * np.concatenate([np.zeros((1, 3)), np.cumsum(pull, axis=0)])
    assert np.abs(found.trace["velocity"][:, 0] - v).max() < 1e-14
    x = (
        scene.state.position
        + np.concatenate([np.zeros((1, 3)), np.cumsum((v[1:] + v[:-1]) / 2, axis=0)]) * STEP
    )
    assert np.abs(found.trace["position"][:, 0] - x).max() < 1e-15
    assert np.array_equal(scene.gravity_at(np.arange(1, 21)), pull)
    potential = -scene.masses[0] * np.sum(x[1:] * pull, axis=1)
    assert np.abs(found.history.potential_energy[1:] - potential).max() < 1e-15
    assert [(a, b) for a, b, _ in scene.segments] == [(0, 5), (5, 9), (9, 20)]


def test_friction_of_each_phase():
    """Detects: coefficients of another phase or pair; no kernel for a friction that is 0 at the start."""
    pairs = [PAIRS[0], {**PAIRS[1], "friction": 0.0}]
    phases = [{"start": 0.03, "pairs": [{"materials": ("wall", "ball"), "friction": 0.3}]},
              {"start": 0.06, "pairs": [{"materials": ("ball", "wall"), "friction": 0.1}]}]  # fmt: skip
    trace = run(one(pairs=pairs, phases=phases)).trace
    assert trace is not None
    v = trace["velocity"][:, 0, 0]
    assert (v[:300] == 3.0).all()
    slope = [(v[b] - v[a]) / ((b - a) * 10 * STEP) for a, b in ((310, 590), (610, 990))]
    # the load swings by the drop onto the floor: the mean over the phase is a little off
    assert slope == pytest.approx([-3.0, -1.0], rel=0.02)


@pytest.fixture(scope="module")
def plain() -> dict[str, np.ndarray]:
    scene = tilted()
    frame = finish(Solver(scene, threads=1))
    alone = finish(Solver(falling_bed(300), threads=1))
    assert np.abs(frame["position"] - alone["position"]).max() > 1e-3
    return frame


@pytest.mark.parametrize("options", [{}, {"threads": 2}, {"chunk": 32}], ids=str)
def test_bit_identical(plain, options):
    """Detects: launches of one phase in the next."""
    same(plain, finish(Solver(tilted(), **{"threads": 1, **options})))


def test_by_hand(plain):
    """Detects: `Simulation` steps over the start of a phase."""
    scene = tilted()
    with Simulation(scene, threads=1) as sim:
        for steps in (777, 1, 400, scene.n_steps - 1178):
            sim.step(steps)
        assert np.array_equal(sim.read("position").numpy(), plain["position"])


@pytest.mark.parametrize("stop", [599, 600, 601, 1000, 1249, 1250, 1700])
def test_two_parts_are_one_run(tmp_path, stop):
    """Detects: a restart in another phase, at the start of one, before it and after it."""
    scene = tilted(100, output={"frames_every": 0.01, "history_every": 0.001, "restart_every": 2e-5})
    whole = run(scene, tmp_path / "whole", threads=1)
    parts = stopped_and_resumed(scene, tmp_path / "parts", at=stop)
    for a, b in zip(whole.frames, parts.frames, strict=True):
        same(a, b)
    assert type(whole).load(tmp_path / "whole").scene == scene
    assert not any("energy grew" in warning for warning in whole.warnings)


def test_what_is_the_same_scene():
    """Detects: a hash that phases do not change, or an unknown start without a word."""
    scene = tilted()
    assert scene.hash != tilted(phases=PHASES[:2]).hash != falling_bed(300).hash
    late = tilted(20, phases=[{"start": 1.0, "gravity": (0, 0, -1.0)}])
    assert any("phases[0].start = 1 s: never" in w for w in run(late).warnings)
    assert scene.replace(time={"duration": 0.015}).segments[-1][:2] == (600, 750)
    rounded = tilted(20, phases=[{"start": 2.7e-5, "gravity": (0, 0, -1.0)}])
    assert any("phases[0].start = 2.7e-05 s: rounded to step 1, 2e-05 s" in w for w in run(rounded).warnings)
