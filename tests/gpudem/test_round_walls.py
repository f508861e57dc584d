"""Cylinders and cones: the surface on the host and on the device, balls that rest, roll and fall there."""

import functools
from typing import Any

import numpy as np
import pytest
import warp as wp

import gpudem
from gpudem.errors import SceneError
from gpudem.scene import Cone, Cylinder, Scene
from gpudem.scene.mesh_distance import distance_to_triangles
from gpudem.solver.state import structs
from gpudem.walls.registry import kind

RADIUS = 0.003
AXES = ((0.0, 0.0, 1.0), (1.0, -2.0, 3.0))


def cylinder(**changes: Any) -> Cylinder:
    data: dict[str, Any] = {
        "name": "pipe", "material": "a", "radius": 0.03, "point": (0.01, -0.02, 0.005), "axis": (1, -2, 3),
    }  # fmt: skip
    return Cylinder(**{**data, **changes})


def cone(**changes: Any) -> Cone:
    data: dict[str, Any] = {
        "name": "hopper", "material": "a", "radius": 0.04, "end_radius": 0.01, "length": 0.05,
        "point": (0.01, -0.02, 0.005), "axis": (1, -2, 3),
    }  # fmt: skip
    return Cone(**{**data, **changes})


WALLS = [
    cylinder(), cylinder(length=0.05), cylinder(axis=(0, 0, 1)),
    cone(), cone(end_radius=0.0), cone(radius=0.0), cone(end_radius=0.04), cone(axis=(0, 2, 0)),
]  # fmt: skip


@functools.cache
def measure_kernel(name: str) -> Any:
    surface, Walls = kind(name).surface, structs("float64").Walls

    @wp.kernel(module="unique")
    def measure(walls: Walls, x: wp.array[wp.vec3d], gap: wp.array[wp.float64], normal: wp.array[wp.vec3d]):
        i = wp.tid()
        g, n = surface(walls, 0, x[i])
        gap[i] = g
        normal[i] = n

    return measure


def on_device(wall: Any, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(gap, normal) by the kind's device function, in float64."""
    walls = structs("float64").Walls()
    for name, value in zip(("direction", "point", "size"), wall.shape(), strict=True):
        setattr(walls, name, wp.array([value], dtype=wp.vec3d, device="cpu"))
    x = wp.array(points, dtype=wp.vec3d, device="cpu")
    gap = wp.zeros(len(points), dtype=wp.float64, device="cpu")
    normal = wp.zeros(len(points), dtype=wp.vec3d, device="cpu")
    wp.launch(measure_kernel(wall.kind), len(points), [walls, x, gap, normal], device="cpu")
    return gap.numpy(), normal.numpy()


@pytest.mark.parametrize("wall", WALLS, ids=lambda w: f"{w.kind} {w.shape()[2]} {w.axis}")
def test_device_and_host_agree_and_the_normal_leads_to_the_surface(wall):
    """10 000 places: both gaps, and x - gap n lies on the surface. Catches a wrong side, rim or end."""
    points = np.random.default_rng(1).uniform(-0.1, 0.1, (10_000, 3))
    gap, normal = on_device(wall, points)
    assert np.abs(gap - wall.gap(points)).max() < 1e-15
    assert gap.min() >= 0
    # the direction away from the axis is as exact as |x|/rho roundings: 1e-16 x 0.2 m/1 mm
    assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-13
    assert wall.gap(points - gap[:, None] * normal).max() < 1e-14


@pytest.mark.parametrize("wall", [w for w in WALLS if w.bounds() is not None], ids=lambda w: f"{w.kind}")
def test_they_are_the_limit_of_their_own_facets(wall):
    """Distance from 48 flat facets, which lie up to R (1 - cos(pi/48)) within: catches a wrong cone angle."""
    points = np.random.default_rng(2).uniform(-0.1, 0.1, (2000, 3))
    corners, quads = wall.outline(*wall.bounds())
    facets = np.concatenate([corners[quads[:, [0, 1, 2]]], corners[quads[:, [0, 2, 3]]]])
    off = distance_to_triangles(points, facets) - wall.gap(points)
    sagitta = max(wall.shape()[2][:2]) * (1 - np.cos(np.pi / 48))
    assert np.abs(off).max() < 1.01 * sagitta
    low, high = wall.bounds()
    assert (corners >= low - 1e-15).all()
    assert (corners <= high + 1e-15).all()


def test_a_point_on_the_axis_gets_a_direction_away_from_it():
    """There every direction is as near; NaN would end the run. Both branches of the choice are taken."""
    for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (-3, 1, 2)):
        wall = cylinder(axis=axis, point=(0, 0, 0))
        gap, normal = on_device(wall, np.zeros((1, 3)))
        assert gap[0] == 0.03
        assert abs(np.linalg.norm(normal[0]) - 1) < 1e-15
        assert abs(normal[0] @ wall.unit_axis) < 1e-15


# -- in runs -------------------------------------------------------------------------------------------------


def scene(walls: list[dict[str, Any]], x: Any, **changes: Any) -> Scene:
    data: dict[str, Any] = {
        "name": "round", "gravity": (0, 0, -9.81),
        "materials": {"a": {"young": 5e6, "poisson": 0.3, "density": 2500.0}},
        "pairs": [{"materials": ("a", "a"), "restitution": 0.3, "friction": 0.4}],
        "particles": {"source": "explicit", "material": "a", "radius": RADIUS, "position": [x]},
        "walls": [{"name": f"w{i}", "material": "a", **wall} for i, wall in enumerate(walls)],
        "domain": {"lo": (-0.1, -0.1, -0.1), "hi": (0.1, 0.1, 0.1)},
        "time": {"step": 2e-5, "duration": 0.02}, "output": {"trace_every": 2e-3},
    }  # fmt: skip
    return Scene(**{**data, **changes})


