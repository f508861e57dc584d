"""Beverloo, Janssen and Rankine against numbers known elsewhere; measures of the hopper on made-up runs."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from comparisons import kit
from comparisons.cases.machines import hopper_scenes as scenes
from comparisons.oracles import silo
from comparisons.oracles.mesh_shapes import revolved
from gpudem.scene.mesh_distance import distance_to_triangles


def test_beverloo_scales_as_stated():
    """Detects a wrong power of a length, of gravity, or an empty annulus of another width."""
    assert silo.beverloo(1.4, 1.0, 1.0, 1.0) == 0.0
    assert silo.beverloo(2.4, 1.0, 1.0, 1.0) == pytest.approx(0.58)
    one = silo.beverloo(0.05, 0.006, 600, 9.81)
    assert silo.beverloo(0.10, 0.012, 600, 9.81) == pytest.approx(one * 2**2.5)
    assert silo.beverloo(0.05, 0.006, 600, 4 * 9.81) == pytest.approx(2 * one)


def test_janssen_tends_to_hydrostatics_and_to_saturation():
    """Detects an exponent with a factor missing: the profile's integral must be what the walls take off."""
    assert silo.bottom_share(0.0) == 1.0
    assert silo.bottom_share(1e-9) == pytest.approx(1 - 5e-10, abs=1e-12)
    assert silo.bottom_share(1.0) == pytest.approx(1 - math.exp(-1))
    assert silo.janssen_number(silo.bottom_share(0.7)) == pytest.approx(0.7)
    with pytest.raises(ValueError, match="between 0 and 1"):
        silo.janssen_number(1.0)
    height, width, weight, k, friction = 0.3, 0.1, 6000.0, 0.5, 0.4
    number = 4 * friction * k * height / width
    z = np.linspace(0, height, 2001)
    stress = silo.wall_stress(z, height, number, k, weight)
    hung = friction * 4 * width * float(np.trapezoid(stress, z))
    assert hung / (weight * width**2 * height) == pytest.approx(1 - silo.bottom_share(number), rel=1e-6)
    assert stress[1] == pytest.approx(k * weight * z[1], rel=1e-2)


def test_rankine():
    assert silo.active_ratio(math.radians(30)) == pytest.approx(1 / 3)
    assert silo.active_ratio(0.0) == 1.0


def test_revolved_surface_has_the_area_of_its_circles_and_no_gap():
    """Detects corners on the circle, whose polygon is smaller, and triangles that leave a gap."""
    corners = revolved([(0.02, 0.0), (0.05, 0.03)], 24)
    assert len(corners) == 48
    low = corners.reshape(-1, 3)[np.isclose(corners.reshape(-1, 3)[:, 2], 0.0)][:, :2]
    angles, first = np.unique(np.arctan2(low[:, 1], low[:, 0]).round(9), return_index=True)
    x, y = low[first][:24].T
    assert len(angles) in (24, 25)  # -pi and pi are one corner
    assert 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) == pytest.approx(math.pi * 0.02**2)
    angle, share = np.random.default_rng(1).uniform(0, 1, (2, 200)) * [[2 * math.pi], [1.0]]
    rho, z = 0.02 + 0.03 * share, 0.03 * share
    points = np.column_stack([rho * np.cos(angle), rho * np.sin(angle), z])
    assert distance_to_triangles(points, corners).max() < 0.05 * (1 / math.cos(math.pi / 24) - 1)


def falling(times, *, start, speed=0.2, aside=0.0):
    """A run of one ball in free fall from `start` [m], as frames; moved `aside` in the last one."""
    scene = scenes.Hopper(5.5, 9.0, 350).scene()
    frames = []
    for k, t in enumerate(times):
        shift = aside if k == len(times) - 1 else 0.0
        position = [[shift, 0, start - speed * t - scenes.GRAVITY * t**2 / 2]]
        velocity = [[0, 0, -speed - scenes.GRAVITY * t]]
        frames.append({"position": np.array(position), "velocity": np.array(velocity)})

    class Frames(list):
        pass

    listed = Frames(frames)
    listed.times = np.array(times)  # pyright: ignore[reportAttributeAccessIssue]
    parts = {key: getattr(scene, key) for key in ("wall_elements", "meshes")}
    run = SimpleNamespace(
        scene=SimpleNamespace(masses=np.array([1.0]), output=scene.output, **parts), frames=listed
    )
    return kit.Results("quick", {("one", "gpudem"): run})  # pyright: ignore[reportArgumentType]


def test_passage_is_traced_back_exactly():
    """Detects a time that is that of a frame, or of a straight line."""
    found = scenes.passage(falling([0.0, 0.015, 0.022], start=0.006), "one", "gpudem")
    exact = (-0.2 + math.sqrt(0.2**2 + 2 * scenes.GRAVITY * 0.006)) / scenes.GRAVITY
    assert found.time == pytest.approx([exact], abs=1e-12)
    assert found.astray == 0


def test_a_ball_outside_or_back_is_counted():
    """Detects a leak that is not seen: outside of the cone above the orifice, and back up through it."""
    outside = falling([0.0, 0.001], start=0.006, aside=0.026)
    assert scenes.passage(outside, "one", "gpudem").astray == 1
    back = falling([0.0, 0.04, 0.041], start=0.006)
    back["one", "gpudem"].frames[2]["position"][0, 2] = 0.001
    assert scenes.passage(back, "one", "gpudem").astray == 1


def test_loads_are_those_of_hertz():
    """Detects a side counted as the bottom, another radius, the weight of another number of balls."""
    scene = scenes.Silo(count=250).scene()
    x, radius = np.array(scene.state.position), scene.state.radius
    x[0] = (-scenes.Silo().width / 2 * scenes.DIAMETER + radius[0] - 1e-6, 0.0, 0.02)
    x[1, 2] = radius[1] - 2e-6 - 0.005 * 0.065  # the floor has sunk: 65 ms, its start counted half
    run = SimpleNamespace(scene=scene, frames=[{"position": x, "radius": radius}])
    found = scenes.load(run)  # pyright: ignore[reportArgumentType]
    young = scenes.STIFF / (2 * (1 - 0.3**2))
    assert found.sides == pytest.approx(4 / 3 * young * math.sqrt(radius[0]) * 1e-9, rel=1e-6)
    assert found.bottom == pytest.approx(4 / 3 * young * math.sqrt(radius[1]) * 2e-6**1.5, rel=1e-6)
    assert found.weight == pytest.approx(9.81 * 1000 * (4 / 3 * math.pi * radius**3).sum())
    assert found.mobilized == pytest.approx((found.weight - found.bottom) / found.sides)
