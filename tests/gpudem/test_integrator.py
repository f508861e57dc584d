"""The `path` integrator: second order with damping and with sliding friction, where `half_step` is first.

Catches: a window that does not join the next, the part of a window before the touch or after the end lost, a
predicted velocity of the wrong time, a spring stretched by a whole step in the step of the touch.
"""

import numpy as np
import pytest

from comparisons.metrics.trace import observed_order
from comparisons.oracles.impact import impact
from gpudem.driver import simulate as run
from gpudem.scene import Scene
from gpudem.solver.spec import Spec
from tests.gpudem.beds import falling_bed, gas

CONTACT_TIME = 7e-4
STEPS = (60, 180, 540)


def scene(steps: int, restitution: float, **contact) -> Scene:
    """Oblique impact of unequal spheres, touching in mid-step, `steps` steps a contact."""
    step = CONTACT_TIME / steps
    flight, velocity = 6.37 * CONTACT_TIME / STEPS[0], np.array([0.5, 0.4, 0.1])
    touch = np.array([0.0061, 0.0, 0.0])
    return Scene(
        name="oblique",
        materials={"ball": {"young": 5e6, "poisson": 0.34, "density": 1768.0}},
        pairs=[{"materials": ("ball", "ball"), "restitution": restitution, "friction": 0.1}],
        contact=contact,
        particles={
            "source": "explicit", "material": "ball", "radius": [0.003, 0.0031],
            "position": [-flight * velocity, touch + flight * velocity],
            "velocity": [velocity, -velocity],
        },
        domain={"lo": (-0.02,) * 3, "hi": (0.02,) * 3},
        time={"step": step, "duration": 1.4 * CONTACT_TIME},
        output={"trace_every": step},
    )  # fmt: skip


def order(integrator: str, restitution: float, **contact) -> tuple[float, float]:
    """(observed order of the largest position error, its value at the finest step / largest overlap)."""
    errors = []
    for steps in STEPS:
        stated = scene(steps, restitution, **contact)
        truth, trace = impact(stated, 0, 1), run(stated, integrator=integrator).trace
        error = np.abs(trace["position"] - truth.at(trace["time"])["position"]).max()
        errors.append(error / truth.contact.peak_overlap)
    return observed_order([1 / s for s in STEPS], errors), errors[-1]


def test_second_order_with_damping():
    """Coulomb without pull and dashpot: the law itself has no jump."""
    law = {"limit_force": True, "tangential_damping": False}
    plain, path = order("half_step", 0.5, **law), order("path", 0.5, **law)
    assert 0.85 < plain[0] < 1.3
    assert path[0] > 1.8
    assert path[1] < plain[1] / 20


def test_elastic_scenes_share_one_kernel():
    """Nothing depends on velocity there: the same Spec, so the same bits."""
    assert Spec.of(gas()) == Spec.of(gas(solver={"integrator": "path"}))
    assert Spec.of(falling_bed(10)) != Spec.of(falling_bed(10, solver={"integrator": "path"}))


def test_path_does_not_depend_on_cores():
    """Catches predicted velocities left behind by the re-ordering."""
    bed = falling_bed(2500, solver={"integrator": "path"}, time={"step": 4e-5, "duration": 0.04},
                      output={"history_every": 0.01})  # fmt: skip
    one, two = run(bed, threads=1), run(bed, threads=2)
    assert one.notes["rebuilds"] > 10
    assert np.array_equal(one.history.to_numpy(), two.history.to_numpy())
    plain = run(bed, integrator="half_step").history
    assert one.history.kinetic_energy.iloc[1] == pytest.approx(plain.kinetic_energy.iloc[1], rel=0.02)
