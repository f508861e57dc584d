"""Tests that need LIGGGHTS, a GPU or a browser: skipped where it is missing, failed where it is required.

In a run of several workers (`make test`), tests that measure time have the machine for themselves.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
from collections.abc import Generator
from importlib.metadata import entry_points

import pytest

from comparisons.harness.pytest_checks import CheckItem
from tests.machine import machine

#: The plug-in comes with the installed package; from a tree that is not installed it is named here.
pytest_plugins = [] if entry_points(group="pytest11", name="gpudem") else ["comparisons.pytest_plugin"]


def pytest_configure() -> None:
    """Take back SIGINT, which a shell lets a command in the background (cron, nohup, &) ignore, and so all of
    its children: tests that interrupt a process would wait for its end in vain.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _gpu() -> bool:
    from comparisons.harness.provenance import gpus

    return bool(gpus())


def _liggghts() -> bool:
    return shutil.which(os.environ.get("GPUDEM_LIGGGHTS", "liggghts")) is not None


def _browser() -> bool:
    return shutil.which("chromium") is not None and shutil.which("chromedriver") is not None


#: marker -> (is it here, environment variable that makes its absence a failure, what is missing).
NEEDS = {
    "gpu": (_gpu, "GPUDEM_REQUIRE_GPU", "no CUDA device"),
    "liggghts": (_liggghts, "GPUDEM_REQUIRE_LIGGGHTS", "no liggghts binary (apt-get install liggghts)"),
    "browser": (_browser, "GPUDEM_REQUIRE_BROWSER", "no chromium (apt-get install chromium chromium-driver)"),
}


def pytest_runtest_setup(item: pytest.Item) -> None:
    for marker, (here, variable, missing) in NEEDS.items():
        if item.get_closest_marker(marker) and not here():
            if os.environ.get(variable) == "1":
                pytest.fail(f"{missing}, and {variable}=1 requires it", pytrace=False)
            pytest.skip(missing)


