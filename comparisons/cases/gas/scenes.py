"""Gases of spheres in a cube: their scenes, and what is measured on them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from comparisons import kit
from comparisons.oracles import linear
from gpudem.output.run import Run
from gpudem.scene import Contact, Domain, Lattice, Material, Pair, Scene

RADIUS, DENSITY, POISSON = 1e-3, 2500.0, 0.3
DIAMETER, MASS = 2 * RADIUS, DENSITY * 4 / 3 * math.pi * RADIUS**3
#: Characteristic velocity of `hooke`, by which a Young's modulus gives a spring [m/s].
SPEED = 1.0


def box_length(count: int, phi: float) -> float:
    """Edge [m] of the cube that `count` spheres fill to the volume share phi."""
    return (count * math.pi / 6 * (2 * RADIUS) ** 3 / phi) ** (1 / 3)


def stiffness(contact_time: float) -> float:
    """K [N/m] of a linear spring between two spheres: pi sqrt(m*/k) = contact time, m* = m/2."""
    return MASS / 2 * (math.pi / contact_time) ** 2


def spring_young(contact_time: float, speed: float) -> float:
    """Young's modulus [Pa] that makes `hooke` at this characteristic velocity a spring of that stiffness."""
    star = linear.young_star(stiffness(contact_time), RADIUS / 2, MASS / 2, speed)
    return 2 * (1 - POISSON**2) * star


def material(young: float) -> Material:
    """The material of all gases, with a Young's modulus [Pa]."""
    return Material(young=young, poisson=POISSON, density=DENSITY)


def springs(contact_time: float, restitution: float, wall: str = "", **contact: Any) -> dict[str, Any]:
    """Sections of a gas with linear springs through `hooke`, so that every contact lasts equally long.

    Args:
        contact_time: Time of a contact of two spheres [s].
        restitution: Of two spheres; a wall is elastic.
        wall: Material of the walls, if there are any.
        contact: Further fields of `Contact`.
    """
    names = ["ball", wall] if wall else ["ball"]
    losses = zip(names, (restitution, 1.0), strict=False)
    return {
        "materials": dict.fromkeys(names, material(spring_young(contact_time, SPEED))),
        "pairs": [Pair(materials=("ball", name), restitution=e) for name, e in losses],
        "contact": Contact(normal="hooke", characteristic_velocity=SPEED, **contact),
    }


def gas_box(name: str, count: int, phi: float, seed: int, **sections: Any) -> Scene:
    """`count` spheres of one kind on a jittered lattice, velocities normal with T = 1 m2/s2 a component.

    The cube is periodic unless `sections` give walls.
    """
    edge = box_length(count, phi)
    cells, open_ = math.ceil(count ** (1 / 3) - 1e-9), "walls" not in sections
    return Scene(
        name=name,
        particles=Lattice(
            source="lattice", material="ball", count=count, radius=RADIUS, lo=(0, 0, 0),
            hi=(edge, edge, edge),
            spacing=edge / cells / (2 * RADIUS) * (1 - 1e-9), velocity_rms=1.0, seed=seed,
        ),
        domain=Domain(lo=(0, 0, 0), hi=(edge, edge, edge), periodic=(open_, open_, open_)),
        **sections,
    )  # fmt: skip


def temperature(run: Run) -> np.ndarray:
    """T [m2/s2] in time, from the kinetic energy of the history."""
    return 2 * run.history["kinetic_energy"].to_numpy() / (3 * MASS * len(run.scene.state))


def cooling(
    results: kit.Results, code: str, since: float, prefix: str = "seed_"
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the runs of a prefix: times [s], T^-1/2 [s/m] (seeds, times), and the slope [1/m] (seeds,) of the
    straight line through T^-1/2 after a time [s]; by Haff's law it does not depend on T(0).
    """
    runs = [results[label, code] for label in results.labels(code, prefix=prefix)]
    time, values = runs[0].history["time"].to_numpy(), np.array([temperature(run) ** -0.5 for run in runs])
    late = time > since
    return time, values, np.array([np.polyfit(time[late], one[late], 1)[0] for one in values])


def growth(run: Run, column: str, since: float) -> float:
    """Growth of a column of the history per second, from a time [s] on."""
    time, values = run.history["time"].to_numpy(), run.history[column].to_numpy()
    k = int(np.searchsorted(time, since - 1e-12))
    return float((values[-1] - values[k]) / (time[-1] - time[k]))


def overlaps(position: np.ndarray, edge: float) -> np.ndarray:
    """Overlaps [m] of all pairs that touch in a periodic cube."""
    from scipy.spatial import KDTree

    place = position % edge
    place[place >= edge] = 0.0
    i, j = KDTree(place, boxsize=edge).query_pairs(2 * RADIUS, output_type="ndarray").T
    apart = place[i] - place[j]
    apart -= edge * np.round(apart / edge)
    return 2 * RADIUS - np.linalg.norm(apart, axis=1)
