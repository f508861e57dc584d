"""The commands about one scene: run, resume, animate, deck, validate."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from comparisons import codes, execute, progress, provenance, setup_table
from gpudem.errors import GpudemError
from gpudem.output.restart import FILE, Restart
from gpudem.output.run import Run
from gpudem.scene import Scene
from gpudem.scene import checks as scene_checks


class RunError(GpudemError):
    """A code could not run a valid scene."""

    exit_code = 3


def run(path: Path, code: str, options: codes.Options, out: Path | None, quiet: bool) -> int:
    """Run a scene file through one code into a folder; Ctrl-C keeps the frames written so far."""
    scene = Scene.from_toml(path)
    directory = (
        execute.own_directory(out) if out else execute.new_directory(Path("runs"), provenance.commit()[0])
    )
    (directory / "scene.json").write_text(scene.to_json())
    return _shown(
        scene, path, code, directory, quiet,
        lambda step: codes.CODES[code].run(scene, directory, options, step, {}),
    )  # fmt: skip


def resume(directory: Path, device: str, threads: int | None, quiet: bool) -> int:
    """Go on with a run of gpudem from its restart file."""
    from gpudem import driver

    restart = Restart.load(directory)
    click.echo(f"from step {restart.step}, t = {restart.step * restart.scene.time.step:.9g} s", err=True)
    return _shown(
        restart.scene, directory, "gpudem", directory, quiet,
        lambda step: driver.resume(directory, device=device, threads=threads, progress=step),
    )  # fmt: skip


def _shown(
    scene: Scene, what: Path, code: str, directory: Path, quiet: bool, start: Callable[[codes.Progress], Run]
) -> int:
    """Run with progress and a last line; Ctrl-C keeps what is on disk. Raises RunError."""
    reporter = progress.reporter(quiet)
    reporter.say(f"{scene.name}: {len(scene.state)} particles, {scene.n_steps} steps -> {directory}")
    before = scene_checks.scene_warnings(scene) if code == "event_driven" else scene_checks.warnings(scene)
    for warning in before:
        click.echo(f"warning: {warning}", err=True)
    reporter.begin(scene.name, len(scene.state), scene.n_steps)
    try:
        result = start(reporter.step)
    except KeyboardInterrupt:
        reporter.close()
        click.echo(f"interrupted at step {reporter.pace.done}; what is on disk stays: {directory}", err=True)
        if (directory / FILE).is_file():
            click.echo(f"go on with: gpudem resume {directory}", err=True)
        return 130
    except GpudemError as error:
        raise RunError(
            f"{codes.title(code)} could not run {what}: {error}\nwhat is on disk stays: {directory}"
        ) from error
    finally:
        reporter.end()
        reporter.close()
    for warning in (w for w in result.warnings if w not in before):
        click.echo(f"warning: {warning}", err=True)
    t = result.timing
    cores = f"{t.cores} {'rank' if code == 'liggghts' else 'core'}{'s' if t.cores > 1 else ''}"
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
    click.echo(directory / "run.pvd")
    return 0


def animate(directory: Path, out: Path, quiet: bool, **options: Any) -> int:
    """Draw the frames of a run into a file."""
    from comparisons import animate as module
    from comparisons import render

    count = module.animate(directory, out, **options)
    if not render.can_render():
        click.echo(f"warning: {render.NO_GL}", err=True)
    if not quiet:
        click.echo(f"{count} frames, {out.stat().st_size / 1e6:.2f} MB", err=True)
    click.echo(out)
    return 0


def deck(path: Path) -> int:
    """Print the deck."""
    from reference.liggghts import deck as module

    click.echo(module.render(Scene.from_toml(path)).text, nl=False)
    return 0


def validate(path: Path) -> int:
    """Say what a valid scene amounts to. Raises SceneError for one that is not."""
    scene = Scene.from_toml(path)
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
