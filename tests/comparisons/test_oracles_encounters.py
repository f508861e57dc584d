"""Oracles of several impacts in turn, and of several planes at once."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from comparisons.cases.encounters import meet_again, several_walls, tilted_plane
from comparisons.cases.encounters.throws import RADIUS
from comparisons.oracles.impact import COLUMNS, impact
from comparisons.oracles.motion import motion
from comparisons.oracles.planes import on_planes

TWICE = meet_again.WALL_TWICE[1]


@pytest.mark.parametrize(
    ("scene", "encounter"),
    [(meet_again.wall_twice(), TWICE), (meet_again.pair_twice(), meet_again.PAIR_TWICE[2])],
    ids=["wall", "pair"],
)
def test_motion_is_continuous_and_passes_through_every_impact(scene, encounter):
    """Detects a piece that begins where the last one does not end."""
    found = motion(scene, encounter.meetings)
    assert len(found.impacts) == len(encounter.meetings)
    for row, pieces in found.pieces.items():
        for begin, _ in pieces[1:]:
            before, after = (found.at(row, np.array([begin + sign * 1e-14])) for sign in (-1, 1))
            for column, scale in zip(COLUMNS, (1e-5, 1.0, 1 / RADIUS), strict=True):
                assert np.abs(after[column] - before[column]).max() < 1e-6 * scale, (row, begin, column)
    contacts = [(since + part.touch, since + part.end) for since, part in found.impacts if 0 in part.rows]
    assert all(end < begin for (_, end), (begin, _) in itertools.pairwise(contacts))


def test_bounces_between_two_planes_against_small_steps():
    """Detects an impact that starts from another state than the last one ended with: two oracles, no code in
    common but the constants of the bodies.
    """
    scene = meet_again.wall_twice()
    times = np.arange(scene.n_steps + 1) * scene.time.step
    steps = on_planes(scene, [1], ["floor", "ceiling"], times)
    exact = motion(scene, TWICE.meetings).at(1, times)
    assert np.abs(steps["velocity"][:, 0] - exact["velocity"]).max() < 3e-3
    assert RADIUS * np.abs(steps["angular_velocity"][:, 0] - exact["angular_velocity"]).max() < 3e-3


def test_small_steps_converge_to_the_ode():
    """Detects a law on planes with another limit: half the step, about half the error."""
    scene = tilted_plane.scene("tilted", tilted_plane.turn(), 0.4)
    times = np.arange(scene.n_steps + 1) * scene.time.step
    exact = impact(scene, 3, "floor").at(times)["velocity"][:, 0]
    errors = [
        np.abs(on_planes(scene, [3], ["floor"], times, substeps)["velocity"][:, 0] - exact).max()
        for substeps in (2, 4, 8)
    ]
    assert errors[0] < 5e-3
    assert errors[1] < 0.7 * errors[0]
    assert errors[2] < 0.7 * errors[1]


def test_a_contact_ends_where_its_plane_is_removed():
    """Detects a gate that pushes after its removal."""
    scene = several_walls.gate()
    found = motion(scene, several_walls.AT_THE_GATE[0].meetings)
    velocity = found.at(0, several_walls.REMOVED + np.array([-1e-6, 0.0, 1e-6, 1e-5]))["velocity"]
    assert np.abs(velocity[1] - velocity[0]).max() > 1e-3
    assert np.abs(velocity[2:] - velocity[1]).max() == 0.0


def test_what_motion_does_not_cover_is_refused():
    """Detects an impact taken for solved that does not happen, or is not the next one."""
    scene = meet_again.wall_twice()
    with pytest.raises(ValueError, match="does not fly at"):
        motion(scene, [(0, "ceiling")])
    early = several_walls.gate().replace(
        walls=[
            w.model_copy(update={"removed_at": 2e-6} if w.name == "gate" else {})
            for w in several_walls.gate().walls
        ]
    )
    with pytest.raises(ValueError, match="removed before"):
        motion(early, several_walls.AT_THE_GATE[0].meetings)
