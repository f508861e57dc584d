"""`make mutants`: runs the test set on the solver with each mutation of the table, one at a time.

Exit code 0: a test failed for each mutant. 1: a mutant survived. 2: the table does not fit the sources, or
the baseline fails. 3: no mutant survived, but some are unknown: the tests reached the time limit before one
failed.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import click

from comparisons import provenance
from comparisons.mutants.markers import Sources
from comparisons.mutants.recorded import RECORDED, load_record
from comparisons.mutants.table import Mutation, TestSet, load
from comparisons.mutants.trial import CAUGHT, SURVIVED, UNKNOWN, SourceCopy, Verdict
from gpudem.errors import GpudemError

ROOT = Path(__file__).parents[2]
#: Up to so many mutants, the baseline is verified only for the tests that they need.
FEW = 20


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("names", nargs=-1)
@click.option("--record", is_flag=True, help="Store the result in comparisons/recorded/mutants.json.")
@click.option(
    "--everything", is_flag=True, help="Run the whole test set on each mutant, not only until a test fails."
)
def main(names: tuple[str, ...], record: bool, everything: bool) -> None:
    """Test all mutants, or those named."""
    try:
        test_set, mutations = load()
        chosen = [m for m in mutations if not names or m.name in names]
        unknown_names = set(names) - {m.name for m in mutations}
        if unknown_names:
            raise GpudemError(f"no such mutation: {', '.join(sorted(unknown_names))}")
        sources = Sources.read(ROOT)
        for m in mutations:
            m.applied(sources)
        rows, seconds = _test_all(test_set, chosen, everything)
    except GpudemError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(2)
    by_outcome = {
        o: [row["name"] for row in rows if row["outcome"] == o] for o in (CAUGHT, SURVIVED, UNKNOWN)
    }
    click.echo(f"{len(by_outcome[CAUGHT])} of {len(rows)} caught, {seconds:.0f} s")
    for outcome in (SURVIVED, UNKNOWN):
        if by_outcome[outcome]:
            click.echo(f"{outcome}: {', '.join(by_outcome[outcome])}")
    if record:
        _record(rows, seconds, mutations, merge=bool(names))
    sys.exit(exit_code(rows))


def exit_code(rows: list[dict[str, Any]]) -> int:
    """0: all caught; 1: one survived; 3: none survived, one is unknown."""
    outcomes = {row["outcome"] for row in rows}
    return 1 if SURVIVED in outcomes else 3 if UNKNOWN in outcomes else 0


def _record(rows: list[dict[str, Any]], seconds: float, mutations: list[Mutation], merge: bool) -> None:
    """Write the record; with `merge`, rows replace those of the same names, and each has its own commit."""
    where = {k: v for k, v in provenance.collect().items() if k in ("date", "commit", "hardware")}
    RECORDED.parent.mkdir(exist_ok=True)
    last = load_record() if merge else None
    if last is not None:
        where, seconds = last.provenance, last.seconds
        merged = {row["name"]: row for row in [*(r.data for r in last.rows), *rows]}
        rows = [merged[m.name] for m in mutations if m.name in merged]
    text = json.dumps({"provenance": where, "seconds": round(seconds), "mutants": rows}, indent=1)
    RECORDED.write_text(text + "\n")
    click.echo(f"stored in {RECORDED}")


def _test_all(
    test_set: TestSet, chosen: list[Mutation], everything: bool
) -> tuple[list[dict[str, Any]], float]:
    began, rows = time.monotonic(), []
    with tempfile.TemporaryDirectory(prefix="mutants_") as folder:
        copy = SourceCopy(ROOT, Path(folder), test_set)
        if len(chosen) > FEW:  # else each member of the test set is verified when a mutant first needs it
            seconds = copy.verify_baseline(list(test_set.nodes))
            click.echo(f"baseline: all {len(test_set.nodes)} members of the test set pass, {seconds:.0f} s")
        for k, m in enumerate(chosen, 1):
            verdict = copy.test(m, list(test_set.nodes if everything else m.first_tests))
            rows.append(_row(m, copy.sources, verdict, provenance.commit()[0]))
            click.echo(f"[{k}/{len(chosen)}] {m.name}: {_phrase(verdict)}, {verdict.seconds:.0f} s")
    return rows, time.monotonic() - began


def _phrase(verdict: Verdict) -> str:
    if verdict.outcome == UNKNOWN:
        return "UNKNOWN: no test failed before the time limit"
    if verdict.outcome == SURVIVED:
        return "SURVIVED"
    more = f" and {len(verdict.caught_by) - 1} more" if len(verdict.caught_by) > 1 else ""
    return f"caught by {verdict.caught_by[0]}{more}"


def _row(m: Mutation, sources: Sources, verdict: Verdict, commit: str) -> dict[str, Any]:
    marked = sources.find(m.marker)
    return {
        "name": m.name, "marker": m.marker, "operation": str(m.operation), "file": marked.path,
        "line": marked.line, "defect": m.defect, "outcome": verdict.outcome, "caught_by": verdict.caught_by,
        "tried": len(verdict.tried), "seconds": round(verdict.seconds, 1), "commit": commit,
    }  # fmt: skip


if __name__ == "__main__":
    main()
