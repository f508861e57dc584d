"""Does the suite catch errors? The recorded result of `make mutants`: the solver broken in named ways."""

from __future__ import annotations

import pandas

from comparisons.case import Case, Check, Measured, Results, Table
from comparisons.mutants.recorded import recorded
from comparisons.mutants.table import load

LEAST = 25


def survivors(results: Results) -> Measured:
    """Mutants of the record that nothing caught; NaN without a record."""
    data = recorded()
    if data is None:
        return Measured(float("nan"), note="not recorded: make mutants ARGS=--record")
    alive = [row["name"] for row in data["mutants"] if not row["caught_by"]]
    return Measured(len(alive), note=", ".join(alive) or f"all {len(data['mutants'])} caught")


def out_of_date(results: Results) -> Measured:
    """Mutations of the table that the record does not have."""
    data = recorded()
    kept = {} if data is None else {row["name"] for row in data["mutants"]}
    mutations = load()[1]
    wrong = [m.name for m in mutations if m.name not in kept]
    return Measured(len(wrong), measured=len(mutations), note=", ".join(wrong))


def table(results: Results) -> pandas.DataFrame:
    """One row a mutant: what is wrong, and which members of the battery saw it."""
    data = recorded()
    rows = []
    for row in data["mutants"] if data else []:
        seen = dict.fromkeys(name.partition(":")[0] for name in row["caught_by"] or ["nothing"])
        rows.append((row["name"], row["wrong"], ", ".join(seen)))
    return pandas.DataFrame(rows, columns=["mutant", "what is wrong then", "caught by"])


def _caption() -> str:
    data = recorded()
    if data is None:
        return "Not recorded yet: make mutants ARGS=--record."
    p = data["provenance"]
    return (
        f"Recorded, not run now: {p['date']}, commit {p['commit']}, {p['hardware']['cpu']},"
        f" {p['hardware']['cores']} cores, {data['seconds'] / 60:.0f} minutes. emulator: step by step"
        " against an independent NumPy statement of the law; case: the checks of that case against closed"
        " forms and the ODE; the others are tests of the solver by that name. A mutant that the first"
        " members of the battery miss meets all of it."
    )


CASE = Case(
    name="mutants",
    title="Does the suite catch errors?",
    purpose=(
        "A check that cannot fail shows nothing. The solver is broken in named ways, one at a time: a sign, a"
        " factor, a lost spring, a cell missed. Each broken copy meets a battery of fast checks, which the"
        " sound copy passes; one that passes as well would be an error that could stand in the solver unseen."
    ),
    source="make mutants; the ways are data, comparisons/mutants/data/mutations.toml.",
    variants=lambda tier: [],
    checks=(
        Check(
            name="mutants that no check catches", measure=survivors, tolerance=0, unit="mutants",
            against="recorded make mutants", mark="R", needs=(), reason="an exact statement",
            catches="a wrong that the suite is blind to",
        ),
        Check(
            name="ways to break the solver that the record does not have", measure=out_of_date,
            tolerance=0, unit="mutants", against="the table", mark="R", needs=(), reason="an exact statement",
            catches="a record that is out of date",
        ),
        Check(
            name="ways to break the solver", measure=lambda results: float(len(load()[1])), lo=LEAST,
            tolerance=1000, unit="mutants", against="at least 25 asked", mark="R", needs=(),
            reason="a wrong of every kind", catches="a table that has shrunk",
        ),
    ),
    tables=(Table("Mutants", _caption(), table, needs=()),),
    features=("mutants",),
    order=95,
)  # fmt: skip
