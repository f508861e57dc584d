"""Places and velocities of moving walls on the host, against closed forms, sums and brute force.

Catches: a phase, a sign, a center or an order of motions that is wrong; sums where closed forms are asked and
the other way round; a block of steps that does not go on where the last one ended; a bound of speed or
displacement that is none.
"""

from typing import Any

import numpy as np
import pytest

from gpudem.scene import Scene
from gpudem.scene.mesh import Mesh
from gpudem.scene.motion import Linear, Swing, rotations
from gpudem.scene.round_walls import Cone, Cylinder
from gpudem.scene.walls import Plane, Wall
from gpudem.solver.wall_motion import WallMotion
from gpudem.walls.motion import BLOCK, Poses, WallPath
from tests.gpudem.beds import MATERIALS, PAIRS

DT = 1e-3
X = np.array([0.3, -0.2, 0.5])
AXIS, POINT = np.array([1.0, 2.0, -2.0]) / 3, np.array([0.1, 0.4, -0.3])

LINEAR = {"type": "linear", "velocity": (0.3, -0.1, 0.2)}
OSCILLATE = {"type": "oscillate", "amplitude": (0.02, 0.01, -0.03), "period": 0.17}
ROTATE = {"type": "rotate", "axis": (1, 2, -2), "point": tuple(POINT), "period": 0.7}
SWING = {"type": "swing", "axis": (1, 2, -2), "point": tuple(POINT), "amplitude": 0.4, "period": 0.23}
KNOTS = (0.1, 0.2, 0.35)
TABLE = {"type": "table", "time": KNOTS, "velocity": [(0.1, 0, 0.2), (0.3, 0.5, -0.2), (-0.1, 0, 0)]}
TURNS = {
    "type": "table",
    "time": KNOTS,
    "angular_velocity": [1.0, 3.0, -2.0],
    "axis": (1, 2, -2),
    "point": tuple(POINT),
}


def motions(*stated: dict[str, Any]) -> Any:
    return Plane.model_validate(
        {"name": "w", "material": "m", "point": (0, 0, 0), "normal": (0, 0, 1), "motion": stated}
    ).motion


def path(*stated: dict[str, Any], dt: float = DT, sums: bool = False) -> WallPath:
    return WallPath(motions(*stated), dt, sums)


def places(poses: Poses, x: np.ndarray = X) -> np.ndarray:
    return poses.rotation @ x + poses.shift


def turned(x: np.ndarray, angle: float | np.ndarray, point: np.ndarray = POINT) -> np.ndarray:
    """By complex numbers in the plane across the axis: not Rodrigues' formula."""
    d = x - point
    along = (d @ AXIS) * AXIS
    u, v = d - along, np.cross(AXIS, d - along)
    spun = np.exp(1j * np.atleast_1d(angle))
    return point + along + np.real(spun)[:, None] * u + np.imag(spun)[:, None] * v


TIME = np.arange(600) * DT


def table_way(values: np.ndarray) -> np.ndarray:
    """Integral of a table by midpoints of a very fine grid."""
    fine = (np.arange(600 * 2000) + 0.5) * DT / 2000
    return np.concatenate([[0], np.cumsum(np.interp(fine, KNOTS, values))[1999::2000] * DT / 2000])[:600]


CLOSED = {
    "linear": (LINEAR, lambda: X + TIME[:, None] * np.array(LINEAR["velocity"])),
    "oscillate": (
        OSCILLATE,
        lambda: X + np.sin(2 * np.pi * TIME / 0.17)[:, None] * np.array(OSCILLATE["amplitude"]),
    ),
    "rotate": (ROTATE, lambda: turned(X, 2 * np.pi * TIME / 0.7)),
    "swing": (SWING, lambda: turned(X, 0.4 * np.sin(2 * np.pi * TIME / 0.23))),
    "table": (TABLE, lambda: X + np.stack([table_way(c) for c in np.array(TABLE["velocity"]).T], axis=1)),
    "table of angular velocity": (TURNS, lambda: turned(X, table_way(np.array(TURNS["angular_velocity"])))),
}


@pytest.mark.parametrize("name", CLOSED)
def test_places_in_closed_form(name):
    """Of each type, over several blocks of steps; catches a wrong phase, sign, period or point."""
    stated, expected = CLOSED[name]
    found = places(path(stated).at(0, 600))
    assert np.abs(found - X).max() > 0.01
    assert np.abs(found - expected()).max() < 1e-9  # the fine grid of the tables; the others 1e-15


COMBINED = {
    **{name: (stated,) for name, (stated, _) in CLOSED.items()},
    "linear, rotate": (LINEAR, ROTATE),
    "rotate, linear": (ROTATE, LINEAR),
    "oscillate, swing": (OSCILLATE, SWING),
    "swing, oscillate, rotate": (SWING, OSCILLATE, {**ROTATE, "axis": (0, 0, 1)}),
}


