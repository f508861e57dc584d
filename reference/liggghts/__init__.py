"""LIGGGHTS 3.8 as a reference code: one function, `run(scene, directory) -> Run`."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from gpudem.output import observables
from gpudem.output.atomic import WriteError
from gpudem.output.directory import begin
from gpudem.output.run import Run, Timing
from gpudem.scene import Scene, checks
from gpudem.solver import guards
from reference.liggghts import binary as program
from reference.liggghts import dump, limits, recorded, wall_loads
from reference.liggghts.deck import RAW, TRACE, render
from reference.liggghts.errors import LiggghtsFailed, LiggghtsNotFound
from reference.liggghts.runner import execute


def run(
    scene: Scene, directory: Path, *, ranks: int = 1, timeout: float | None = None,
    progress: Callable[[int], None] | None = None, use_recorded: bool = True,
) -> Run:  # fmt: skip
    """Run a scene in LIGGGHTS; deck.in, particles.data and log.liggghts stay beside the result.

    Args:
        scene: What to run.
        directory: Where to; made if missing, what an earlier run left in it is removed.
        ranks: MPI processes.
        timeout: Wall-clock limit [s].
        progress: Called with the number of steps done.
        use_recorded: Where the binary is missing, take output recorded for exactly this deck, if there is
            any; the run's warnings and notes then say so.

    Raises:
        LiggghtsCannotState: LIGGGHTS has no words for something in the scene.
        LiggghtsNotFound: no binary and nothing recorded; says how to install it.
        LiggghtsFailed: the run did not reach its end with all particles.
        LiggghtsTimeout: it did not end in time.
        LiggghtsOutputError: a dump is missing or broken.
    """
    directory = Path(directory)
    deck = render(scene, ranks)
    try:
        binary = program.find_liggghts()
    except LiggghtsNotFound as error:
        if not (use_recorded and recorded.has(deck.hash)):
            raise LiggghtsNotFound(
                f"{error}\n  and no output is recorded for deck {deck.hash[:12]}"
            ) from None
        _begin(directory, scene)
        return recorded.recall(deck.hash, scene, directory)
    _begin(directory, scene)
    outcome = execute(deck, directory, binary, ranks=ranks, timeout=timeout, progress=progress)
    console = outcome.console
    traced = dump.trace(scene, directory / TRACE) if scene.output.trace_every is not None else None
    history, left_out = dump.history(scene, console.blocks, directory / RAW), []
    if history is not None:
        history, left_out = observables.select(history, wall_loads.chosen(scene), "LIGGGHTS")
    dump.frames(scene, directory)
    timing = Timing(
        particles=dump.mean_count(scene, console.blocks), steps=scene.n_steps,
        stepping_s=max(0.0, outcome.loop_s - console.output_s),
        setup_s=outcome.wall_s - outcome.loop_s, output_s=console.output_s, cores=ranks,
        peak_memory_bytes=outcome.peak_memory_bytes,
    )  # fmt: skip
    notes = {"deck_hash": deck.hash, "ranks": ranks, "recorded": False, "binary": binary, **console.counts}
    warnings = [*checks.warnings(scene), *limits.warnings(scene), *console.warnings, *left_out]
    result = Run("liggghts", console.version, scene, directory, timing, warnings, notes, traced, history)
    result.warnings += guards.overlap_warnings(result)
    result.save()
    return result


def _begin(directory: Path, scene: Scene) -> None:
    """Remove what an earlier run left, so that a failed run cannot pass for it. Raises LiggghtsFailed."""
    try:
        begin(directory, scene)
        if (directory / RAW).is_dir():
            shutil.rmtree(directory / RAW)
    except OSError as error:
        raise LiggghtsFailed(f"{directory}: cannot be written: {error}") from error
    except WriteError as error:
        raise LiggghtsFailed(str(error)) from error