#: Rows of tables that are slow (`-m slow`): a neighbor, a quick case or the test of a mutant finds it in
#: `make test`. Pattern of their names -> what stays.
SLOW_ROWS = {
    r"test_random_scenes.py::test_.*\[(?!11\])": (
        "the one with springs of friction and rolling, cohesion, sizes, materials, a mesh, periodic sides and"
        " insertions"
    ),
    r"test_precision.py::test_mixed_follows_every_law\[(own_|unlike|sjkr_|sjkr2_wall|torsion_|epsd3)": (
        "each law once"
    ),
    r"test_precision.py::test_mixed_follows_every_law\[history_.*_(resting|no_spring)": "oblique impacts",
    r"test_precision.py::test_mixed_follows_every_law\[(?!(hooke|cdt|epsd2)_wall).*_wall": "a law a slot",
    r"test_precision.py::test_mixed_follows_every_law\[(epsd2_alone|periodic_crossing)": (
        "epsd2; the crossing with a full list"
    ),
    r"test_walls.py::test_mesh_agrees_with_binary\[(mesh_epsd2|mesh_cdt|mesh_no_history|periodic_ridge)": (
        "laws at planes; history on meshes; the case mesh_plane"
    ),
    r"test_walls.py::test_mesh_agrees_.*\[(swing_linear|linear_swing|table_|osc_(rotate|turntable))": (
        "two motions in either order, three motions, a turntable that moves"
    ),
    r"test_walls.py::test_mesh_agrees_with_binary\[flat_mesh_frictionless": "cohesion and friction on meshes",
    r"test_wall_loads.py::test_loads_agree_with_binary\[(mesh_cdt|flat_mesh|mesh_linear|mesh_gate)": (
        "loads of belts, turns, periodic floors and servos"
    ),
    r"test_own_repository.py::test_a_mistake_is_one_line\[(package|code|tier)": "case, jobs",
    r"test_own_repository.py::test_with_several_workers_there_is_one_report\[loadscope": "load",
    r"test_mesh_rules.py::test_liggghts_rule\[faceted sphere\]": "shuffled",
    r"test_checks_can_fail.py::.*\[(merge angle|curvature|period of|restitution on a plate|dashpot)": (
        "speed of walls, an edge, a rim; friction"
    ),
    r"test_mesh_everything.py::test_full_list_in_a_graph\[(?!friction\]|path)": (
        "friction, path; rule liggghts in a random scene"
    ),
    r"test_mesh_everything.py::test_a_box_of_triangles.*\[(frictionless|no history|hooke|cdt)": (
        "friction, path, epsd2, rule liggghts, precisions"
    ),
    r"test_mesh_everything.py::test_a_floor_that_moves_on_through_periodic_sides\[(mixed|float32)": (
        "float64; precisions of a mesh that turns, at periodic sides (test_survives)"
    ),
    r"test_mesh_invariance.py::test_rolls_over_a_shuffled_mesh_as_over_a_plane\[(mixed|float32)": (
        "float64; precisions of a box of triangles"
    ),
    r"test_moving_walls.py::test_precision": "precisions of a box and a mesh that turn (test_survives)",
    r"test_moving_walls.py::test_restart_in_the_middle_of_a_turn\[\d+-(path|mixed)": (
        "closed forms and sums; restarts of path and mixed at walls that vibrate"
    ),
    r"test_vibration.py::test_precision\[float32": "mixed",
    r"test_round_walls.py::test_balls_stay_in_a_hopper_of_three_kinds\[float32": "mixed",
    r"test_cuda.py::test_agrees_with_the_cpu\[(hooke|cdt|friction without history|saw-tooth)-rehearsed": (
        "friction, epsd2, path, a fast floor; a saw-tooth in chunks (test_vibration)"
    ),
    r"test_cuda.py::test_what_is_kept_.*\[(saw-tooth|float32|layers)": (
        "a fast floor, mixed, gas, path: one program writes all"
    ),
    r"test_neighbor_list.py::test_equals_all_pairs\[(full-1-size[23]|half-1-size3|half in blocks-1-size3)": (
        "open, periodic along all axes and along two, two cells across"
    ),
    r"test_size_classes.py::test_equals_all_pairs\[full-.*-size[37]-": "open, periodic along all axes",
    r"test_against_oracle.py::test_the_slow_searches_.*\[.*saw-tooth": (
        "a fast floor, walls; the case event_speed"
    ),
    r"test_extremes.py::test_right_or_said\[(sizes|small_triangles|fast_wall)-mixed": "float64",
    r"test_path_order.py::test_second_order\[normal, no pull-(?!hertz\])": "hertz; every law with pull",
    r"test_path_order.py::test_(full_list_is_the_half_list\[oblique-|half_step_.*\[)(hooke|hertz/)": "hertz",
    r"test_path_order.py::test_full_list_is_the_half_list\[normal": "oblique impacts",
    r"test_wall_forces.py::test_a_servo_reaches_its_force\[0.5": "a servo without integral",
    r"test_cuda_compile.py::test_plain_steps_.*\[(.*-float32|(frictionless|jkr|groups|path|mesh l.*)-)": (
        "most registers: everything, sjkr with epsd, mesh"
    ),
    r"test_wall_phases.py::test_agrees_with_binary\[(starts|stops|sums|tables|several|.*_of_mesh)": (
        "a drum that turns back, a belt, a gate, another material; sums at one change"
    ),
    r"test_wall_phases.py::test_two_parts_are_one_run\[(401|999|1250)": "at a change, and between two",
    r"test_phases.py::test_two_parts_are_one_run\[(599|601|1249|1250|1700)": "at a change, and between two",
}


@pytest.hookimpl(tryfirst=True)  # before -m selects
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    rows = re.compile("|".join(SLOW_ROWS))
    for item in items:
        if rows.search(item.nodeid):
            item.add_marker("slow")
        if isinstance(item, CheckItem):
            item.add_marker("cases")
            if item.case.timed:
                item.add_marker("timing")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    file = item.config.rootpath / ".pytest_cache" / "machine"
    workers = file if hasattr(item.config, "workerinput") else None
    with machine(workers, exclusive=item.get_closest_marker("timing") is not None):
        return (yield)