LYING = {"kind": "cylinder", "radius": 0.05, "point": (0, 0, 0), "axis": (0, 1, 0)}


@pytest.mark.parametrize(
    ("wall", "height"),
    [
        (LYING, -0.05 + RADIUS),  # inside, at the lowest line
        (LYING, 0.05 + RADIUS),  # outside, on top
        ({**LYING, "point": (0, -0.02, 0), "length": 0.04}, -0.05 + RADIUS),
        ({"kind": "cone", "point": (0, 0, 0), "axis": (0, 0, 1), "radius": 0.03, "end_radius": 0.08,
          "length": 1e-15}, RADIUS),  # a flat ring
    ],
    ids=["inside", "outside", "with ends", "ring"],
)  # fmt: skip
def test_at_rest_it_is_a_plane(wall, height):
    """A ball falls 0.1 mm onto its lowest line, crest or ring as onto a plane: catches a curvature in R*."""
    x = (0.05 if wall["kind"] == "cone" else 0.0, 0.0, height + 1e-4)
    point = (0, 0, height - RADIUS)
    flat = {"kind": "plane", "point": point, "normal": (0, 0, 1)}
    a = gpudem.simulate(scene([wall], x)).trace
    b = gpudem.simulate(scene([flat], x)).trace
    assert a is not None
    assert b is not None
    assert np.abs(b["force"]).max() > 1e-3
    assert np.abs(a["position"] - b["position"]).max() < 1e-12
    assert np.abs(a["force"] - b["force"]).max() < 1e-8 * np.abs(b["force"]).max()


@pytest.mark.parametrize("precision", ["float64", "mixed", "float32"])
def test_balls_stay_in_a_hopper_of_three_kinds(precision):
    """Pipe above a cone above a floor: catches a rim through which balls fall, in any precision."""
    walls = [
        {"kind": "cylinder", "radius": 0.04, "point": (0, 0, 0), "axis": (0, 0, 1), "length": 0.08},
        {"kind": "cone", "radius": 0.01, "end_radius": 0.04, "point": (0, 0, -0.05), "axis": (0, 0, 1),
         "length": 0.05},
        {"kind": "plane", "point": (0, 0, -0.05), "normal": (0, 0, 1)},
    ]  # fmt: skip
    particles = {"source": "lattice", "material": "a", "count": 200, "radius": RADIUS, "seed": 3,
                 "lo": (-0.026, -0.026, 0.0), "hi": (0.026, 0.026, 0.08), "velocity_rms": 0.2}  # fmt: skip
    run = gpudem.simulate(
        scene(walls, None, particles=particles, solver={"precision": precision},
              time={"step": 2e-5, "duration": 0.3}, output={"trace_every": 0.3, "history_every": 0.1})
    )  # fmt: skip
    assert run.trace is not None
    x = run.trace["position"][-1]
    rho, z = np.hypot(x[:, 0], x[:, 1]), x[:, 2]
    shell = np.where(z > 0, 0.04, 0.01 + 0.03 * (z + 0.05) / 0.05)
    assert (rho < shell).all()
    assert z.min() > -0.05 + 0.9 * RADIUS
    assert z.min() < -0.05 + 1.1 * RADIUS
    assert z.max() < 0.02


def test_a_ball_falls_through_a_cylinder_of_no_end():
    """Without ends nothing stops it, past an end it is free: catches caps."""
    wall = {**LYING, "axis": (0, 0, 1), "radius": 0.0045, "point": (0, 0, -0.02), "length": 0.04}
    trace = gpudem.simulate(scene([wall], (0, 0, 0.03), time={"step": 2e-5, "duration": 0.1})).trace
    assert trace is not None
    fall = trace["position"][-1, 0, 2] - 0.03 + 9.81 / 2 * trace["time"][-1] ** 2
    assert abs(fall) < 1e-5


# -- what is refused -----------------------------------------------------------------------------------------


def test_sides_and_periodicity():
    """Along a periodic axis an infinite cylinder is right; others would lack their images."""
    domain = {"lo": (-0.1, -0.1, -0.1), "hi": (0.1, 0.1, 0.1), "periodic": (False, True, False)}
    scene([LYING], (0, 0, -0.04), domain=domain)
    for wall, message in [
        ({**LYING, "axis": (1, 0, 0)}, "w0 is infinite and not along y, which is periodic"),
        (
            {**LYING, "point": (0, -0.1, 0), "length": 0.2},
            "w0 comes within 0.003 m .* without length it goes on",
        ),
        ({**LYING, "axis": (0, 0, 1), "point": (0, 0.06, -0.02), "length": 0.1}, "w0 comes within 0.003 m"),
    ]:
        with pytest.raises(SceneError, match=message):
            scene([wall], (0, 0, -0.04), domain=domain)
    scene([{**LYING, "point": (0, -0.05, 0), "length": 0.1}], (0, 0, -0.04), domain=domain)


def test_it_moves_like_every_wall():
    """A pipe that turns about its axis carries a ball up its side: catches a kind without a pose."""
    turning = {**LYING, "motion": [{"type": "rotate", "axis": (0, 1, 0), "period": 0.5}]}
    trace = gpudem.simulate(
        scene([turning], (0, 0, -0.05 + RADIUS - 1e-6), time={"step": 2e-5, "duration": 0.05})
    ).trace
    assert trace is not None
    spin = trace["angular_velocity"][-1, 0, 1]
    assert trace["position"][-1, 0, 0] < -1e-3
    assert spin > 1.0
