"""Balls of two sizes poured into a box in random fillings, and measures of the bed that they make."""

from __future__ import annotations

from typing import Any

import numpy as np

from comparisons import kit
from comparisons.metrics import contacts
from gpudem.output.run import Run
from gpudem.scene import Contact, Domain, Material, Output, Pair, Scene, Time
from gpudem.scene.distributions import Normal
from gpudem.scene.regions import Block
from gpudem.scene.sources import InsertPack, Part
from gpudem.scene.walls import Box

LARGE, SMALL = 0.003, 0.002
DENSITY, GRAVITY = 2500.0, 9.81
#: Share of the large balls by mass.
SHARE = 0.5
#: Balls, and width of the box [m].
BALLS: dict[kit.Tier, int] = {"quick": 220, "standard": 500, "full": 1200}
WIDTH: dict[kit.Tier, float] = {"quick": 0.03, "standard": 0.036, "full": 0.048}
SEEDS: dict[kit.Tier, int] = {"quick": 5, "standard": 7, "full": 10}
#: Height of the box [m]; balls come in its upper part.
HEIGHT: dict[kit.Tier, float] = {"quick": 0.08, "standard": 0.11, "full": 0.14}
#: A soft material: overlaps of the bed at rest are below 1 % of a diameter.
YOUNG, POISSON, RESTITUTION, FRICTION = 5e6, 0.3, 0.5, 0.4
STEP = 4e-5
#: First filling, and interval to the second [s].
FIRST, EVERY = 2e-3, 0.048
DURATION: dict[kit.Tier, float] = {"quick": 0.3, "standard": 0.4, "full": 0.5}
#: Length of the run that is compared ball by ball [s], and interval of its rows [s].
EARLY, ROW = 0.062, 2e-3
#: Balls fall at this velocity [m/s], with this standard deviation of each component.
VELOCITY, SPREAD = -1.0, 0.05


def scene(tier: kit.Tier, seed: int, duration: float, **output: Any) -> Scene:
    """One pouring."""
    width, height = WIDTH[tier], HEIGHT[tier]
    sizes = Normal(kind="normal", mean=SMALL, sigma=0.1 * SMALL, lo=0.8 * SMALL, hi=1.2 * SMALL)
    pack = InsertPack(
        kind="pack",
        region=Block(kind="block", lo=(0, 0, 0.55 * height), hi=(width, width, height)),
        count=BALLS[tier], time=FIRST, every=EVERY, attempts=300, seed=seed,
        mixture=(
            Part(material="glass", radius=LARGE, share=SHARE),
            Part(material="glass", radius=sizes, share=1 - SHARE),
        ),
        share_by="mass", velocity=(0, 0, VELOCITY), velocity_spread=SPREAD,
    )  # fmt: skip
    return Scene(
        name="filling", title=f"{BALLS[tier]} balls of two sizes, seed {seed}",
        materials={"glass": Material(young=YOUNG, poisson=POISSON, density=DENSITY)},
        pairs=(Pair(materials=("glass", "glass"), restitution=RESTITUTION, friction=FRICTION),),
        contact=Contact(), insert=(pack,), gravity=(0, 0, -GRAVITY),
        walls=(Box(name="box", material="glass", sides=("xlo", "xhi", "ylo", "yhi", "zlo")),),
        domain=Domain(lo=(0, 0, 0), hi=(width, width, height)),
        time=Time(step=STEP, duration=duration), output=Output(**output),
    )  # fmt: skip


def below(height: float, z: np.ndarray, radius: np.ndarray) -> float:
    """Volume [m3] of spheres below a height [m]: of each the cap pi h^2 (3 R - h)/3 of its height h there."""
    h = np.clip(height - (z - radius), 0, 2 * radius)
    return float((np.pi * h**2 * (3 * radius - h) / 3).sum())


def packing_fraction(frame: dict[str, np.ndarray], width: float) -> float:
    """Solid share of the middle of a bed, from a fifth to three fifths of its height, side walls included."""
    z, radius = frame["position"][:, 2], frame["radius"]
    top = float(np.quantile(z + radius, 0.95))
    low, high = 0.2 * top, 0.6 * top
    return (below(high, z, radius) - below(low, z, radius)) / (width**2 * (high - low))


def metrics(run: Run) -> dict[str, float]:
    """What is compared over the seeds, of the last frame."""
    frame, scene = run.frames[-1], run.scene
    position, radius = frame["position"], frame["radius"]
    found = contacts.find(position, radius, np.zeros(3), scene.wall_elements)
    large = radius > 0.5 * (LARGE + 1.2 * SMALL)
    unlike = large[found.pairs[:, 0]] != large[found.pairs[:, 1]]
    top = float(np.quantile(position[:, 2] + radius, 0.95))
    small = position[~large, 2].mean() - position[large, 2].mean()
    assert run.history is not None
    time, energy = (run.history[name].to_numpy() for name in ("time", "kinetic_energy"))
    return {
        "packing fraction [1]": packing_fraction(frame, scene.domain.hi[0]),
        "height of the bed [mm]": 1e3 * top,
        "coordination, with walls [1]": (2 * len(found.pairs) + len(found.wall_pairs)) / len(radius),
        "share of contacts between sizes [1]": float(unlike.mean()),
        "small above large balls / height [1]": float(small) / top,
        "kinetic energy of the second filling [mJ]": 1e3
        * float(energy[time > FIRST + EVERY].max()),
    }  # fmt: skip
