"""The commands about one scene: run, resume, pack, animate, deck, validate."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

from comparisons.harness import codes, execute, progress, provenance, setup_table
from gpudem.errors import GpudemError
from gpudem.output.directory import RUN
from gpudem.output.restart import FILE, Restart
from gpudem.output.run import Run
from gpudem.scene import Scene
from gpudem.scene import checks as scene_checks

#: Parts in which the progress of a growth is told.
GROWTH_STEPS = 1000


class RunError(GpudemError):
    """A code could not run a valid scene."""

    exit_code = 3


def run(path: Path, code: str, options: codes.Options, out: Path | None, quiet: bool) -> int:
    """Run a scene file through one code into a folder; Ctrl-C keeps the frames written so far."""
    scene = Scene.from_file(path)

    def start(step: codes.Progress) -> Run:
        result = codes.CODES[code].run(scene, directory, options, step, {})
        if not (directory / RUN).is_file():
            result.save()
        return result

    with output_directory(out) as directory:
        return _shown(scene, path, code, directory, quiet, start)


@contextlib.contextmanager
def output_directory(out: Path | None) -> Iterator[Path]:
    """The folder of the user's choice, or a new one under runs/; removed if nothing was written to it.

    Raises GpudemError: not empty, or not to be written.
    """
    existed = out is not None and out.is_dir()
    if out:
        directory = execute.own_directory(out)
    else:
        directory = execute.new_directory(Path("runs"), provenance.commit()[0])
    try:
        yield directory
    finally:
        if not existed and directory.is_dir() and not any(directory.iterdir()):
            directory.rmdir()
            latest = directory.parent / execute.LATEST
            if out is None and latest.is_symlink() and not latest.exists():
                latest.unlink()


def resume(directory: Path, device: str, threads: int | None, quiet: bool) -> int:
    """Continue a run of gpudem from its restart file."""
    from gpudem import driver

    restart = Restart.load(directory)
    click.echo(f"from step {restart.step}, t = {restart.step * restart.scene.time.step:.9g} s", err=True)
    return _shown(
        restart.scene, directory, "gpudem", directory, quiet,
        lambda step: driver.resume(directory, device=device, threads=threads, progress=step),
        done=restart.step,
    )  # fmt: skip


def _shown(
    scene: Scene,
    what: Path,
    code: str,
    directory: Path,
    quiet: bool,
    start: Callable[[codes.Progress], Run],
    done: int = 0,
) -> int:
    """Run with progress and a last line, from step `done`; what is on disk stays. Raises RunError."""
    reporter = progress.reporter(quiet)
    reporter.say(f"{scene.name}: {len(scene.state)} particles, {scene.n_steps} steps -> {directory}")
    before = scene_checks.scene_warnings(scene) if code == "event_driven" else scene_checks.warnings(scene)
    for warning in before:
        click.echo(f"warning: {warning}", err=True)
    pace = reporter.begin(scene.name, len(scene.state), scene.n_steps)
    pace.done = done
    try:
        result = start(lambda step: reporter.step(pace, step))
    except KeyboardInterrupt:
        reporter.close()
        step = _last_step(directory, pace.done)
        click.echo(f"interrupted at step {step}{_stays(directory)}", err=True)
        if (directory / FILE).is_file():
            click.echo(f"continue with: gpudem resume {directory}", err=True)
        return 130
    except GpudemError as error:
        raise RunError(f"{codes.title(code)} could not run {what}: {error}{_stays(directory)}") from error
    finally:
        reporter.end(pace)
        reporter.close()
    for warning in (w for w in result.warnings if w not in before):
        click.echo(f"warning: {warning}", err=True)
    _summary(result, code)
    click.echo(directory / "run.pvd")
    return 0


def _stays(directory: Path) -> str:
    """Where to find what there is, if there is anything."""
    return f"; what is on disk stays: {directory}" if any(directory.iterdir()) else ""


def _last_step(directory: Path, seen: int) -> int:
    """The step of an interrupted run by its own notes; else the last one of which was told."""
    try:
        return int(json.loads((directory / RUN).read_text())["notes"]["interrupted_at_step"])
    except (OSError, ValueError, KeyError, TypeError):
        return seen


def _summary(result: Run, code: str) -> None:
    """How fast it was, and by which neighbour list."""
    t = result.timing
    cores = f"{t.cores} {codes.unit(code)}{'s' if t.cores > 1 else ''}"
    click.echo(
        f"{t.steps} steps of {t.particles} particles in {progress.duration(t.stepping_s)}:"
        f" {progress.quantity(t.rate)} particle-steps/s on {t.device}, {cores}, {t.precision}"
    )
    if chosen := result.notes.get("list"):
        cells = " x ".join(map(str, chosen["cells"]))
        kind = f"half list, blocks of {chosen['block']}" if "block" in chosen else "full list"
        click.echo(
            f"{kind}, skin {chosen['skin']:.4g} m, cells {cells}, sorted along"
            f" {', '.join(chosen['slowest_first'])} (slowest first); rebuilt {result.notes['rebuilds']} times"
        )


def animate(directory: Path, out: Path, quiet: bool, **options: Any) -> int:
    """Draw the frames of a run into a file."""
    from comparisons.report import animate as module
    from comparisons.report import render

    count = module.animate(directory, out, **options)
    if not render.can_render():
        click.echo(f"warning: {render.NO_GL}", err=True)
    if not quiet:
        click.echo(f"{count} frames, {out.stat().st_size / 1e6:.2f} MB", err=True)
    click.echo(out)
    return 0


def _to_pack(path: Path, out: Path) -> Scene:
    """The scene of which particles are to be made and written. Raises GpudemError."""
    scene = Scene.from_file(path)
    if out.suffix != ".npz":
        raise GpudemError(f"--out {out}: must end in .npz, which particles.path reads")
    return scene


@contextlib.contextmanager
def _making(path: Path, scene: Scene, steps: int, quiet: bool) -> Iterator[codes.Progress]:
    """Progress of what is made of a scene file, in so many steps. Raises RunError, which names the file."""
    reporter = progress.reporter(quiet)
    pace = reporter.begin(scene.name, len(scene.state), steps)
    try:
        yield lambda step: reporter.step(pace, step)
    except GpudemError as error:
        raise RunError(f"{path}: {error}") from error
    finally:
        reporter.end(pace)
        reporter.close()


def pack(path: Path, out: Path, until_settled: bool, quiet: bool, fraction: float, **options: Any) -> int:
    """Make a bed and write it. Raises RunError."""
    from gpudem import bed

    scene = _to_pack(path, out)
    for warning in warnings(scene):
        click.echo(f"warning: {warning}", err=True)
    with _making(path, scene, scene.n_steps, quiet) as step:
        made = bed.make(scene, until_settled=until_settled, fraction=fraction, progress=step, **options)
    made.write(out)
    state = "settled" if made.settled else "not settled"
    click.echo(
        f"{len(made.radius)} particles at {made.time:.6g} s, {state}: mean energy that of a fall of"
        f" {made.energy:.3g} radii\n{out}"
    )
    if until_settled and not made.settled:
        click.echo(
            f"warning: they still move at the end of the run; a longer time.duration, or a fraction above"
            f" {fraction:g}, would let them settle", err=True,
        )  # fmt: skip
    return 0


def grow(path: Path, out: Path, full: bool, quiet: bool) -> int:
    """Make a dense packing by growth and write it. Raises RunError."""
    from gpudem import growth

    scene = _to_pack(path, out)
    with _making(path, scene, GROWTH_STEPS, quiet) as step:
        made = growth.grow(scene, full=full, progress=lambda share: step(int(GROWTH_STEPS * share)))
    made.write(out)
    left_out = f"; {made.left_out} of the statement do not fit" if made.left_out else ""
    click.echo(
        f"{len(made.radius)} particles, packing fraction {made.fraction:.4f}, overlaps up to"
        f" {made.overlap:.2g} of the radius{left_out}\n{out}"
    )
    return 0


def deck(path: Path) -> int:
    """Print the deck."""
    from reference.liggghts import deck as module

    click.echo(module.render(Scene.from_file(path)).text, nl=False)
    return 0


def validate(path: Path) -> int:
    """Say what a valid scene amounts to. Raises SceneError for one that is not."""
    scene = Scene.from_file(path)
    click.echo(f"{path}: valid\n")
    rows = [(f"{name} [{unit}]" if unit else name, value) for name, value, unit in setup_table.rows([scene])]
    frames = scene.n_steps // scene.frame_stride + 1
    rows += [("frames", str(frames)), ("scene hash", scene.hash[:16])]
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        click.echo(f"  {name:{width}}  {value}")
    for warning in warnings(scene):
        click.echo(f"warning: {warning}", err=True)
    return 0


def warnings(scene: Scene) -> list[str]:
    """The checks that the scene waives, and the warnings that every run of it gets."""
    return [*(f"check waived: {name}" for name in scene.allow), *scene_checks.warnings(scene)]
