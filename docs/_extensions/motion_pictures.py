"""The picture of the types of motion in the user guide, drawn by the code that moves walls."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

#: Type -> (keys, duration of the picture [s]); the wall is a plate from (0, 0) to (0.1, 0) in the plane x, z.
TURN = {"axis": (0.0, -1.0, 0.0), "point": (0.0, 0.0, 0.0)}
MOTIONS: dict[str, tuple[list[dict[str, Any]], float]] = {
    "linear": ([{"type": "linear", "velocity": (0.05, 0.0, 0.1)}], 1.0),
    "oscillate": ([{"type": "oscillate", "amplitude": (0.0, 0.0, 0.04), "period": 1.0}], 1.0),
    "rotate": ([{"type": "rotate", **TURN, "period": 1.0}], 0.75),
    "swing": ([{"type": "swing", **TURN, "amplitude": 0.6, "period": 1.0}], 1.0),
    "table of velocity": (
        [{"type": "table", "time": [0.0, 0.5, 1.0], "velocity": [(0.1, 0, 0), (0.1, 0, 0.2), (0.1, 0, 0)]}],
        1.0,
    ),
    "table of angular velocity": (
        [{"type": "table", **TURN, "time": [0.0, 1.0], "angular_velocity": [0.0, 4.0]}],
        1.0,
    ),
    "linear, rotate": (
        [{"type": "linear", "velocity": (0.25, 0.0, 0.0)}, {"type": "rotate", **TURN, "period": 1.0}],
        1.0,
    ),
    "rotate, linear": (
        [{"type": "rotate", **TURN, "period": 1.0}, {"type": "linear", "velocity": (0.25, 0.0, 0.0)}],
        1.0,
    ),
}
#: Places of the wall in each picture.
PLACES = 9


def picture() -> str:
    """One panel for each entry of `MOTIONS`, as SVG; the same text each time."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"svg.hashsalt": "motions"}):
        figure = Figure(figsize=(11, 5.6), layout="constrained")
        panels = figure.subplots(2, 4)
        for panel, (name, (stated, duration)) in zip(panels.flat, MOTIONS.items(), strict=True):
            _draw(panel, stated, duration)
            panel.set_title(name)
        figure.supxlabel("x [m]")
        figure.supylabel("z [m]")
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None}, transparent=True)
    return text.getvalue()


def _draw(panel: Any, stated: list[dict[str, Any]], duration: float) -> None:
    from gpudem.scene import Plane
    from gpudem.walls.motion import WallPath

    motions = Plane(name="w", material="m", point=(0, 0, 0), normal=(0, 0, 1), motion=stated).motion  # type: ignore[arg-type]
    steps = 40 * (PLACES - 1)
    poses = WallPath(motions, duration / steps).at(0, steps + 1)
    ends = np.stack([poses.rotation @ np.array([x, 0.0, 0.0]) + poses.shift for x in (0.0, 0.1)])
    panel.plot(ends[1, :, 0], ends[1, :, 2], color="tab:orange", linewidth=1)
    for k in range(0, steps + 1, 40):
        panel.plot(
            ends[:, k, 0],
            ends[:, k, 2],
            color="black",
            linewidth=3 if k == 0 else 0.8,
            alpha=1 if k == 0 else 0.6,
        )
    panel.set_aspect("equal", "datalim")
    panel.grid(alpha=0.3)
