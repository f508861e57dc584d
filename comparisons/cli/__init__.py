"""The command line.

Exit codes: 0 all checks hold, 1 a check fails, 2 bad input, 3 a code could not run or output could not be
written, 130 stopped by Ctrl-C, SIGTERM or SIGHUP.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from comparisons.harness import codes
from comparisons.harness.case import TIERS
from gpudem._version import __version__
from gpudem.errors import GpudemError, SceneError
from gpudem.extras import from_extra

if TYPE_CHECKING:
    from comparisons.harness.results import Comparison

BAD_INPUT, COULD_NOT_RUN, INTERRUPTED = 2, 3, 130
#: What ends a run in order: what is there is saved first. SIGHUP is that of a terminal that closes.
STOPS = (signal.SIGTERM, signal.SIGHUP)

DEVICE = click.option(
    "--device", default="cpu", show_default=True, help="Warp device of gpudem: cpu, cuda:0."
)
PRECISION = click.option(
    "--precision", type=click.Choice(["float64", "mixed", "float32"]), help="Overrides the scene's."
)
THREADS = click.option(
    "--threads", type=click.IntRange(1), help="Cores of gpudem on the CPU.  [default: all]"
)
RANKS = click.option(
    "--ranks", type=click.IntRange(1), default=1, show_default=True, help="MPI ranks of LIGGGHTS."
)
QUIET = click.option("-q", "--quiet", is_flag=True, help="No progress.")
SCENE = click.argument("scene", type=click.Path(path_type=Path))
PACKAGES = click.option(
    "--cases", "packages", multiple=True, metavar="PACKAGE",
    help="Cases of a package or module that can be imported, also from the current folder; repeatable.",
)  # fmt: skip


class _Failure(GpudemError):
    """The machine, not the user's input, is in the way: disk full, closed pipe, no memory."""

    exit_code = COULD_NOT_RUN


@contextlib.contextmanager
def _one_line() -> Iterator[None]:
    """Errors of the system as errors of ours. Raises GpudemError in place of OSError and MemoryError."""
    try:
        yield
    except BrokenPipeError:
        raise _Failure("the output was closed before all was written to it (broken pipe)") from None
    except OSError as error:
        where = error.filename if isinstance(error.filename, str) else "the output"
        kind = (
            _Failure if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO) else GpudemError
        )
        raise kind(f"{where}: {error.strerror or error}") from error
    except MemoryError as error:
        raise _Failure(f"not enough memory{f': {error}' if str(error) else ''}") from error


class _App(click.Group):
    """A group in which a closed pipe is an error of ours, not click's silent exit code 1."""

    def make_context(self, *arguments: Any, **options: Any) -> click.Context:
        with _one_line():
            return super().make_context(*arguments, **options)

    def invoke(self, ctx: click.Context) -> Any:
        with _one_line():
            return super().invoke(ctx)


@click.group(cls=_App, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__)
def app() -> None:
    """Discrete element method on NVIDIA Warp, cross-validated against LIGGGHTS."""


@app.command()
@SCENE
@click.option("--code", default="gpudem", show_default=True, help="Which code runs it.")
@DEVICE
@PRECISION
@THREADS
@RANKS
@click.option(
    "--out", type=click.Path(path_type=Path), help="New or empty folder.  [default: runs/<UTC>_<commit>]"
)
@QUIET
def run(scene: Path, code: str, out: Path | None, quiet: bool, **options: Any) -> int:
    """Run one scene; frames open in ParaView by run.pvd."""
    from comparisons.cli import scene_commands as cli_scene

    code = codes.select([code])[0]
    return cli_scene.run(scene, code, codes.Options(**options), out, quiet)


@app.command()
@click.argument("directory", type=click.Path(path_type=Path))
@DEVICE
@THREADS
@QUIET
def resume(directory: Path, device: str, threads: int | None, quiet: bool) -> int:
    """Go on with a stopped run from its restart file (scene: output.restart_every)."""
    from comparisons.cli import scene_commands as cli_scene

    return cli_scene.resume(directory, device, threads, quiet)


