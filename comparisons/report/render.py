"""Pictures of piles: spheres in an outlined box, by pyvista off-screen, or flat circles where GL is missing.

Off-screen rendering without a screen or a GPU needs the Debian packages libgl1, libegl1 and libgl1-mesa-dri.
"""

from __future__ import annotations

import functools
import io
import os
import subprocess
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from gpudem.output.frames import walls_mesh
from gpudem.output.vtu import Frame
from gpudem.scene import Plane, Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Width [pixels] of one picture; enough for half a page at twice its density.
WIDTH = 1100
#: Where the camera looks: along the depth of the box, and for `oblique` a little to the right and down.
VIEWS = {
    "oblique": np.array([0.18, 1.0, -0.26]) / np.linalg.norm([0.18, 1.0, -0.26]),
    "side": np.array([0.0, 1.0, 0.0]),
}
#: More spheres than this are drawn as shaded points instead of meshes.
MESHES = 4000
#: What stands under pictures that are circles because GL is missing.
NO_GL = "flat view: no off-screen rendering here (Debian: libgl1 libegl1 libgl1-mesa-dri)"

_PROBE = (
    "import pyvista as v; p = v.Plotter(off_screen=True, window_size=(8, 8)); p.screenshot(return_img=True)"
)


def can_render() -> bool:
    """Whether VTK renders off-screen here, and GPUDEM_NO_RENDER is not set."""
    return not os.environ.get("GPUDEM_NO_RENDER") and _renders()


