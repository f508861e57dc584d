"""The picture of what insertion and growth make, in the user guide, from the code that places them."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

#: Box of the pictures [m], and when they show it [s].
SIZE, TIME = 0.1, 0.06
SIZES = {"kind": "uniform", "lo": 0.003, "hi": 0.006}
BOX = {"kind": "block", "lo": (0, 0, 0), "hi": (SIZE, SIZE, SIZE)}
#: Title -> insertion.
INSERTIONS: dict[str, dict[str, Any]] = {
    "pack: as many as random points hold": {"kind": "pack", "region": BOX, "volume_fraction": 0.3},
    "rate: in the upper half": {
        "kind": "rate", "number_rate": 4000.0, "every": 0.01,
        "region": {"kind": "block", "lo": (0, 0, SIZE / 2), "hi": (SIZE, SIZE, SIZE)},
    },
    "stream: layers through a disc": {
        "kind": "stream", "number_rate": 1500.0, "velocity": (0.0, 0.0, -1.2),
        "face": {"kind": "disc", "center": (SIZE / 2, SIZE / 2, 0.994 * SIZE), "axis": (0, 0, 1),
                 "radius": 0.035},
    },
}  # fmt: skip
#: The last panel: a pack that has grown.
GROWN = "--grow: a packing fraction of 0.54"


def picture() -> str:
    """One panel for each kind of insertion and one of growth, as SVG; the same text each time."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"svg.hashsalt": "insertions"}):
        figure = Figure(figsize=(11, 3.1), layout="constrained")
        panels = figure.subplots(1, len(INSERTIONS) + 1)
        shown = {title: inserted(stated) for title, stated in INSERTIONS.items()} | {GROWN: grown()}
        for panel, (title, (position, radius)) in zip(panels, shown.items(), strict=True):
            _draw(panel, position, radius)
            panel.set_title(title, fontsize=10)
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None}, transparent=True)
    return text.getvalue()


def inserted(stated: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Centers and radii [m] of what has come by TIME, where free flight has taken it within the box."""
    scene = _scene(stated)
    came, state = scene.inserted, scene.inserted.state
    time = (TIME - came.time)[:, None] if stated["kind"] != "pack" else 0.0
    position = state.position + time * state.velocity + time**2 / 2 * np.array(scene.gravity)
    there = (position[:, 2] > 0) & (came.time <= TIME)
    return position[there], state.radius[there]


def grown() -> tuple[np.ndarray, np.ndarray]:
    """Centers and radii [m] of a dense packing between the walls of the box."""
    from gpudem import growth

    made = growth.grow(_scene({"kind": "pack", "region": BOX, "volume_fraction": 0.54, "attempts": 1}))
    return made.position, made.radius


def _scene(stated: dict[str, Any]) -> Any:
    from gpudem.scene import Scene

    insert = {"material": "glass", "radius": SIZES, "seed": 1, **stated}
    return Scene(
        name="picture", materials={"glass": {"young": 5e6, "poisson": 0.3, "density": 2500.0}},
        pairs=[{"materials": ("glass", "glass"), "restitution": 0.7}], insert=[insert],
        gravity=(0.0, 0.0, -9.81), domain={"lo": (0, 0, 0), "hi": (SIZE, SIZE, SIZE)},
        time={"step": 1e-5, "duration": TIME},
    )  # type: ignore[arg-type]  # fmt: skip


def _draw(panel: Any, position: np.ndarray, radius: np.ndarray) -> None:
    """From the front; the farther a sphere, the paler."""
    from matplotlib.patches import Circle, Rectangle

    near, far = np.array([0.17, 0.35, 0.52]), np.array([0.80, 0.87, 0.93])
    for k in np.argsort(-position[:, 1], kind="stable"):
        color = near + (far - near) * position[k, 1] / SIZE
        x, z, r = float(position[k, 0]), float(position[k, 2]), float(radius[k])
        panel.add_patch(Circle((x, z), r, facecolor=color, edgecolor="white", lw=0.3))
    panel.add_patch(Rectangle((0, 0), SIZE, SIZE, fill=False, edgecolor="#b5bcc4", lw=0.8))
    panel.set(xlim=(-0.002, SIZE + 0.002), ylim=(-0.002, SIZE + 0.002), aspect="equal")
    panel.set_axis_off()
