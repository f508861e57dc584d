"""The frames of a run: written one by one while it runs, read on request."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gpudem.output.atomic import WriteError, replacing
from gpudem.output.directory import FRAMES
from gpudem.output.vtu import PVD, Frame, read_pvd, read_vtu, write_pvd, write_vtu
from gpudem.scene import Scene
from gpudem.scene.walls import Wall


def _walls_mesh(walls: list[Wall], lo: np.ndarray, hi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The outlines of all walls as one mesh of quads: points [m], shape (p, 3), and corners, shape (q, 4)."""
    points, quads, count = [], [], 0
    for wall in walls:
        corners, faces = wall.outline(lo, hi)
        points.append(corners)
        quads.append(faces + count)
        count += len(corners)
    return np.concatenate(points), np.concatenate(quads)


class FrameWriter:
    """Writes frames/p_<step>.vtu and, after each, run.pvd, so that an aborted run still opens."""

    def __init__(self, directory: Path, scene: Scene, resumed_at: int | None = None):
        """`resumed_at`: the frames up to this step are on disk; those after it are written again.

        Raises WriteError.
        """
        self.directory, self.scene = directory, scene
        try:
            (directory / FRAMES).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise WriteError(directory / FRAMES, error) from error
        self._entries: list[tuple[float, int, str]] = []
        self._walls = [(a, self._write_walls(k, walls)) for k, (a, _, walls) in enumerate(scene.segments)]
        if resumed_at is not None:
            for step in range(0, resumed_at + 1, scene.frame_stride):
                self._enter(step)
            write_pvd(self.directory / PVD, self._entries)

    def add(self, step: int, frame: Frame) -> None:
        """Write one frame at `step` and bring the .pvd up to date."""
        write_vtu(self.directory / _name(step), frame)
        self._enter(step)
        write_pvd(self.directory / PVD, self._entries)

    def _enter(self, step: int) -> None:
        time = step * self.scene.time.step
        self._entries.append((time, 0, _name(step)))
        walls = [name for start, name in self._walls if start < step or start == 0][-1]
        if walls:
            self._entries.append((time, 1, walls))

    def _write_walls(self, k: int, walls: list[Wall]) -> str | None:
        if not walls:
            return None
        import meshio

        points, quads = _walls_mesh(walls, np.array(self.scene.domain.lo), np.array(self.scene.domain.hi))
        name = f"{FRAMES}/walls_{k}.vtu"
        with replacing(self.directory / name) as partial:
            mesh = meshio.Mesh(points, [("quad", quads)])
            mesh.write(partial, file_format="vtu", binary=True, compression=None)
        return name


def _name(step: int) -> str:
    return f"{FRAMES}/p_{step:09d}.vtu"


@dataclasses.dataclass(frozen=True)
class Frames:
    """The frames of a run, read when asked for: `frames[0]`, `frames[-1]`, `for frame in frames`."""

    directory: Path
    times: np.ndarray
    """Physical times [s], shape (frames,)."""
    names: list[str]

    @classmethod
    def open(cls, directory: Path) -> Frames:
        """From run.pvd. Raises FrameError if it is missing or broken."""
        mine = [(time, name) for time, part, name in read_pvd(directory / PVD) if part == 0]
        return cls(directory, np.array([time for time, _ in mine]), [name for _, name in mine])

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, k: int) -> Frame:
        return read_vtu(self.directory / self.names[k])

    def __iter__(self) -> Iterator[Frame]:
        return (self[k] for k in range(len(self)))

    def at(self, time: float) -> Frame:
        """The frame nearest to a time [s]."""
        return self[int(np.argmin(np.abs(self.times - time)))]
