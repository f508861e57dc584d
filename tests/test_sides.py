"""Particles on, or rounded to, the sides of a domain: never outside, never at two places, in any code."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpudem import driver, event_driven
from gpudem.output.vtu import write_vtu
from gpudem.scene import Domain, Explicit, FromFile, Material, Pair, Plane, Scene, SceneError, Time
from gpudem.scene.packing import InitialState

#: Sides whose length, or whose sums with it, are not exact: none is 0 or opposite to the other.
DOMAINS = [(0.1, 0.3), (-0.05, 0.05), (1e-3, 0.7), (-0.3, -0.1), (100.1, 100.4), (0.0, 0.1), (-1 / 3, 1 / 7)]


def scene(position, lo: float, hi: float, periodic: bool = True, **more) -> Scene:
    """Balls of 1 mm in a domain lo..hi along x, periodic there, 2 m wide along y and z."""
    return Scene(
        **{
            "name": "sides",
            "materials": {"a": Material(young=5e6, poisson=0.3, density=2500)},
            "pairs": [Pair(materials=("a", "a"))],
            "particles": {"source": "explicit", "position": position, "radius": 1e-3, "material": "a"},
            "domain": Domain(lo=(lo, -1, -1), hi=(hi, 1, 1), periodic=(periodic, False, False)),
            "time": Time(step=1e-6, duration=1e-5),
            **more,
        }
    )


def places(lo: float, hi: float) -> list[float]:
    """On the sides, one number beyond them, and as a run in float32 rounds and writes them."""
    singles = [float(np.float32(x)) for x in (lo, hi)]
    beyond = [np.nextafter(lo, -np.inf), np.nextafter(hi, np.inf), np.nextafter(hi, -np.inf)]
    around = [float(np.nextafter(np.float32(x), np.float32(s))) for x in (lo, hi) for s in (-np.inf, np.inf)]
    return [lo, hi, *singles, *map(float, beyond), *around]


@pytest.mark.parametrize(("lo", "hi"), DOMAINS)
def test_on_a_periodic_side_is_inside(lo: float, hi: float) -> None:
    """lo <= x < hi in every code, each within a rounding of where it was, modulo the length."""
    stated = places(lo, hi)
    one = scene([[x, 0.01 * k, 0.0] for k, x in enumerate(stated)], lo, hi)
    x = one.state.position[:, 0]
    assert ((x >= lo) & (x < hi)).all()
    apart = np.abs(x - stated)
    slack = 2.0**-22 * max(abs(lo), abs(hi))
    assert np.minimum(apart, np.abs(apart - (hi - lo))).max() <= slack
    within = [k for k, value in enumerate(stated) if lo <= value < hi]
    assert (x[within] == np.array(stated)[within]).all(), "what lies within stays to the bit"
    assert one.state.position[1, 0] == pytest.approx(lo, abs=1e-16 * max(abs(lo), abs(hi)) * 4), (
        "the upper face"
    )
    assert one.particles.position[1, 0] == hi, "the statement is not changed"
    assert Scene.from_json(one.to_json()) == one


@given(lo=st.floats(-1e3, 1e3), length=st.floats(1e-2, 1e3), below=st.floats(0, 1e-7))
@settings(max_examples=100, deadline=None)
def test_any_domain(lo: float, length: float, below: float) -> None:
    """Catches x % length giving the length itself for a tiny negative x, and hi - (hi - lo) below lo."""
    hi = lo + length
    x = [lo, hi, lo - below * abs(lo), hi + below * abs(hi), np.nextafter(lo, -np.inf), lo - 1e-300]
    position = np.zeros((len(x), 3))
    position[:, 0] = x
    state = InitialState.build(position, 1.0, 0).within(
        (lo, -1.0, -1.0), (hi, 1.0, 1.0), (True, False, False)
    )
    assert ((state.position[:, 0] >= lo) & (state.position[:, 0] < hi)).all()


@pytest.mark.parametrize(("lo", "hi"), DOMAINS)
def test_rounded_beyond_another_side_is_on_it(lo: float, hi: float) -> None:
    stated = places(lo, hi)
    one = scene([[x, 0.01 * k, 0.0] for k, x in enumerate(stated)], lo, hi, periodic=False)
    x = one.state.position[:, 0]
    assert ((x >= lo) & (x <= hi)).all()
    assert np.abs(x - stated).max() <= 2.0**-22 * max(abs(lo), abs(hi))
    assert x[1] == hi


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("x", [0.3 + 1e-6, 0.1 - 1e-6, 5.0])
def test_beyond_a_side_is_an_error(x: float, periodic: bool) -> None:
    """A micrometre is no rounding: a slip in the statement, along periodic sides too."""
    with pytest.raises(SceneError, match="1 outside the domain"):
        scene([[0.2, 0, 0], [x, 0, 0]], 0.1, 0.3, periodic)


@pytest.mark.parametrize(("lo", "hi"), DOMAINS)
@pytest.mark.parametrize("gap", [0.0, 1e-16, 1.7e-3, 1.95e-3])
def test_overlaps_across_a_periodic_side(lo: float, hi: float, gap: float) -> None:
    """Two balls of 1 mm overlap by more than 0.1 R up to a distance of 1.9 mm, also over the side."""
    across = [[lo + 0.4 * gap, 0, 0], [hi - 0.6 * gap, 0, 0]]
    scene(across, lo, hi, periodic=False)
    if gap > 1.9e-3:
        scene(across, lo, hi, allow=[])
        return
    with pytest.raises(SceneError, match="1 pairs overlap at the start, the worst: 1 and 2"):
        scene(across, lo, hi)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize(("lo", "hi"), DOMAINS)
def test_frames_are_read_back(lo: float, hi: float, dtype: type, tmp_path: Path) -> None:
    """What a run in any precision writes of particles at the sides is a valid start."""
    x = np.array(places(lo, hi), dtype).astype(np.float64)
    position = np.stack([x, 0.01 * np.arange(len(x)), np.zeros(len(x))], axis=1)
    none = np.zeros_like(position)
    frame = {"id": np.arange(1, len(x) + 1), "material": np.zeros(len(x), np.int32), "position": position,
             "velocity": none, "angular_velocity": none, "force": none, "torque": none,
             "radius": np.full(len(x), 1e-3)}  # fmt: skip
    write_vtu(tmp_path / "p.vtu", frame)
    for periodic in (True, False):
        file = FromFile(source="file", path=str(tmp_path / "p.vtu"))
        found = scene(None, lo, hi, periodic, particles=file).state.position[:, 0]
        assert ((found >= lo) & (found <= hi)).all()


@pytest.mark.parametrize(("tilt", "refused"), [(6e-17, False), (-1e-13, False), (1e-11, True), (1e-9, True)])
def test_hard_spheres_refuse_a_tilt_and_no_rounding(tilt: float, refused: bool) -> None:
    floor = Plane(name="floor", material="a", point=(0, 0, -1), normal=(tilt, 0, 1))
    fall = Explicit(position=[[0.2, 0, -0.99]], radius=1e-3, material="a", velocity=[[0, 0, -2000.0]])
    one = scene(None, 0.1, 0.3, periodic=False, walls=[floor], particles=fall, output={"trace_every": 1e-5})
    one = one.replace(allow=["time_step"])
    if refused:
        with pytest.raises(SceneError, match=r"walls\.floor\.normal = .*: must be along an axis"):
            event_driven.run(one)
    else:
        trace = event_driven.run(one).trace
        assert trace is not None
        assert trace["velocity"][-1, 0].tolist() == [0, 0, 2000]
    points, _ = one.planes[0].outline(np.array([0.1, -1, -1]), np.array([0.3, 1, 1]))
    assert (np.ptp(points[:, 0]) > 0.21) == refused, (
        "drawn cut to the domain only where it lies along its sides"
    )


def test_hard_spheres_and_decks_get_the_same_places() -> None:
    """A ball on the upper periodic face is at the lower one in what each code starts from."""
    from reference.liggghts import deck

    floor = Plane(name="floor", material="a", point=(0, 0, -1), normal=(0, 0, 1))
    one = scene([[0.3, 0, 0]], 0.1, 0.3, walls=[floor], output={"trace_every": 1e-5})
    x = float(one.state.position[0, 0])
    assert x == pytest.approx(0.1)
    for trace in (event_driven.run(one).trace, driver.simulate(one).trace):
        assert trace is not None
        assert trace["position"][0, 0, 0] == x
    assert f"{x:.17g} 0 0" in deck.data(one)
