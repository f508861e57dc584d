"""Runs cases through codes into a folder and keeps results.json, report.html and junit.xml up to date."""

from __future__ import annotations

import dataclasses
import time
import traceback
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from comparisons.harness import codes, provenance, recorded_cases, setup_table
from comparisons.harness.case import Case, Tier, Variant
from comparisons.harness.evaluate import Evaluation, describe, outcome
from comparisons.harness.progress import Reporter, duration
from comparisons.harness.results import (
    CaseResult,
    CheckResult,
    Comparison,
    FindingResult,
    RunResult,
    TimingResult,
)  # fmt: skip
from comparisons.report import junit
from comparisons.report import page as report
from gpudem.errors import GpudemError
from reference.errors import CannotState, CodeMissing, CodeTimeout

LATEST = "latest"
#: A code that is not there or does not come to an end has said nothing about a scene.
NO_ANSWER = (CodeMissing, CodeTimeout)


def new_directory(root: Path, commit: str) -> Path:
    """Make ROOT/<UTC>_<commit>/ and point ROOT/latest to it; an existing run is never reused.

    Raises GpudemError if the folder cannot be made.
    """
    stamp = f"{datetime.now(UTC):%Y-%m-%dT%H%M%SZ}_{commit}"
    for suffix in ("", *(f"_{k}" for k in range(2, 1000))):
        try:
            (root / (stamp + suffix)).mkdir(parents=True)
        except FileExistsError:
            if not root.is_dir():
                raise GpudemError(f"{root}: is a file; choose another folder with --out") from None
            continue
        except OSError as error:
            raise GpudemError(f"{root}: cannot make a folder for the run: {error.strerror}") from None
        link = root / f".{LATEST}.{stamp}{suffix}"
        link.symlink_to(stamp + suffix, target_is_directory=True)
        link.replace(root / LATEST)
        return root / (stamp + suffix)
    raise GpudemError(f"{root}: too many runs within one second")


