"""Adhesion (`jkr`) against the oracle, which works from the contact radius by root finding and quadrature.

Detects: a wrong root of the quartic, pull-off force, gap at which contacts break or effective value; a
contact across a gap that has never touched, or that is forgotten at a rebuild, in a restart or between lists.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from comparisons.oracles.adhesion import Adhesion
from comparisons.oracles.bodies import bodies
from comparisons.oracles.mesh_shapes import rectangle
from gpudem.driver import simulate
from gpudem.errors import SceneError
from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from tests.gpudem.beds import finish
from tests.gpudem.meshes import mesh

SOFT = {"young": 1e7, "poisson": 0.3, "density": 2500.0}
HARD = {"young": 4e7, "poisson": 0.25, "density": 4000.0}
WORK = {("soft", "soft"): 0.5, ("soft", "hard"): 0.2, ("hard", "hard"): 0.8}
FLOOR = {"kind": "plane", "name": "floor", "material": "hard", "point": (0, 0, 0), "normal": (0, 0, 1)}
R = 1e-3


def scene(position, velocity, material: Any = "soft", radius: Any = R, work=WORK, **more: Any) -> Scene:
    """Spheres of some 1 mm without friction, traced at every step of 0.2 us."""
    pair = {"restitution": 1.0, **more.pop("pair", {})}
    pairs = [{"materials": m, "work_of_adhesion": w, **pair} for m, w in work.items()]
    steps = more.pop("steps", 20000)
    contact = {"normal": "jkr", "tangential": "off", **more.pop("contact", {})}
    return Scene(**{
        "name": "adhesion", "materials": {"soft": SOFT, "hard": HARD}, "pairs": pairs, "contact": contact,
        "particles": {"source": "explicit", "position": position, "velocity": velocity, "radius": radius,
                      "material": material},
        "domain": {"lo": (-0.05, -0.05, -0.05), "hi": (0.05, 0.05, 0.05)},
        "time": {"step": 2e-7, "duration": steps * 2e-7}, "output": {"trace_every": 2e-7}, **more,
    })  # fmt: skip


def meeting(speed: float, **more) -> Scene:
    """Two unlike spheres, 1 um apart, meet head-on."""
    return scene(
        [[-R - 5e-7, 0, 0], [1.5 * R + 5e-7, 0, 0]], [[speed / 2, 0, 0], [-speed / 2, 0, 0]],
        material=["soft", "hard"], radius=[R, 1.5 * R], **more,
    )  # fmt: skip


def falling(speed: float, **more) -> Scene:
    """A sphere 1 um above a floor moves towards it, without gravity."""
    return scene([[0, 0, R + 1e-6]], [[0, 0, -speed]], walls=[FLOOR], **more)


def law(scene: Scene) -> Adhesion:
    """The oracle of the first contact."""
    walled = bool(scene.walls)
    flat = scene.replace(walls=[FLOOR]) if walled else scene  # the oracle knows planes only
    return Adhesion(bodies(flat, 0, "floor" if walled else 1), 0.2)


def overlaps(scene: Scene, trace: dict) -> np.ndarray:
    """Overlap [m] at every step."""
    x, radius = trace["position"], scene.state.radius
    if scene.walls:
        return radius[0] - x[:, 0, 2]
    return radius.sum() - np.linalg.norm(x[:, 0] - x[:, 1], axis=1)


def tiles(height: float = 0.0, size: float = 0.02, count: int = 8) -> dict[str, Any]:
    """A square about the origin of two triangles a tile, named as the plane that it stands for."""
    corners = rectangle((-size, -size, height), (2 * size, 0, 0), (0, 2 * size, 0), (count, count))
    return {**mesh(corners, "floor"), "material": "hard"}


def falling_on_mesh(speed: float, **more) -> Scene:
    """The same as `falling` on a mesh, over an edge of two triangles."""
    return falling(speed, **more).replace(walls=[tiles()])


MAKERS = {"pair": meeting, "floor": falling, "mesh": falling_on_mesh}


@pytest.mark.parametrize("kind", MAKERS)
def test_force_along_a_contact(kind):
    """From touch to the break, at every step: the oracle's force at that overlap, and none elsewhere."""
    at = MAKERS[kind](0.01)
    oracle = law(at)
    speed = 1.3 * oracle.sticking_speed
    at = MAKERS[kind](speed)
    trace = simulate(at).trace
    assert trace is not None
    overlap, force = overlaps(at, trace), np.linalg.norm(trace["force"][:, 0], axis=1)
    touched = np.flatnonzero(overlap > 0)
    last = touched[-1] + np.flatnonzero(overlap[touched[-1] :] > -oracle.gap)[-1]
    held = np.arange(touched[0], last + 1)
    assert overlap[held].min() < -0.98 * oracle.gap
    want = np.array([abs(oracle.force_at(d)) for d in overlap[held]])
    near = overlap[held] < -0.9999 * oracle.gap  # the root's derivative is infinite at the break
    assert np.abs(force[held] - want)[~near].max() < 1e-10 * want.max()
    assert np.abs(force[held] - want).max() < 1e-6 * want.max()
    assert not force[: touched[0]].any()  # across a gap that was never closed
    assert not force[last + 1 :].any()
    pull = -trace["force"][:, 0, 2] if at.walls else trace["force"][:, 0, 0]
    assert pull.max() == pytest.approx(oracle.pull_off, rel=1e-6)
    v = trace["velocity"][-1]
    lost = speed**2 - np.linalg.norm(v[0] if at.walls else v[0] - v[1]) ** 2
    # the steps in which the contact begins and breaks are not whole: 1e-3 of the energy
    assert lost == pytest.approx(oracle.sticking_speed**2, rel=5e-3)


