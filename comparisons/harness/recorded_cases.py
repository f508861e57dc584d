"""Cases that take too long for every run: their last results in the full tier, kept with their provenance.

`gpudem compare CASE --tier full --record` writes comparisons/recorded/full/CASE.json; a report of a shorter
tier shows it beside the case, as recorded, with date, commit and machine. Figures and tables that say
`recorded` lie beside it in CASE/.
"""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from comparisons.harness.results import Artefact, CaseResult, Comparison, Origin, Recorded
from gpudem.errors import GpudemError
from gpudem.output.atomic import write_bytes

FOLDER = Path(__file__).parents[1] / "recorded" / "full"

_FORM = TypeAdapter(Recorded)


def keep(comparison: Comparison, directory: Path, folder: Path = FOLDER) -> list[Path]:
    """Write the finished cases of a comparison that lies in a directory, one file each; returns the files."""
    made = comparison.provenance
    facts = Origin(
        commit=made["commit"], dirty=made["dirty"], date=made["date"], hardware=made["hardware"]
    )  # fmt: skip
    written = []
    for case in comparison.cases:
        if case.status != "done":
            continue
        versions = {run.code: run.version for run in comparison.runs if run.case == case.name}
        recorded = Recorded(
            tier=comparison.tier,
            provenance=facts,
            versions=versions,
            wall_s=round(case.wall_s, 1),
            checks=[c for c in comparison.checks if c.case == case.name],
            artefacts=_artefacts(case, directory, folder),
            code=case.code,
            findings=[f for f in comparison.findings if f.case == case.name],
        )
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{case.name}.json"
        write_bytes(path, _FORM.dump_json(recorded, indent=1) + b"\n")
        written.append(path)
    return written


def _artefacts(case: CaseResult, directory: Path, folder: Path) -> list[Artefact]:
    """Copies of the figures and tables to be kept."""
    shutil.rmtree(folder / case.name, ignore_errors=True)
    kept = []
    for item in case.artefacts:
        if not item.recorded or item.status != "ok":
            continue
        source = directory / item.file
        file = Path(case.name) / source.name
        (folder / case.name).mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, folder / file)
        kept.append(dataclasses.replace(item, file=str(file)))
    return kept


def find(case: str, folder: Path = FOLDER) -> Recorded | None:
    """What was kept of a case; None if nothing was. Raises GpudemError naming a broken file."""
    path = folder / f"{case}.json"
    if not path.is_file():
        return None
    try:
        return _FORM.validate_json(path.read_bytes())
    except ValidationError as error:
        raise GpudemError(f"{path}: {error.errors()[0]['msg']} ({error.error_count()} problems)") from None
