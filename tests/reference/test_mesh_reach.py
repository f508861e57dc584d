"""Meshes that come beyond the domain: LIGGGHTS ends a run in which it loses the center of a triangle."""

from __future__ import annotations

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.scene import Scene
from reference import liggghts as code
from reference.liggghts.deck import render
from reference.liggghts.errors import LiggghtsCannotState, LiggghtsFailed
from reference.liggghts.removal import box

SOFT = {"young": 5e6, "poisson": 0.3, "density": 2000.0}
LEAVES = {"type": "linear", "velocity": (-0.5, 0, 0)}
TURNS = {"type": "rotate", "axis": (0, 0, 1), "point": (0.05, 0.05, 0), "period": 0.1}


def tray(ends: tuple[float, float], motion: dict | None = None, gravity: float = -10.0, **domain) -> Scene:
    """Two balls on a tray of two triangles that reaches along x from one end to the other [m]."""
    a, b = ends
    wall = {
        "kind": "mesh", "name": "tray", "material": "ball", "triangles": [[0, 1, 2], [0, 2, 3]],
        "vertices": [[a, 0.01, 0.02], [b, 0.01, 0.02], [b, 0.09, 0.02], [a, 0.09, 0.02]],
        "motion": [motion] if motion else [],
    }  # fmt: skip
    return Scene(
        name="tray", materials={"ball": SOFT}, gravity=(0, 0, gravity), walls=[wall],
        pairs=[{"materials": ("ball", "ball"), "restitution": 0.5, "friction": 0.3}],
        contact={"mesh_contacts": "liggghts"},
        particles={"source": "explicit", "position": [(0.05, 0.05, 0.0252), (0.035, 0.035, 0.0252)],
                   "radius": 0.005, "material": "ball"},
        domain={"lo": (0, 0, 0), "hi": (0.1, 0.1, 0.1), **domain}, time={"step": 1e-5, "duration": 0.06},
        output={"trace_every": 1e-3, "history_every": 1e-3},
    )  # fmt: skip


@pytest.mark.liggghts
@pytest.mark.parametrize(
    ("ends", "motion"),
    [((-0.05, 0.09), None), ((-0.2, 0.3), None), ((-0.02, 0.09), {**LEAVES, "velocity": (-1.0, 0, 0)}),
     ((-0.1, 0.2), TURNS)],
    ids=["reaches out", "larger than the domain", "leaves", "turns"],
)  # fmt: skip
def test_agrees_with_binary(ends, motion, tmp_path, liggghts):
    """Detects: triangles that LIGGGHTS loses, or a box that grows at another side."""
    scene = tray(ends, motion)
    lo, hi = box(scene)[0]
    assert lo < scene.domain.lo[0] - 0.001 or hi > scene.domain.hi[0] + 0.001
    run, ours = code.run(scene, tmp_path), simulate(scene)
    assert run.trace is not None
    assert ours.trace is not None
    for name, scale in (("position", 0.01), ("velocity", 0.5), ("angular_velocity", 100.0)):
        assert np.abs(run.trace[name] - ours.trace[name]).max() < 1e-9 * scale, name
    assert np.abs(ours.trace["force"]).max() > 1e-3, "the balls lie on the tray"


@pytest.mark.liggghts
def test_a_ball_beyond_a_closed_side_ends_the_run(tmp_path, liggghts):
    """Detects: a loss that nobody sees, since the box reaches farther than the domain."""
    scene = tray((-1.0, 0.09)).replace(gravity=(-200.0, 0, -10.0))
    with pytest.raises(LiggghtsFailed, match=r"a side that is not open, in or before step \d+; open: none"):
        code.run(scene, tmp_path)


@pytest.mark.parametrize("motion", [None, LEAVES, TURNS], ids=["at rest", "leaves", "turns"])
def test_beyond_an_open_side(motion):
    """Detects: LIGGGHTS' own message, which names neither the wall nor the side, in the place of this one."""
    scene = tray((-0.06, 0.09), motion, sides={"xlo": "outflow"})
    with pytest.raises(LiggghtsCannotState, match=r"walls.tray: .*comes to x = -0\.\d+ m, beyond .* xlo"):
        render(scene)


def test_within_the_domain_nothing_changes():
    """Detects: particles counted, or a larger box, where no center of a triangle comes beyond a side."""
    scene = tray((-0.02, 0.09), TURNS | {"period": 100.0}, sides={"xlo": "outflow"})
    assert "beyond" in render(scene).text
    closed = tray((0.0, 0.1), LEAVES | {"velocity": (-0.01, 0, 0)})
    assert "beyond" not in render(closed).text
    assert box(closed)[0] == (-0.0005, pytest.approx(0.1005))
