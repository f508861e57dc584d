"""Frames of a finished run, of any code, as a moving picture: GIF or MP4 by the ending of the file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.report import render
from gpudem.errors import GpudemError
from gpudem.output.atomic import replacing
from gpudem.output.directory import load_scene
from gpudem.output.frames import Frames
from gpudem.output.vtu import PVD, Frame
from gpudem.scene import Scene

ENDINGS = (".gif", ".mp4")
NO_MP4 = "MP4 needs the package imageio-ffmpeg: pip install 'gpudem[video]' (or end the file in .gif)"
UNITS = {"speed": "m/s", "radius": "m", "velocity": "m/s", "force": "N", "torque": "N m"}
#: Where a domain is open far upwards: so many of the particles are seen in every frame, and so much above.
SEEN, HEADROOM = 0.9, 1.15
#: Speeds that few particles reach in few frames do not stretch the colours.
FAST, FAST_FRAMES = 0.99, 0.8


def animate(
    directory: Path,
    out: Path,
    *,
    fps: float = 20.0,
    view: str = "side",
    color: str = "speed",
    width: int = 800,
    progress: Callable[[int], None] | None = None,
) -> int:
    """Draw all frames of a run into a file.

    The range of the colours and the part of the domain that is seen are the same in all frames: from the
    bottom of the domain up to where the particles come (SEEN of them in every frame).

    Args:
        directory: Where run.pvd and scene.json are.
        out: File to write, .gif or .mp4.
        fps: Frames a second.
        view: "side", along the depth, or "oblique", a little from above.
        color: "speed" or a column of the frames; of a vector its length.
        width: Of the picture [pixels].
        progress: Called with the number of frames done.

    Returns:
        How many frames there are.

    Raises:
        GpudemError: no frames, unknown column or ending, no encoder.
    """
    frames, images = _drawn(directory, out, view, color, width, progress)
    with replacing(out) as partial:
        write = _write_mp4 if out.suffix.lower() == ".mp4" else _write_gif
        write(images, partial, fps)
    return len(frames)


def _drawn(
    directory: Path, out: Path, view: str, color: str, width: int, progress: Callable[[int], None] | None
) -> tuple[Frames, Iterator[Any]]:
    """The frames of a run, and their pictures, drawn one by one as they are asked for."""
    scene, frames = _open(directory, out)
    limits, box = _ranges(scene, frames, color)
    unit = f" {UNITS[color]}" if color in UNITS else ""
    label = f"{color} {limits[0]:.3g} to {limits[1]:.3g}{unit}"

    def images() -> Iterator[Any]:
        for k, (time, frame) in enumerate(zip(frames.times, frames, strict=True), 1):
            if render.can_render():
                image = render.picture(
                    scene, frame, color=color, limits=limits, time=time, view=view, box=box, width=width
                )
            else:
                image = render.flat(scene, frame, color=color, limits=limits, box=box, width=width)
            yield _labelled(image, f"t = {time:.3f} s", label)
            if progress:
                progress(k)

    return frames, images()


def _open(directory: Path, out: Path) -> tuple[Scene, Frames]:
    """The scene and the frames of a run that can be drawn into `out`. Raises GpudemError if they cannot."""
    if out.suffix.lower() not in ENDINGS:
        raise GpudemError(f"{out}: unknown ending {out.suffix!r}; known: {', '.join(ENDINGS)}")
    if out.suffix.lower() == ".mp4":
        _encoder()
    scene = load_scene(directory)
    frames = Frames.open(directory)
    if len(frames) == 0:
        raise GpudemError(f"{directory / PVD}: no frames; state output.frames_every in the scene")
    return scene, frames


def _ranges(
    scene: Scene, frames: Frames, color: str
) -> tuple[tuple[float, float], tuple[np.ndarray, np.ndarray]]:
    """(range of the colours, corners of what is seen) over all frames."""
    lows, highs, tops = [], [], []
    for frame in frames:
        _known(frame, color)
        value = render.values(frame, color)
        lows.append(float(value.min()))
        highs.append(float(np.quantile(value, FAST)))
        tops.append(float(np.quantile(frame["position"][:, 2] + frame["radius"], SEEN)))
    low = 0.0 if color == "speed" else min(lows)
    high = float(np.quantile(highs, FAST_FRAMES))
    lo, hi = np.array(scene.domain.lo, float), np.array(scene.domain.hi, float)
    hi[2] = min(hi[2], lo[2] + HEADROOM * (max(tops) - lo[2]))
    return (low, high if high > low else low + 1.0), (lo, hi)


def _known(frame: Frame, color: str) -> None:
    if color != "speed" and (color not in frame or color == "points"):
        known = ", ".join(["speed", *sorted(set(frame) - {"points"})])
        raise GpudemError(f"color = {color!r}: no such column in the frames; known: {known}")


def _labelled(image: np.ndarray, left: str, right: str) -> Any:
    """The image with a line of text above it, as a Pillow image."""
    from PIL import Image, ImageDraw, ImageFont

    size = max(12, image.shape[1] // 45)
    font = ImageFont.load_default(size)
    line = size + 10
    # even sizes: MP4 halves the resolution of its colours
    height, width = (n + n % 2 for n in (image.shape[0] + line, image.shape[1]))
    page = Image.new("RGB", (width, height), "white")
    page.paste(Image.fromarray(image), (0, line))
    draw = ImageDraw.Draw(page)
    draw.text((8, 4), left, fill="#1b2430", font=font)
    draw.text((width - 8, 4), right, fill="#56616e", font=font, anchor="ra")
    return page


def _write_gif(images: Iterator[Any], out: Path, fps: float) -> None:
    """All frames with the palette of 64 colours of their own, shown for ever."""
    small = (image.quantize(64) for image in images)
    first = next(small)
    first.save(
        out,
        "gif",
        save_all=True,
        append_images=small,
        duration=max(20, round(1000 / fps)),
        loop=0,
        optimize=True,
    )


def _encoder() -> Any:
    try:
        import imageio_ffmpeg  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise GpudemError(NO_MP4) from None
    return imageio_ffmpeg


def _write_mp4(images: Iterator[Any], out: Path, fps: float) -> None:
    """H.264 with colours that every player takes."""
    writer = None
    try:
        for image in images:
            if writer is None:
                writer = _encoder().write_frames(
                    str(out),
                    image.size,
                    fps=fps,
                    codec="libx264",
                    macro_block_size=2,
                    quality=7,
                    output_params=["-f", "mp4"],
                )
                writer.send(None)
            writer.send(np.asarray(image).tobytes())
    finally:
        if writer is not None:
            writer.close()
