"""The frames of a run: written one by one while it runs, read on request."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from gpudem.output.atomic import WriteError, replacing
from gpudem.output.directory import FRAMES
from gpudem.output.vtu import PVD, Frame, read_pvd, read_vtu, read_vtu_and_cells, write_pvd, write_vtu
from gpudem.scene import Scene
from gpudem.scene.walls import Wall


def walls_mesh(
    scene: Scene, walls: list[Wall], step: int = 0, servo_ways: Mapping[str, np.ndarray] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The outlines of walls in a step as one mesh of quads: points [m], shape (p, 3), and corners, (q, 4).

    A wall with motions is where they have moved it, the saw-tooth of a plane at its lowest place. How far
    servos have moved a wall beyond that only its run can tell: servo_ways, by name [m].
    """
    lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
    points, quads, count = [], [], 0
    for wall in walls:
        corners, faces = wall.outline(lo, hi)
        if wall.name in scene.wall_paths:
            pose = scene.wall_paths[wall.name].at(step, 1)
            corners = corners @ pose.rotation[0].T + pose.shift[0]  # mutate: moved_outline
        if servo_ways is not None and wall.name in servo_ways:
            corners = corners + servo_ways[wall.name]
        points.append(corners)
        quads.append(faces + count)
        count += len(corners)
    return np.concatenate(points), np.concatenate(quads)


def wall_cells(
    scene: Scene, walls: list[Wall], forces: Mapping[str, np.ndarray], points: np.ndarray, quads: np.ndarray
) -> dict[str, np.ndarray]:
    """What the frames have for each cell of `walls_mesh`, shape (q,), where `output.wall_stress` is stated.

    wall: its number in the scene, of a box one a side, from 0. pressure [Pa]: force of the particles on a
    triangle against its normal (right-hand rule of its corners), by its area; negative where they press on
    its back. shear_stress [Pa]: magnitude of the force within it, by its area. NaN for walls that
    `output.wall_stress` does not name, and where no force is known.

    Args:
        scene: The scene.
        walls: Those of the mesh, in their order.
        forces: On each triangle [N], (k, 3), by name of the wall.
        points: Of `walls_mesh` [m].
        quads: Of `walls_mesh`.
    """
    elements, lo, hi = scene.wall_elements, np.array(scene.domain.lo), np.array(scene.domain.hi)
    cells = [len(wall.outline(lo, hi)[1]) for wall in walls]
    force = np.full((len(quads), 3), np.nan)
    for wall, first in zip(walls, np.cumsum(cells) - cells, strict=True):
        if wall.name in forces:
            force[first : first + len(forces[wall.name])] = forces[wall.name]
    a, b, c = (points[quads[:, k]] for k in range(3))
    twice = np.cross(b - a, c - a)
    area = np.maximum(np.linalg.norm(twice, axis=1) / 2, 1e-300)
    normal = twice / (2 * area)[:, None]
    along = np.einsum("ij,ij->i", force, normal)
    pressure = -along / area  # mutate: pressure_of_triangle
    return {
        "wall": np.repeat([elements.index(wall) for wall in walls], cells).astype(np.int32),
        "pressure": pressure,
        "shear_stress": np.linalg.norm(force - along[:, None] * normal, axis=1) / area,
    }


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
        self._segments = scene.segments
        there = (directory / FRAMES).glob("walls_*.vtu") if resumed_at is not None else ()
        self._written = {f"{FRAMES}/{path.name}" for path in there}
        if resumed_at is not None:
            for step in range(0, resumed_at + 1, scene.frame_stride):
                self._enter(step)
            write_pvd(self.directory / PVD, self._entries)

    def add(
        self, step: int, frame: Frame, servo_ways: Mapping[str, np.ndarray] | None = None,
        triangle_forces: Mapping[str, np.ndarray] | None = None,
    ) -> None:  # fmt: skip
        """Write one frame at `step`, with walls that a servo moves there and forces [N] on triangles of
        meshes by name, and bring the .pvd up to date.
        """
        write_vtu(self.directory / _name(step), frame)
        self._enter(step, servo_ways, triangle_forces)
        write_pvd(self.directory / PVD, self._entries)

    def _enter(
        self, step: int, servo_ways: Mapping[str, np.ndarray] | None = None,
        forces: Mapping[str, np.ndarray] | None = None,
    ) -> None:  # fmt: skip
        time = step * self.scene.time.step
        self._entries.append((time, 0, _name(step)))
        walls = self._file_of_walls(step, servo_ways, forces or {})
        if walls:
            self._entries.append((time, 1, walls))

    def _file_of_walls(
        self, step: int, servo_ways: Mapping[str, np.ndarray] | None, forces: Mapping[str, np.ndarray]
    ) -> str | None:
        """The file of the walls up to `step`: one for each segment, one for each frame where they move or
        have a stress.
        """
        k = [k for k, (start, _, _) in enumerate(self._segments) if start < step or start == 0][-1]
        walls = self._segments[k][2]
        stressed = bool(self.scene.output.wall_stress)
        each = stressed or any(wall.name in self.scene.wall_paths for wall in walls)
        name = f"{FRAMES}/walls_{step:09d}.vtu" if each else f"{FRAMES}/walls_{k}.vtu"
        if walls and name not in self._written:
            import meshio

            points, quads = walls_mesh(self.scene, walls, step, servo_ways)
            cells = wall_cells(self.scene, walls, forces, points, quads) if stressed else {}
            with replacing(self.directory / name) as partial:
                mesh = meshio.Mesh(points, [("quad", quads)], cell_data={k: [v] for k, v in cells.items()})
                mesh.write(partial, file_format="vtu", binary=True, compression=None)
            self._written.add(name)
        return name if walls else None


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

    def walls(self, k: int) -> dict[str, np.ndarray]:
        """What frame k has for the cells of its walls (`wall_cells`); {} without `output.wall_stress`.

        Raises FrameError: a missing or broken file.
        """
        step = self.names[k].removeprefix(f"{FRAMES}/p_")
        path = self.directory / FRAMES / f"walls_{step}"
        return read_vtu_and_cells(path)[1] if path.is_file() else {}

    def at(self, time: float) -> Frame:
        """The frame nearest to a time [s]."""
        return self[int(np.argmin(np.abs(self.times - time)))]
