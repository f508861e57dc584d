"""Small scenes of hard disks and spheres for the tests."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gpudem.scene import Box, Contact, Domain, Explicit, Material, Output, Pair, Plane, Scene, Time
from gpudem.scene.walls import Side, Vibration

RADIUS = 0.02


def scene(
    position: Any,
    velocity: Any,
    *,
    radius: Any = RADIUS,
    restitution: float = 1.0,
    wall_restitution: float = 1.0,
    friction: float = 0.0,
    wall_friction: float = 0.0,
    spin: Any = None,
    gravity: tuple[float, float, float] = (0, 0, 0),
    sides: tuple[Side, ...] = (),
    lo: tuple[float, float, float] = (-1, -1, -1),
    hi: tuple[float, float, float] = (1, 1, 1),
    periodic: tuple[bool, bool, bool] = (False, False, False),
    duration: float = 1.0,
    density: float = 3 / (4 * math.pi * RADIUS**3),
    **more: Any,
) -> Scene:
    """Balls of mass 1 kg at the usual radius, with walls at the chosen sides of lo..hi."""
    return Scene(
        name="hard",
        materials={
            "ball": Material(young=1e9, poisson=0.3, density=density),
            "wall": Material(young=1e9, poisson=0.3, density=1000),
        },
        pairs=more.pop("pairs", None)
        or [
            Pair(materials=("ball", "ball"), restitution=restitution, friction=friction),
            Pair(materials=("ball", "wall"), restitution=wall_restitution, friction=wall_friction),
        ],
        contact=more.pop("contact", Contact(tangential="history" if friction or wall_friction else "off")),
        particles=Explicit(
            position=position, velocity=velocity, radius=radius, material="ball", angular_velocity=spin
        ),
        gravity=gravity,
        walls=more.pop("walls", [Box(kind="box", name="box", material="wall", sides=sides)] if sides else []),
        domain=Domain(lo=lo, hi=hi, periodic=periodic),
        time=Time(step=1e-3, duration=duration),
        output=more.pop("output", Output(history_every=0.1)),
        allow=("time_step", "unusual_units"),
        **more,
    )


def placed(
    rng: np.random.Generator, n: int, lo: Any, hi: Any, radius: np.ndarray, flat: int | None = None
) -> np.ndarray:
    """Random centers between lo and hi, no two spheres closer than touching."""
    made = np.empty((0, 3))
    for _ in range(1000 * n):
        if len(made) == n:
            return made
        x = rng.uniform(np.asarray(lo) + radius[len(made)], np.asarray(hi) - radius[len(made)])
        if flat is not None:
            x[flat] = 0.0
        if (np.linalg.norm(made - x, axis=1) > radius[: len(made)] + radius[len(made)]).all():
            made = np.vstack([made, x])
    raise ValueError("too dense to place at random")


def floored(speed: float, amplitude: float, sides: tuple[Side, ...] = (), **more: Any) -> list[Any]:
    """Walls at the chosen sides, and a vibrating floor at z = 0 (or the plane that `more` makes of it)."""
    floor: dict[str, Any] = {"name": "floor", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1)}
    moving = Plane(**(floor | {"vibration": Vibration(speed=speed, amplitude=amplitude)} | more))
    return [*([Box(kind="box", name="box", material="wall", sides=sides)] if sides else []), moving]


def vibrated(
    n: int = 60, seed: int = 1, floor_speed: float = 0.0, amplitude: float = 0.0, **more: Any
) -> Scene:
    """Disks over a floor, open above, between walls: the source's scene, smaller by default."""
    if floor_speed > 0:
        more = {"walls": floored(floor_speed, amplitude, ("xlo", "xhi"))} | more
    rng, width = np.random.default_rng(seed), 2.0 * n / 300
    position = placed(rng, n, (-width / 2, -1, 0), (width / 2, 1, 0.5), np.full(n, RADIUS), flat=1)
    velocity = rng.normal(size=(n, 3)) * (1, 0, 1)
    known: dict[str, Any] = {
        "restitution": 0.95,
        "gravity": (0, 0, -1),
        "sides": ("xlo", "xhi", "zlo"),
        "lo": (-width / 2, -0.1, 0),
        "hi": (width / 2, 0.1, 12),
    }
    position = position + np.array(more.pop("shift", (0, 0, 0)))
    return scene(position, velocity, **(known | more))


def gas(n: int = 100, seed: int = 1, edge: float = 0.22, **more: Any) -> Scene:
    """Spheres of two sizes in a periodic cube."""
    rng = np.random.default_rng(seed)
    radius = more.pop("radius", rng.choice([RADIUS, 0.7 * RADIUS], size=n))
    position = placed(rng, n, (0, 0, 0), (edge, edge, edge), np.broadcast_to(radius, n))
    known: dict[str, Any] = {"lo": (0, 0, 0), "hi": (edge, edge, edge), "periodic": (True, True, True)}
    return scene(position, rng.normal(size=(n, 3)), radius=radius, **(known | more))
