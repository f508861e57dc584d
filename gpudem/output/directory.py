"""The folder of a run: what stands in it, how a new run takes it over, and the scene that it holds.

    scene.json     the resolved scene
    particles.npz  its initial state, where the scene takes its particles from a file
    mesh_NAME.npz  vertices and triangles of the wall NAME, where the scene takes them from a file
    run.json       code, version, timing, warnings, and the hash of the scene; written last
    run.pvd        frames and walls with physical time, frames/p_<step>.vtu, frames/walls_<k>.vtu; where
                   walls move, frames/walls_<step>.vtu
    history.csv    trace.npz  restart.npz

A run needs nothing outside its folder: it can be moved, and the files of particles and meshes that it came
from may change.
"""

from __future__ import annotations

import dataclasses
import os
import shutil
from pathlib import Path

from gpudem.errors import GpudemError
from gpudem.output.atomic import WriteError, remove_temporary, write_npz, write_text
from gpudem.output.vtu import PVD
from gpudem.scene import FromFile, Mesh, Scene, SceneError
from gpudem.scene.files import json_text, parse_json
from gpudem.scene.sources import Source

SCENE, PARTICLES, RUN = "scene.json", "particles.npz", "run.json"
HISTORY, TRACE, RESTART, FRAMES = "history.csv", "trace.npz", "restart.npz", "frames"
#: In the order in which they are removed: first what makes a folder a run.
_FILES = (RUN, RESTART, HISTORY, TRACE, PVD, SCENE, PARTICLES)


def check_writable(directory: Path) -> None:
    """Raises WriteError where the folder cannot be made or written; creates nothing."""
    place = directory.absolute()
    while not place.exists() and place != place.parent:
        place = place.parent
    if not place.is_dir():
        raise WriteError(directory, NotADirectoryError(20, f"{place} is not a folder"))
    if not os.access(place, os.W_OK | os.X_OK):
        raise WriteError(directory, PermissionError(13, os.strerror(13)))


def begin(directory: Path, scene: Scene) -> None:
    """Make the folder that of a new run: what an older run of any code left is removed, the scene saved.

    Only files of the names above are removed; others stay. Raises WriteError.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(directory, error) from error
    remove_temporary(directory)
    for name in (*_FILES[:-2], *_own_files(directory), *_FILES[-2:]):
        _remove(directory / name)
    frames = directory / FRAMES
    if frames.is_dir():
        remove_temporary(frames)
        for path in [*frames.glob("p_*.vtu"), *frames.glob("walls_*.vtu")]:
            _remove(path)
        if not any(frames.iterdir()):
            shutil.rmtree(frames, ignore_errors=True)
    save_scene(directory, scene)


def begin_again(directory: Path, step: int) -> None:
    """Make the folder that of a run that continues from `step`: what was written after it is removed.

    Raises WriteError.
    """
    for name in (RUN, HISTORY, TRACE):
        _remove(directory / name)
    remove_temporary(directory)
    frames = directory / FRAMES
    if frames.is_dir():
        remove_temporary(frames)
        for path in [*frames.glob("p_*.vtu"), *frames.glob(f"walls_{'?' * 9}.vtu")]:
            number = path.stem.rpartition("_")[2]
            if number.isdigit() and int(number) > step:
                _remove(path)


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise WriteError(path, error) from error


def _own_files(directory: Path) -> list[str]:
    """Files of meshes and insertions that the scene.json of a folder names, if `save_scene` writes such."""
    try:
        data = parse_json((directory / SCENE).read_text(encoding="utf-8"), SCENE)
        meshes = [wall["file"] for wall in data["walls"] if wall.get("file") == _mesh_file(wall["name"])]
        lists = [insert.get("path") for insert in data.get("insert", ())]
        return meshes + [_insertion_file(k) for k, path in enumerate(lists) if path == _insertion_file(k)]
    except (OSError, UnicodeDecodeError, SceneError, LookupError, TypeError, AttributeError):
        return []  # no scene that we wrote


def _insertion_file(k: int) -> str:
    return f"insert_{k}.npz"


def _mesh_file(wall: str) -> str:
    return f"mesh_{wall}.npz"


def save_scene(directory: Path, scene: Scene) -> None:
    """Write scene.json, and what it takes from files: particles.npz, insert_K.npz, mesh_NAME.npz.

    Raises WriteError.
    """
    data = scene.model_dump()
    if isinstance(scene.particles, FromFile):
        start = scene.particles_at_start
        columns = {field.name: getattr(start, field.name) for field in dataclasses.fields(start)}
        write_npz(directory / PARTICLES, columns)
        data["particles"]["path"] = PARTICLES
    data["insert"] = list(data["insert"])
    for k, insert in enumerate(scene.insert):
        if isinstance(insert, Source) or insert.path is not None:
            found = scene.insertion_lists[k]
            assert found.time is not None
            columns = {f.name: getattr(found.state, f.name) for f in dataclasses.fields(found.state)}
            data["insert"][k] = {"kind": "list", "path": _insertion_file(k)}
            write_npz(directory / _insertion_file(k), {**columns, "time": found.time})
    for wall, stated in zip(scene.walls, data["walls"], strict=True):
        if isinstance(wall, Mesh) and wall.file is not None:
            vertices, triangles = wall.stated
            stated["file"] = _mesh_file(wall.name)
            write_npz(directory / stated["file"], {"vertices": vertices, "triangles": triangles})
    write_text(directory / SCENE, json_text(data))


def load_scene(directory: Path) -> Scene:
    """The scene of a run with the particles that were run; a relative particle path counts from the folder.

    Raises:
        GpudemError: scene.json is missing.
        SceneError: it cannot be read or is not a scene, particles.npz is missing or broken.
    """
    path = directory / SCENE
    if not path.is_file():
        raise GpudemError(f"{path}: no such file: not the folder of a run")
    return Scene.from_file(path)


def require_hash(path: Path, stated: object, scene: Scene) -> None:
    """Raises GpudemError where a file of a run states the hash of another scene than scene.json gives."""
    if stated != scene.hash:
        raise GpudemError(
            f"{path}: of another scene (hash {str(stated)[:12]}) than {path.with_name(SCENE)} (hash"
            f" {scene.hash[:12]}): the folder holds parts of two runs, or its scene or particles were changed"
        )
