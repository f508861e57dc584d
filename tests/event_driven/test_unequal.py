"""Hard spheres of unequal masses and radii: one oblique impact in closed form, and columns of the history.

Detects: a reduced mass, lever arm or moment of inertia of equal spheres; a wall that takes another particle's
radius; energies or a centre of mass by the first particle's mass.
"""

import numpy as np
import pytest

from gpudem import event_driven
from gpudem.event_driven.engine import Engine
from gpudem.event_driven.problem import HardSphereProblem
from tests.event_driven import scenes

RADII = np.array([0.02, 0.035])
DENSITY = 3000.0
MASSES = DENSITY * 4 / 3 * np.pi * RADII**3


@pytest.mark.parametrize("order", [1, -1], ids=["small first", "large first"])
@pytest.mark.parametrize(("mu", "beta"), [(0.2, 1.0), (10.0, 0.3)], ids=["slides", "sticks"])
def test_oblique_impact(mu, beta, order):
    """J_n = (1 + e) m* v_n; J_t = min((1 + beta) 2/7 m* v_t, mu J_n); spins R J_t/I, each with its own R."""
    radii, masses, e = RADII[::order], MASSES[::order], 0.8
    v = np.array([[0.9, 0.0, -1.1], [-0.4, 0.0, 0.6]])
    touch = np.array([[0, 0, radii[0]], [0, 0, -radii[1]]])
    scene = scenes.scene(touch - 0.05 * v, v, radius=radii, density=DENSITY, restitution=e, friction=mu)
    engine = Engine(HardSphereProblem.from_scene(scene, tangential_restitution=beta))
    engine.advance(0.06)
    assert engine.counts.collisions == 1
    reduced = masses[0] * masses[1] / masses.sum()
    relative = v[0] - v[1]
    push = (1 + e) * reduced * -relative[2]
    drag = min((1 + beta) * 2 / 7 * reduced * relative[0], mu * push)
    after = v + np.array([[-drag, 0, push], [drag, 0, -push]]) / masses[:, None]
    spin = np.zeros((2, 3))
    spin[:, 1] = drag * radii / (0.4 * masses * radii**2)
    assert engine.state()[1] == pytest.approx(after, abs=1e-12)
    assert engine.angular_velocity == pytest.approx(spin, abs=1e-10)
    lost = 0.5 * (masses * ((v**2) - (after**2)).sum(axis=1)).sum()
    lost -= 0.5 * (0.4 * masses * radii**2 * (spin**2).sum(axis=1)).sum()
    assert engine.sums.dissipated == pytest.approx(lost, rel=1e-10)


def test_each_meets_the_wall_at_its_own_radius():
    """Both fall from one height: the larger touches first; times by its own radius."""
    scene = scenes.scene(
        [[-0.3, 0, 0.2], [0.3, 0, 0.2]], [[0, 0, -1.0]] * 2, radius=RADII, density=DENSITY, sides=("zlo",),
        lo=(-1, -1, 0), duration=0.4, wall_restitution=0.5,
        output={"history_every": 0.01, "trace_every": 0.01},
    )  # fmt: skip
    done = event_driven.run(scene)
    assert done.trace is not None
    assert done.history is not None
    t = done.trace["time"][:, None]
    hit = 0.2 - RADII
    height = np.where(t < hit, 0.2 - t, RADII + 0.5 * (t - hit))
    assert np.abs(done.trace["position"][:, :, 2] - height).max() < 1e-12
    speed = np.where(t < hit, 1.0, 0.5)
    assert np.allclose(done.history["kinetic_energy"], 0.5 * speed**2 @ MASSES, rtol=1e-12)
    assert np.allclose(done.history["centre_z"], height @ MASSES / MASSES.sum(), rtol=1e-12)
    assert np.allclose(done.history["centre_x"], 0.3 * (MASSES[1] - MASSES[0]) / MASSES.sum(), rtol=1e-12)
