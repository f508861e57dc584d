"""The metrics on data whose answer is known: each test names the wrong it would see."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from comparisons.cases.single_contact import head_on, wall_restitution
from comparisons.cases.single_contact.meetings import overlap
from comparisons.metrics import pile, statistics, trace
from gpudem.output.run import Run, Timing

R = 0.01


def layers(nx: int, ny: int, nz: int) -> np.ndarray:
    """A cubic stack of touching grains of radius R, its corner at the origin."""
    grid = np.stack(np.meshgrid(range(nx), range(ny), range(nz), indexing="ij"), axis=-1).reshape(-1, 3)
    return R + 2 * R * grid


def test_difference_takes_the_worst_step_and_particle():
    # a mean over steps, which hides a single bad one
    a = np.zeros((5, 2, 3))
    b = a.copy()
    b[3, 1] = (3.0, 4.0, 0.0)
    assert trace.largest_difference(a, b) == 5.0
    assert trace.largest_difference(a, b, np.array([1.0, 10.0])) == 0.5
    b[0, 0, 0] = np.nan
    assert np.isnan(trace.largest_difference(a, b))
    with pytest.raises(ValueError, match="different shape"):
        trace.largest_difference(a, b[:4])


def test_peak_between_samples():
    # the largest sample taken for the peak
    t = np.linspace(0, 1, 11)
    assert trace.peak(t, 2 - (t - 0.537) ** 2) == (pytest.approx(0.537), pytest.approx(2.0))


def test_contact_interval_between_samples():
    # whole steps; a contact that began before the trace
    t = np.linspace(0, 1, 101)
    overlap = np.where(t < 0.5, t - 0.233, 0.777 - t)
    assert trace.contact_interval(t, overlap) == (pytest.approx(0.233), pytest.approx(0.777))
    with pytest.raises(ValueError, match="no beginning"):
        trace.contact_interval(t, overlap + 0.5)
    with pytest.raises(ValueError, match="no beginning"):
        trace.contact_interval(t, overlap - 1)
    with pytest.raises(ValueError, match="does not end"):
        trace.contact_interval(t[:70], overlap[:70])


@pytest.mark.parametrize(
    ("scene", "meeting", "gap"),
    [
        (head_on.scene(1e-6), head_on.MEETINGS[1], 0.8 * head_on.FLIGHT),
        (wall_restitution.scene(False, 1e-6), wall_restitution.MEETINGS[1], 1.3 * wall_restitution.FLIGHT),
    ],
    ids=["sphere", "wall"],
)
def test_overlap_at_the_start(scene, meeting, gap):
    """Detects the sign of a wall's normal, a radius left out: the flight to the touch is known."""
    timing, start = Timing(8, 1, 1.0), {"position": scene.state.position[None]}
    run = Run("gpudem", "", scene, Path(), timing, trace=start)
    assert overlap(run, meeting)[0] == pytest.approx(-gap)


def test_rebound():
    # speed in place of its normal part
    velocity = np.array([[3.0, 0, -2.0], [1.0, 0, 1.5]])
    assert trace.rebound(velocity, np.array([0, 0, 1.0])) == pytest.approx(0.75)


def test_observed_order():
    # two rungs, where one lucky error makes any slope
    h = np.array([1e-3, 5e-4, 1e-4])
    assert trace.observed_order(h, 7 * h**2) == pytest.approx(2.0)
    with pytest.raises(ValueError, match="three steps"):
        trace.observed_order(h[:2], h[:2])


def test_height_of_a_stack():
    # centres in place of tops; the window's mean in place of its highest
    stack = layers(10, 4, 3)
    radius = np.full(len(stack), R)
    at = np.array([0.05, 0.10, 0.30])
    assert pile.height(stack, radius, at, (0.0, 0.08)) == pytest.approx([0.06, 0.06, 0.0])


def test_a_flying_grain_is_no_pile():
    # one stray grain above the heap, or ahead of it, read as the surface or the run-out
    stack = np.vstack([layers(10, 4, 3), [(0.1, 0.04, 0.2), (0.5, 0.04, R)]])
    radius = np.full(len(stack), R)
    assert pile.main_mass(stack, radius).sum() == 120
    assert pile.height(stack, radius, np.array([0.1]), (0.0, 0.08)) == pytest.approx([0.06])
    assert pile.run_out(stack, radius) == (pytest.approx(0.2), pytest.approx(0.51))


def test_one_proud_grain_moves_the_height_by_its_strip_alone():
    # the highest grain of the whole depth read as the surface
    stack = np.vstack([layers(10, 4, 3), [(0.11, 0.03, 0.07)]])
    found = pile.height(stack, np.full(len(stack), R), np.array([0.11]), (0.0, 0.08))
    assert found == pytest.approx([(3 * 0.06 + 0.08) / 4])


