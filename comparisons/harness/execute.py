"""Runs cases through codes into a folder and keeps results.json, report.html and junit.xml up to date."""

from __future__ import annotations

import contextlib
import dataclasses
import time
import traceback
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from comparisons.harness import attribution, codes, jobs, provenance, recorded_cases, setup_table, sources
from comparisons.harness.case import Case, Tier, Unmeasured, Variant
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
from gpudem.output.run import Timing
from gpudem.solver.device import cores

LATEST = "latest"


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


@dataclasses.dataclass
class _Open:
    """A case under way."""

    evaluation: Evaluation
    result: CaseResult
    variants: dict[str, Variant] = dataclasses.field(default_factory=dict)
    to_run: list[jobs.Job] = dataclasses.field(default_factory=list)
    """Its runs that have no outcome yet."""
    followed: bool = False
    """Its follow-up is among them, or done."""
    spent: float = 0.0
    """Seconds of its set-up, runs, checks, figures and tables, whether or not others ran beside them."""

    @property
    def case(self) -> Case:
        return self.evaluation.case

    def is_timed(self, job: jobs.Job) -> bool:
        """Whether nothing may run beside a run."""
        return self.case.timed or self.variants[job.key[1]].timed

    @contextlib.contextmanager
    def errors(self) -> Iterator[None]:
        """An exception of the block is that of the case, whose checks then have no result."""
        began = time.monotonic()
        try:
            yield
        except Exception as error:
            self.result = dataclasses.replace(self.result, status="error", why=describe(error))
            self.to_run.clear()
        self.spent += time.monotonic() - began


#: Runs that an executor has.
_Sent = dict["Future[jobs.Outcome]", tuple[_Open, jobs.Job]]


