"""The frames of a run: written one by one while it goes, read when asked for."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gpudem.output.vtu import PVD, Frame, read_pvd, read_vtu, write_pvd, write_vtu
from gpudem.scene import Scene
from gpudem.scene.sections import Wall


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
        """`resumed_at`: keep the entries of run.pvd up to this step; later frames are written anew."""
        self.directory, self.scene = directory, scene
        (directory / "frames").mkdir(parents=True, exist_ok=True)
        self._entries: list[tuple[float, int, str]] = []
        if resumed_at is not None and (directory / PVD).is_file():
            limit = (resumed_at + 0.5) * scene.time.step
            self._entries = [entry for entry in read_pvd(directory / PVD) if entry[0] < limit]
        self._walls = [(a, self._write_walls(k, walls)) for k, (a, _, walls) in enumerate(scene.segments)]

    def add(self, step: int, frame: Frame) -> None:
        """Write one frame at `step` and bring the .pvd up to date."""
        time, name = step * self.scene.time.step, f"frames/p_{step:09d}.vtu"
        write_vtu(self.directory / name, frame)
        self._entries.append((time, 0, name))
        walls = [name for start, name in self._walls if start < step or start == 0][-1]
        if walls:
            self._entries.append((time, 1, walls))
        write_pvd(self.directory / PVD, self._entries)

    def _write_walls(self, k: int, walls: list[Wall]) -> str | None:
        if not walls:
            return None
        import meshio

        points, quads = _walls_mesh(walls, np.array(self.scene.domain.lo), np.array(self.scene.domain.hi))
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
