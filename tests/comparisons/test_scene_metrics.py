"""Measures of `gpudem compare SCENE`: contacts by geometry, growth of rounding, numbers of a flow."""

from __future__ import annotations

import math

import numpy as np
import pytest

from comparisons.metrics import bulk, contacts, growth
from comparisons.metrics.parting import differences
from gpudem.scene import Scene


def test_contacts_across_a_periodic_side():
    """Detects: a contact through a periodic side that is missed, or one that is found twice."""
    position = np.array([[0.001, 0.0, 0.0], [0.099, 0.0, 0.0], [0.05, 0.0, 0.0], [0.0595, 0.0, 0.0]])
    radius, period = np.full(4, 0.005), np.array([0.1, 0.0, 0.0])
    found = contacts.find(position, radius, period)
    assert sorted(map(tuple, found.pairs.tolist())) == [(0, 1), (2, 3)]
    row = found.pairs.tolist().index([0, 1])
    assert found.overlap[row] == pytest.approx(0.008)
    assert found.normal[row] == pytest.approx([1.0, 0.0, 0.0])  # from particle 2, through the side
    assert found.largest_overlap(radius) == pytest.approx(1.6)
    assert len(contacts.find(position, radius, np.zeros(3))) == 1


def test_contacts_with_walls():
    """Detects: a wall whose normal or place is not taken into account."""
    found = contacts.find(np.array([[0.02, 0.02, 0.004], [0.02, 0.02, 0.06]]), np.full(2, 0.005), np.zeros(3),
                          box().wall_elements)  # fmt: skip
    assert found.wall_pairs.tolist() == [[0, 0]]
    assert found.wall_overlap == pytest.approx([0.001])


def test_growth_of_a_rounding_difference():
    """Detects: another unit of the rate, a fit over the saturated part, growth where there is none."""
    time = np.linspace(0, 1, 201)
    exponential = growth.running_envelope([1e-15 * np.exp(40 * time)], np.full(201, 1e-18))
    found = growth.growth(time, np.minimum(exponential, 1.0), 1e-3)
    assert found.rate == pytest.approx(40, rel=1e-6)
    assert found.decade == pytest.approx(math.log(10) / 40, rel=1e-6)
    assert found.correlation == pytest.approx(1.0)
    assert growth.horizon(time, exponential, 1e-3) == pytest.approx(math.log(1e12) / 40, abs=0.005)
    slow = growth.growth(time, 1e-15 * (1 + 100 * time), 1e-3)
    assert slow.rate is None
    assert slow.factor == pytest.approx(101)
    assert math.isinf(slow.decade)
    assert math.isinf(growth.horizon(time, 1e-15 * (1 + time), 1e-3))


def test_an_envelope_never_falls_and_keeps_its_floor():
    """Detects: a difference that happens to pass through zero and then accuses another code."""
    runs = [np.array([0.0, 2.0, 1.0, 0.0]), np.array([0.0, 1.0, 1.5, 0.0])]
    found = growth.running_envelope(runs, np.array([1.0, 1.0, 1.0, 3.0]))
    assert found.tolist() == [1.0, 2.0, 2.0, 3.0]


def test_what_is_not_a_number_is_beyond():
    """Detects: NaN taken for agreement."""
    assert growth.first_beyond(np.array([0.0, np.nan, 2.0]), np.ones(3)) == 1
    assert growth.first_beyond(np.array([0.0, 1.0, 1.0]), np.ones(3)) is None


FLOOR = {"kind": "plane", "name": "floor", "material": "glass", "point": (0, 0, 0), "normal": (0, 0, 1)}