@pytest.mark.parametrize("name", COMBINED)
def test_velocity_is_the_derivative_of_the_place(name):
    """Central differences of places at 1e-6 s; catches a center that does not move with the wall."""
    dt = 1e-6
    poses = path(*COMBINED[name], dt=dt).at(150_000, 3)
    x = places(poses)
    found = poses.velocity_at(x)[1]
    assert np.linalg.norm(found) > 0.05
    assert np.abs(found - (x[2] - x[0]) / (2 * dt)).max() < 1e-7 * np.linalg.norm(found) + 2e-9


def test_velocity_at_the_start():
    """True at t = 0, but in LIGGGHTS' rule zero there, and there only."""
    for stated in (OSCILLATE, SWING, ROTATE, LINEAR):
        true, theirs = path(stated).at(0, 2), path(stated, sums=True).at(0, 2)
        assert np.abs(true.velocity_at(X)[0]).max() > 0.01
        assert np.abs(theirs.velocity_at(X)[0]).max() == 0.0
        assert np.abs(theirs.velocity_at(X)[1] - true.velocity_at(X)[1]).max() < 1e-15


@pytest.mark.parametrize("stated", [OSCILLATE, SWING, TABLE, TURNS], ids=lambda s: s["type"])
def test_right_hand_sums(stated):
    """x_n = x_(n-1) + v_n dt, as LIGGGHTS 3.8.0 does (black-box runs); not the closed form."""
    one, steps = motions(stated)[0], 600
    way = np.zeros(3) if not one.turns else 0.0
    expected = []
    for n in range(steps):
        way = way + (one.rate(np.array([n * DT]))[0] * DT if n else 0.0)
        expected.append(turned(X, way)[0] if one.turns else X + way)
    sums, exact = places(path(stated, sums=True).at(0, steps)), places(path(stated).at(0, steps))
    assert np.abs(sums - expected).max() < 1e-14
    assert np.abs(sums - exact).max() > 1e-6


def test_linear_and_rotate_have_no_sums():
    """LIGGGHTS computes these two in closed form."""
    for stated in (LINEAR, ROTATE):
        one, other = (path(stated, sums=sums).at(0, 600) for sums in (False, True))
        assert np.array_equal(places(one), places(other))


def test_point_travels_with_translations_before_it():
    """Linear, then rotate: v = w x (q - p - V t) + V (measured from LIGGGHTS to 1e-12), in both rules."""
    v, w = np.array(LINEAR["velocity"]), 2 * np.pi / 0.7 * AXIS
    for sums in (False, True):
        poses = path(LINEAR, ROTATE, sums=sums).at(1, 400)
        time = np.arange(1, 401)[:, None] * DT
        q = places(poses)
        assert np.abs(q - turned(X, 2 * np.pi * time[:, 0] / 0.7) - v * time).max() < 1e-12
        assert np.abs(poses.velocity_at(q) - (np.cross(w, q - POINT - v * time) + v)).max() < 1e-12


def test_point_at_rest_before_translations():
    """Rotate, then linear: the wall, already moved, turns about a point at rest.

    LIGGGHTS, to 1e-12: each step turns and then moves, v = w x (q - p - V dt) + V. Ours: the motion of
    velocity w x (q - p) + V, for which x' = R(w t) (x + ...) is integrated in closed form here.
    """
    v, rate = np.array(LINEAR["velocity"]), 2 * np.pi / 0.7
    theirs, q = path(ROTATE, LINEAR, sums=True).at(0, 400), X
    for n in range(1, 400):
        q = turned(q, rate * DT)[0] + v * DT
        assert np.abs(places(theirs)[n] - q).max() < 1e-12
        expected = np.cross(rate * AXIS, q - POINT - v * DT) + v
        assert np.abs(theirs.velocity_at(places(theirs))[n] - expected).max() < 1e-12
    errors = []
    for dt in (DT, DT / 2):
        ours, n = path(ROTATE, LINEAR, dt=dt), round(0.399 / dt)
        along = (v @ AXIS) * AXIS
        a, b = v - along, np.cross(AXIS, v)
        t = n * dt
        drift = along * t + a * np.sin(rate * t) / rate + b * (1 - np.cos(rate * t)) / rate
        expected = turned(X, rate * t)[0] + drift
        errors.append(np.abs(places(ours.at(n, 1))[0] - expected).max())
    assert errors[0] < 1e-5
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)  # second order