@pytest.mark.parametrize("kind", MAKERS)
@pytest.mark.parametrize("share", [0.97, 1.03])
def test_sticking(kind, share):
    """Below the sticking speed a sphere stays, above it leaves; the energy is 7.09 (w^5 R*^4/E*^2)^(1/3)."""
    oracle = law(MAKERS[kind](0.01))
    b = oracle.bodies
    assert oracle.lost == pytest.approx(
        7.0922 * (0.2**5 * b.radius_star**4 / b.young_star**2) ** (1 / 3), rel=1e-5
    )
    at = MAKERS[kind](share * oracle.sticking_speed)
    trace = simulate(at).trace
    assert trace is not None
    assert (overlaps(at, trace)[-1] > -oracle.gap) == (share < 1)


def test_damped_impact_against_the_ode():
    """The dashpot is that of hertz with the contact radius in the place of sqrt(R* overlap)."""
    at = meeting(0.05, pair={"restitution": 0.6}, steps=5000)
    oracle = law(at)
    log = abs(math.log(0.6))
    beta = log / math.hypot(log, math.pi)
    trace = simulate(at).trace
    assert trace is not None
    overlap = overlaps(at, trace)
    start = 1e-6 / 0.05
    dashpot = 2 * math.sqrt(5 / 6) * beta * math.sqrt(2 * oracle.bodies.young_star)
    first = int(np.ceil(start / at.time.step))
    solved, _ = oracle.motion(0.05, trace["time"][first:] - start, dashpot)
    inside = np.isfinite(solved)
    assert inside.sum() > 1000
    off = np.abs(overlap[first:] - solved)[inside].max()
    # first order in the step: a dashpot that sees velocities half a step behind
    assert off < 5e-3 * np.nanmax(solved)


def test_friction_of_a_sphere_that_sticks():
    """At rest along the normal F_n = 0, and the limit is mu 3 pi w R*: a sliding sphere slows by it."""
    mu, oracle = 0.3, law(falling(0.01))
    rest = (9 * math.pi * 0.2 * R**2 / (2 * oracle.bodies.young_star)) ** (1 / 3)
    at = scene(
        [[0, 0, R - oracle.overlap(rest)]], [[0.5, 0, 0]], walls=[FLOOR], steps=500,
        contact={"tangential": "history"}, pair={"friction": mu},
    )  # fmt: skip
    trace = simulate(at).trace
    assert trace is not None
    late = trace["force"][300:, 0]
    assert np.abs(late[:, 2]).max() < 1e-3 * oracle.pull_off
    assert late[:, 0] == pytest.approx(-mu * 3 * math.pi * 0.2 * R, rel=1e-3)


def test_no_contact_at_a_negative_overlap_at_the_start():
    """Within the gap at which a contact would break, but never in touch: no force."""
    oracle = law(falling(0.01))
    at = scene([[0, 0, R + 0.5 * oracle.gap]], [[0, 0, 0.0]], walls=[FLOOR], steps=20)
    trace = simulate(at).trace
    assert trace is not None
    assert not trace["force"].any()
    touching = scene([[0, 0, R - 0.01 * oracle.gap]], [[0, 0, 0.0]], walls=[FLOOR], steps=20)
    assert simulate(touching).trace["force"][0, 0, 2] < 0