class Session:
    """One comparison: the cases, the codes, the folder, and the results so far.

    Args:
        cases: What to run.
        directory: An empty folder for all that is written.
        tier: Which variants and checks of the cases.
        selected: Names of codes; None: all.
        options: How they run.
        reporter: Where progress is shown.
        command: The command line, for the report.
        workers: Runs side by side in so many processes, one core each; 1: one after another in this process,
            with the cores that `options` allows. Variants and cases that are timed run alone either way.
        executor: Takes the runs instead of local workers; `jobs.Job` and `jobs.Outcome` are what is sent.
    """

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
        workers: int = 1,
        executor: Executor | None = None,
    ):
        self.cases = {case.name: case for case in cases}
        selected = tuple(codes.CODES) if selected is None else selected
        self.directory, self.selected = directory, selected
        self.tier: Tier = tier
        self.options, self.reporter = options or codes.Options(), reporter or Reporter()
        self._workers, self._executor = workers, executor
        self._display = jobs.Display(self.reporter)
        self._began = time.monotonic()
        self._order: dict[jobs.Key, int] = {}
        self._not_sent: dict[str, str] = {}
        """Codes with a run that could not be sent to a worker: why."""
        self.comparison = Comparison(
            tier=tier,
            codes=selected,
            options=dataclasses.asdict(self.options),
            started=provenance.utc_now(),
            written=provenance.utc_now(),
            provenance=provenance.collect(command),
            cases=[_blank(case, tier) for case in cases],
            missing={code: why for code in selected if (why := codes.missing(code))},
        )

    def run(self) -> Comparison:
        """All cases. After Ctrl-C what is done is kept, and the rest is left out, and why."""
        self.write()
        try:
            if self._executor is not None or self._workers > 1:
                self._side_by_side([self._open(case) for case in self.cases.values()])
            else:
                for case in self.cases.values():
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
        """All variants through all selected codes, one after another in this process, then its checks."""
        opened = self._open(case)
        self._title(opened)
        self._alone(opened)
        return self._judge(opened)

    def run_with_others(self, case: Case) -> None:
        """Run a case that has not run. Where runs go side by side, all others that have not run take part;
        a case that times programs itself runs alone.
        """
        if self._executor is None and self._workers == 1:
            self.run_case(case)
            return
        waiting = {blank.name for blank in self.comparison.cases if blank.status == "waiting"}
        others = [other for other in self.cases.values() if other.name in waiting and not other.timed]
        self._side_by_side([self._open(one) for one in ([case] if case.timed else others)])

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
        place = {name: k for k, name in enumerate(self.cases)}
        for of_cases in (self.comparison.checks, self.comparison.findings):
            of_cases.sort(key=lambda result: place[result.case])
        for of_runs in (self.comparison.runs, self.comparison.timings):
            of_runs.sort(key=lambda r: (place[r.case], self._order[r.case, r.variant, r.code]))
        self.comparison.wall_s = time.monotonic() - self._began
        self.comparison.written = provenance.utc_now()
        self.comparison.save(self.directory)
        junit.write(self.comparison, self.directory)
        report.write(self.comparison, self.directory)

    # -- parts -----------------------------------------------------------------------------------------------

    def _side_by_side(self, opened: list[_Open]) -> None:
        """What is timed first, alone; then all others, each case judged when its last run is in."""
        for case in opened:
            for job in [job for job in case.to_run if case.is_timed(job)]:
                self._here(case, job)
            if case.case.timed:
                self._title(case)
                self._alone(case)
                self._judge(case)
        rest = [case for case in opened if not case.case.timed]
        with self._workers_of_session() as executor:
            self._untimed(rest, executor)

    def _workers_of_session(self) -> AbstractContextManager[Executor]:
        if self._executor is not None:
            return contextlib.nullcontext(self._executor)
        return jobs.local_workers(self._workers, self._display)

    def _untimed(self, opened: list[_Open], executor: Executor) -> None:
        """Checks are evaluated in this process while workers go on with the runs of other cases."""
        waiting: _Sent = {}
        for case in opened:
            self._send(case, executor, waiting)
        ready = [case for case in opened if not case.to_run]
        at_the_end: list[_Open] = []
        try:
            while waiting or ready or at_the_end:
                if not waiting and not ready:
                    ready.append(at_the_end.pop(0))
                    self._alone(ready[0])
                for done in wait(waiting, 0.0 if ready else None, FIRST_COMPLETED).done:
                    case, job = waiting.pop(done)
                    self._take(case, job, _outcome(done), shared=True)
                    ready += [case] * (not case.to_run)
                case = ready.pop(0) if ready else None
                if case is not None and not self._more(case):
                    self._title(case)
                    self._judge(case)
                elif case is not None and any(map(case.is_timed, case.to_run)):
                    at_the_end.append(case)
                elif case is not None:
                    self._send(case, executor, waiting)
                    ready += [case] * (not case.to_run)
        finally:
            for future in waiting:
                future.cancel()

    def _send(self, case: _Open, executor: Executor, waiting: _Sent) -> None:
        """Hand the runs that a case has to do to the executor; those that cannot be sent are done here."""
        for job in list(case.to_run):
            on_one_core = dataclasses.replace(job, options=_one_core(job.options))
            why = job.why_not_sent()
            if why:
                self._not_sent.setdefault(job.key[2], why)
                self._here(case, on_one_core, shared=True)
            else:
                waiting[executor.submit(jobs.perform, on_one_core)] = case, job
        self.comparison.notices[:] = [
            f"{codes.title(code)} runs in the main process, one run after another: {why}"
            for code, why in self._not_sent.items()
        ]

    def _alone(self, case: _Open) -> None:
        """Do all runs of a case in this process, one after another."""
        while case.to_run or self._more(case):
            self._here(case, case.to_run[0])

    def _open(self, case: Case) -> _Open:
        """A case with its set-up and the runs that it has to do, in the order of the report."""
        opened = _Open(Evaluation(case, self.tier, self.selected), _blank(case, self.tier))
        with opened.errors():
            variants = case.variants(self.tier)
            setup = setup_table.rows([v.scene for v in variants])
            opened.result = dataclasses.replace(opened.result, setup=setup, status="done")
            self._add(opened, variants)
        return opened

    def _more(self, case: _Open) -> bool:
        """Whether a case whose runs are done has more to do: its follow-up, which is asked for once."""
        if not case.followed and case.result.status != "error":
            case.followed = True
            case.evaluation.sort(self._order)
            with case.errors():
                self._add(case, case.evaluation.follow_up())
        return bool(case.to_run)

    def _add(self, case: _Open, variants: list[Variant]) -> None:
        name = case.case.name
        made = [
            jobs.Job(
                (name, variant.label, code), f"{name} {variant.label} {codes.title(code)}",
                variant.scene, codes.CODES[code].run,
                self.directory / name / variant.label / code, self.options, variant.options.get(code, {}),
            )
            for variant in variants
            for code in variant.codes_of(self.selected)
        ]  # fmt: skip
        case.variants |= {variant.label: variant for variant in variants}
        self._order |= {job.key: len(self._order) + k for k, job in enumerate(made)}
        case.to_run += made

    def _here(self, case: _Open, job: jobs.Job, shared: bool = False) -> None:
        """Run a job in this process."""
        self._take(case, job, jobs.perform(job, self._display), shared)

    def _take(self, case: _Open, job: jobs.Job, outcome: jobs.Outcome, shared: bool) -> None:
        """Note what came of a job; `shared`: others may have run beside it."""
        self._display((job.key, None))  # a worker that has died has not said so
        case.to_run[:] = [other for other in case.to_run if other.key != job.key]
        case.spent += outcome.wall_s
        evaluation, (name, label, code), run = case.evaluation, job.key, outcome.run
        facts: dict[str, Any] = {
            "case": name,
            "variant": label,
            "code": code,
            "directory": str(job.directory.relative_to(self.directory)),
            "scene_hash": job.scene.hash,
            "state_hash": outcome.state_hash,
            "seed": outcome.seed,
        }
        if run is None:
            status, noted = _without_run(evaluation, case.variants[label], code, outcome)
            noted[label, code] = outcome.why
            self.comparison.runs.append(RunResult(**facts, version="", status=status, why=outcome.why))
            if status == "error":
                job.directory.mkdir(parents=True, exist_ok=True)
                (job.directory / "error.txt").write_text(outcome.traceback)
                self.reporter.say(f"  ERROR {codes.title(code)} on {name} {label}: {outcome.why}")
            return
        recorded = bool(run.notes.get("recorded", False))
        if not recorded:
            timing: dict[str, Any] = dataclasses.asdict(run.timing) | {"rate": run.timing.rate}
            self.comparison.timings.append(
                TimingResult(case=name, variant=label, code=code, version=run.version, wall_s=outcome.wall_s,
                             shared=shared, **timing)
            )  # fmt: skip
        self.comparison.runs.append(
            RunResult(
                **facts,
                version=run.version,
                status="ok",
                warnings=run.warnings,
                notes=run.notes,
                deck_hash=str(run.notes.get("deck_hash", "")),
                recorded=recorded,
            )
        )
        if recorded or not case.variants[label].timed:
            timing_type = ElsewhereTimed if recorded else Untimed
            run = dataclasses.replace(run, timing=timing_type(**dataclasses.asdict(run.timing)))
        evaluation.runs[label, code] = run

    def _judge(self, case: _Open) -> list[CheckResult]:
        """Checks, findings, figures and tables of a case whose runs are all in; the page is rewritten."""
        began, evaluation, result = time.monotonic(), case.evaluation, case.result
        evaluation.sort(self._order)
        checks = self._checks(evaluation, result)
        self.comparison.checks += checks
        ran = tuple(dict.fromkeys(code for _, code in evaluation.runs))
        own = [evaluation.finding(finding) for finding in attribution.findings(ran)]
        findings = [evaluation.finding(f) for f in case.case.findings_of(self.tier, self.selected)] + own
        self.comparison.findings += findings
        figures = [f for f in case.case.figures if self.tier in f.tiers]
        tables = [t for t in (*attribution.tables(ran), *case.case.tables) if self.tier in t.tiers]
        result.artefacts[:] = [evaluation.figure(f, self.directory, k) for k, f in enumerate(figures, 1)]
        result.artefacts.extend(evaluation.table(t, self.directory, k) for k, t in enumerate(tables, 1))
        differs = evaluation.differs()
        headline = evaluation.headline(checks, differs)
        result = dataclasses.replace(result, headline=headline, differs=differs)
        case.spent += time.monotonic() - began
        self._replace(dataclasses.replace(result, wall_s=case.spent))
        self._say(result, checks, findings, case.spent)
        for finding in own:
            self.reporter.say(f"  {finding.name}: {finding.note or finding.why}")
        self.write()
        return checks

    def _title(self, case: _Open) -> None:
        number = list(self.cases).index(case.case.name) + 1
        self.reporter.say(f"[{number}/{len(self.cases)}] {case.case.name}: {case.case.title}")

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
        left_out = sum(c.status == "left_out" for c in checks)
        others = f", {left_out} left out" if left_out else ""
        judged = len(checks) - left_out
        self.reporter.say(f"  {held} of {judged} checks hold{others}; computing time {duration(seconds)}")
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