@pytest.mark.parametrize("sums", [False, True])
@pytest.mark.parametrize("name", COMBINED)
def test_any_part_of_the_steps(name, sums):
    """Asked for in pieces, backwards, across blocks or from the middle on: the same bits. Catches a block
    that does not begin where the one before ended."""
    whole = path(*COMBINED[name], sums=sums).at(0, 6 * BLOCK)
    other = path(*COMBINED[name], sums=sums)
    for first, count in ((5 * BLOCK + 3, 7), (0, 1), (BLOCK - 2, 5), (3 * BLOCK - 1, BLOCK + 2), (17, 3)):
        part = other.at(first, count)
        assert np.array_equal(part.rotation, whole.rotation[first : first + count])
        assert np.array_equal(part.shift, whole.shift[first : first + count])
        assert np.array_equal(part.velocity_at(X), whole.velocity_at(X)[first : first + count])


def test_no_stretch_after_many_steps():
    """Composed steps: rounding must not make a wall larger."""
    poses = path(ROTATE, SWING, dt=1e-2).at(200 * BLOCK, 1)
    assert np.abs(poses.rotation[0] @ poses.rotation[0].T - np.eye(3)).max() < 1e-13


TABLE_OF_ONE = {"type": "table", "time": [0.0], "velocity": [(0.3, -0.1, 0.2)]}


def test_a_table_of_one_row_is_linear():
    """Constant before and after; also where every row is before the start."""
    for time in ([0.0], [-1.0], [5.0]):
        found = places(path({**TABLE_OF_ONE, "time": time}).at(0, 600))
        assert np.abs(found - CLOSED["linear"][1]()).max() < 1e-15


# -- bounds ------------------------------------------------------------------------------------------------

LO, HI = np.array([-0.5, -0.3, -0.2]), np.array([0.4, 0.6, 0.7])


def mesh(**changes: Any) -> Mesh:
    """A bent strip of four triangles."""
    points = [(0, 0, 0), (0.2, 0, 0.05), (0.2, 0.3, 0), (0, 0.3, 0.1), (0.4, 0.1, 0.2), (0.4, 0.3, 0.1)]
    rows = [(0, 1, 2), (0, 2, 3), (1, 4, 5), (1, 5, 2)]
    data = {"name": "w", "material": "m", "vertices": points, "triangles": rows}
    return Mesh.model_validate(data | changes)


def plane(**changes: Any) -> Plane:
    return Plane(name="w", material="m", point=(0.1, 0.2, 0.3), normal=(2 / 7, 3 / 7, 6 / 7), **changes)


def cylinder(length: float | None = 0.4, **changes: Any) -> Cylinder:
    return Cylinder(
        name="w",
        material="m",
        point=(0.0, 0.1, 0.1),
        axis=(1, 0.5, 0.2),
        radius=0.15,
        length=length,
        **changes,
    )


def endless(**changes: Any) -> Cylinder:
    return cylinder(None, **changes)


def cone(**changes: Any) -> Cone:
    data = {"point": (0, 0.1, 0.1), "axis": (0.2, 1, 0.3), "radius": 0.05, "end_radius": 0.2, "length": 0.3}
    return Cone.model_validate({"name": "w", "material": "m", **data, **changes})


ALL_KINDS = [mesh, plane, cylinder, endless, cone]


@pytest.mark.parametrize("make", ALL_KINDS)
@pytest.mark.parametrize("name", COMBINED)
def test_no_gap_changes_by_more(make, name):
    """`moved` against gaps of 400 points of the domain; catches a bound that is none, and one that is
    more than 3 times too large."""
    wall: Wall = make(motion=COMBINED[name])
    poses = WallPath(wall.motion, DT).at(150, 60)  # type: ignore[arg-type]
    marks = wall.marks(poses.rotation, poses.shift, LO, HI)
    way = wall.moved(marks, marks[0])
    points = np.random.default_rng(3).uniform(LO, HI, (400, 3))
    gaps = np.array([wall.gap((points - s) @ r) for r, s in zip(poses.rotation, poses.shift, strict=True)])
    seen = np.abs(gaps - gaps[0]).max(axis=1)
    assert seen[-1] > 1e-3
    assert (seen <= way + 1e-12).all()
    assert way[-1] < 3 * seen[-1]


@pytest.mark.parametrize("make", [endless, cylinder, cone])
def test_a_turn_about_its_own_axis_moves_no_surface(make):
    """A shaft and a drum ask for no lists; an endless one may slide along its axis, too."""
    wall = make()
    turn = {"type": "rotate", "axis": wall.axis, "point": wall.point, "period": 0.1}
    slide = {"type": "linear", "velocity": tuple(np.array(wall.axis) * 3)}
    poses = path(slide, turn).at(0, 300) if make is endless else path(turn).at(0, 300)
    marks = wall.marks(poses.rotation, poses.shift, LO, HI)
    assert wall.moved(marks, marks[0]).max() < 1e-12


