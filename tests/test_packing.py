"""Initial positions: nothing overlaps, everything lies within, the same seed gives the same bits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist

from gpudem.scene import Lattice
from gpudem.scene.distributions import Lognormal
from gpudem.scene.packing import InitialState, lattice

INDEX = {"ps": 0, "steel": 1}


def recipe(**changes) -> Lattice:
    return Lattice(
        **{
            "source": "lattice",
            "material": "steel",
            "count": 300,
            "lo": (0, 0, 0),
            "hi": (0.05, 0.06, 0.1),
            "radius": 0.003,
            **changes,
        }
    )


def test_full_jitter_uses_the_gap_and_no_more() -> None:
    """Two neighbours that both move by half of the gap between them just touch; any more could overlap."""
    still, moved = (lattice(recipe(jitter=j, spacing=1.3), INDEX) for j in (0.0, 1.0))
    largest_shift = np.abs(moved.position - still.position).max()
    half_gap = 0.3 * 0.003
    assert 0.98 * half_gap < largest_shift <= half_gap * (1 + 1e-12)
    assert pdist(moved.position).min() >= 2 * 0.003


@given(seed=st.integers(0, 2**32), spacing=st.floats(1, 2), jitter=st.floats(0, 1), count=st.integers(1, 120))
@settings(max_examples=40, deadline=None)
def test_inside_and_apart(seed: int, spacing: float, jitter: float, count: int) -> None:
    """Every sphere lies wholly within lo..hi and apart from every other, for any seed.

    Scenes are not searched for overlaps of a lattice within their domain, trusting this.
    """
    p = recipe(seed=seed, spacing=spacing, jitter=jitter, count=count)
    state = lattice(p, INDEX)
    assert (state.position >= np.array(p.lo) + 0.003 * (1 - 1e-9)).all()
    assert (state.position <= np.array(p.hi) - 0.003 * (1 - 1e-9)).all()
    assert count == 1 or pdist(state.position).min() >= 0.006 * (1 - 1e-9)


def test_fills_from_below() -> None:
    state = lattice(recipe(count=90, jitter=0.0), INDEX)
    places = 7 * 9  # of a pitch of 6.3 mm in 50 mm x 60 mm
    assert np.ptp(state.position[:places, 2]) == 0
    assert state.position[places:, 2].min() > state.position[0, 2]
    assert state.position[:places, 0].mean() == pytest.approx(0.025), "centred in x"
    assert state.position[:places, 1].mean() == pytest.approx(0.03), "centred in y"


def test_seed() -> None:
    """The same seed gives the same bits, another seed other positions, in every column drawn."""
    one, same, other = (lattice(recipe(seed=s, velocity_rms=0.1), INDEX) for s in (1, 1, 2))
    assert one.position.tobytes() == same.position.tobytes()
    assert one.velocity.tobytes() == same.velocity.tobytes()
    assert (one.position != other.position).all()


def test_mixture_shares_and_room() -> None:
    """Shares are by number; the pitch is that of the largest, so that no mixture overlaps."""
    state = lattice(
        recipe(
            count=4000,
            hi=(0.1, 0.1, 0.3),
            radius=({"radius": 0.001, "share": 3}, {"radius": 0.003, "share": 1}),
        ),
        INDEX,
    )
    small = (state.radius == 0.001).mean()
    assert small == pytest.approx(0.75, abs=4 * np.sqrt(0.75 * 0.25 / 4000)), "4 standard deviations"
    assert set(state.radius) == {0.001, 0.003}
    assert pdist(state.position[:500]).min() >= 0.006 * (1 - 1e-9)


def test_velocity_rms_is_of_each_component() -> None:
    state = lattice(recipe(count=300, velocity_rms=0.2), INDEX)
    rms = np.sqrt((state.velocity**2).mean(axis=0))
    np.testing.assert_allclose(rms, 0.2, atol=4 * 0.2 / np.sqrt(2 * 300))


def test_material_and_types() -> None:
    state = lattice(recipe(), INDEX)
    assert (state.material == 1).all()
    assert state.material.dtype == np.int32
    assert (state.velocity == 0).all()
    assert state.position.dtype == np.float64
    assert all(column.flags.c_contiguous for column in vars(state).values())


def test_scalars_hold_for_all() -> None:
    state = InitialState.build([[0, 0, 0], [1, 1, 1]], 0.5, 0)
    assert state.radius.tolist() == [0.5, 0.5]
    assert state.material.tolist() == [0, 0]
    assert len(state) == 2


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("velocity", [[0, 0, 0]], r"velocity has 1 rows; must have one for each of the 2 particles"),
        ("velocity", [[0, 0], [0, 0]], r"velocity has shape \(2, 2\); must be \(2, 3\)"),
        ("angular_velocity", [[0, 0, 0]] * 3, r"angular_velocity has 3 rows"),
        ("radius", [1, 1, 1], r"radius has 3 rows"),
    ],
)
def test_columns_that_do_not_fit(column: str, value: list, message: str) -> None:
    columns = {"position": [[0, 0, 0], [1, 1, 1]], "radius": 0.5, "material": 0} | {column: value}
    with pytest.raises(ValueError, match=message):
        InitialState.build(**columns)


def test_a_box_without_end() -> None:
    """Places of the lattice beyond what an integer counts. Catches an overflow for a long domain."""
    state = lattice(recipe(count=7, lo=(0.0, 0.0, 0.0), hi=(1e17, 1e17, 1.0)), INDEX)
    assert np.ptp(state.position[:, 1:], axis=0) == pytest.approx(0, abs=32)  # one row; 16 m between numbers


@pytest.mark.parametrize("by", ["number", "mass"])
def test_radii_of_a_distribution(by: str) -> None:
    """A lattice draws the radii of a distribution by its seed, apart by the largest drawn.

    Detects: another distribution than stated, shares by number for shares by mass, a lattice for the mean
    radius, a seed without effect.
    """
    size = {"kind": "lognormal", "median": 0.001, "sigma": 0.3, "lo": 5e-4, "hi": 0.003, "by": by}
    p = recipe(radius=size, count=4000, hi=(0.2, 0.2, 0.2), jitter=0.5)
    state = lattice(p, INDEX)
    assert isinstance(p.radius, Lognormal)
    error = np.std(state.radius) / np.sqrt(len(state))
    assert abs(state.radius.mean() - p.radius.moment(1)) < 5 * error
    gap = pdist(state.position[:500]) - pdist(state.radius[:500, None], lambda a, b: float(a[0] + b[0]))
    assert gap.min() > 0
    columns = np.unique(
        np.round(lattice(recipe(radius=size, count=60, jitter=0.0), INDEX).position[:, 0], 12)
    )
    drawn = lattice(recipe(radius=size, count=60, jitter=0.0), INDEX).radius
    assert np.diff(columns).min() == pytest.approx(2 * 1.05 * drawn.max())
    again, other = lattice(p, INDEX), lattice(p.model_copy(update={"seed": 1}), INDEX)
    assert np.array_equal(state.radius, again.radius)
    assert not np.array_equal(state.radius, other.radius)


def test_a_lattice_that_cannot_hold_the_largest_says_so() -> None:
    """Detects: a message that does not name the radius that sets the pitch."""
    size = {"kind": "uniform", "lo": 0.001, "hi": 0.02}
    with pytest.raises(
        ValueError, match=r"count = 300 does not fit: .* diameters of the largest particle, radius"
    ):
        lattice(recipe(radius=size), INDEX)
