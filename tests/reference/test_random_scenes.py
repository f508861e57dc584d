"""Random scenes of everything together: both codes, and gpudem in parts, agree."""

from __future__ import annotations

import numpy as np
import pandas
import pytest

from gpudem.driver import simulate
from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from reference import liggghts as code
from tests.gpudem.beds import finish, same
from tests.reference.random_scenes import random_scene, richer_scene

#: Relative to the largest value of a column: rounding after some hundred contacts is 1e-15 to 3e-12.
TOLERANCE = 1e-9
#: Torque of `cdt` jumps where a spin changes its sign: a ball that comes to rest multiplies rounding. [s]
UNTIL = {"cdt": 0.008}
#: One of them is in every run of the tests (`SLOW_ROWS`), the others in the slow tier; from RICHER on with
#: more features.
SCENES, RICHER = [*range(24), *range(100, 124)], 100
#: Columns of walls, and what else LIGGGHTS may leave out, with a warning.
OF_WALLS = ("force_", "torque_", "position_", "work_")
LEFT_OUT = (*OF_WALLS, "flow_", "contacts", "work")


@pytest.mark.liggghts
@pytest.mark.parametrize("number", SCENES)
def test_codes_agree(number, tmp_path, liggghts):
    """Detects: what holds for each feature and not for several, in the solver or in the deck."""
    scene = richer_scene(number) if number >= RICHER else random_scene(number)
    ours, run = simulate(scene, threads=1), code.run(scene, tmp_path)
    assert run.trace is not None
    assert ours.trace is not None
    rows = slice(np.count_nonzero(ours.trace["time"] <= UNTIL.get(scene.contact.rolling, np.inf)))
    for name in ("position", "velocity", "angular_velocity", "force", "torque"):
        one, other = run.trace[name][rows], ours.trace[name][rows]
        assert np.array_equal(np.isnan(one), np.isnan(other)), name
        assert np.nanmax(np.abs(one - other)) <= TOLERANCE * np.nanmax(np.abs(other)), name
    assert run.history is not None
    assert ours.history is not None
    assert ours.history.contacts.max() > 0
    assert all(name.startswith(LEFT_OUT) for name in set(ours.history) - set(run.history))
    for name in run.history:
        one, other = run.history[name][rows], ours.history[name][rows]
        scale = largest(ours.history, name)
        assert np.nanmax(np.abs(one - other)) <= TOLERANCE * scale, name


def largest(history: pandas.DataFrame, name: str) -> float:
    """The largest value of a column, or of those of its quantity at all walls and groups."""
    quantity = next((begin for begin in OF_WALLS if name.startswith(begin)), "")
    names = [n for n in history if n.startswith(quantity)] if quantity else [name]
    return max(float(np.nanmax(np.abs(history[names].to_numpy()))), 1e-300)


@pytest.mark.parametrize("number", SCENES)
def test_in_parts(number):
    """Detects: state that a restart file lacks, and launches between two looks of the host, as on a GPU,
    that miss an event: with several features at once.
    """
    precision, integrator = [("float64", "half_step"), ("mixed", "path"), ("float64", "path")][number % 3]
    rule = ("unique", "liggghts")[number % 2]
    drawn = richer_scene(number, removes=True) if number >= RICHER else random_scene(number)
    if any(group.motion for group in drawn.groups):
        integrator = "half_step"  # "path" knows no such motion
    scene = drawn.replace(
        contact=drawn.contact.model_dump() | {"mesh_contacts": rule}, output={},
        solver={"precision": precision, "integrator": integrator},
    )  # fmt: skip
    cut = int(np.random.default_rng(number).integers(2, scene.n_steps - 2))
    whole = finish(Solver(scene, threads=1))
    same(whole, in_two(scene, cut))
    full = [finish(Solver(scene, half_list=False, threads=t, chunk=c)) for t, c in ((1, 1), (2, 16))]
    same(*full)


def in_two(scene: Scene, cut: int) -> dict[str, np.ndarray]:
    """The last frame of a run that a second solver takes over after a step."""
    solver = Solver(scene, threads=1)
    for first, last, walls in scene.segments:
        solver.start(walls, write=first == 0)
        done = first
        if first < cut < last - 1:
            solver.advance(cut - first)
            saved, done = solver.state_dict(), cut
            solver.close()
            solver = Solver(scene, threads=1)
            solver.load_state_dict(saved, walls)
        solver.advance(last - done - 1)
        solver.write_step(last=True)
    solver.close()
    return solver.frame()
