"""Guards: what would be a wrong result without a message ends with one, naming particle, time and cause."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pandas
import pytest

from gpudem.driver import simulate as run
from gpudem.errors import SimulationError
from gpudem.output.run import Run, Timing
from gpudem.scene import Scene
from gpudem.scene.overlaps import start_elastic_energy
from gpudem.solver import guards
from tests.gpudem.beds import falling_bed

WALL = {"kind": "plane", "name": "floor", "material": "ball", "point": (0, 0, 0), "normal": (0, 0, 1)}


def two(
    speed: float,
    step: float,
    *,
    wall: bool = False,
    young: float = 5e6,
    radius: float | list[float] = 0.003,
    **more,
) -> Scene:
    """Two spheres head-on, 1 mm apart, or one against the floor."""
    position = [(0.05, 0.05, 0.02), (0.05, 0.05, 0.027)]
    velocity = [(0, 0, speed / 2), (0, 0, -speed / 2)]
    if wall:
        position, velocity = [(0.05, 0.05, 0.004)], [(0, 0, -speed)]
    data = {
        "name": "two",
        "materials": {"ball": {"young": young, "poisson": 0.3, "density": 2500.0}},
        "pairs": [{"materials": ("ball", "ball"), "restitution": 0.9}],
        "particles": {"source": "explicit", "material": "ball", "radius": radius, "position": position,
                      "velocity": velocity},
        "walls": [WALL] if wall else [], "domain": {"lo": (0, 0, 0), "hi": (0.1, 0.1, 0.1)},
        "time": {"step": step, "duration": 100 * step}, "allow": ["time_step"],
    }  # fmt: skip
    return Scene(**data | more)


def failure(scene: Scene) -> str:
    with pytest.raises(SimulationError) as caught:
        run(scene)
    return str(caught.value)


def test_overlap_of_two_particles():
    """Catches a guard by the larger radius, or one that never fires."""
    text = failure(two(20.0, 1e-5, young=1e5))
    assert re.match(
        r"particle [12] overlaps particle [12] by more than 0.5 of the smaller radius at t = ", text
    )
    assert re.search(r"\(step \d+\); .*waive with allow = \['large_overlap'\]", text)


def test_overlap_counts_by_the_smaller_radius():
    """By 0.7 of the small one, 0.14 of the large."""
    scene = two(14.0, 1e-6, young=1e7, radius=[0.005, 0.001], particles={
        "source": "explicit", "material": "ball", "radius": [0.005, 0.001],
        "position": [(0.05, 0.05, 0.02), (0.05, 0.05, 0.0262)], "velocity": [(0, 0, 7.0), (0, 0, -7.0)],
    }, solver={"skin": 1e-4}, time={"step": 1e-6, "duration": 1e-3})  # fmt: skip
    assert "of the smaller radius" in failure(scene)


def test_overlap_with_a_wall_names_it():
    text = failure(two(20.0, 1e-5, wall=True, young=1e5))
    assert text.startswith("particle 1 overlaps wall floor by more than 0.5 of the radius at t = ")


def test_overlap_of_two_particles_above_a_wall():
    """Catches the partner's row taken for the number of a wall."""
    assert "of the smaller radius" in failure(two(20.0, 1e-5, young=1e5).replace(walls=[WALL]))


def test_a_step_across_a_radius():
    text = failure(two(1000.0, 1e-5))
    assert re.match(r"particle [12] moves faster than 300 m/s, the smallest radius in a step at t = ", text)
    assert "waive with allow = ['speed']" in text


def test_guards_can_be_waived():
    assert run(two(20.0, 1e-5, young=1e5, allow=["time_step", "large_overlap"])).timing.steps == 100
    fast = two(
        1000.0, 1e-5, allow=["time_step", "speed", "large_overlap"], time={"step": 1e-5, "duration": 2e-5}
    )
    assert run(fast).timing.steps == 2  # they have passed through each other, and nobody says so


def test_an_ordinary_bed_meets_no_guard():
    """A gate, walls, friction: no guard fires, and the energy of a bed at rest does not pass for growth."""
    done = run(falling_bed(600, output={"history_every": 1e-3}))
    assert done.warnings == []


def test_energy_that_grows_is_told():
    """A contact of two steps: the first finds a deep overlap; the spring gives back more than it got."""
    step = 3e-4
    done = run(two(4.0, step, allow=["time_step", "large_overlap", "speed"], output={"history_every": step},
                   time={"step": step, "duration": 10 * step}))  # fmt: skip
    assert done.history is not None
    assert done.history.kinetic_energy.max() > 2 * done.history.kinetic_energy.iloc[0]
    assert len(done.warnings) == 2  # the step is told first, then what came of it
    assert re.match(
        r"time\.step = 0\.0003 s: above the usual 0\.05 of the Hertz contact time", done.warnings[0]
    )
    assert re.match(r"energy grew: at t = 0\.0009 s .* exceed those at the start by 270 %", done.warnings[1])
    sound = two(4.0, 1e-5, output={"history_every": 1e-5})
    assert run(sound).warnings == []