def own_directory(directory: Path) -> Path:
    """A folder chosen by the user: made, or empty. Raises GpudemError otherwise."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        if any(directory.iterdir()):
            raise GpudemError(
                f"{directory}: not empty; runs never overwrite one another: choose a new folder"
            )
        probe = directory / ".probe"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise GpudemError(f"{directory}: cannot write there: {error.strerror}") from None
    return directory


class Session:
    """One comparison: the cases, the codes, the folder, and the results so far."""

    def __init__(
        self,
        cases: list[Case],
        directory: Path,
        *,
        tier: Tier = "quick",
        selected: tuple[str, ...] | None = None,
        options: codes.Options | None = None,
        reporter: Reporter | None = None,
        command: list[str] | None = None,
    ):
        self.cases = {case.name: case for case in cases}
        selected = tuple(codes.CODES) if selected is None else selected
        self.directory, self.selected = directory, selected
        self.tier: Tier = tier
        self.options, self.reporter = options or codes.Options(), reporter or Reporter()
        self._began = time.monotonic()
        self.comparison = Comparison(
            tier=tier,
            codes=selected,
            options=dataclasses.asdict(self.options),
            started=provenance.utc_now(),
            written=provenance.utc_now(),
            provenance=provenance.collect(command),
            cases=[_blank(case, tier) for case in cases],
        )

    def run(self) -> Comparison:
        """All cases in order. After Ctrl-C what is done is kept, and the rest is left out, and why."""
        self.write()
        try:
            for number, case in enumerate(self.cases.values(), 1):
                self.reporter.say(f"[{number}/{len(self.cases)}] {case.name}: {case.title}")
                self.run_case(case)
            self.finished()
        except KeyboardInterrupt:
            self.interrupted()
        finally:
            self.reporter.close()
        return self.comparison

    def finished(self) -> None:
        """All cases are done: the last word of the report."""
        self.comparison.state = "done"
        self.write()

    def run_case(self, case: Case) -> list[CheckResult]:
        """All variants through all selected codes, then checks, findings, figures and tables; the page is
        rewritten.
        """
        began, evaluation = time.monotonic(), Evaluation(case, self.tier, self.selected)
        result = _blank(case, self.tier)
        try:
            variants = case.variants(self.tier)
            result = dataclasses.replace(result, setup=setup_table.rows([v.scene for v in variants]))
            self._run_all(evaluation, variants)
            self._run_all(evaluation, evaluation.follow_up())
            result = dataclasses.replace(result, status="done")
        except Exception as error:
            result = dataclasses.replace(result, status="error", why=describe(error))
        checks = self._checks(evaluation, result)
        self.comparison.checks += checks
        findings = [evaluation.finding(f) for f in case.findings_of(self.tier, self.selected)]
        self.comparison.findings += findings
        figures = [f for f in case.figures if self.tier in f.tiers]
        tables = [t for t in case.tables if self.tier in t.tiers]
        result.artefacts[:] = [evaluation.figure(f, self.directory, k) for k, f in enumerate(figures, 1)]
        result.artefacts.extend(evaluation.table(t, self.directory, k) for k, t in enumerate(tables, 1))
        headline = evaluation.headline(checks)
        result = dataclasses.replace(result, headline=headline)
        self._replace(dataclasses.replace(result, wall_s=time.monotonic() - began))
        self._say(result, checks, findings, time.monotonic() - began)
        self.write()
        return checks

    def interrupted(self) -> None:
        """Ctrl-C: what did not come to be evaluated is left out, and said so."""
        self.comparison.state = "interrupted"
        for blank in [c for c in self.comparison.cases if c.status == "waiting"]:
            self._replace(dataclasses.replace(blank, status="interrupted", why="interrupted by the user"))
            case, done = (
                self.cases[blank.name],
                {c.name for c in self.comparison.checks if c.case == blank.name},
            )
            rest = [c for c in case.checks_of(self.tier, self.selected) if c.name not in done]
            self.comparison.checks += [outcome(case, c, "left_out", "interrupted by the user") for c in rest]
        self.write()

    def write(self) -> None:
        """Bring results.json, junit.xml and report.html up to date, each whole or not at all."""
        self.comparison.wall_s = time.monotonic() - self._began
        self.comparison.written = provenance.utc_now()
        self.comparison.save(self.directory)
        junit.write(self.comparison, self.directory)
        report.write(self.comparison, self.directory)

    # -- parts -----------------------------------------------------------------------------------------------

    def _run_all(self, evaluation: Evaluation, variants: list[Variant]) -> None:
        for variant in variants:
            for code in variant.codes_of(self.selected):
                self._run(evaluation, variant, code)

    def _run(self, evaluation: Evaluation, variant: Variant, code: str) -> None:
        case, scene = evaluation.case.name, variant.scene
        directory = self.directory / case / variant.label / code
        directory.mkdir(parents=True)
        facts = {
            "case": case,
            "variant": variant.label,
            "code": code,
            "directory": str(directory.relative_to(self.directory)),
            "scene_hash": scene.hash,
            "state_hash": provenance.state_hash(scene),
            "seed": provenance.seed(scene),
        }
        began = time.monotonic()
        self.reporter.begin(f"{case} {variant.label} {codes.title(code)}", len(scene.state), scene.n_steps)
        try:
            extra = variant.options.get(code, {})
            run = codes.CODES[code].run(scene, directory, self.options, self.reporter.step, extra)
        except Exception as error:
            why = describe(error)
            left_out = _left_out(evaluation, variant, code, error)
            if left_out is not None:
                left_out[variant.label, code] = why
                self.comparison.runs.append(RunResult(**facts, version="", status="left_out", why=why))
                return
            if variant.may_end and isinstance(error, GpudemError) and not isinstance(error, NO_ANSWER):
                evaluation.ended[variant.label, code] = why
                self.comparison.runs.append(RunResult(**facts, version="", status="ended", why=why))
                return
            (directory / "error.txt").write_text(traceback.format_exc())
            evaluation.failed[variant.label, code] = why
            self.comparison.runs.append(RunResult(**facts, version="", status="error", why=why))
            self.reporter.say(f"  ERROR {codes.title(code)} on {variant.label}: {why}")
            return
        finally:
            self.reporter.end()
        wall = time.monotonic() - began
        evaluation.runs[variant.label, code] = run
        self.comparison.runs.append(
            RunResult(
                **facts,
                version=run.version,
                status="ok",
                warnings=run.warnings,
                notes=run.notes,
                deck_hash=str(run.notes.get("deck_hash", "")),
                recorded=bool(run.notes.get("recorded", False)),
            )
        )
        timing: dict[str, Any] = dataclasses.asdict(run.timing) | {"rate": run.timing.rate, "wall_s": wall}
        self.comparison.timings.append(
            TimingResult(case=case, variant=variant.label, code=code, version=run.version, **timing)
        )

    def _checks(self, evaluation: Evaluation, result: CaseResult) -> list[CheckResult]:
        checks = evaluation.case.checks_of(self.tier, self.selected)
        if result.status == "error":
            return [outcome(evaluation.case, check, "error", result.why) for check in checks]
        return [evaluation.check(check) for check in checks]

    def _replace(self, result: CaseResult) -> None:
        cases = self.comparison.cases
        cases[[c.name for c in cases].index(result.name)] = result

    def _say(
        self, result: CaseResult, checks: list[CheckResult], findings: list[FindingResult], seconds: float
    ) -> None:
        held = sum(c.status == "pass" for c in checks)
        self.reporter.say(f"  {held} of {len(checks)} checks hold, {duration(seconds)}")
        if result.headline:
            self.reporter.say(f"  {result.headline}")
        if result.status == "error":
            self.reporter.say(f"  ERROR {result.why}")
            return
        for item in result.artefacts:
            if item.status == "error":
                self.reporter.say(f"  ERROR {item.kind} {item.title!r}: {item.why}")
        for finding in findings:
            if finding.status == "error":
                self.reporter.say(f"  ERROR finding {finding.name!r}: {finding.why}")
        for check in checks:
            if check.status in ("fail", "error"):
                self.reporter.say(f"  {check.status.upper()} {check.name}: {check.verdict}")


def _left_out(
    evaluation: Evaluation, variant: Variant, code: str, error: Exception
) -> dict[tuple[str, str], str] | None:
    """Where to note a run that is left out, its code missing or not to be given the scene; None: it failed.

    A variant that names its codes has been written for them: what they cannot be given is a failure.
    """
    if isinstance(error, CodeMissing):
        return evaluation.absent
    if isinstance(error, CannotState) and not variant.names(code) and not variant.may_end:
        return evaluation.unstated
    return None


def _blank(case: Case, tier: Tier) -> CaseResult:
    recorded = recorded_cases.find(case.name) if tier != "full" else None
    facts = (case.name, case.title, case.purpose, case.source, case.order, case.features)
    return CaseResult(*facts, recorded=recorded)