def cluster() -> Scene:
    """Nine spheres of two materials and sizes fly into each other and a floor: contacts begin and break."""
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*[np.arange(2)] * 3, indexing="ij"), -1).reshape(-1, 3)
    position = np.vstack([grid * 2.55 * R + (0, 0, 1.6 * R), [[1.3 * R, 1.2 * R, 6.6 * R]]])
    velocity = rng.normal(scale=0.08, size=(9, 3)) - (0, 0, 0.1)
    return scene(
        position, velocity, material=["soft", "hard"] * 4 + ["soft"],
        radius=np.where(np.arange(9) % 3, R, 1.2 * R),
        walls=[FLOOR], steps=60000, gravity=(0, 0, -9.81), contact={"tangential": "history"},
        pair={"friction": 0.3, "restitution": 0.9}, output={"trace_every": 4e-6, "history_every": 4e-6},
        solver={"skin": 2e-5},
    )  # fmt: skip


def test_lists_agree():
    """Half and full list within rounding, through rebuilds: a contact across a gap is kept by both."""
    half, full = (finish(Solver(cluster(), half_list=choice)) for choice in (True, False))
    for column in ("position", "velocity"):
        scale = np.abs(half[column]).max()
        assert np.abs(half[column] - full[column]).max() < 1e-8 * scale


def hanging(walls: list[dict[str, Any]], **more) -> Scene:
    """A sphere that slides along a ceiling and a side wall: it hangs across a gap, by 1.45 pi w R, and comes
    to it from touch.
    """
    weight = 1.45 * math.pi * 0.2 * R
    mass = 4 / 3 * math.pi * R**3 * SOFT["density"]
    return scene(
        [[-0.006, R - 1e-7, -R + 1e-7]], [[0.3, 0.0, 0.0]], walls=walls, steps=30000, pair={"friction": 0.2,
        "restitution": 0.5}, contact={"tangential": "history"}, gravity=(0.0, 0.0, -weight / mass),
        output={"trace_every": 1e-6}, **more,
    )  # fmt: skip


def test_a_contact_across_a_gap_goes_on_from_triangle_to_triangle():
    """Along a ceiling of 128 triangles and a side wall of 128 as along planes, at negative overlaps.

    Detects a contact that is forgotten, or loses its spring, where the nearest triangle changes.
    """
    planes = [
        {**FLOOR, "name": "top", "normal": (0, 0, -1)},
        {**FLOOR, "name": "side", "normal": (0, 1, 0)},
    ]
    side = rectangle((-0.02, 0, -0.02), (0.04, 0, 0), (0, 0, 0.04), (8, 8))
    meshes = [{**tiles(), "name": "top"}, {**mesh(side, "side"), "material": "hard"}]
    flat, tiled = (simulate(hanging(walls)).trace for walls in (planes, meshes))
    assert flat is not None
    assert tiled is not None
    overlap = R + flat["position"][:, 0, 2]
    gap = law(falling(0.01)).gap
    assert (overlap[-5000:] < -0.05 * gap).all()  # it hangs
    assert np.ptp(flat["position"][:, 0, 0]) > 0.0005
    for column in ("position", "velocity", "angular_velocity", "force"):
        scale = np.abs(flat[column]).max()
        assert np.abs(flat[column] - tiled[column]).max() < 1e-9 * scale, column


@pytest.mark.parametrize("make", [falling, falling_on_mesh])
def test_restart_keeps_contacts_across_gaps(make):
    """Cut while the surfaces are apart and hold each other: the same bits as uncut."""
    at = make(1.2 * law(falling(0.01)).sticking_speed)
    whole = simulate(at).trace
    assert whole is not None
    apart = np.flatnonzero((overlaps(at, whole) < 0) & (whole["force"][:, 0, 2] < 0))
    assert len(apart) > 20
    stop = int(apart[10])
    first, second = Solver(at), Solver(at)
    first.start()
    first.advance(stop)
    second.load_state_dict(first.state_dict())
    second.advance(at.n_steps - stop)
    assert np.array_equal(second.column("position"), whole["position"][-1])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"solver": {"integrator": "path"}}, "force jumps where contacts begin and break"),
        ({"contact": {"normal": "jkr", "limit_force": True}}, "would take its attraction away"),
        ({"contact": {"normal": "jkr", "cohesion": "sjkr"}}, "an attraction of its own"),
        ({"contact": {"normal": "jkr", "rolling": "cdt"}}, "'cdt': its torque"),
        ({"walls": [{**FLOOR, "contact": {"normal": "hertz"}}]}, "must be that of all contacts"),
        ({"walls": [tiles()], "contact": {"normal": "jkr", "mesh_contacts": "liggghts"}}, "no law with"),
    ],
)  # fmt: skip
def test_what_it_does_not_go_with(changes, message):
    with pytest.raises(SceneError, match=message):
        falling(0.01).replace(**changes)