@functools.cache
def _renders() -> bool:
    """Tried in another process, for a broken GL stack kills its own."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE], capture_output=True, timeout=120, env=_environment()
        )
    except subprocess.SubprocessError:
        return False
    return done.returncode == 0


def backend() -> str:
    """How pictures are made here, in words."""
    return "pyvista, off-screen" if can_render() else f"matplotlib, {NO_GL}"


def _environment() -> dict[str, str]:
    """Without a screen VTK first tries X and complains; name EGL at once."""
    if os.environ.get("DISPLAY") or not sys.platform.startswith("linux"):
        return dict(os.environ)
    return {"VTK_DEFAULT_OPENGL_WINDOW": "vtkEGLRenderWindow", **os.environ}


def picture(
    scene: Scene,
    frame: Frame,
    *,
    color: str = "speed",
    limits: tuple[float, float] | None = None,
    time: float = 0.0,
    view: str = "oblique",
    box: tuple[np.ndarray, np.ndarray] | None = None,
    width: int = WIDTH,
) -> np.ndarray:
    """A frame from the side, by default a little from above, as an image (height, width, 3), uint8.

    Args:
        scene: Gives domain and walls.
        frame: The particles.
        color: "speed" [m/s], "id", or any scalar column of the frame.
        limits: Range of the colours; default: the frame's own.
        time: Physical time [s]: walls are where they are then, gates removed by then are not drawn.
        view: One of VIEWS.
        box: Corners of what is seen [m]; default: the domain.
        width: Of the image [pixels].
    """
    import pyvista

    os.environ.update(_environment())
    lo, hi = box or (np.array(scene.domain.lo), np.array(scene.domain.hi))
    forward, height = VIEWS[view], pixels(lo, hi, view, width)
    edges = (*np.stack([lo, hi], axis=1).ravel(),)
    plotter: Any = pyvista.Plotter(off_screen=True, window_size=[width, height], lighting="light kit")
    plotter.set_background("white")
    cloud: Any = pyvista.PolyData(np.ascontiguousarray(frame["position"]))
    cloud["color"], radius = values(frame, color), frame["radius"]
    look = {"scalars": "color", "cmap": "viridis", "clim": limits, "show_scalar_bar": False}
    if len(radius) <= MESHES:
        cloud["radius"] = radius
        ball = pyvista.Sphere(radius=1.0, theta_resolution=16, phi_resolution=12)
        mesh = cloud.glyph(scale="radius", geom=ball, orient=False)
        plotter.add_mesh(mesh, smooth_shading=True, specular=0.2, **look)
    else:
        actor = plotter.add_mesh(
            cloud, style="points_gaussian", emissive=False, render_points_as_spheres=True, **look
        )
        actor.mapper.scale_factor = float(np.mean(radius))
    plotter.add_mesh(pyvista.Box(edges), style="wireframe", color="#9aa4ae", line_width=1.5, lighting=False)
    _add_walls(plotter, scene, lo, hi, view, time)
    camera, extent = plotter.camera, _extent(lo, hi, forward)
    camera.parallel_projection = True
    camera.focal_point, camera.up = (lo + hi) / 2, (0.0, 0.0, 1.0)
    camera.position = (lo + hi) / 2 - 4 * np.linalg.norm(hi - lo) * forward
    plotter.reset_camera_clipping_range()
    camera.parallel_scale = 0.515 * max(extent[1], extent[0] * height / width)
    image = plotter.screenshot(None, return_img=True)
    plotter.close()
    return image[..., :3]


def png(image: np.ndarray) -> bytes:
    """An image as PNG with a palette of 256 colours."""
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(image).quantize(256).save(out, "png", optimize=True)
    return out.getvalue()


def side_by_side(
    views: Mapping[str, tuple[Scene, Frame]],
    *,
    color: str = "speed",
    unit: str = "m/s",
    limits: tuple[float, float] | None = None,
    time: float = 0.0,
) -> Figure:
    """Piles beside one another, {"gpudem, 0.5 s": (scene, frame), ...}, one colour range for all."""
    from comparisons.report import plots

    if limits is None:
        every = np.concatenate([values(frame, color) for _, frame in views.values()])
        limits = (0.0 if color == "speed" else float(every.min()), float(np.quantile(every, 0.995)) or 1.0)
    columns = min(2, len(views))
    rows = -(-len(views) // columns)
    scene, _ = next(iter(views.values()))
    ratio = pixels(np.array(scene.domain.lo), np.array(scene.domain.hi)) / WIDTH
    height = rows * (plots.WHOLE / columns * ratio + 0.35) + 0.6
    fig, axes = plots.figure(rows, columns, width=plots.WHOLE, height=height, squeeze=False)
    for axis in axes.flat:
        axis.axis("off")
    for axis, (title, (scene, frame)) in zip(axes.flat, views.items(), strict=False):
        axis.set_title(title)
        if can_render():
            axis.imshow(picture(scene, frame, color=color, limits=limits, time=time))
        else:
            _circles(axis, scene, frame, color, limits)
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    scale = ScalarMappable(Normalize(*limits), cmap="viridis")
    bar = fig.colorbar(
        scale, ax=axes, orientation="horizontal", shrink=0.35, aspect=45, pad=0.01, label=f"{color} [{unit}]"
    )
    bar.outline.set_visible(False)
    if not can_render():
        fig.supxlabel(NO_GL, fontsize=8, color=plots.SOFT)
    return fig


def values(frame: Frame, color: str) -> np.ndarray:
    """The scalar of each particle that its colour shows; of a vector its length."""
    if color == "speed":
        return np.linalg.norm(frame["velocity"], axis=1)
    column = np.asarray(frame[color], dtype=np.float64)
    return np.linalg.norm(column, axis=1) if column.ndim == 2 else column


def flat(
    scene: Scene,
    frame: Frame,
    *,
    color: str,
    limits: tuple[float, float],
    box: tuple[np.ndarray, np.ndarray],
    width: int,
) -> np.ndarray:
    """A frame from the side as circles, where GL is missing; an image (height, width, 3), uint8."""
    from comparisons.report import plots

    height = pixels(*box, "side", width)
    with plots.look():
        figure, axis = plots.figure(width=width / 100, height=height / 100, dpi=100, layout="none")
        axis.set_position((0.015, 0.015, 0.97, 0.97))
        axis.axis("off")
        _circles(axis, scene, frame, color, limits)
        axis.set(xlim=(box[0][0], box[1][0]), ylim=(box[0][2], box[1][2]))
        figure.set_facecolor("white")
        figure.canvas.draw()
        image = np.asarray(figure.canvas.buffer_rgba())[..., :3].copy()  # pyright: ignore[reportAttributeAccessIssue]
        import matplotlib.pyplot as plt

        plt.close(figure)
    return image


def _circles(axis: Any, scene: Scene, frame: Frame, color: str, limits: tuple[float, float]) -> None:
    """The pile from the side: circles, the nearer ones over the farther."""
    from matplotlib.collections import EllipseCollection
    from matplotlib.patches import Rectangle

    order = np.argsort(-frame["position"][:, 1])
    centres, size = frame["position"][order][:, [0, 2]], 2 * frame["radius"][order]
    circles = EllipseCollection(
        size, size, np.zeros(len(size)), units="xy", offsets=centres, transOffset=axis.transData,
        array=values(frame, color)[order], cmap="viridis", clim=limits, linewidths=0,
    )  # fmt: skip
    circles.set_rasterized(True)
    axis.add_collection(circles)
    lo, hi = scene.domain.lo, scene.domain.hi
    axis.add_patch(Rectangle((lo[0], lo[2]), hi[0] - lo[0], hi[2] - lo[2], fill=False, edgecolor="#9aa4ae"))
    axis.set(xlim=(lo[0], hi[0]), ylim=(lo[2], hi[2]), aspect="equal")


def _extent(lo: np.ndarray, hi: np.ndarray, forward: np.ndarray) -> tuple[float, float]:
    """Width and height [m] of a box seen along `forward`."""
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    # the projection of a box is as wide as its edges' projections together
    return float(np.abs(right) @ (hi - lo)), float(np.abs(up) @ (hi - lo))


def pixels(lo: np.ndarray, hi: np.ndarray, view: str = "oblique", width: int = WIDTH) -> int:
    """Height of the image of a box."""
    across, upwards = _extent(lo, hi, VIEWS[view])
    return int(width * min(1.0, max(0.2, upwards / across)))


def _add_walls(plotter: Any, scene: Scene, lo: np.ndarray, hi: np.ndarray, view: str, time: float) -> None:
    """Gates that are there, and walls that are no planes, where they are at a time [s]."""
    import pyvista

    here = [wall for wall in scene.wall_elements if scene.is_present(wall, scene.steps(time))]
    others = [wall for wall in here if not isinstance(wall, Plane)]
    if others:
        points, quads = walls_mesh(scene, others, scene.steps(time))
        faces = np.column_stack([np.full(len(quads), 4), quads])
        plotter.add_mesh(pyvista.PolyData(points, faces), color="#7fa6c9", opacity=0.3)
    for plane in here:
        if isinstance(plane, Plane) and plane.end is not None:
            gate = _gate(plane, lo, hi)
            plotter.add_mesh(gate, color="#d55e00", opacity=0.35, lighting=False)
            if view == "side":  # which sees a gate by its edge
                plotter.add_mesh(gate, style="wireframe", color="#d55e00", line_width=3, lighting=False)


def _gate(plane: Any, lo: np.ndarray, hi: np.ndarray) -> Any:
    import pyvista

    axis = int(np.argmax(np.abs(plane.normal)))
    span = np.stack([lo, hi], axis=1)
    span[axis] = plane.point[axis]
    return pyvista.Box((*span.ravel(),))