@app.command()
@SCENE
@click.option(
    "--until", type=click.Choice(["settled", "end", "full"]), default="settled", show_default=True,
    help="When the particles rest, or at the end of the run; with --grow, full: as many as fit.",
)  # fmt: skip
@click.option(
    "--grow",
    is_flag=True,
    help="No run: the particles of an [[insert]] of kind pack grow in its region, to a dense random packing.",
)
@click.option(
    "--fraction", type=click.FloatRange(1e-6, 1), default=1e-3, show_default=True,
    help="Rest: the mean energy of a particle is below that of a fall of this fraction of a radius.",
)  # fmt: skip
@DEVICE
@THREADS
@click.option("--out", type=click.Path(path_type=Path), default=Path("bed.npz"), show_default=True)
@QUIET
def pack(scene: Path, out: Path, until: str, grow: bool, quiet: bool, **options: Any) -> int:
    """Run a scene until its particles rest, and keep them as a file that [particles] path reads."""
    from comparisons.cli import scene_commands as cli_scene

    if grow:
        if until == "end":
            raise click.UsageError("--until end: nothing is run with --grow")
        return cli_scene.grow(scene, out, until == "full", quiet)
    if until == "full":
        raise click.UsageError("--until full: has no meaning without --grow")
    return cli_scene.pack(scene, out, until == "settled", quiet, **options)


@app.command()
@SCENE
def deck(scene: Path) -> int:
    """Print the LIGGGHTS deck of a scene."""
    from comparisons.cli import scene_commands as cli_scene

    return cli_scene.deck(scene)


@app.command()
@SCENE
def validate(scene: Path) -> int:
    """Check a scene file and say what it amounts to; nothing runs."""
    from comparisons.cli import scene_commands as cli_scene

    return cli_scene.validate(scene)


@app.command()
@click.option(
    "--tier", type=click.Choice(TIERS), default="quick", show_default=True, help="Whose checks to count."
)
@PACKAGES
def cases(tier: Any, packages: tuple[str, ...]) -> int:
    """List the comparison cases: the project's own, those of installed packages, those of --cases."""
    from comparisons.harness.discover import known_cases

    found = known_cases(packages)
    width = max([len(case.name) for case in found], default=0)
    for case in found:
        count = len(case.checks_of(tier))
        where = f"{count:3d} checks" if tier in case.tiers else f"not in {tier}"
        click.echo(f"{case.name:{width}}  {where}  {case.title}")
    return 0


