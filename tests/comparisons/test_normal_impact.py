"""The power-law impact oracle against closed forms and against numbers worked out elsewhere."""

from __future__ import annotations

import math

import pytest

from comparisons.oracles import closed_forms, normal_impact
from comparisons.oracles.bodies import Bodies


def body(e: float) -> Bodies:
    return Bodies((1.0, math.inf), (1.0, math.inf), 0.75, 0.3, e, 0.0)


@pytest.mark.parametrize("limit_force", [False, True])
@pytest.mark.parametrize(("p", "q", "unit"), [(1.0, 0.0, 2.0), (1.5, 0.25, math.sqrt(5))])
@pytest.mark.parametrize("e", [0.06, 0.3, 0.9, 1.0])
def test_damped_oscillator_and_hertz_share_a_closed_form(p, q, unit, e, limit_force):
    # the end of the contact at the wrong event; a dashpot constant that is off by sqrt(5)/2
    found = normal_impact.restitution(p, q, unit * body(e).damping_ratio, limit_force)
    assert found == pytest.approx(closed_forms.restitution(body(e), limit_force), abs=1e-9)


@pytest.mark.parametrize(
    ("v_star", "e"), [(0.05, 0.997121), (0.3, 0.902852), (0.7, 0.600772), (2.0, 0.093000)]
)
def test_viscoelastic_law(v_star, e):
    # numbers integrated apart from this code; a v* defined with another power of A
    assert normal_impact.restitution(1.5, 0.5, v_star**2, True) == pytest.approx(e, abs=1e-6)


def test_viscoelastic_velocity_from_constants():
    # F = kn q (x + gamma m*/kn x'), stated in other units; and its inverse
    kn, radius, mass, speed = 5e9, 0.003, 2e-4, 0.3
    gamma = normal_impact.gamma_for(0.4, kn, radius, mass)
    assert normal_impact.viscoelastic_velocity(kn, gamma, radius, mass, 1.0) == pytest.approx(0.4, rel=1e-12)
    scale = (mass * speed**2 / (kn * math.sqrt(radius))) ** 0.4
    c = gamma * mass * math.sqrt(radius) * scale**1.5 / (mass * speed)
    v_star = normal_impact.viscoelastic_velocity(kn, gamma, radius, mass, speed)
    assert v_star**2 == pytest.approx(c, rel=1e-12)


def test_pade_is_as_good_as_it_says():
    for v_star, off in ((0.2, 1e-5), (0.4, 2e-4), (2.0, 9e-3)):
        exact = normal_impact.restitution(1.5, 0.5, v_star**2, True)
        assert normal_impact.pade(v_star) == pytest.approx(exact, abs=off)


@pytest.mark.parametrize("wanted", [0.2, 0.5, 0.9, 1.0])
def test_restitution_to_put_in_is_the_inverse_under_limit_force(wanted):
    # the two kinds of restitution mixed up
    e = closed_forms.restitution_to_put_in(wanted)
    assert closed_forms.restitution(body(e), True) == pytest.approx(wanted, abs=1e-10)