def box(**changes) -> Scene:
    """Forty particles over a floor."""
    place = [[0.01 + 0.01 * (k % 8), 0.01, 0.006 + 0.01 * (k // 8)] for k in range(40)]
    return Scene(
        **{
            "name": "box", "materials": {"glass": {"young": 1e7, "poisson": 0.25, "density": 2500.0}},
            "pairs": [{"materials": ("glass", "glass")}], "gravity": (0.0, 0.0, -10.0),
            "particles": {"source": "explicit", "position": place, "radius": 0.0045, "material": "glass"},
            "walls": [FLOOR],
            "domain": {"lo": (0, 0, 0), "hi": (0.1, 0.05, 0.1)}, "time": {"step": 1e-6, "duration": 1e-3},
            **changes,
        }
    )  # fmt: skip


def trace_of(scene: Scene, velocity=(0.0, 0.0, 0.0), times: int = 5) -> dict[str, np.ndarray]:
    """Particles that stay where they are, all with one velocity."""
    state, n = scene.state, len(scene.state)
    still = np.zeros((times, n, 3))
    return {
        "step": np.arange(times), "time": np.arange(times) * 1e-3,
        "position": np.repeat(state.position[None], times, axis=0), "velocity": still + np.array(velocity),
        "angular_velocity": still, "force": still + scene.masses[:, None] * np.array(scene.gravity),
        "torque": still,
    }  # fmt: skip


def test_numbers_of_a_flow():
    """Detects: a wrong axis, energy or center; contacts with a wall that do not count."""
    scene = box()
    trace = trace_of(scene, (0.3, 0.0, -0.1))
    assert bulk.axes(scene, trace) == (2, 0)
    found = bulk.metrics(scene, trace, 2, 0)
    mass = scene.masses.sum()
    assert found["kinetic energy, mean [J]"] == pytest.approx(0.5 * mass * 0.1)
    assert found["center of mass along z, end [m]"] == pytest.approx(0.026)
    assert found["mechanical energy, end [J]"] == pytest.approx(0.5 * mass * 0.1 + mass * 10 * 0.026)
    assert found["contacts, mean [1]"] == found["overlap / smaller radius of a contact, mean [1]"] == 0.0
    low = {**trace, "position": trace["position"] - np.array([0, 0, 0.002])}
    found_low = bulk.metrics(scene, low, 2, 0)
    assert found_low["contacts, mean [1]"] == 8
    assert found_low["overlap / smaller radius of a contact, mean [1]"] == pytest.approx(0.0005 / 0.0045)
    assert found["front along x, end [m]"] == pytest.approx(0.0845)
    assert found["velocity along x, middle third, mean [m/s]"] == pytest.approx(0.3)
    _, heights = bulk.height_profile(scene, trace["position"][-1], 2, 0, 4)
    assert heights == pytest.approx([0.0505, 0.0505, 0.0505, 0.0465], abs=1e-9)  # 0.9 quantile of few


def test_potential_energy_along_periodic_sides_is_left_out():
    """Detects: an energy that jumps when a particle passes a side."""
    scene = box(gravity=(1.0, 0.0, -9.0), domain={"lo": (0, 0, 0), "hi": (0.1, 0.05, 0.1),
                                                  "periodic": (True, False, False)})  # fmt: skip
    assert "potential" not in bulk.energies(scene, trace_of(scene))
    assert "center of mass along x, end [m]" not in bulk.metrics(scene, trace_of(scene), 2, 0)


def test_differences_are_those_of_the_nearest_image():
    """Detects: two codes that wrap positions at another step, taken for a difference of a domain's length."""
    scene = box(domain={"lo": (0, 0, 0), "hi": (0.1, 0.05, 0.1), "periodic": (True, False, False)})
    one, two = trace_of(scene), trace_of(scene)
    two["position"] = two["position"] + np.array([0.1 + 1e-9, 0.0, 0.0])
    two["angular_velocity"] = two["angular_velocity"] + 2.0
    found = differences(scene, one, two)
    assert found["position"] == pytest.approx(np.full((5, 40), 1e-9), rel=1e-4)
    assert found["speed"] == pytest.approx(np.full((5, 40), 2.0 * math.sqrt(3) * 0.0045))
    with pytest.raises(ValueError, match="different steps"):
        differences(scene, one, trace_of(scene, times=4))
