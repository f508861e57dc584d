"""Frozen particles in the solver."""

from typing import Any

import numpy as np
import pytest

from gpudem import Simulation
from gpudem.driver import simulate as run
from gpudem.errors import SceneError
from gpudem.scene import Scene
from gpudem.scene.groups import FREE
from gpudem.solver.solver import Solver
from tests.gpudem.beds import MATERIALS, PAIRS, finish, same
from tests.gpudem.groups import on_base
from tests.gpudem.test_restart import stopped_and_resumed


def on_one(frozen: bool = True, **changes: Any) -> Scene:
    """A ball falls on another, which is frozen or not."""
    data: dict[str, Any] = {
        "name": "on_one", "materials": MATERIALS, "pairs": PAIRS[:1],
        "particles": {"source": "explicit", "position": [(0, 0, 0), (0, 0, 0.0201)], "radius": 0.01,
                      "material": "ball", "velocity": [(0, 0, 0), (0, 0, -1.0)]},
        "groups": [{"name": "base", "ids": [1], "frozen": True}] if frozen else [],
        "domain": {"lo": (-1, -1, -1), "hi": (1, 1, 1)}, "time": {"step": 1e-5, "duration": 5e-3},
        "output": {"trace_every": 1e-5},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def test_a_collision_with_a_frozen_ball():
    """Detects: a frozen ball that moves, or whose mass counts; a force that is not that on the partner."""
    trace = run(on_one(pairs=[{**PAIRS[0], "friction": 0.0}])).trace
    assert trace is not None
    assert not np.ptp(trace["position"][:, 0], axis=0).any()
    assert not trace["velocity"][:, 0].any()
    assert np.abs(trace["force"][:, 0]).max() > 1
    assert np.array_equal(trace["force"][:, 0], -trace["force"][:, 1])
    apart = trace["position"][0, 1] / np.linalg.norm(trace["position"][0, 1])
    before, after = trace["velocity"][0, 1] @ apart, trace["velocity"][-1, 1] @ apart
    assert not trace["force"][-1].any()
    # with the effective mass of two free ones, half of it, the restitution would be 0.85
    assert after == pytest.approx(-0.8 * before, rel=5e-3)


def test_bases_cost_no_list_entries():
    """Detects: contacts among frozen balls, or of frozen balls with walls, of which the base has many."""
    scene = on_base()
    still = scene.replace(gravity=(0, 0, 0), particles={"velocity": None}, time={"duration": 2e-3})
    frame = finish(Solver(still, threads=1))
    assert not frame["force"].any()
    assert scene.start_overlap == 0.0
    deep = on_one(particles={**on_one().model_dump()["particles"], "position": [(0, 0, 0), (0, 0, 0.0195)]})
    assert deep.start_overlap == pytest.approx(0.05)


def test_forces_on_a_group(tmp_path):
    """Detects: a force with weight, of other particles or at the start of a phase with the other gravity; a
    torque about another point or without the particles' own.
    """
    output = {"frames_every": 0.002, "history_every": 0.002, "group_forces": ["base"]}
    group = {"name": "base", "frozen": True, "reference": (0.01, 0.02, 0.03), "material": "wall",
             "region": {"kind": "block", "lo": (0, 0, 0), "hi": (0.05, 0.1, 0.1)}}  # fmt: skip
    rest = {**group, "name": "rest", "region": {**group["region"], "lo": (0.05, 0, 0), "hi": (1, 1, 1)}}
    phases = [{"start": 0.03, "gravity": (2.0, 0, -5.0)}]
    scene = on_base(groups=[group, rest], output=output, phases=phases)
    found = run(scene, tmp_path)
    assert found.history is not None
    rows = np.flatnonzero((scene.stated_particles.material == 1) & (scene.state.position[:, 0] <= 0.05))
    assert len(rows) == 100
    for k, frame in enumerate(found.frames):
        g = np.array((0, 0, -9.81) if k <= 15 else (2.0, 0, -5.0))
        force = frame["force"][rows] - scene.masses[rows, None] * g
        arm = scene.state.position[rows] - np.array((0.01, 0.02, 0.03))
        torque = np.cross(arm, force) + frame["torque"][rows]
        row = found.history.iloc[k]
        for name, values in (("force", force), ("torque", torque)):
            got = np.array([row[f"{name}_base_{a}"] for a in "xyz"])
            assert np.abs(got - values.sum(axis=0)).max() < 1e-12, (name, k)
    assert found.history.force_base_z.min() < -0.05


@pytest.fixture(scope="module")
def plain() -> dict[str, np.ndarray]:
    frame = finish(Solver(on_base(), threads=1))
    held = on_base().held != FREE
    assert held.sum() == 200
    assert np.array_equal(frame["position"][held], on_base().state.position[held])
    assert not frame["velocity"][held].any()
    assert not frame["angular_velocity"][held].any()
    assert np.abs(frame["torque"][held]).max() > 1e-6
    assert np.abs(frame["force"][held]).max() > 0.01
    return frame


@pytest.mark.parametrize("options", [{}, {"threads": 2}, {"chunk": 7}, {"chunk": 32}], ids=str)
def test_bit_identical(plain, options):
    """Detects: what is held read at the place of another particle."""
    same(plain, finish(Solver(on_base(), **{"threads": 1, **options})))


@pytest.mark.parametrize("inside", [False, True], ids=["by the host", "within the chunk"])
def test_full_list(plain, inside):
    """As on a GPU. Detects: a pair whose two sides have another effective mass."""
    short = on_base(time={"step": 2e-5, "duration": 0.012})
    one, other, half = (
        finish(Solver(short, threads=1, half_list=kind, **options))
        for kind, options in (
            (False, {}),
            (False, {"chunk": 32, "rebuild_in_graph": inside}),
            (True, {}),
        )
    )
    same(one, other)
    moved = one["position"] - half["position"]
    assert np.abs(moved).max() < 1e-9
    assert np.abs(one["force"] - half["force"]).max() < 1e-6 * np.abs(one["force"]).max()


@pytest.mark.parametrize("seed", range(3))
def test_two_parts_are_one_run(tmp_path, seed):
    """Detects: a restart in which other particles are held, or springs on frozen balls are lost."""
    output = {"frames_every": 0.01, "history_every": 0.001, "restart_every": 0.0005}
    scene = on_base(100, output=output)
    stop = int(np.random.default_rng(seed).integers(30, scene.n_steps - 10))
    whole = run(scene, tmp_path / "whole", threads=1)
    parts = stopped_and_resumed(scene, tmp_path / "parts", at=stop)
    for a, b in zip(whole.frames, parts.frames, strict=True):
        same(a, b)
    assert whole.scene == type(whole).load(tmp_path / "whole").scene
    listed = {"name": "listed", "ids": np.arange(1, 201), "frozen": True}
    assert whole.scene.hash == scene.replace(groups=[listed]).hash
    assert on_one().hash != on_one(frozen=False).hash


def test_what_is_written_by_hand():
    """Detects: a frozen ball that `write` lets move."""
    with Simulation(on_one()) as sim:
        from gpudem.errors import GpudemError

        with pytest.raises(GpudemError, match="particle 1 is in group 'base'"):
            sim.write("velocity", np.ones((2, 3)))
        with pytest.raises(GpudemError, match="particle 1 is in group 'base'"):
            sim.write("position", np.array([(0, 0, 0.1), (0, 0, 0.5)]))
        sim.write("velocity", np.array([(0, 0, 0), (0, 0, 0.5)]))
        sim.step(10)
        assert sim.read("position").numpy()[1, 2] > 0.0201


def thrown(halvings: int, friction: float, integrator: str = "path", **options: Any) -> np.ndarray:
    """Velocity of a ball after an oblique hit on a frozen one, with a step of 20 us halved so many times."""
    scene = Scene(
        name="thrown", materials=MATERIALS, pairs=[{**PAIRS[0], "restitution": 0.6, "friction": friction}],
        particles={"source": "explicit", "position": [(0, 0, 0), (0.0223, 0.004, 0.001)],
                   "radius": [0.01, 0.012], "velocity": [(0, 0, 0), (-1.0, 0.1, 0.0)], "material": "ball"},
        groups=[{"name": "target", "ids": [1], "frozen": True}],
        contact={"limit_force": True, "tangential_damping": False}, solver={"integrator": integrator},
        domain={"lo": (-0.1, -0.1, -0.1), "hi": (0.1, 0.1, 0.1)},
        time={"step": 2e-5 / 2**halvings, "duration": 0.008}, allow=["time_step"],
    )  # fmt: skip
    frame = finish(Solver(scene, threads=1, **options))
    assert not frame["velocity"][0].any()
    assert not frame["position"][0].any()
    return frame["velocity"][1]


def test_path_is_of_second_order_at_a_frozen_ball():
    """2 in theory; `half_step` is far off.

    Detects: a frozen ball whose predicted velocity is not 0, windows of half a step with another mass.
    """
    exact = thrown(7, 0.0)
    error = [np.abs(thrown(k, 0.0) - exact).max() for k in (0, 4)]
    assert 1.8 < np.log2(error[0] / error[1]) / 4 < 2.4, error
    assert np.abs(thrown(4, 0.0, "half_step") - exact).max() > 50 * error[1]
    assert np.abs(exact - (-1.0, 0.1, 0.0)).max() > 1


def test_path_with_a_full_list():
    """Detects: windows of a contact with a frozen ball on one side of the pair only."""
    assert np.abs(thrown(1, 0.3) - thrown(1, 0.3, half_list=False)).max() < 1e-12


def test_a_bed_from_a_file_is_held(tmp_path):
    """Detects: velocities of a file that count with `at_rest`, or are lost without it, or not in the hash."""
    bed = {
        "position": [(0, 0, 0), (0, 0, 0.03)],
        "velocity": [(0, 1e-3, 0), (0, 0, -1.0)],
        "radius": [0.01, 0.01],
    }
    np.savez(tmp_path / "bed.npz", angular_velocity=np.ones((2, 3)), **bed)
    stated = {"source": "file", "path": str(tmp_path / "bed.npz"), "material": "ball"}
    with pytest.raises(SceneError, match=r"particle 1 has velocity \(0.0, 0.001, 0.0\) m/s of its own"):
        on_one(particles=stated)
    scene, moving = on_one(particles={**stated, "at_rest": True}), on_one(False, particles=stated)
    assert not scene.state.velocity.any()
    assert not scene.state.angular_velocity.any()
    assert moving.state.velocity[1, 2] == -1.0
    assert moving.hash != moving.replace(particles={"at_rest": True}).hash
    assert Scene.from_json(scene.to_json()).hash == scene.hash
