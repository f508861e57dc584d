"""`make mutants`: runs the test set on the solver with each mutation of the table, one at a time.

Exit code 0: a test failed for each mutant. 1: a mutant survived. 2: the table does not fit the sources, or
the baseline fails. 3: no mutant survived, but some are unknown: the tests reached the time limit before one
failed.
"""

from __future__ import annotations

import fcntl
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from comparisons.harness import provenance
from comparisons.mutation.markers import Sources
from comparisons.mutation.recorded import RECORDED, load_record
from comparisons.mutation.table import Mutation, TestSet, load
from comparisons.mutation.trial import CAUGHT, SURVIVED, UNKNOWN, SourceCopy, Verdict
from gpudem.errors import GpudemError
from gpudem.output.atomic import write_text

ROOT = Path(__file__).parents[2]
#: Up to so many mutants, the baseline is verified only for the tests that they need.
FEW = 20


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("names", nargs=-1)
@click.option("--record", is_flag=True, help="Store the result in comparisons/recorded/mutants.json.")
@click.option("--part", default="1/1", help="K/N: every Nth mutant from the Kth on, for several processes.")
@click.option(
    "--everything", is_flag=True, help="Run the whole test set on each mutant, not only until a test fails."
)
def main(names: tuple[str, ...], record: bool, part: str, everything: bool) -> None:
    """Test all mutants, or those named; each result is stored at once."""
    try:
        test_set, mutations = load()
        chosen = _part([m for m in mutations if not names or m.name in names], part)
        unknown_names = set(names) - {m.name for m in mutations}
        if unknown_names:
            raise GpudemError(f"no such mutation: {', '.join(sorted(unknown_names))}")
        sources = Sources.read(ROOT)
        for m in mutations:
            m.applied(sources)

        def store(row: dict[str, Any]) -> None:
            if record:
                _record([row], 0.0, mutations, merge=True)

        few = len(chosen) <= FEW or part != "1/1"
        rows, seconds = _test_all(test_set, chosen, everything, few, store)
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
        _record(rows, seconds, mutations, merge=len(chosen) < len(mutations))
        click.echo(f"stored in {RECORDED}")
    sys.exit(exit_code(rows))


def _part(mutations: list[Mutation], part: str) -> list[Mutation]:
    """Every Nth from the Kth on, of K/N. Raises GpudemError: not such a fraction."""
    try:
        k, n = (int(number) for number in part.split("/"))
    except ValueError:
        k = n = 0
    if not 1 <= k <= n:
        raise GpudemError(f"--part = {part!r}: must be K/N with 1 <= K <= N, like 1/2")
    return mutations[k - 1 :: n]


def exit_code(rows: list[dict[str, Any]]) -> int:
    """0: all caught; 1: one survived; 3: none survived, one is unknown."""
    outcomes = {row["outcome"] for row in rows}
    return 1 if SURVIVED in outcomes else 3 if UNKNOWN in outcomes else 0


def _record(rows: list[dict[str, Any]], seconds: float, mutations: list[Mutation], merge: bool) -> None:
    """Write the record; with `merge`, rows replace those of the same names, and each has its own commit."""
    where = {k: v for k, v in provenance.collect().items() if k in ("date", "commit", "hardware")}
    RECORDED.parent.mkdir(exist_ok=True)
    with (RECORDED.parent / ".mutants.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # several processes may test a part each
        last = load_record() if merge else None
        if last is not None:
            where, seconds = last.provenance, last.seconds
            merged = {row["name"]: row for row in [*(r.data for r in last.rows), *rows]}
            rows = [merged[m.name] for m in mutations if m.name in merged]
        text = json.dumps({"provenance": where, "seconds": round(seconds), "mutants": rows}, indent=1)
        write_text(RECORDED, text + "\n")


def _test_all(
    test_set: TestSet,
    chosen: list[Mutation],
    everything: bool,
    few: bool,
    store: Callable[[dict[str, Any]], None],
) -> tuple[list[dict[str, Any]], float]:
    began, rows = time.monotonic(), []
    with tempfile.TemporaryDirectory(prefix="mutants_") as folder:
        copy = SourceCopy(ROOT, Path(folder), test_set)
        if not few:  # else each member of the test set is verified when a mutant first needs it
            seconds = copy.verify_baseline(list(test_set.nodes))
            click.echo(f"baseline: all {len(test_set.nodes)} members of the test set pass, {seconds:.0f} s")
        for k, m in enumerate(chosen, 1):
            verdict = copy.test(m, list(test_set.nodes if everything else m.first_tests))
            rows.append(_row(m, copy.sources, verdict, provenance.commit()[0]))
            store(rows[-1])
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
