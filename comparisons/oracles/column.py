"""Hard spheres under gravity over a floor, in equilibrium: one temperature, and how they thin out upwards.

T [m2/s2] is the mean square of one velocity component, g [m/s2] gravity, cover [1/m2] spheres per floor area,
height counts from where a sphere touches the floor. Each height is in local equilibrium, after Carnahan and
Starling (1969): d(phi Z)/dheight = -g phi/T. At the floor there are more, by the second virial coefficient:
who stands less than a diameter above it has no neighbours below, which leaves room for n^2 pi d^4/4 more
spheres an area, 4/15 d above touching on average.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import root_scalar

from comparisons.oracles import gas


@dataclasses.dataclass(frozen=True)
class Column:
    """The profile in local equilibrium, without the layer at the floor, and what follows with it."""

    temperature: float
    height: np.ndarray
    """[m], ascending from 0."""
    phi: np.ndarray
    """Volume share at each height."""
    layer: float
    """Share of all spheres that the layer at the floor has more than the profile says."""
    centre: float
    """Mean height [m], with the layer."""

    def share_below(self, height: np.ndarray) -> np.ndarray:
        """Share of the profile's spheres below a height [m], without the layer."""
        below = cumulative_trapezoid(self.phi, self.height, initial=0)
        return np.interp(height, self.height, below / below[-1])


def column(temperature: float, gravity: float, diameter: float, cover: float) -> Column:
    """The column of a temperature."""
    volume, layer, phi0 = math.pi / 6 * diameter**3, 0.0, 0.0
    for _ in range(50):  # the layer bears itself: the profile above carries the weight of the rest
        load = (1 - layer) * cover * gravity / temperature * volume
        phi0 = root_scalar(
            lambda p, load=load: p * gas.compressibility(p) - load, bracket=(0.0, 0.9), xtol=1e-15
        ).root
        layer = (phi0 / volume) ** 2 * math.pi * diameter**4 / 4 / cover
    phi = phi0 * np.concatenate([np.linspace(1, 0.01, 4000), np.geomspace(0.01, 1e-12, 4000)[1:]])
    pressure = np.array([p * gas.compressibility(p) for p in phi])
    steps = -np.diff(pressure) / np.sqrt(phi[1:] * phi[:-1]) * temperature / gravity
    height = np.concatenate([[0.0], np.cumsum(steps)])
    mean = float(np.trapezoid(phi * height, height) / np.trapezoid(phi, height))
    centre = (1 - layer) * mean + layer * 4 / 15 * diameter
    return Column(temperature, height, phi, layer, centre)


def of_energy(energy: float, freedom: float, gravity: float, diameter: float, cover: float) -> Column:
    """The column of an energy [m2/s2] a mass, freedom/2 T + g height; `freedom` degrees a sphere."""

    def error(temperature: float) -> float:
        high = column(temperature, gravity, diameter, cover).centre
        return freedom / 2 * temperature + gravity * high - energy

    top = 2 * energy / freedom
    found = root_scalar(error, bracket=(0.05 * top, top), xtol=1e-10 * top).root
    return column(found, gravity, diameter, cover)


def floor_rate(count: int, gravity: float, temperature: float) -> float:
    """Hits on the floor per second [1/s]: each brings 2 m sqrt(pi T/2) on average, together N m g."""
    return count * gravity / math.sqrt(2 * math.pi * temperature)
