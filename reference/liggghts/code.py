"""LIGGGHTS as the harness knows it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gpudem.output.run import Run
from gpudem.scene import Scene
from reference.code import Code, Options, Progress
from reference.liggghts import binary
from reference.liggghts.errors import LiggghtsNotFound


def _run(scene: Scene, directory: Path, options: Options, progress: Progress, extra: dict[str, Any]) -> Run:
    from reference import liggghts
    from reference.liggghts import deviations

    if "deviation" in extra:  # a deck of the closed list of the report's findings
        return deviations.run(scene, directory, progress=progress, **extra)
    arguments: dict[str, Any] = {"ranks": options.ranks} | extra
    return liggghts.run(scene, directory, progress=progress, **arguments)


def _missing() -> str:
    try:
        binary.find_liggghts()
    except LiggghtsNotFound as error:
        return str(error)
    return ""


def _ranks(cores: int) -> dict[str, Any]:
    return {"ranks": cores, "use_recorded": False}


CODE = Code(
    name="liggghts", title="LIGGGHTS", run=_run, role="reference", unit="rank", missing=_missing,
    on_cores=_ranks,
    style={
        "color": "#d55e00", "linestyle": "none", "marker": "o", "markersize": 4.5,
        "markerfacecolor": "none", "markeredgewidth": 1.2, "zorder": 4,
    },
)  # fmt: skip
