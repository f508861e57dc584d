"""report.html: one self-contained page from results.json and the artefacts beside it. No code runs for it."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from comparisons.harness import codes, recorded_cases
from comparisons.harness.numbers import number
from comparisons.harness.progress import duration, quantity
from comparisons.harness.results import Artefact, Comparison
from comparisons.report import view as report_view
from gpudem.output.atomic import write_bytes

REPORT = "report.html"

#: Sections that collect figures and tables from all cases: key -> (heading, what the reader finds there).
COLLECTED = {
    "lead": (
        "What accuracy costs",
        "The run time that each code and option needs for a given error of the motion through a contact:"
        " stepping only, one core, the codes in turn on one machine.",
    ),
    "advice": (
        "Which step, modulus and precision to use",
        "Recommendations, with the numbers measured here.",
    ),
    "work_precision": (
        "Error against run time",
        "What each digit of accuracy costs: each point is one run, lower left is better. The time is that of"
        " stepping; compiling, set-up and output are listed in the timing tables.",
    ),
    "speed": (
        "Speed and memory",
        "Both codes in one run on one machine: the same scene, the same number of cores, warm-up first.",
    ),
    "limits": ("Where each code breaks", "The limits of each code, and what goes wrong beyond them."),
    "leaves_out": (
        "What a scene leaves out",
        "Physics that a scene does not have costs nothing: no array, no kernel branch, no deck line.",
    ),
}


def write(comparison: Comparison, directory: Path) -> Path:
    """Write DIRECTORY/report.html and return its path."""
    path = directory / REPORT
    write_bytes(path, html(comparison, directory).encode())
    return path


def html(comparison: Comparison, directory: Path) -> str:
    """The page. Figures, tables and decks are read from the folder; what is missing is said to be."""
    view = report_view.View(comparison, directory)
    return _environment().get_template("report.html.j2").render(
        c=comparison, view=view, collected=COLLECTED, artefact=functools.partial(_artefact, directory),
        kept=functools.partial(_artefact, recorded_cases.FOLDER),
    )  # fmt: skip


def _artefact(directory: Path, item: Artefact) -> dict[str, Any]:
    """What stands in the page for a figure or table."""
    path = directory / item.file
    if item.status != "ok":
        return {"missing": item.why}
    if not path.is_file():
        return {"missing": f"{item.file} is missing"}
    if item.kind == "figure":
        return {"svg": Markup(path.read_text())}  # made by comparisons.svg from our own figures: trusted
    return {"table": report_view.read_table(path)}


@functools.cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {
        "num": number, "short": lambda x: number(x, 2), "quantity": quantity, "duration": duration,
        "code": codes.title, "memory": report_view.memory, "slug": report_view.anchor,
    }  # fmt: skip
    return environment
