"""Checks, findings, figures and tables of a case, evaluated on its runs; a failure becomes a result."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from comparisons.harness import brought, codes
from comparisons.harness.case import (
    Case,
    Check,
    Figure,
    Finding,
    Measured,
    Results,
    Table,
    Tier,
    Unmeasured,
    Variant,
)
from comparisons.harness.results import Artefact, CheckResult, FindingResult, Status
from gpudem.errors import GpudemError
from gpudem.output.run import Run

Key = tuple[str, str]


class RunFailed(GpudemError):
    """A measure asked for a run that failed."""


class Runs(dict[Key, Run]):
    """The runs of a case. Asking for one that failed or is missing raises, and so does asking for all.

    No result is made from fewer runs than it needs; only what a code cannot be given is left out of all.
    """

    def __init__(
        self,
        runs: dict[Key, Run],
        failed: dict[Key, str],
        absent: dict[Key, str],
        unstated: dict[Key, str],
        unneeded: dict[Key, str] | None = None,
    ):
        """`unneeded`: runs of missing codes without which all are whole; asked for, they are left out."""
        super().__init__(runs)
        self.failed, self.absent, self.unstated = failed, absent, unstated
        self.unneeded = unneeded or {}

    def __missing__(self, key: Key) -> Run:
        code, variant = codes.title(key[1]), key[0]
        if key in self.failed:
            raise RunFailed(f"{code} failed on {variant}: {self.failed[key]}")
        if key in self.absent or key in self.unneeded:
            raise Unmeasured(f"needs {code} on {variant}: {(self.unneeded | self.absent)[key]}")
        if key in self.unstated:
            raise Unmeasured(f"{code} cannot be given {variant}: {self.unstated[key]}")
        raise KeyError(key)

    def get(self, key: Key, default: Any = None) -> Any:
        """The run, or `default` if there never was to be one; one that failed or is missing raises."""
        return self[key] if key in self or key in self.failed or key in self.absent else default

    def _whole(self) -> None:
        for key in (*self.failed, *self.absent):
            self.__missing__(key)

    def __iter__(self):
        self._whole()
        return super().__iter__()

    def items(self):
        """(key, run) of all; raises RunFailed if one failed."""
        self._whole()
        return super().items()

    def values(self):
        """All runs; raises RunFailed if one failed."""
        self._whole()
        return super().values()


class Evaluation:
    """The runs of one case and what its checks, figures and tables make of them."""

    def __init__(self, case: Case, tier: Tier, selected: tuple[str, ...]):
        self.case, self.selected = case, selected
        self.tier: Tier = tier
        self.runs: dict[Key, Run] = {}
        self.failed: dict[Key, str] = {}
        self.ended: dict[Key, str] = {}
        self.absent: dict[Key, str] = {}
        """Runs of codes that are not on this machine: why, and how to get the code."""
        self.unstated: dict[Key, str] = {}
        """Runs left out since the code cannot be given the scene: why."""
        self._cache: dict[Any, Any] = {}

    def sort(self, order: dict[tuple[str, str, str], int]) -> None:
        """Put the runs in the order of (case, variant, code), whichever came in first."""
        for found in (self.runs, self.failed, self.ended, self.absent, self.unstated):
            keys = sorted(found, key=lambda key: order[self.case.name, *key])
            held = {key: found[key] for key in keys}
            found.clear()
            found.update(held)  # pyright: ignore[reportArgumentType, reportCallIssue]

    def check(self, check: Check) -> CheckResult:
        """Evaluate one check; an exception becomes an error result with its message."""
        why = brought.not_required(check, self.runs)
        if why:
            return outcome(self.case, check, "left_out", why)
        status, why, found = self._measure(check)
        if status == "ok":
            status = "pass" if holds(check, found["value"]) else "fail"
        if status == "fail":
            why = brought.explained(check, found["value"], self.runs, self._results(check.needs))
            status = "left_out" if why else "fail"
        return outcome(self.case, check, status, why, **found)

    def finding(self, finding: Finding) -> FindingResult:
        """Measure one finding; an exception becomes an error result with its message."""
        status, why, found = self._measure(finding)
        kept = {k: v for k, v in found.items() if k in ("value", "note")}
        return FindingResult(
            self.case.name, finding.name, status, finding.unit, finding.sentence, finding.needs, why, **kept
        )

    def _measure(self, item: Check | Finding) -> tuple[Any, str, dict[str, Any]]:
        """("ok", "left_out" or "error", why it is not ok, the numbers and the note)."""
        status, why = self._missing(item)
        if status:
            return status, why, {}
        try:
            measured = item.measure(self._results(item.needs))
            if not isinstance(measured, Measured):
                measured = Measured(float(measured))
            found: dict[str, Any] = {
                k: _number(getattr(measured, k)) for k in ("value", "measured", "expected")
            }
            return "ok", "", {**found, "note": measured.note}
        except Unmeasured as error:
            return "left_out", str(error), {}
        except Exception as error:
            return *self._without(error), {}

    def follow_up(self) -> list[Variant]:
        """The variants that depend on the runs that there are."""
        return self.case.follow_up(self._results(())) if self.case.follow_up else []

    def differs(self) -> dict[str, str]:
        """What differs in each code that a user brought (`brought.differs`), by code."""
        own = [code for code in self.selected if codes.brought(code)]
        found = {code: brought.differs(code, self._results((code,))) for code in own}
        return {code: what for code, what in found.items() if what}

    def headline(self, checks: list[CheckResult], differs: dict[str, str]) -> str:
        """What was found, in one sentence; why it could not be made where that fails."""
        if self.case.headline is None:
            found = [brought.sentence(code, what, checks) for code, what in differs.items()]
            return f"{'; '.join(found)}." if found else ""
        try:
            first = self.case.headline(self._results(()), checks)
        except Exception as error:
            return f"the sentence could not be made: {describe(error)}"
        ran = {code for _, code in self.runs}
        of = {code: {check.status for check in checks if code in check.needs} for code in differs}
        agree = {code for code in differs if "pass" in of[code] and not of[code] & {"fail", "error"}}
        more = [
            f"{codes.title(code)}: {what}"
            for code, what in differs.items()  # where the code's checks hold, nothing is left to explain
            if code in ran and not (code in agree and what.startswith(brought.UNKNOWN))
        ]
        return f"{'; '.join([first.removesuffix('.'), *more])}." if more else first

    def figure(self, figure: Figure, root: Path, number: int) -> Artefact:
        """Draw one figure into <case>/figures/."""
        from comparisons.report import plots, svg

        def write(stem: str) -> str:
            path = root / self.case.name / "figures" / f"{stem}.svg"
            path.parent.mkdir(parents=True, exist_ok=True)
            with plots.look():
                drawn = figure.draw(self._results(figure.needs))
                path.write_text(svg.of(drawn))
            return str(path.relative_to(root))

        return self._artefact("figure", figure, number, write)

    def table(self, table: Table, root: Path, number: int) -> Artefact:
        """Write one table into <case>/tables/."""
        import pandas

        def write(stem: str) -> str:
            path = root / self.case.name / "tables" / f"{stem}.csv"
            path.parent.mkdir(parents=True, exist_ok=True)
            pandas.DataFrame(table.make(self._results(table.needs))).to_csv(path, index=False)
            return str(path.relative_to(root))

        return self._artefact("table", table, number, write)

    def _artefact(self, kind, item: Figure | Table, number: int, write) -> Artefact:
        status, why = self._missing(item)
        file = ""
        if not status:
            try:
                status, file = "ok", write(f"{number:02d}_{slug(item.title)}")
            except Unmeasured as error:
                status, why = "left_out", str(error)
            except Exception as error:
                status, why = self._without(error)
        return Artefact(kind, item.title, item.caption, item.section, file, status, why, item.recorded)

    def _without(self, error: Exception) -> tuple[Any, str]:
        """(status, why) where an exception ended a measure, such as a column that a code does not write."""
        why = brought.not_written(error, self.runs, self.failed) if isinstance(error, KeyError) else ""
        return ("left_out", why) if why else ("error", describe(error))

    def _results(self, needs: tuple[str, ...]) -> Results:
        failed, absent = (
            {key: why for key, why in of.items() if key[1] in needs} for of in (self.failed, self.absent)
        )
        left_out = {**self.unstated, **self.absent}
        runs = Runs(self.runs, failed, absent, self.unstated, self.absent)
        return Results(self.tier, runs, self._cache, self.ended, left_out, self.failed)

    def _missing(self, item: Check | Finding | Figure | Table) -> tuple[Any, str]:
        away = [code for code in item.needs if code not in self.selected]
        if away:
            return "left_out", f"needs {', '.join(map(codes.title, away))}, which was not selected"
        left_out = {code: why for (_, code), why in [*self.unstated.items(), *self.absent.items()]}
        ran = {code for _, code in [*self.runs, *self.failed, *self.ended]}
        gone = [code for code in item.needs if code in left_out and code not in ran]
        if gone:
            return "left_out", f"needs {codes.title(gone[0])}: {left_out[gone[0]]}"
        never = [code for code in item.needs if code not in ran]
        if never:
            return (
                "error",
                f"no variant of the {self.tier} tier runs through {', '.join(map(codes.title, never))}",
            )
        return None, ""


def outcome(case: Case, check: Check, status: Status, why: str = "", **found: Any) -> CheckResult:
    """The result of a check; `found`: value, measured, expected, note."""
    said = ("name", "unit", "tolerance", "lo", "against", "mark", "reason", "catches", "needs")
    facts = {field: getattr(check, field) for field in said}
    return CheckResult(case=case.name, status=status, why=why, **facts, **found)


def holds(check: Check, value: float) -> bool:
    """Whether a value lies within a check's tolerance; NaN does not."""
    return value <= check.tolerance and (check.lo is None or value >= check.lo)


def describe(error: BaseException) -> str:
    """An exception as a reader needs it: our own messages as they are, others with their kind and place."""
    if isinstance(error, GpudemError):
        return str(error)
    place, last = "", error.__traceback__
    while last is not None:
        place, last = f" ({Path(last.tb_frame.f_code.co_filename).name}, line {last.tb_lineno})", last.tb_next
    return f"{type(error).__name__}: {error}{place}"


def slug(title: str) -> str:
    """A title as a file name."""
    return re.sub(r"[^a-z0-9]+", "_", title.lower()).strip("_")[:48] or "untitled"


def _number(x: Any) -> float | None:
    return None if x is None else float(x)
