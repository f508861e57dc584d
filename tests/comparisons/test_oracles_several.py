"""Oracles of more than two bodies: columns, waves in them, a ball on four others, spheres in a row."""

import dataclasses
import math

import numpy as np
import pytest

from comparisons.oracles.bodies import Bodies
from comparisons.oracles.chain import Chain
from comparisons.oracles.several import row_of_spheres, squeezed

MASS, RADIUS, STAR, G = 2e-4, 3e-3, 3e6, 9.81
FLOOR = Bodies((MASS, math.inf), (RADIUS, math.inf), STAR, 1e6, 1.0, 0.0)
PAIR = dataclasses.replace(FLOOR, mass=(MASS, MASS), radius=(RADIUS, RADIUS))


def test_a_column_at_rest_balances():
    # the load of the contact above counted for the one below; R instead of R* = R/2
    chain = Chain(4, FLOOR, PAIR, G)
    up = 4 / 3 * STAR * math.sqrt(RADIUS) * chain.overlap[0] ** 1.5
    assert up == pytest.approx(4 * MASS * G)
    top = 4 / 3 * STAR * math.sqrt(RADIUS / 2) * chain.overlap[3] ** 1.5
    assert top == pytest.approx(MASS * G)
    assert np.diff(chain.height) == pytest.approx(2 * RADIUS - chain.overlap[1:])
    assert chain.height[0] == pytest.approx(RADIUS - chain.overlap[0])


def test_a_small_push_swings_at_the_frequency_of_the_contact():
    # a spring constant without the 3/2 of the derivative; a wave that loses energy
    chain = Chain(1, FLOOR, PAIR, G)
    frequency = math.sqrt(1.5 * MASS * G / chain.overlap[0] / MASS)
    way, velocity = chain.motion(np.array([-1e-6]), math.pi / frequency)
    assert velocity == pytest.approx([1e-6], rel=1e-4)
    assert abs(way[0]) < 1e-4 * 1e-6 / frequency
    way, _ = chain.motion(np.array([-1e-6]), 0.5 * math.pi / frequency)
    assert way == pytest.approx([-1e-6 / frequency], rel=1e-3)


def test_momentum_of_a_wave_before_it_reaches_the_floor():
    # a force that acts on one of its two balls alone
    chain = Chain(200, FLOOR, PAIR, G)
    push = np.zeros(200)
    push[-1] = -1e-5
    _, velocity = chain.motion(push, 5e-3)
    assert velocity.sum() == pytest.approx(-1e-5, rel=1e-6)
    assert np.abs(velocity[-1]) < 0.5e-5  # it has moved on


def test_a_ball_on_four_sinks_by_the_balance_of_forces():
    # the weight shared by three; the sides pushed by the whole force instead of its share along them
    weight = 0.05
    top = Bodies((weight / G, MASS), (1.5 * RADIUS, RADIUS), STAR, 1e6, 1.0, 0.0)
    side, floor, sunk = squeezed(FLOOR, top, G)
    out, rise = RADIUS + side, math.sqrt(4.25) * RADIUS + floor - sunk
    apart = math.sqrt(2 * out**2 + rise**2)
    pair = top.normal_constant * (2.5 * RADIUS - apart) ** 1.5
    assert 4 * pair * rise / apart == pytest.approx(weight, rel=1e-9)
    assert FLOOR.normal_constant * side**1.5 == pytest.approx(pair * out / apart, rel=1e-9)
    assert FLOOR.normal_constant * floor**1.5 == pytest.approx(MASS * G + weight / 4, rel=1e-9)


@pytest.mark.parametrize("restitution", [1.0, 0.7])
def test_two_spheres_in_a_row_part_with_the_restitution(restitution):
    # a dashpot with the wrong sign or mass; momentum lost
    pair = dataclasses.replace(PAIR, mass=(MASS, 3 * MASS), restitution=restitution)
    found = row_of_spheres([pair], np.array([0.0, 2.001 * RADIUS]), np.array([0.0, -1.0]), 0.01)
    assert found[1] - found[0] == pytest.approx(restitution, rel=1e-3)
    assert found[0] + 3 * found[1] == pytest.approx(-3.0, rel=1e-9)


def test_a_row_of_three_passes_the_blow_on():
    # a force applied to the wrong neighbour
    found = row_of_spheres([PAIR, PAIR], np.array([0.0, 2.1, 4.2]) * RADIUS, np.array([0.0, 0.0, -1.0]), 0.02)
    assert found == pytest.approx([-1.0, 0.0, 0.0], abs=1e-6)