def test_touching_across_a_periodic_side():
    # grains at both ends of a periodic depth counted as apart
    ends = np.array([[0.0, 0.001, 0.0], [0.0, 0.099, 0.0], [0.02, 0.001, 0.0]])
    radius = np.full(3, R)
    assert pile.coordination(ends, radius) == pytest.approx(2 / 3)
    assert pile.coordination(ends, radius, period=0.1) == pytest.approx(2.0)
    assert pile.main_mass(ends, radius, period=0.1).all()
    assert not pile.main_mass(ends, radius).all()


def test_packing_of_a_cubic_stack():
    # diameters for radii: eight times too much
    stack = layers(6, 6, 6)
    found = pile.packing_fraction(stack, np.full(len(stack), R), (0.02, 0.02, 0.02), (0.1, 0.1, 0.1))
    assert found == pytest.approx(np.pi / 6)


def test_centre_of_mass_weighs_by_volume():
    found = pile.centre_of_mass(np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([R, 2 * R]))
    assert found == pytest.approx([8 / 9, 0, 0])


def test_arrival_between_samples():
    # the next sample taken for the arrival; a front that never arrives reported as the last time
    t = np.array([0.0, 0.1, 0.2])
    assert pile.arrival(t, np.array([0.0, 0.4, 0.8]), 0.6) == pytest.approx(0.15)
    assert np.isnan(pile.arrival(t, np.array([0.0, 0.4, 0.5]), 0.6))


def test_profile_distance_is_a_length():
    x = np.array([0.0, 0.1, 0.4])
    assert pile.profile_distance(x, np.full(3, 0.2), np.full(3, 0.17)) == pytest.approx(0.03)


def test_welch_sees_a_shift_and_not_a_spread():
    # pooled variances; a test that never rejects
    rng = np.random.default_rng(3)
    same = statistics.welch(rng.normal(0, 1, 6), rng.normal(0, 4, 6))
    shifted = statistics.welch(rng.normal(0, 1, 6), rng.normal(6, 1, 6))
    assert same.p > 0.05 > 1e-3 > shifted.p
    assert shifted.bound > abs(shifted.difference) > 4
    assert statistics.welch([1.0, 1, 1], [1.0, 1, 1]).p == 1
    with pytest.raises(ValueError, match="finite"):
        statistics.welch([1.0, 2, np.nan], [1.0, 2, 3])


def test_welch_interval_covers_as_often_as_it_says():
    # a normal quantile in place of Student's: covers 88 % with five seeds
    rng = np.random.default_rng(5)
    hits = [
        abs(c.difference) <= c.half_width
        for c in (statistics.welch(*rng.normal(0, 1, (2, 5))) for _ in range(2000))
    ]
    assert 0.935 < np.mean(hits) < 0.975


def test_largest_gap_corrects_for_the_number_of_metrics():
    # one p per metric at face value: 16 metrics of equal codes alarm in every seventh comparison at 0.01
    rng = np.random.default_rng(7)
    smallest = [statistics.largest_gap(*rng.normal(0, 1, (2, 5, 16))).min() for _ in range(400)]
    assert np.mean(np.array(smallest) < 0.01) < 0.03
    assert 0.05 < np.mean(np.array(smallest) < 0.1) < 0.15


def test_largest_gap_sees_one_metric_of_many():
    # a test that cannot fail: a smallest possible p above its level
    rng = np.random.default_rng(8)
    a, b = rng.normal(0, 1, (2, 5, 16))
    b[:, 3] += 10
    p = statistics.largest_gap(a, b)
    assert p[3] == pytest.approx(2 / 252)
    assert p[np.arange(16) != 3].min() > 0.01
    assert statistics.largest_gap(a, a).min() == 1.0
    with pytest.raises(ValueError, match="5 to 10"):
        statistics.largest_gap(a[:4], b[:4])


def test_compare_goes_by_the_names_of_metrics():
    """Samples that are compared in the order in which their metrics stand."""
    rng = np.random.default_rng(9)
    a = {name: rng.normal(0, 1, 5) for name in ("height", "time")}
    b = {"more": rng.normal(0, 1, 5), "time": a["time"] + 20, "height": a["height"]}
    found = statistics.compare(a, b)
    assert list(found) == ["height", "time"]
    assert (found["height"].difference, found["height"].corrected) == (0.0, 1.0)
    assert found["time"].difference == pytest.approx(-20)
    assert found["time"].corrected == pytest.approx(2 / 252)


def test_the_largest_overlap_across_a_periodic_side():
    # the far image taken: no overlap at all; a sum of radii that is one radius
    ends = np.array([[0.0, 0.001, 0.0], [0.0, 0.1 - 0.0185, 0.0], [0.0195, 0.001, 0.0]])
    radius = np.full(3, R)
    assert pile.largest_overlap(ends, radius) == pytest.approx(2 * R - 0.0195)
    assert pile.largest_overlap(ends, radius, period=0.1) == pytest.approx(2 * R - 0.0195)
    ends[1, 1] = 0.1 - 0.018
    assert pile.largest_overlap(ends, radius, period=0.1) == pytest.approx(2 * R - 0.019)
