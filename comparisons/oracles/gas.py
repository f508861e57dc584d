"""Kinetic theory of a gas of smooth spheres, or disks, in a periodic box: collision rate, pressure, cooling.

T [m2/s2] is the mean square of one velocity component, n [1/m3] the number density, phi the volume share.
Sources: Carnahan and Starling, J. Chem. Phys. 51 (1969) 635; Chapman and Cowling (1970); Haff, J. Fluid Mech.
134 (1983) 401; van Noije and Ernst, Granular Matter 1 (1998) 57 (second Sonine coefficient); Henderson, Mol.
Phys. 30 (1975) 971; Luding, Phys. Rev. E 63 (2001) 042201 (disks); Clisby and McCoy, J. Stat. Phys. 122
(2006) 15 (virial coefficients).
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


def virial_series(phi: float) -> float:
    """Z of hard spheres from the second to the tenth virial coefficient; at phi = pi/12 1e-4 are left out.

    Above Carnahan and Starling there: 3.2691 against 3.2624.
    """
    coefficients = (4, 10, 18.36477, 28.22445, 39.81515, 53.34442, 68.538, 85.813, 105.78)
    return 1 + sum(b * phi**k for k, b in enumerate(coefficients, 1))


def henderson(eta: float) -> float:
    """Pair distribution of disks at contact g [1], area share eta: (1 - 7 eta/16)/(1 - eta)^2."""
    return (1 - 7 * eta / 16) / (1 - eta) ** 2


def disk_contact_value(eta: float) -> float:
    """Luding's correction of Henderson's g [1]: less (eta^3/16)/(8 (1 - eta)^4)."""
    return henderson(eta) - eta**3 / 16 / (8 * (1 - eta) ** 4)


def disk_compressibility(eta: float, g: float) -> float:
    """Z = p A/(N m T) of hard disks with a pair distribution at contact g: 1 + 2 eta g."""
    return 1 + 2 * eta * g


def rate_of_pressure(z: float, diameter: float, temperature: float, axes: int) -> float:
    """Collisions of one per second that go with a Z [1/s]: 2 axes (Z - 1) sqrt(T/pi)/d.

    Each brings an impulse of m sqrt(pi T) on average: exact in equilibrium at any density.
    """
    return 2 * axes * (z - 1) * math.sqrt(temperature / math.pi) / diameter


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