def test_a_plane_that_slides_along_itself_does_not_move():
    wall = plane(motion=[{"type": "linear", "velocity": (3, -2, 0)},
                         {"type": "rotate", "axis": (2, 3, 6), "point": (0.3, 0.1, 0.2),
                          "period": 0.1}])  # fmt: skip
    poses = WallPath(wall.motion, DT).at(0, 500)  # type: ignore[arg-type]
    assert np.abs(poses.shift).max() > 0.5
    marks = wall.marks(poses.rotation, poses.shift, LO, HI)
    assert wall.moved(marks, marks[0]).max() < 1e-12


@pytest.mark.parametrize("make", ALL_KINDS)
@pytest.mark.parametrize("name", COMBINED)
def test_no_point_is_faster(make, name):
    """`largest_speed` against points of the wall in the domain, at every step of a run."""
    wall: Wall = make(motion=COMBINED[name], surface_velocity=(0.01, 0, 0))
    poses = WallPath(wall.motion, DT).at(0, 500)  # type: ignore[arg-type]
    reach = wall.reach_points()
    fastest = 0.0
    for k in range(500):
        part = poses.part(k, k + 1)
        if reach is None:
            q = np.random.default_rng(k).uniform(LO, HI, (200, 3))
        else:
            q = reach @ part.rotation[0].T + part.shift[0]
            q = q[((q >= LO) & (q <= HI)).all(axis=1)]
        if len(q):
            fastest = max(fastest, np.linalg.norm(part.velocity_at(q), axis=1).max() + 0.01)
    bound = wall.largest_speed(LO, HI, 0.5)
    assert fastest <= bound * (1 + 1e-12)
    assert bound < 3 * fastest


# -- tables for the device ---------------------------------------------------------------------------------


def scene_of(*walls: dict[str, Any], **changes: Any) -> Scene:
    data: dict[str, Any] = {
        "name": "walls", "materials": MATERIALS, "pairs": PAIRS,
        "particles": {"source": "explicit", "material": "ball", "radius": 0.003, "position": [(0, 0, 0.5)]},
        "walls": walls, "domain": {"lo": tuple(LO), "hi": tuple(HI)},
        "time": {"step": 2e-5, "duration": 0.04},
    }  # fmt: skip
    return Scene(**{**data, **changes})


FLOOR = {"kind": "plane", "name": "floor", "material": "wall", "point": (0, 0, -0.1), "normal": (0, 0, 1)}


def test_a_list_reaches_as_far_as_half_the_skin():
    """Steps until a wall has moved skin/2, counted from the list's step, forgotten at the next one."""
    scene = scene_of(
        {**FLOOR, "motion": [{"type": "linear", "velocity": (0, 5, 0.0999)}]}, solver={"skin": 1e-3}
    )
    motion = WallMotion(scene, 1)
    assert motion.steps_within(5, 1) == 0  # no list yet
    for made in (0, 100, 777):
        motion.list_made(made)
        steps = [motion.steps_within(step, 1) for step in range(made, made + 300)]
        assert steps == [1] * 251 + [0] * 49  # 1.998e-6 m a step
        motion.list_made(made)
        assert motion.steps_within(made + 240, 32) == 11


def test_rodrigues():
    """Orthogonal, right-handed, of the angle asked for; exact for no turn."""
    matrices = rotations(AXIS, np.array([0.0, 0.1, 2.0, 1e-9]))
    assert np.array_equal(matrices[0], np.eye(3))
    assert np.allclose(matrices @ np.swapaxes(matrices, 1, 2), np.eye(3), atol=1e-15)
    assert np.allclose(np.linalg.det(matrices), 1)
    assert np.allclose(matrices[2] @ (X - POINT) + POINT, turned(X, 2.0)[0], atol=1e-15)


def test_point_of_a_swing_stays():
    """LIGGGHTS' riggle turns the wall about a point at rest, whatever translation comes before.

    Source: corners of a mesh as LIGGGHTS 3.8.0 writes them; forces agree to 1e-12 (`osc_swing`).
    """
    moves = Linear(type="linear", velocity=(1.0, 0.0, 0.0))
    swing = Swing(type="swing", axis=(0, 0, 1), point=(0.5, 0.0, 0.0), amplitude=0.1, period=1.0)
    sums, exact = (WallPath([moves, swing], 1e-3, sums=rule).at(1, 100) for rule in (True, False))
    assert np.allclose(sums.center, (0.5, 0, 0))
    assert np.allclose(exact.center[:, 0], 0.5 + 1e-3 * np.arange(1, 101))
    assert np.abs(sums.shift[-1] - exact.shift[-1]).max() > 1e-4
