"""Periodic sides: particles on, or rounded to, a face of any domain move and collide as elsewhere."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from gpudem import event_driven
from gpudem.event_driven.engine import Engine
from gpudem.event_driven.problem import HardSphereProblem, wrap_periodic
from gpudem.scene import Box, FromFile, Output, Plane
from tests.event_driven import scenes
from tests.event_driven.brute_force import BruteForceHardSpheres

#: (lo, hi) of an axis [m]: symmetric, exact and inexact in binary, far from the origin, of very unequal ends.
NAMED = [(-0.2, 0.2), (-0.15, 0.25), (-0.1, 1.0), (0.05, 0.3), (0.0, 0.7), (-0.3, 0.0), (1e3, 1e3 + 0.3),
         (-1e4 / 3, 1e4 / 7), (-1e-9, 0.4), (0.1 + 0.2, 1.0)]  # fmt: skip


def domains(count: int, seed: int) -> list[tuple[float, float]]:
    rng = np.random.default_rng(seed)
    lo, size = rng.normal(size=count) * 10.0 ** rng.integers(-3, 4, count), rng.uniform(0.3, 3.0, count)
    return [*NAMED, *zip(lo.tolist(), (lo + size).tolist(), strict=True)]


def on_the_faces(lo: float, hi: float) -> np.ndarray:
    """Coordinates on both faces and one rounding off them, inside the domain."""
    return np.array([lo, np.nextafter(lo, hi), np.nextafter(hi, lo), hi])


def distance(x: np.ndarray, want: np.ndarray, lo: float, hi: float) -> float:
    """Largest distance between coordinates and the nearest image of others."""
    size = hi - lo
    return float(np.abs((x - want + size / 2) % size - size / 2).max())


def test_wrapped_positions_are_in_the_domain_and_the_same_place():
    # detects: a position of hi, or beyond it, after wrapping, which our own reader refuses
    rounded_up = 0
    for lo, hi in domains(2000, seed=1):
        size = hi - lo
        edges = on_the_faces(lo, hi)
        below = np.concatenate([np.nextafter(edges, -1e30), lo - size * 10.0 ** -np.arange(12.0, 25.0)])
        x = np.concatenate([edges, below, np.nextafter(edges, 1e30), edges + size, edges - 3 * size])
        wrapped = wrap_periodic(x[:, None], np.array([lo]), np.array([hi]), np.array([True]))[:, 0]
        assert (lo <= wrapped).all(), (lo, hi)
        assert (wrapped < hi).all(), (lo, hi)
        assert distance(wrapped, x, lo, hi) <= 16 * np.spacing(max(abs(lo), abs(hi), 4 * size)), (lo, hi)
        rounded_up += int((lo + (x - lo) % size >= hi).sum())
    assert rounded_up > 2000  # the guarded rounding was among them


def test_other_axes_are_not_wrapped():
    # detects: a particle above an open side that is moved to the opposite one
    x = np.array([[0.25, 0.25, -3.0]])
    wrapped = wrap_periodic(x, np.zeros(3), np.full(3, 0.2), np.array([True, False, False]))
    np.testing.assert_allclose(wrapped, [[0.05, 0.25, -3.0]], rtol=1e-15)


def faces_scene(lo: float, hi: float, axis: int, flat: bool, **more):
    """Spheres on the faces of one axis that move both ways or not at all, too far apart to collide; the last
    two of them are on a face when the gate is removed at 0.25 s."""
    starts, speeds = on_the_faces(lo, hi), np.array([0.3, -0.3, 0.0])
    x0, v0 = (a.ravel() for a in np.meshgrid(starts, speeds, indexing="ij"))
    x0, v0 = np.append(x0, [hi - 0.05, lo + 0.05]), np.append(v0, [0.2, -0.2])
    n, across = len(x0), (axis + 1) % 3  # spread over the next axis; a layer across the third, or not
    position, velocity = np.zeros((n, 3)), np.zeros((n, 3))
    position[:, axis], velocity[:, axis] = x0, v0
    position[:, across] = 3 * scenes.RADIUS * np.arange(n)
    if not flat:
        position[:, (axis + 2) % 3] = 0.01 * np.arange(n)
    low, high, normal = [-1.0] * 3, [1.0] * 3, [0.0] * 3
    low[axis], high[axis], normal[across] = lo, hi, -1.0
    point = [0.0] * 3
    point[across] = 0.95
    gate = Plane(name="gate", material="wall", point=tuple(point), normal=tuple(normal), removed_at=0.25)
    return scenes.scene(
        position, velocity, lo=tuple(low), hi=tuple(high), walls=[gate],
        periodic=tuple(k == axis for k in range(3)), **more,
    ), x0, v0  # fmt: skip


@pytest.mark.parametrize("flat", [True, False], ids=["layer", "3-D"])
@pytest.mark.parametrize("axis", range(3), ids=["x", "y", "z"])
def test_particles_on_a_face_are_not_lost(axis, flat):
    # detects: a sphere on a face that is lost, stands still, jumps, or is outside the domain when it is read;
    # in both directions, at the start and when a gate has been removed
    for lo, hi in domains(6, seed=axis):
        scene, x0, v0 = faces_scene(lo, hi, axis, flat)
        engine = Engine(HardSphereProblem.from_scene(scene))
        # each of some 1000 cell crossings rounds the position once
        tolerance = 1000 * np.spacing(max(abs(lo), abs(hi), 1.0))
        for t in (0.0, 0.1, 0.25, (hi - lo) / 0.3, 2 * (hi - lo) / 0.3, 2 * (hi - lo) / 0.3 + 1.0):
            engine.advance(max(t, engine.time))
            x = engine.state()[0][:, axis]
            assert ((lo <= x) & (x < hi)).all(), (lo, hi, t)
            assert distance(x, x0 + v0 * engine.time, lo, hi) < tolerance, (lo, hi, t)
            unwrapped = engine.unwrapped_positions()[:, axis]
            start = engine.problem.position[:, axis]  # hi of the scene may be lo here
            np.testing.assert_allclose(unwrapped, start + v0 * engine.time, rtol=0, atol=tolerance)
        assert engine.counts.collisions == 0


@pytest.mark.parametrize(("lo", "hi"), NAMED)
@pytest.mark.parametrize("start", range(4), ids=["lo", "above lo", "below hi", "hi"])
def test_a_pair_meets_across_the_faces(lo, hi, start):
    # detects: a partner on the other side of a face that is not seen: the sphere on the face is in a cell
    # other than that of its position, or its image is a period off
    radius, gap, meetings = 0.02, 0.05, []
    for way in (1.0, -1.0):
        x = on_the_faces(lo, hi)[start]
        other = lo + ((x - lo) + way * (2 * radius + gap)) % (hi - lo)
        scene = scenes.scene(
            [[x, 0, 0], [other, 0, 0]], [[way, 0, 0], [0, 0, 0]], lo=(lo, -1, -1), hi=(hi, 1, 1),
            periodic=(True, False, False), radius=radius, duration=0.09,
        )  # fmt: skip
        engine = Engine(HardSphereProblem.from_scene(scene), log=10)
        engine.advance(0.09)
        meetings += engine.log[1].tolist()
        np.testing.assert_allclose(engine.state()[1][:, 0], [0, way], rtol=0, atol=1e-12)
    assert meetings == pytest.approx([gap, gap], abs=10 * np.spacing(max(abs(lo), abs(hi), 1.0)))


@pytest.mark.parametrize("flat", [True, False], ids=["layer", "3-D"])
@pytest.mark.parametrize(("lo", "hi"), [(-0.15, 0.25), (0.05, 0.3), (1e3, 1e3 + 0.3)])
def test_a_gas_that_starts_on_the_faces_has_the_collisions_of_the_reference(lo, hi, flat):
    # detects: what the single pairs above leave out: corners, several images, cells of a layer
    n, rng = 4, np.random.default_rng(7)
    pitch = (hi - lo) / n
    line = np.append(lo + pitch * np.arange(1, n), hi)
    grid = np.array(list(itertools.product(line, [0.0] if flat else line, line)))
    velocity = rng.normal(size=grid.shape) * ((1, 0, 1) if flat else (1, 1, 1))
    scene = scenes.scene(
        grid, velocity, radius=0.3 * pitch, restitution=0.9,
        lo=(lo, -1, lo) if flat else (lo,) * 3, hi=(hi, 1, hi) if flat else (hi,) * 3,
        periodic=(True, not flat, True),
    )  # fmt: skip
    problem = HardSphereProblem.from_scene(scene)
    reference = BruteForceHardSpheres(problem)
    reference.advance(1.0, 40)
    engine = Engine(problem, log=40)
    engine.advance(reference.time + 1e-11)
    pairs = [(min(a, b), max(a, b)) for a, b in engine.log[0].tolist()]
    assert pairs == [(i, j) for _, i, j in reference.log]
    np.testing.assert_allclose(engine.log[1], [t for t, _, _ in reference.log], rtol=0, atol=1e-10)


@pytest.mark.parametrize(("lo", "hi"), [(-0.15, 0.25), (-0.1, 1.0), (0.05, 0.3), (-1e-9, 0.4)])
def test_what_is_written_can_be_read_as_particles(tmp_path, lo, hi):
    # detects: a frame or a trace with a position outside the domain, which stops a run that starts from it
    output = Output(trace_every=0.01, frames_every=0.1)
    scene, _, _ = faces_scene(lo, hi, 0, False, output=output, duration=1.0)
    run = event_driven.run(scene, tmp_path)
    x = run.trace["position"][:, :, 0]
    assert ((lo <= x) & (x < hi)).all()
    paths = sorted((tmp_path / "frames").glob("p_*.vtu"))
    assert len(paths) == 11
    for path in paths:
        again = scene.replace(particles=FromFile(source="file", path=str(path), material="ball"))
        assert len(again.state) == len(scene.state)


def test_energy_follows_particles_through_the_sides():
    # detects: a potential energy that jumps by m g L at each passage where gravity is along a periodic axis
    slope = math.radians(24)
    gravity = (9.81 * math.sin(slope), 0, -9.81 * math.cos(slope))
    scene = scenes.scene(
        [[0, 0, 0.1], [0.1, 0, 0.3]], [[0, 0, 0]] * 2, gravity=gravity, lo=(-0.15, -1, 0), hi=(0.25, 1, 1),
        periodic=(True, True, False), walls=[Box(kind="box", name="box", material="wall", sides=("zlo",))],
    )  # fmt: skip
    engine = Engine(HardSphereProblem.from_scene(scene))
    begin = engine.energy()
    engine.advance(1.0)
    assert engine.unwrapped_positions()[0, 0] == pytest.approx(0.5 * gravity[0], rel=1e-12)  # five passages
    assert engine.counts.walls > 2
    assert engine.energy() == pytest.approx(begin, abs=1e-12)
