"""`make mutants`: breaks the solver in every way of the table, one at a time; which check sees it?

Ends with 1 if a mutant survives, 2 if the table is out of date or the sound copy fails the battery.
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
from comparisons.mutants.recorded import RECORDED, recorded
from comparisons.mutants.table import Battery, Mutation, load
from comparisons.mutants.trial import Copy, Verdict
from gpudem.errors import GpudemError

ROOT = Path(__file__).parents[2]
#: So few mutants do not ask for the whole battery on the sound copy first.
FEW = 20


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("names", nargs=-1)
@click.option("--record", is_flag=True, help="Keep the result in comparisons/recorded/mutants.json.")
@click.option(
    "--everything", is_flag=True, help="Try the whole battery on each, not until one check catches."
)
def main(names: tuple[str, ...], record: bool, everything: bool) -> None:
    """Break the solver in all ways, or in those named."""
    try:
        battery, mutations = load()
        chosen = [m for m in mutations if not names or m.name in names]
        unknown = set(names) - {m.name for m in mutations}
        if unknown:
            raise GpudemError(f"no such mutation: {', '.join(sorted(unknown))}")
        for m in mutations:
            m.applied((ROOT / m.file).read_text())
        rows, seconds = _all(battery, chosen, everything)
    except GpudemError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(2)
    alive = [row["name"] for row in rows if not row["caught_by"]]
    click.echo(f"{len(rows) - len(alive)} of {len(rows)} caught, {seconds:.0f} s")
    if alive:
        click.echo(f"survived: {', '.join(alive)}")
    if record:
        where = {k: v for k, v in provenance.collect().items() if k in ("date", "commit", "hardware")}
        RECORDED.parent.mkdir(exist_ok=True)
        kept = recorded() if names else None  # those named replace their rows, each with its own commit
        if kept is not None:
            where, seconds = kept["provenance"], kept["seconds"]
            again = {row["name"]: row for row in [*kept["mutants"], *rows]}
            rows = [again[m.name] for m in mutations if m.name in again]
        text = json.dumps({"provenance": where, "seconds": round(seconds), "mutants": rows}, indent=1)
        RECORDED.write_text(text + "\n")
        click.echo(f"kept in {RECORDED}")
    sys.exit(1 if alive else 0)


def _all(battery: Battery, chosen: list[Mutation], everything: bool) -> tuple[list[dict[str, Any]], float]:
    began, rows = time.monotonic(), []
    with tempfile.TemporaryDirectory(prefix="mutants_") as folder:
        copy = Copy(ROOT, Path(folder), battery)
        if len(chosen) > FEW:  # else each member is proved when a mutant first meets it
            seconds = copy.prove(list(battery.nodes))
            click.echo(f"sound copy: all {len(battery.nodes)} members of the battery pass, {seconds:.0f} s")
        for k, m in enumerate(chosen, 1):
            first = list(battery.nodes) if everything else list(m.look)
            verdict = copy.mutant(m, first)
            rows.append(_row(m, verdict, provenance.commit()[0]))
            word = f"caught by {verdict.caught_by[0]}" if verdict.caught_by else "SURVIVED"
            more = f" and {len(verdict.caught_by) - 1} more" if len(verdict.caught_by) > 1 else ""
            click.echo(f"[{k}/{len(chosen)}] {m.name}: {word}{more}, {verdict.seconds:.0f} s")
    return rows, time.monotonic() - began


def _row(m: Mutation, verdict: Verdict, commit: str) -> dict[str, Any]:
    return {
        "name": m.name, "file": m.file, "old": m.old, "new": m.new, "wrong": m.wrong,
        "caught_by": verdict.caught_by, "tried": len(verdict.tried), "seconds": round(verdict.seconds, 1),
        "commit": commit,
    }  # fmt: skip


if __name__ == "__main__":
    main()
