"""Do the tests detect defects? The recorded result of `make mutants`: the solver with known defects."""

from __future__ import annotations

from comparisons.kit import Case, Finding, Measured, Results, Rows, Table
from comparisons.mutation.recorded import load_record
from comparisons.mutation.table import Mutation, load
from comparisons.mutation.trial import CAUGHT, SURVIVED, UNKNOWN


def _count(outcome: str) -> Measured:
    """Mutants of the record with an outcome; NaN without a record."""
    record = load_record()
    if record is None:
        return Measured(float("nan"), note="not recorded: make mutants ARGS=--record")
    names = record.named(outcome)
    total = f"{len(record.named(CAUGHT))} of {len(record.rows)} caught"
    return Measured(len(names), note=", ".join(names) or total)


def survivors(results: Results) -> Measured:
    return _count(SURVIVED)


def unknown(results: Results) -> Measured:
    return _count(UNKNOWN)


def not_recorded(results: Results) -> Measured:
    """Mutations of the table that the record does not contain, or only with another operation."""
    record, mutations = load_record(), load()[1]
    rows = {row.name: row.data for row in record.rows} if record else {}

    def recorded(m: Mutation) -> bool:
        row = rows.get(m.name)
        if row is None or "operation" not in row:  # without one: of the format before markers
            return row is not None
        return (row["marker"], row["operation"]) == (m.marker, str(m.operation))

    missing = [m.name for m in mutations if not recorded(m)]
    return Measured(len(missing), note=", ".join(missing))


def table(results: Results) -> Rows:
    """One row per mutant: the defect, and the members of the test set that detected it."""
    record = load_record()
    return [
        {"mutant": row.name, "defect": row.defect, "outcome": row.outcome,
         "caught by": ", ".join(dict.fromkeys(name.partition(":")[0] for name in row.caught_by))}
        for row in (record.rows if record else [])
    ]  # fmt: skip


def _caption() -> str:
    record = load_record()
    if record is None:
        return "Not recorded yet: make mutants ARGS=--record."
    p = record.provenance
    return (
        f"Recorded, not run for this report: {p['date']}, commit {p['commit']}, {p['hardware']['cpu']},"
        f" {p['hardware']['cores']} cores, {record.seconds / 60:.0f} minutes. emulator: comparison step by"
        " step with an independent NumPy implementation of the contact law; case: the checks of that case"
        " against closed forms and the ODE; the others are tests of the solver of that name. If no test among"
        " the first fails for a mutant, the whole test set runs. unknown: the time limit was reached before a"
        " test failed."
    )


CASE = Case(
    name="mutants",
    title="Do the tests detect defects?",
    purpose=(
        "A check that cannot fail shows nothing. Mutation testing puts known defects into the solver, one at"
        " a time: a sign, a factor, a lost spring, a missed cell. The test set, which passes on the solver"
        " itself (the baseline), runs on each of these mutants; if it passes there too, the solver could have"
        " that defect without a test failing."
    ),
    source="make mutants; the mutations are data, comparisons/mutation/data/mutations.toml.",
    variants=lambda tier: [],
    checks=(),
    findings=(
        Finding("mutants that no test detects", survivors, "mutants", "Of the recorded run.", ()),
        Finding(
            "mutants without a result within the time limit", unknown, "mutants",
            "Of the recorded run; not counted as detected.", (),
        ),
        Finding(
            "mutations that the record does not contain", not_recorded, "mutants",
            "0: the record is of the present table of mutations.", (),
        ),
        Finding(
            "mutations", lambda results: float(len(load()[1])), "mutants",
            "Defects in the table; 25 were required.", (),
        ),
    ),
    tables=(Table("Mutants", _caption(), table, needs=()),),
    features=("mutants",),
    order=95,
)  # fmt: skip
