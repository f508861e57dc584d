"""Kinetic theory of a gas of smooth spheres in a periodic box: collision rate, pressure, cooling.

T [m2/s2] is the mean square of one velocity component, n [1/m3] the number density, phi the volume share.
Sources: Carnahan and Starling, J. Chem. Phys. 51 (1969) 635; Chapman and Cowling (1970); Haff, J. Fluid Mech.
134 (1983) 401; van Noije and Ernst, Granular Matter 1 (1998) 57 (second Sonine coefficient).
"""

from __future__ import annotations

import math


def volume_share(diameter: float, density: float) -> float:
    """Phi [1] = pi/6 n d^3."""
    return math.pi / 6 * density * diameter**3


def contact_value(phi: float) -> float:
    """Pair distribution at contact g [1] (Carnahan and Starling): (1 - phi/2)/(1 - phi)^3."""
    return (1 - phi / 2) / (1 - phi) ** 3


def compressibility(phi: float) -> float:
    """Z = p V/(N m T) of hard spheres: 1 + 4 phi g = (1 + phi + phi^2 - phi^3)/(1 - phi)^3."""
    return 1 + 4 * phi * contact_value(phi)


def collision_rate(diameter: float, density: float, temperature: float, g: float) -> float:
    """Collisions of one sphere per second (Enskog): 4 sqrt(pi) n d^2 g sqrt(T)."""
    return 4 * math.sqrt(math.pi) * density * diameter**2 * g * math.sqrt(temperature)


def soft_diameter(diameter: float, stiffness: float, mass: float, temperature: float) -> float:
    """Diameter [m] of the hard sphere that a linear spring k equals: d - sqrt(pi m T/(2 k)).

    Barker and Henderson (1967): integral of 1 - exp(-U/(m T)) dr with U = k (d - r)^2/2.
    """
    return diameter - math.sqrt(math.pi * mass * temperature / (2 * stiffness))


def haff_slope(diameter: float, density: float, restitution: float) -> float:
    """d(T^-1/2)/dt [1/m] of a cooling gas: T = T0/(1 + t/tau)^2 with 1/tau = slope sqrt(T0).

    slope = (2/3) sqrt(pi) (1 - e^2) n d^2 g (1 + 3 a2/16),
    a2 = 16 (1 - e)(1 - 2 e^2)/(81 - 17 e + 30 e^2 (1 - e)): each collision takes (1 - e^2) m v_n^2/4.
    """
    e = restitution
    a2 = 16 * (1 - e) * (1 - 2 * e * e) / (81 - 17 * e + 30 * e * e * (1 - e))
    g = contact_value(volume_share(diameter, density))
    return 2 / 3 * math.sqrt(math.pi) * (1 - e * e) * density * diameter**2 * g * (1 + 3 * a2 / 16)
