"""report.html: one self-contained page from results.json and the artefacts beside it. No code runs for it."""

from __future__ import annotations

import base64
import functools
import hashlib
from pathlib import Path
from typing import Any

import jinja2

from comparisons.harness import codes, recorded_cases
from comparisons.harness.folder import FIGURE, TABLE, Folder, Refused, link
from comparisons.harness.numbers import number
from comparisons.harness.progress import duration, quantity
from comparisons.harness.results import Artefact, Comparison
from comparisons.report import svg as svg_module
from comparisons.report import view as report_view
from gpudem.output.atomic import write_bytes

REPORT = "report.html"
TEMPLATES = Path(__file__).parent / "templates"

#: Sections that collect figures and tables from all cases: key -> (heading, what the reader finds there).
COLLECTED = {
    "lead": (
        "What accuracy costs",
        "The run time that each code and option needs for a given error of the motion through a contact:"
        " stepping only, one core, the codes in turn on one machine.",
    ),
    "advice": (
        "Which time step, modulus and precision to use",
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
    "limits": ("Where each code breaks", "The limits of each code, and what happens beyond them."),
    "leaves_out": (
        "What a scene leaves out",
        "Physics that a scene does not have costs nothing: no array, no kernel branch, no deck line.",
    ),
}


def write(comparison: Comparison, directory: Path) -> Path:
    """Write DIRECTORY/report.html and return its path."""
    path = directory / REPORT
    write_bytes(path, html(comparison, directory).encode(errors="replace"))
    return path


def html(comparison: Comparison, directory: Path) -> str:
    """The page. Figures, tables and decks are read from the folder; what is missing or refused is said to be.

    Nothing outside the folder (and that of the project's records) is read, and the page runs no script but
    its own: figures are images, all text is escaped, and a content security policy says so to the browser.
    """
    view = report_view.View(comparison, directory)
    return _environment().get_template("report.html.j2").render(
        c=comparison, view=view, collected=COLLECTED, wide=svg_module.WIDE, script_hash=_script_hash(),
        artefact=functools.cache(functools.partial(_artefact, view.folder)),
        kept=functools.cache(functools.partial(_artefact, Folder(recorded_cases.FOLDER))),
    )  # fmt: skip


def _artefact(folder: Folder, item: Artefact) -> dict[str, Any]:
    """What stands in the page for a figure or table."""
    if item.status != "ok":
        return {"missing": item.why}
    try:
        if item.kind == "figure":
            return {"image": _image(folder.read(item.file, FIGURE))}
        return {"table": report_view.read_table(folder.read(item.file, TABLE).decode(errors="replace"))}
    except Refused as error:
        return {"missing": str(error)}


def _image(svg: bytes) -> dict[str, Any]:
    """Source and size [CSS pixels] of an SVG as an image, in which a browser runs and loads nothing."""
    width, height = svg_module.size(svg.decode(errors="replace"))
    data = base64.b64encode(svg).decode()
    return {"src": f"data:image/svg+xml;base64,{data}", "width": width, "height": height}


def _script_hash() -> str:
    """Of the page's one script, for its content security policy."""
    text = (TEMPLATES / "page.js").read_text().removesuffix("\n")  # as jinja includes it
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


@functools.cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {
        "num": number, "short": lambda x: number(x, 2), "quantity": quantity, "duration": duration,
        "code": codes.title, "memory": report_view.memory, "slug": report_view.anchor,
        "link": link, "named": report_view.named, "prose": report_view.prose,
    }  # fmt: skip
    return environment