@app.command()
@click.argument("case", nargs=-1)
@PACKAGES
@click.option("--tier", type=click.Choice(TIERS), default="quick", show_default=True)
@click.option(
    "--seeds", type=click.IntRange(5, 10), help="Of a scene: runs over seeds, each code.  [default: 5]"
)
@click.option("--against", multiple=True, help="Of a scene: only this code beside gpudem; repeatable.")
@click.option("--work-precision", is_flag=True, help="Of a scene: error against time over steps.")
@click.option("--record", is_flag=True, help="Full tier: keep the results in comparisons/recorded/full.")
@click.option("--codes", "chosen", help="Comma-separated.  [default: all]")
@click.option(
    "--with",
    "own",
    metavar="COMMAND",
    help="A code of yours: 'python my_dem.py {scene} {out}' (docs/guide/own_code.md).",
)
@click.option(
    "--with-name", "own_name", default="own_code", show_default=True, help="Its name in the report."
)
@click.option(
    "--with-timeout", "own_timeout", default=600.0, show_default=True, help="Its time limit a run [s]."
)
@DEVICE
@PRECISION
@THREADS
@RANKS
@click.option(
    "--jobs",
    type=click.IntRange(1),
    help="Runs side by side, those that are not timed.  [default: one a core; on a GPU 1]",
)
@click.option(
    "--out", type=click.Path(path_type=Path), help="New or empty folder.  [default: runs/<UTC>_<commit>]"
)
@QUIET
def compare(
    case: tuple[str, ...],
    packages: tuple[str, ...],
    tier: Any,
    record: bool,
    chosen: str | None,
    own: str | None,
    own_name: str,
    own_timeout: float,
    jobs: int | None,
    out: Path | None,
    quiet: bool,
    seeds: int | None,
    against: tuple[str, ...],
    work_precision: bool,
    **options: Any,
) -> int:
    """Run cases (default: all, or those of --cases) or scene files; write a report, results.json, junit.xml.

    An argument that is a file, or ends in .toml or .json, is a scene: what can be asked of it is found out.
    """
    from comparisons.cli.scene_commands import output_directory
    from comparisons.harness import execute, progress, recorded_cases
    from comparisons.harness.discover import cases_to_run
    from comparisons.scene_case import build

    scenes, known = build.split(case)
    if not scenes and (seeds or work_precision):
        raise GpudemError("--seeds and --work-precision are for scene files, and none is given")
    cases = cases_to_run(known, tier, packages) if known or packages or not scenes else []  # may bring codes
    cases += build.from_files(
        scenes, [c.name for c in cases], seeds=seeds or 5, work_precision=work_precision,
        precision=options["precision"],
    )  # fmt: skip
    beside = ["gpudem", *against] if against else None
    try:
        names = codes.select(beside or (codes.CODES if chosen is None else chosen.split(",")))
    except GpudemError as error:
        raise GpudemError(f"{'--against' if against else '--codes'}: {error}") from None
    if own is not None:
        names = (*names, codes.register_command(own, own_name, own_timeout))
    if record and tier != "full":
        raise GpudemError(f"--record: keeps results of the full tier, this is {tier}: add --tier full")
    if not cases:
        raise GpudemError(f"no case in the {tier} tier")
    with output_directory(out) as directory:
        reporter = progress.reporter(quiet)
        reporter.say(f"report: {directory / 'report.html'} (rewritten after every case)")
        made = codes.Options(**options)
        session = execute.Session(
            cases, directory, tier=tier, selected=names, options=made, reporter=reporter,
            workers=execute.default_workers(made) if jobs is None else jobs,
        )  # fmt: skip
        result = session.run()
    for path in recorded_cases.keep(result, directory) if record else []:
        click.echo(f"kept: {path}", err=True)
    _found(result, directory)
    return result.exit_code()


def _found(result: Comparison, directory: Path) -> None:
    """The last lines of a comparison."""
    from comparisons.harness import progress
    from comparisons.report import view

    n = result.counts()
    click.echo(
        f"{n['pass']} pass, {n['fail']} fail, {n['error']} error, {n['left_out']} left out"
        f" in {progress.duration(result.wall_s)}\n{directory / 'report.html'}"
    )
    for line in (*view.missing_codes(result), *result.notices):
        click.echo(line)
    for case, sentence in view.headlines(result):
        click.echo(f"{case}: {sentence}" if case else sentence)
    for line in result.broken():
        click.echo(f"error: {line}", err=True)
    if result.state == "interrupted":
        click.echo("interrupted: what was done so far is in the report", err=True)


@app.command()
@click.argument("directory", type=click.Path(path_type=Path))
def report(directory: Path) -> int:
    """Rebuild report.html and junit.xml of a comparison from its stored results; no code runs."""
    from comparisons.harness import results
    from comparisons.harness.evaluate import describe
    from comparisons.report import junit, page

    comparison = results.load(directory)
    try:
        junit.write(comparison, directory)
        click.echo(page.write(comparison, directory))
    except (ArithmeticError, LookupError, ValueError) as error:  # of the schema, and yet nothing to show
        raise GpudemError(f"{directory}: its results cannot be shown: {describe(error)}") from error
    except OSError as error:
        raise GpudemError(f"{directory}: cannot write there: {error.strerror}") from None
    return 0


