"""More than two bodies: a heavy ball at rest on four light ones, and spheres that strike in a row."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from comparisons.oracles.bodies import Bodies


def squeezed(wall: Bodies, top: Bodies, gravity: float) -> np.ndarray:
    """How far [m] four equal balls in a square box sink into its sides and into its floor, and a ball that
    rests on them sinks below where it would just touch: (side, floor, top).

    The balls stand in the corners of a box four of their radii wide; no friction. Unknowns from the balance
    of forces along the side, on the floor and of the ball on top; all contacts Hertz (1882).
    `wall`: a light ball and the wall; `top`: the ball on top and a light one.
    """
    from scipy.optimize import fsolve

    r, reach = wall.radius[0], sum(top.radius)
    light, heavy = wall.mass[0], top.mass[0]
    start = math.sqrt(reach**2 - 2 * r**2)

    def parts(u: np.ndarray) -> tuple[float, float, float]:
        """(pair force [N], its share along x, its share along z)."""
        side, rise = r + u[0], start + u[1] - u[2]
        apart = math.sqrt(2 * side**2 + rise**2)
        return top.normal_constant * max(reach - apart, 0.0) ** 1.5, side / apart, rise / apart

    def balance(scaled: np.ndarray) -> list[float]:
        u = scaled * r
        force, along, up = parts(u)
        sides = [wall.normal_constant * max(x, 0.0) ** 1.5 for x in u[:2]]
        weight = heavy * gravity
        return [
            (sides[0] - force * along) / weight,
            (sides[1] - force * up) / weight - light / heavy,
            4 * force * up / weight - 1,
        ]

    found, _, ok, said = fsolve(balance, [0.01, 0.01, 0.03], xtol=1e-13, full_output=True)
    if ok != 1:
        raise ArithmeticError(f"no balance of forces: {said}")
    return found * r


def row_of_spheres(
    contacts: Sequence[Bodies], position: np.ndarray, velocity: np.ndarray, time: float
) -> np.ndarray:
    """Velocities [m/s] after a time [s] of spheres on a line, each with its contact to the next.

    F = k overlap^1.5 + c overlap^(1/4) d(overlap)/dt while they overlap: DOP853, rtol 1e-10, steps of at most
    1/2000 of the time, so that no contact is stepped over.
    """
    from scipy.integrate import solve_ivp

    mass = np.array([c.mass[0] for c in contacts] + [contacts[-1].mass[1]])
    reach = np.array([sum(c.radius) for c in contacts])
    spring = np.array([c.normal_constant for c in contacts])
    damping = np.array([c.normal_damping for c in contacts])
    n = len(mass)

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        overlap = np.maximum(reach - np.diff(y[:n]), 0.0)
        force = spring * overlap**1.5 - damping * overlap**0.25 * np.diff(y[n:])
        net = np.append(force, 0.0)  # pushes apart: the lower one down, the upper one up
        return np.concatenate([y[n:], (np.insert(force, 0, 0.0) - net) / mass])

    start = np.concatenate([position, velocity])
    solved = solve_ivp(
        slope, (0.0, time), start, method="DOP853", rtol=1e-10, atol=1e-14, max_step=time / 2000
    )
    return solved.y[n:, -1]