def default_workers(options: codes.Options) -> int:
    """How many runs go side by side where nobody says: one for each core; on a GPU, one."""
    if options.device != "cpu":
        return 1
    return max(1, cores() // max(options.threads or 1, options.ranks))


class Untimed(Timing):
    """The timing of a run that others may have run beside: its seconds are no measurement of speed.

    Raises GpudemError where a check, figure or table asks for them.
    """

    def __getattribute__(self, name: str) -> Any:
        """Everything but times."""
        if name.endswith("_s") or name == "rate":
            raise type(self)._error(name)
        return super().__getattribute__(name)

    @staticmethod
    def _error(name: str) -> GpudemError:
        return GpudemError(
            f"timing.{name}: other runs may have shared the machine; a variant whose times are read says"
            " timed=True"
        )


class ElsewhereTimed(Untimed):
    """The timing of recorded output: what asks for its seconds is left out."""

    @staticmethod
    def _error(name: str) -> GpudemError:
        return Unmeasured(f"timing.{name}: recorded output of another machine says nothing of speed here")


def _one_core(options: codes.Options) -> codes.Options:
    """For a run beside others."""
    return dataclasses.replace(options, threads=options.threads or 1)


def _outcome(done: Future[jobs.Outcome]) -> jobs.Outcome:
    """What a worker has sent; if it is dead, that."""
    try:
        return done.result()
    except BrokenExecutor as error:
        why = f"the worker process ended before its run did: {error}"
        return jobs.Outcome("failed", 0.0, why=f"{why}; --jobs 1 runs all in one process", traceback=why)
    except Exception as error:  # what came back cannot be read here
        return jobs.Outcome("failed", 0.0, why=describe(error), traceback=traceback.format_exc())


def _without_run(
    evaluation: Evaluation, variant: Variant, code: str, outcome: jobs.Outcome
) -> tuple[Any, dict[tuple[str, str], str]]:
    """Status of a job that gave no run, and where the evaluation notes it.

    A variant that names its codes has been written for them: what they cannot be given is a failure.
    """
    if outcome.end == "missing":
        return "left_out", evaluation.absent
    if outcome.end == "cannot_state" and not variant.names(code) and not variant.may_end:
        return "left_out", evaluation.unstated
    if outcome.end in ("cannot_state", "gave_up") and variant.may_end:
        return "ended", evaluation.ended
    return "error", evaluation.failed


def _blank(case: Case, tier: Tier) -> CaseResult:
    recorded = recorded_cases.find(case.name) if tier != "full" else None
    facts = (case.name, case.title, case.purpose, case.source, case.order, case.features)
    return CaseResult(*facts, recorded=recorded, code=sources.hashes(case))