@pytest.mark.parametrize("where", ["pair", "wall"])
def test_energy_of_overlaps_at_the_start_has_its_own_cause(where):
    """A sound step: catches a warning of the time step where balls that overlap push one another apart."""
    gap = 0.92 * 0.003 if where == "wall" else 0.05
    position = [[0, 0, gap], [0.1, 0, 0.05] if where == "wall" else [2 * 0.003 * 0.96, 0, gap]]
    floor = {"kind": "plane", "name": "floor", "material": "a", "point": (0, 0, 0), "normal": (0, 0, 1)}
    scene = Scene(
        name="pushed", materials={"a": {"young": 5e6, "poisson": 0.3, "density": 2500.0}},
        pairs=[{"materials": ("a", "a"), "restitution": 0.8}], walls=[floor],
        particles={"source": "explicit", "position": position, "radius": 0.003, "material": "a"},
        domain={"lo": (-0.2,) * 3, "hi": (0.2,) * 3}, time={"step": 2e-6, "duration": 2e-3},
        output={"history_every": 1e-4},
    )  # fmt: skip
    done = run(scene)
    assert done.history is not None
    assert done.history.kinetic_energy.iloc[-1] > 0
    (warning,) = [w for w in done.warnings if "energy grew" in w]
    assert warning.endswith("overlaps at the start, up to 8 % of a radius, release it")
    assert "time step" not in warning


def test_a_step_too_long_is_the_cause_beside_overlaps_too():
    """Catches a cause that any overlap explains, whatever the growth."""
    scene = Scene(
        name="stack", materials={"a": {"young": 5e6, "poisson": 0.3, "density": 2500.0}},
        pairs=[{"materials": ("a", "a"), "restitution": 0.9}],
        particles={"source": "explicit", "position": [[0, 0, 0], [0.00597, 0, 0]], "radius": 0.003,
                   "material": "a"},
        domain={"lo": (-0.2,) * 3, "hi": (0.2,) * 3}, time={"step": 2e-6, "duration": 2e-3},
    )  # fmt: skip
    e_eff = 5e6 / 2 / (1 - 0.09)
    exact = 8 / 15 * e_eff * np.sqrt(0.0015) * 3e-5**2.5
    assert start_elastic_energy(scene) == pytest.approx(exact, rel=1e-9)
    columns = ("time", "kinetic_energy", "rotational_energy", "potential_energy")
    for factor, cause in ((0.9, "release it"), (3.0, "the time step is too long for this scene")):
        history = pandas.DataFrame([(0.0, 0.0, 0.0, 0.0), (1.0, factor * exact, 0.0, 0.0)], columns=columns)
        (warning,) = guards.energy_warnings(scene, history)
        assert warning.endswith(cause)


def output_of(scene: Scene, heights: list[float], force: list[float] | None = None) -> Run:
    """A run of another code that has its balls at these heights [m], one a state."""
    position = np.repeat(scene.state.position[None], len(heights), axis=0)
    position[:, 0, 2] = heights
    trace = {"time": np.arange(len(heights)) * scene.time.step, "position": position}
    if force:
        trace["force"] = np.zeros_like(position)
        trace["force"][:, 0, 2] = force
    return Run("other", "1", scene, Path(), Timing(len(scene.state), len(heights), 1.0), trace=trace)


def test_a_deep_overlap_in_the_output_of_another_code():
    """Of two particles, in a wall, in a wall that has moved: named with its time. Detects a code that goes on
    without a word; a state of the largest force that is not looked at; a wall at its first place; an overlap
    within the limit, or one that the scene waives, called deep.
    """
    pair = two(1.0, 1e-5)
    (found,) = guards.overlap_warnings(output_of(pair, [0.02, 0.0245]))
    assert found.startswith("overlap of 1.17 of the radius: particles 1 and 2 at t = 1e-05 s")
    assert "no contact law holds" in found
    assert guards.overlap_warnings(output_of(pair, [0.02, 0.0224])) == []
    gone = output_of(pair, [np.nan, 0.02])
    assert gone.trace is not None
    gone.trace["position"][0, 1, 2] = 0.0999
    lid = {**WALL, "point": (0, 0, 0.1), "normal": (0, 0, -1)}
    (found,) = guards.overlap_warnings(dataclasses.replace(gone, scene=pair.replace(walls=[lid])))
    assert "particle 2 in wall floor" in found
    assert guards.overlap_warnings(output_of(pair.replace(allow=("large_overlap",)), [0.0245])) == []
    wall = two(1.0, 1e-5, wall=True)
    heights = [0.004] * 1000
    heights[505] = 0.001
    assert guards.overlap_warnings(output_of(wall, heights)) == []
    (found,) = guards.overlap_warnings(output_of(wall, heights, [float(h < 0.002) for h in heights]))
    assert "overlap of 0.667 of the radius: particle 1 in wall floor at t = 0.00505 s" in found
    lift = {**WALL, "motion": [{"type": "linear", "velocity": (0, 0, 30.0)}]}
    (found,) = guards.overlap_warnings(output_of(wall.replace(walls=[lift]), [0.004] * 10))
    assert "overlap of 0.567 of the radius: particle 1 in wall floor at t = 9e-05 s" in found


def test_a_deep_insertion_in_the_output_of_another_code():
    """Detects: a time step or material that is blamed for a particle inserted where another one is."""
    ball = {"material": "ball", "radius": 0.005, "position": [(0.05, 0.05, 0.02)]}
    onto = {**ball, "kind": "list", "time": 1e-5, "position": [(0.05, 0.05, 0.03)]}
    scene = two(1.0, 1e-5, particles={**ball, "source": "explicit"}, insert=[onto])
    (found,) = guards.overlap_warnings(output_of(scene, [0.02, 0.0245]))
    assert "at t = 1e-05 s" in found
    assert "insert[0] inserts particle 2 in this step where particle 1 is" in found
    (found,) = guards.overlap_warnings(output_of(scene, [0.02, 0.02, 0.0245]))
    assert "the material is too soft or the time step too long" in found
