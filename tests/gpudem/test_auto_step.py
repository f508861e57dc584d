"""step = "auto": the accuracy that is stated is the accuracy that comes out, without waste."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from comparisons.oracles.impact import impact
from gpudem.driver import simulate as run
from gpudem.scene import Scene
from gpudem.scene.time_step import (
    USUAL_CONTACT,
    USUAL_RAYLEIGH,
    contact_time,
    min_restitution,
    rayleigh_time,
    step_for,
)
from tests.gpudem.beds import falling_bed
from tests.gpudem.test_integrator import scene as oblique

LAW = {"limit_force": True, "tangential_damping": False}


def automatic(restitution: float, accuracy: float, integrator: str) -> Scene:
    """The oblique impact of unequal spheres at the step that the accuracy needs."""
    stated = oblique(60, restitution, **LAW)
    data = stated.model_dump()
    data["time"] = {"step": "auto", "accuracy": accuracy, "duration": stated.time.duration}
    data["solver"]["integrator"] = integrator
    data["output"]["trace_every"] = 1e-9
    return Scene(**data)


@pytest.mark.parametrize("integrator", ["half_step", "path"])
@pytest.mark.parametrize("accuracy", [1e-2, 1e-3])
@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.9, 1.0])
def test_the_stated_accuracy_is_reached(restitution, accuracy, integrator):
    """Catches a contact time of another law or speed, an order taken for another; a step far too small."""
    stated = automatic(restitution, accuracy, integrator)
    truth, trace = impact(stated, 0, 1), run(stated).trace
    error = np.abs(trace["position"] - truth.at(trace["time"])["position"]).max() / truth.contact.peak_overlap
    assert error < accuracy
    assert error > accuracy / 30 or stated.time.step == step_for(stated, 0.1)  # 20 steps a contact at least


@pytest.mark.parametrize("damping", [0.0, 3e4, 1.5e5])
def test_hertz_stiffness_reaches_its_accuracy(damping):
    """Catches a restitution guessed for a law that states none: steps a hundred times too many, or too few.

    Head-on against a wall at 1 m/s; the truth is the law's own equation, solved again here.
    """
    radius, kn, accuracy = 0.003, 1e7, 1e-3
    mass = 1768 * 4 / 3 * np.pi * radius**3
    stated = Scene(
        name="impact", materials={"ball": {"young": 5e6, "poisson": 0.34, "density": 1768.0}},
        pairs=[{"materials": ("ball", "ball"), "restitution": 0.9, "kn": kn, "kt": 0.0, "gamma_n": damping,
                "gamma_t": 0.0}],
        contact={"normal": "hertz/stiffness", "tangential": "off"},
        particles={"source": "explicit", "position": [[0, 0, 1.0001 * radius]], "velocity": [[0, 0, -1.0]],
                   "radius": radius, "material": "ball"},
        walls=[{"kind": "box", "name": "floor", "material": "ball", "sides": ["zlo"]}],
        domain={"lo": (-0.1, -0.1, 0.0), "hi": (0.1, 0.1, 0.1)},
        time={"step": "auto", "accuracy": accuracy, "duration": 2e-3}, output={"trace_every": 1e-9},
    )  # fmt: skip

    def slope(_, y):
        d = max(radius - y[0], 0.0)
        q = np.sqrt(radius * d)
        return [y[1], q * (kn * d - damping * mass * y[1]) / mass]

    trace = run(stated).trace
    assert trace is not None
    time = trace["time"]
    start = [1.0001 * radius, -1.0]
    found = solve_ivp(slope, (0, time[-1]), start, t_eval=time, rtol=1e-11, atol=1e-15, max_step=1e-6)
    deepest = radius - found.y[0].min()
    out = found.y[1, -1]
    assert out > 0
    assert min_restitution(stated) == pytest.approx(out, rel=2e-3)
    error = np.abs(trace["position"][:, 0, 2] - found.y[0]).max() / deepest
    assert error < accuracy
    assert error > accuracy / 100


def test_the_resolved_scene_states_the_step():
    one = automatic(0.5, 1e-3, "path")
    assert json.loads(one.to_json())["time"]["step"] == one.time.step == step_for(one, 1e-3)
    assert Scene.from_json(one.to_json()) == one


def test_the_usual_limits_hold_where_accuracy_would_allow_more():
    rough = falling_bed(50, time={"step": "auto", "accuracy": 0.1, "duration": 0.01})
    usual = min(USUAL_RAYLEIGH * rayleigh_time(rough), USUAL_CONTACT * contact_time(rough))
    assert rough.time.step <= usual * (1 + 1e-12)


def test_contact_time_of_each_law():
    """hertz/stiffness with kn = 4/3 E* is hertz; hooke's is half a period of its oscillator."""
    one = oblique(60, 0.5, **LAW)
    star = 5e6 / (2 * (1 - 0.34**2))
    constants = {"kn": 4 / 3 * star, "kt": 1e6, "gamma_n": 0.0, "gamma_t": 0.0}
    pairs = [{**one.model_dump()["pairs"][0], **constants}]
    stiffness = one.replace(pairs=pairs, contact={"normal": "hertz/stiffness"})
    assert contact_time(stiffness) == pytest.approx(contact_time(one), rel=1e-12)
    hooke = one.replace(contact={"normal": "hooke", "characteristic_velocity": 1.0})
    mass, radius = 1768 * 4 / 3 * np.pi * 0.003**3 / 2, 0.0015
    k = 16 / 15 * radius**0.5 * star * (15 * mass / (16 * radius**0.5 * star)) ** 0.2
    assert contact_time(hooke) == pytest.approx(np.pi * (mass / k) ** 0.5, rel=1e-6)
