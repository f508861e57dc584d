"""The precision modes: what float32 loses, mixed keeps.

Catches: an overlap taken as a difference in float32, a velocity or position added up in float32.
"""

import numpy as np
import pytest

from gpudem.driver import simulate as run
from gpudem.scene import Scene
from tests.gpudem.beds import gas
from tests.reference.emulator import emulate
from tests.reference.scenes import AGREEMENT, OURS

pytestmark = pytest.mark.long

COLUMNS = ("position", "velocity", "angular_velocity")


@pytest.mark.parametrize("name", [name for name in [*AGREEMENT, *OURS] if "bed" not in name])
def test_mixed_follows_every_law(name):
    """1e-6 of the scale, in positions 1e-7: forces carry 6e-8, a contact adds up some hundred of them.

    With cohesion twice that: a normal force is the difference of two, each with 6e-8 of its own size.
    """
    scene = (AGREEMENT | OURS)[name]()
    ours, theirs = run(scene, precision="mixed").trace, emulate(scene)
    apart = {}
    for column in COLUMNS:
        scale = max(np.abs(theirs[column]).max(), 1e-300)
        bound = (1e-7 if column == "position" else 1e-6) * (1 + scene.needs.cohesion)
        apart[column] = np.abs(ours[column] - theirs[column]).max() / scale
        assert apart[column] < bound, column
    assert apart["velocity"] > 1e-11  # it was not float64, which agrees to 1e-12


def resting(precision: str) -> tuple[float, float]:
    """(speed [m/s], net force / weight) of a ball at the paper's stiffness, after coming to rest."""
    scene = Scene(
        name="resting",
        materials={"ball": {"young": 3.25e9, "poisson": 0.34, "density": 1768.0}},
        pairs=[{"materials": ("ball", "ball"), "restitution": 0.3}],
        particles={
            "source": "explicit", "material": "ball", "radius": 0.003, "position": [(0.7, 0.4, 0.803)],
            "velocity": [(0.0, 0.0, -1e-3)],
        },
        walls=[{"kind": "plane", "name": "floor", "material": "ball", "point": (0, 0, 0.8),
                "normal": (0, 0, 1)}],
        gravity=(0, 0, -9.81), domain={"lo": (0, 0, 0), "hi": (1, 1, 1)},
        time={"step": 2e-7, "duration": 0.004}, output={"trace_every": 0.004},
    )  # fmt: skip
    trace = run(scene, precision=precision).trace
    weight = 9.81 * 1768.0 * 4 / 3 * np.pi * 0.003**3
    return float(np.abs(trace["velocity"][-1]).max()), float(trace["force"][-1, 0, 2] / weight)


def test_a_stiff_ball_comes_to_rest_in_mixed():
    """Net force and speed die away as in float64. In float32 the ball freezes while its velocity
    says it moves: a step of 1e-10 m is lost in a position of 1 m."""
    exact, mixed, single = (resting(p) for p in ("float64", "mixed", "float32"))
    assert exact[0] < 1e-8
    assert mixed[0] < 1e-8
    assert abs(mixed[1]) < 1e-5
    assert single[0] > 1e-4


def test_energy_of_a_gas_in_mixed_is_that_of_float64():
    scene = gas(time={"step": 1e-6, "duration": 0.01}, output={"history_every": 1e-4})
    apart = [h[h.contacts == 0].kinetic_energy.to_numpy() for h in
             (run(scene, precision=p).history for p in ("float64", "mixed"))]  # fmt: skip
    drift = [np.abs(e / e[0] - 1).max() for e in apart]
    assert drift[0] < 2e-5
    assert drift[1] < 2e-5
