"""The frames of a run: written one by one while it goes, read when asked for."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gpudem.output.vtu import PVD, Frame, read_pvd, read_vtu, write_pvd, write_vtu
from gpudem.scene import Plane, Scene


def _walls_mesh(planes: list[Plane], lo: np.ndarray, hi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each plane as a rectangle: axis-aligned ones cut to lo..hi, tilted ones as large as its diagonal."""
    points, size = [], float(np.linalg.norm(hi - lo))
    for plane in planes:
        normal, centre = np.array(plane.normal), (lo + hi) / 2
        foot = centre - ((centre - np.array(plane.point)) @ normal) * normal
        axis = int(np.argmax(np.abs(normal)))
        u = np.roll(np.eye(3)[axis], 1)
        u -= (u @ normal) * normal
        u /= np.linalg.norm(u)
        v = np.cross(normal, u)
        half = [np.abs((hi - lo) @ d) / 2 if np.abs(normal).max() > 1 - 1e-12 else size / 2 for d in (u, v)]
        points += [foot + a * half[0] * u + b * half[1] * v for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return np.array(points).reshape(-1, 3), np.arange(4 * len(planes)).reshape(-1, 4)


class FrameWriter:
    """Writes frames/p_<step>.vtu and, after each, run.pvd, so that an aborted run still opens."""

    def __init__(self, directory: Path, scene: Scene, resumed_at: int | None = None):
        """`resumed_at`: keep the entries of run.pvd up to this step; later frames are written anew."""
        self.directory, self.scene = directory, scene
        (directory / "frames").mkdir(parents=True, exist_ok=True)
        self._entries: list[tuple[float, int, str]] = []
        if resumed_at is not None and (directory / PVD).is_file():
            limit = (resumed_at + 0.5) * scene.time.step
            self._entries = [entry for entry in read_pvd(directory / PVD) if entry[0] < limit]
        self._walls = [(a, self._write_walls(k, planes)) for k, (a, _, planes) in enumerate(scene.segments)]

    def add(self, step: int, frame: Frame) -> None:
        """Write one frame at `step` and bring the .pvd up to date."""
        time, name = step * self.scene.time.step, f"frames/p_{step:09d}.vtu"
        write_vtu(self.directory / name, frame)
        self._entries.append((time, 0, name))
        walls = [name for start, name in self._walls if start < step or start == 0][-1]
        if walls:
            self._entries.append((time, 1, walls))
        write_pvd(self.directory / PVD, self._entries)

    def _write_walls(self, k: int, planes: list[Plane]) -> str | None:
        if not planes:
            return None
        import meshio

        points, quads = _walls_mesh(planes, np.array(self.scene.domain.lo), np.array(self.scene.domain.hi))
        name = f"frames/walls_{k}.vtu"
        meshio.Mesh(points, [("quad", quads)]).write(self.directory / name, binary=True, compression=None)
        return name


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
