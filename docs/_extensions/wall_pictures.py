"""A picture of each kind of wall, drawn from the examples of docs/guide/walls.md when the docs are built."""

from __future__ import annotations

import io
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

#: The domain in which the examples are drawn [m].
LO, HI = np.full(3, -0.07), np.full(3, 0.07)


def examples(page: Path) -> dict[str, Any]:
    """Kind -> the wall that the page shows as its example. Raises SceneError: one that is not valid."""
    from gpudem.scene.wall_kinds import BUILT_IN

    found = {}
    for block in re.findall(r"^```toml\n(\[\[walls\]\].*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL):
        (stated,) = tomllib.loads(block)["walls"]
        found[stated["kind"]] = BUILT_IN[stated["kind"]](**stated)
    return found


def pictures(page: Path) -> dict[str, str]:
    """Kind -> an SVG of its example; the same text in every build."""
    return {kind: picture(wall) for kind, wall in examples(page).items()}


def picture(wall: Any) -> str:
    """An SVG of the outline of a wall."""
    import matplotlib
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    faces: list[np.ndarray] = []
    for element in wall.elements(tuple(LO.tolist()), tuple(HI.tolist())):
        # an infinite tilted plane is drawn as large as the diagonal of what is given
        points, quads = (
            element.outline(LO / 1.8, HI / 1.8) if wall.kind == "plane" else element.outline(LO, HI)
        )
        if wall.kind == "box":  # its planes are infinite; the picture ends at the box
            points = np.clip(points, wall.lo, wall.hi)
        faces += list(points[quads])
    with matplotlib.rc_context({"svg.hashsalt": wall.kind}):
        figure = Figure(figsize=(3.2, 2.6))
        axes: Any = figure.add_axes((0, 0, 1, 1), projection="3d")
        axes.add_collection3d(
            Poly3DCollection(faces, facecolor="#7fa6c9", edgecolor="#2b4a66", linewidth=0.4, alpha=0.45)
        )
        corners = np.array([[(LO, HI)[i >> k & 1][k] for k in range(3)] for i in range(8)])
        for i, j in ((i, i | 1 << k) for i in range(8) for k in range(3) if not i >> k & 1):
            axes.plot(*corners[[i, j]].T, color="#b5bcc4", linewidth=0.6)
        axes.set(xlim=(LO[0], HI[0]), ylim=(LO[1], HI[1]), zlim=(LO[2], HI[2]))
        axes.set_box_aspect((1, 1, 1), zoom=1.1)
        axes.view_init(elev=22, azim=-55)
        axes.set_axis_off()
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None}, transparent=True)
    return text.getvalue()