@app.command()
@click.argument("before", type=click.Path(path_type=Path))
@click.argument("after", type=click.Path(path_type=Path))
@click.option(
    "--tolerance",
    default=0.1,
    show_default=True,
    help="Show changes of a value from so many of its tolerances.",
)
@click.option("--json", "as_json", is_flag=True, help="Print it as JSON.")
def diff(before: Path, after: Path, tolerance: float, as_json: bool) -> int:
    """What changed between two comparisons; exit code 1 if a verdict changed for the worse."""
    from pydantic import TypeAdapter

    from comparisons.harness import difference, results

    found = difference.difference(results.load(before), results.load(after), tolerance)
    if as_json:
        form = TypeAdapter(difference.Difference)
        click.echo(form.dump_json(found, indent=1).decode())
    else:
        click.echo("\n".join(difference.text(found)))
    return int(found.worse)


@app.command()
@click.argument("directory", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help=".gif or .mp4.  [default: DIRECTORY/run.gif]")
@click.option("--fps", type=click.FloatRange(0.1, 100), default=20.0, show_default=True)
@click.option("--view", type=click.Choice(["side", "oblique"]), default="side", show_default=True)
@click.option("--color", default="speed", show_default=True, help="speed, or a column of the frames.")
@click.option("--width", type=click.IntRange(100, 4000), default=800, show_default=True, help="Pixels.")
@QUIET
def animate(directory: Path, out: Path | None, quiet: bool, **options: Any) -> int:
    """Make a moving picture, GIF or MP4, of the frames of a run."""
    from comparisons.cli import scene_commands as cli_scene

    return cli_scene.animate(directory, out or directory / "run.gif", quiet, **options)


@app.command(add_help_option=False, context_settings={"ignore_unknown_options": True})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def bench(arguments: tuple[str, ...]) -> int:
    """Measure speed and memory of both codes on beds of spheres; `gpudem bench --help` for its options."""
    from comparisons.bench import command as module

    return module.main(list(arguments)) or 0


@app.command()
@click.argument("name", type=click.Choice(["scene", "run", "results"]))
def schema(name: str) -> int:
    """Print the JSON schema of a file: scene.json for a code of yours, run.json of it, results.json."""
    from comparisons.harness import results
    from reference.process import contract

    if name == "results":
        click.echo(json.dumps(results.json_schema(), indent=1))
        return 0
    click.echo(contract.schema_path(name).read_text(encoding="utf-8"), nl=False)
    return 0


@app.command()
def info() -> int:
    """Versions, devices, the LIGGGHTS binary, rendering."""
    from comparisons.cli import machine

    return machine.show()


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code; our own errors are printed without traceback."""
    try:
        with _stops(), from_extra():  # commands import what they need
            return app.main(arguments, prog_name="gpudem", standalone_mode=False) or 0
    except SceneError as error:
        return _end(str(error), BAD_INPUT)
    except GpudemError as error:
        return _end(f"error: {error}", getattr(error, "exit_code", BAD_INPUT))
    except click.ClickException as error:
        with contextlib.suppress(OSError):
            error.show()
        return BAD_INPUT
    except (KeyboardInterrupt, click.Abort):
        return _end("interrupted", INTERRUPTED)


@contextlib.contextmanager
def _stops() -> Iterator[None]:
    """SIGTERM and SIGHUP end the block as Ctrl-C does.

    One that is ignored from the start stays so: SIGHUP under `nohup`, and SIGINT of a job in the background.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in STOPS}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)


def _interrupt(signum: int, frame: Any) -> None:
    raise KeyboardInterrupt


def _end(message: str, code: int) -> int:
    """Print why a command ends, and see to it that nothing is written to an output that is closed."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with contextlib.suppress(OSError, ValueError):  # not a file: output captured by a test
                null = os.open(os.devnull, os.O_WRONLY)
                os.dup2(null, stream.fileno())
                os.close(null)
    with contextlib.suppress(OSError, ValueError):
        click.echo(message, err=True)
    return code
