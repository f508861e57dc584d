"""Which rows of tables of tests are slow, and what stays in `make test` in their place."""

from __future__ import annotations

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
    r"test_checks_can_fail.py::.*\[(merge angle|curvature|period of|speed of|restitution on)": (
        "an edge, a rim; mutants of the case moving_walls"
    ),
    r"test_checks_can_fail.py::.*\[(dashpot|friction(?! at))": (
        "friction at a rim and on a floor; mutants of the case oblique"
    ),
    r"test_mesh_everything.py::test_full_list_in_a_graph\[(?!friction\]|path)": (
        "friction, path; rule liggghts in a random scene"
    ),
    r"test_mesh_everything.py::test_a_box_of_triangles.*\[(frictionless|no history|hooke|cdt|float32)": (
        "friction, path, epsd2, rule liggghts, mixed; float32 of a mesh that turns"
    ),
    r"test_mesh_everything.py::test_a_floor_that_moves_on_through_periodic_sides\[(mixed|float32)": (
        "float64; precisions of a mesh that turns, at periodic sides (test_survives)"
    ),
    r"test_mesh_invariance.py::test_rolls_over_a_shuffled_mesh_as_over_a_plane\[(mixed|float32)": (
        "float64; precisions of a box of triangles"
    ),
    r"test_moving_walls.py::test_precision": "precisions of a box and a mesh that turn (test_survives)",
    r"test_moving_walls.py::test_restart_in_the_middle_of_a_turn\[\d+-(path|mixed)": (
        "closed forms and sums; restarts of path and mixed (test_restart, test_restart_order)"
    ),
    r"test_vibration.py::test_precision\[float32": "mixed",
    r"test_round_walls.py::test_balls_stay_in_a_hopper_of_three_kinds\[float32": "mixed",
    r"test_cuda.py::test_agrees_with_the_cpu\[(hooke|cdt|.* without history|saw-tooth|gas|path)-rehearsed": (
        "friction, epsd2, materials, a gate, a fast floor; a saw-tooth in chunks, path with a mesh in a graph"
    ),
    r"test_cuda.py::test_what_is_kept_.*\[(saw-tooth|float32|layers)": (
        "a fast floor, mixed, gas, path: one program writes all"
    ),
    r"test_moving_walls.py::test_a_mesh_that_leaves_through_a_periodic_side": (
        "a floor that moves on through periodic sides (test_mesh_everything)"
    ),
    r"test_mesh_tables.py::test_a_triangle_a_thousand_balls_long\[float32": "float64",
    r"test_restart_order.py::test_after_a_gate_changed_the_order\[mixed, full": "full list, mixed",
    r"test_walls.py::test_mesh_agrees_with_binary\[drum": "a drum of periodic sides; the case drum",
    r"test_mixed_full_list.py::test_motion_in_the_full_list\[epsd2_wall": "forces, damping, a gate, sizes",
    r"test_moving_walls.py::test_no_contact_is_missed\[two walls": "each alone; a wall beside a saw-tooth",
    r"test_mesh_everything.py::test_two_materials_and_sizes": "a random scene with them at a mesh",
    r"test_mesh_everything.py::test_goes_on_from_a_saved_state\[unique": "rule liggghts, same histories",
    r"reference/test_removal.py::test_agrees_with_binary\[periodic": (
        "insertions and groups at periodic sides; removal through them (test_removal)"
    ),
    r"reference/test_groups.py::test_agrees_with_binary\[epsd": "periodic, inserted",
    r"test_cuda.py::test_less_precise_is_as_precise_as_on_the_cpu\[float32-.*-rehearsed": "mixed",
    r"test_everything.py::test_the_motion_is_the_same\[frictionless gas": "a bed, several radii",
    r"test_vibration.py::test_two_parts_are_one_run\[mixed": "float64; mixed in test_restart_order",
    r"::test_agrees_(to_rounding|with_binary)\[(sjkr_(reduce_cdt|limit|hooke|frictionless)|own_sjkr_off)": (
        "cohesion of both kinds, at walls, with reduced limits"
    ),
    r"::test_agrees_to_rounding\[(torsion_epsd3|history_capped_no_spring)": "epsd, oblique",
    r"test_jobs.py::test_no_process_stays_when_the_comparison_is_stopped\[term": "ctrl-c, kill",
    r"test_mesh_rules.py::test_unique_.*\[faceted sphere\]": "shuffled",
    r"test_cuda_compile.py::test_no_spills\[(mesh float32|stiffness|history_incremental|history_rotated)": (
        "meshes in float64 and mixed; most registers: everything, sjkr with epsd, history_capped"
    ),
    r"test_walls.py::test_mesh_agrees_.*\[(belt|mesh_(rotate|oscillate|swing|.*table|comes)|osc_swing)": (
        "their loads and places, step by step (test_wall_loads)"
    ),
    r"test_walls.py::test_mesh_agrees_with_binary\[(rotate_then_linear|periodic_floor|seam_of_two)": (
        "their loads and places, step by step (test_wall_loads)"
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
