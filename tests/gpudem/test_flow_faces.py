"""Flow through faces of limited size: counts of the device against a trace; restarts, writes, exits."""

from typing import Any

import numpy as np
import pytest

from gpudem import Simulation
from gpudem.driver import simulate as run
from gpudem.scene import Scene
from gpudem.scene.sections import FlowPlane
from gpudem.solver.solver import Solver
from tests.gpudem.beds import gas
from tests.gpudem.test_removal import STEP, parting
from tests.gpudem.test_restart import stopped_and_resumed

SIZE = 0.05
#: In the box of `gas`: one tilted, two that reach to the periodic sides, one in an open side.
FACES: list[dict[str, Any]] = [
    {"name": "disc", "face": {"kind": "disc", "center": (0.025, 0.02, 0.02), "axis": (0, 0, -3),
                              "radius": 0.015}},
    {"name": "wide", "face": {"kind": "rectangle", "corner": (0, 0.001, 0.025),
                              "edges": [(0.049, 0, 0), (0, 0.02, 0)]}},
    {"name": "low", "face": {"kind": "rectangle", "corner": (0.03, 0.03, 1e-4),
                             "edges": [(0.02, 0, 0), (0, 0.02, 0)]}},
]  # fmt: skip


def leaking(**changes: Any) -> Scene:
    """A gas that leaves downwards, with FACES, its trace and history at every step."""
    return gas(**{
        "domain": {"lo": (0, 0, 0), "hi": (SIZE, SIZE, SIZE), "periodic": (True, True, False),
                   "sides": {"zlo": "outflow", "zhi": "outflow"}},
        "time": {"step": 4e-6, "duration": 0.012},
        "particles": {"source": "lattice", "material": "ball", "count": 120, "seed": 2, "velocity_rms": 2.0,
                      "radius": [{"radius": 0.003, "share": 0.5}, {"radius": 0.0015, "share": 0.5}],
                      "lo": (0, 0, 0), "hi": (SIZE, SIZE, SIZE)},
        "output": {"trace_every": 4e-6, "history_every": 4e-6, "history": ["particles"], "flow": FACES},
        **changes,
    })  # fmt: skip


def recounted(scene: Scene, surface: FlowPlane, position: np.ndarray) -> np.ndarray:
    """Net crossings since the start at every step from a trace of every step, (t,)."""
    period = np.where(scene.domain.periodic, SIZE, np.inf)
    middle, normal, face = surface.origin, surface.direction, surface.face
    assert face is not None
    offset = position - middle
    side = offset @ normal > 0
    total = [0]
    for k in range(1, len(position)):
        there = np.isfinite(position[k, :, 0])
        changed = np.flatnonzero(there & (side[k] != side[k - 1]))
        before, way = offset[k - 1, changed], offset[k, changed] - offset[k - 1, changed]
        way = way - np.where(np.isfinite(period), period, 0) * np.round(way / period)
        share = -(before @ normal) / (way @ normal)
        at = before + share[:, None] * way
        at = at - np.where(np.isfinite(period), period, 0) * np.round(at / period)
        within = face.depth(at + middle) >= 0
        total.append(total[-1] + int((2 * side[k, changed[within]].astype(int) - 1).sum()))
    return np.array(total)


@pytest.fixture(scope="module")
def plain():
    return run(leaking(), threads=1)


def test_against_paths_of_a_trace(plain):
    """Detects: a face of another place or size, an infinite one, images forgotten, what leaves left out."""
    scene = plain.scene
    for surface in scene.output.flow:
        total = recounted(scene, surface, plain.trace["position"])
        assert np.array_equal(plain.history[f"flow_count_{surface.name}"], total), surface.name
        crossings = np.abs(np.diff(total)).sum()
        whole = np.nan_to_num((plain.trace["position"] - surface.origin) @ surface.direction) > 0
        assert 10 < crossings < 0.8 * np.abs(np.diff(whole.astype(int), axis=0)).sum(), surface.name
    assert plain.history.flow_count_low.iloc[-1] < -3, "what leaves is counted, and is positive upwards"
    assert plain.history.flow_mass_low.iloc[-1] < 0


@pytest.mark.parametrize(
    "options", [{"chunk": 32, "threads": 2}, {"rebuild_in_graph": True, "half_list": False}]
)
def test_launches_of_many_steps(plain, options):
    """Detects: launches after a rebuild is due that count the step before again, counts of another row."""
    solver = Solver(leaking(), **{"threads": 1, "chunk": 32, **options})
    solver.start(write=True)
    solver.advance(leaking().n_steps - 1)
    solver.write_step(last=True)
    found = {name: int(count.sum()) for name, count in solver.crossings().items()}
    assert solver.memory_bytes()["flow.crossed"] == 4 * 3 * len(leaking().state)
    assert found == {name: plain.history[f"flow_count_{name}"].iloc[-1] for name in ("disc", "wide", "low")}
    solver.close()


def test_crossing_and_removal_in_one_step():
    """The second ball crosses x = 0.29 in step 500, and is removed there in that step.

    Detects: counts that begin after those that leave have gone.
    """
    face = {
        "name": "end",
        "face": {"kind": "disc", "center": (0.29, 0.1, 0), "axis": (1, 0, 0), "radius": 0.01},
    }
    removal = {"name": "beyond", "every": STEP, "point": (0.29, 0.1, 0), "normal": (1, 0, 0)}
    scene = parting(
        remove=[removal], output={"history_every": STEP, "history": ["particles"], "flow": [face]}
    )
    history = run(scene).history
    assert history is not None
    assert np.flatnonzero(np.diff(history.flow_count_end)).tolist() == [499]
    assert np.flatnonzero(np.diff(history.removed_beyond))[-1] == 499
    assert history.flow_mass_end.iloc[-1] == scene.masses[1]


def test_two_parts_are_one_run(tmp_path):
    """The second ball crosses x = 0.285 in step 250 and x = 0.29 in step 500, the first after the restart.

    Detects: a restart that has forgotten sides or counts.
    """
    faces = [
        {"name": name, "face": {"kind": "disc", "center": (x, 0.1, 0), "axis": (1, 0, 0), "radius": 0.01}}
        for name, x in (("early", 0.285), ("late", 0.29))
    ]
    scene = parting(output={"history_every": STEP, "restart_every": 499 * STEP, "flow": faces})
    whole = run(scene).history
    parts = stopped_and_resumed(scene, tmp_path, at=499).history
    assert whole is not None
    assert parts is not None
    assert [np.flatnonzero(np.diff(whole[f"flow_count_{name}"])).tolist() for name in ("early", "late")] == [
        [249],
        [499],
    ]
    assert whole.equals(parts)


def slits() -> Scene:
    """Balls that go 2 mm along x and 2 mm along y in a step, and cross the plane of a slit in its middle.

    The slit is 1 mm wide. The first ball is beside it before and after that step, the second crosses beside
    the slit and is behind it after the step, the third meets the image of another one beyond a periodic side.
    """
    start = [(-0.001, 0.0, 0), (-0.001, -0.001, 0.3), (-0.001, 0.1992, -0.3)]
    slit = {"kind": "rectangle", "corner": (0, 0.0005, -0.4), "edges": [(0, 0.001, 0), (0, 0, 0.8)]}
    beyond = {"kind": "rectangle", "corner": (0, -0.2, -0.4), "edges": [(0, 0.0005, 0), (0, 0, 0.8)]}
    return parting(
        particles={"source": "explicit", "radius": 0.01, "material": "ball", "position": start,
                   "velocity": [(100.0, 100.0, 0)] * 3},
        domain={"lo": (-0.2, -0.2, -0.5), "hi": (0.3, 0.2, 0.5), "periodic": (False, True, False)},
        solver={"skin": 0.02}, time={"step": STEP, "duration": 3 * STEP},
        output={"history_every": STEP, "history": ["particles"],
                "flow": [{"name": "slit", "face": slit}, {"name": "beyond", "face": beyond}]},
    )  # fmt: skip


def test_the_place_of_a_crossing():
    """Detects: the place before or after the step taken for that of the crossing, images forgotten."""
    scene = slits()
    history = run(scene).history
    assert history is not None
    assert history.flow_mass_slit.tolist() == [0, *[scene.masses[0]] * 3]
    assert history.flow_mass_beyond.tolist() == [0, *[scene.masses[2]] * 3]


def test_particles_put_elsewhere_have_not_passed():
    """Detects: a place written by hand taken for a path; a crossing after it that is not counted."""
    face = {"name": "gate", "face": {"kind": "disc", "center": (0, 0, 0), "axis": (1, 0, 0), "radius": 0.3}}
    scene = parting(output={"history_every": STEP, "history": ["particles"], "flow": [face]})
    with Simulation(scene) as sim:
        sim.step(3)
        place = sim.read("position").numpy()
        place[2, 0] = 1e-5
        sim.write("position", place)
        assert sim.view(3).passed(scene.output.flow[0])[0] == 0
        sim.step(2)
        assert sim.view(5).passed(scene.output.flow[0])[0] == -1
