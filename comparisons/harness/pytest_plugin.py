"""pytest plug-in: every check of the quick tier is one test, every case runs once, the report is written.

A test module takes part by a test with the argument `case_check`:

    def test_case(case_check):
        case_check()

With pytest-xdist all of them must run in one worker, which writes the report: --dist loadfile does so.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from comparisons.harness import execute, provenance
from comparisons.harness.case import TIERS, Tier
from comparisons.harness.discover import find_cases
from comparisons.harness.results import CheckResult

#: The test of a case beside its checks: that it ran, and that its figures, tables and findings could be made.
WHOLE = "runs and is shown"
#: Name under which a worker of pytest-xdist says where its report is.
REPORT = "gpudem_report"


class Harness:
    """The comparison of one pytest session, made when the first check asks for it."""

    def __init__(self, config: pytest.Config):
        self.config = config
        self.tier: Tier = config.getoption("--tier")  # pyright: ignore[reportAttributeAccessIssue]
        self.cases = [case for case in find_cases() if self.tier in case.tiers]
        self.wanted: set[str] = set()
        self.session: execute.Session | None = None
        self.reports: list[Path] = []
        """Folders of comparisons that workers of pytest-xdist have run."""
        self._done: dict[str, dict[str, CheckResult]] = {}

    def parameters(self) -> list[tuple[str, str]]:
        """(case, check) of the tier."""
        return [
            (case.name, name)
            for case in self.cases
            for name in [*(c.name for c in case.checks_of(self.tier)), WHOLE]
        ]

    def check(self, case: str, name: str) -> None:
        """Run the case if this is its first check, then pass, fail or skip as the check did."""
        if self.session is None:
            directory = execute.new_directory(self.config.rootpath / "runs", provenance.commit()[0])
            chosen = [c for c in self.cases if c.name in self.wanted]
            worker = getattr(self.config, "workerinput", None)  # of pytest-xdist
            arguments = worker["mainargv"][1:] if worker else self.config.invocation_params.args
            command = ["pytest", *arguments]
            self.session = execute.Session(chosen, directory, tier=self.tier, command=command)
        if case not in self._done:
            found = self.session.run_case(self.session.cases[case])
            self._done[case] = {check.name: check for check in found}
        if name == WHOLE:
            self._whole(case)
            return
        result = self._done[case][name]
        if result.status == "left_out":
            pytest.skip(result.why)
        if result.status == "error":
            pytest.fail(result.why, pytrace=False)
        if result.status == "fail":
            message = f"{result.verdict}, against {result.against}; it would catch: {result.catches}"
            pytest.fail(message, pytrace=False)

    def _whole(self, case: str) -> None:
        assert self.session is not None
        comparison = self.session.comparison
        result = next(c for c in comparison.cases if c.name == case)
        wrong = [result.why] if result.status == "error" else []
        wrong += [f"{a.kind} {a.title!r}: {a.why}" for a in result.artefacts if a.status == "error"]
        mine = [f for f in comparison.findings if f.case == case and f.status == "error"]
        wrong += [f"finding {f.name!r}: {f.why}" for f in mine]
        if wrong:
            pytest.fail("\n".join(wrong), pytrace=False)

    def close(self) -> None:
        """Write the report for the last time."""
        if self.session is not None:
            waiting = any(c.status == "waiting" for c in self.session.comparison.cases)
            self.session.interrupted() if waiting else self.session.finished()


_HARNESS = pytest.StashKey[Harness]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """`pytest --tier standard`."""
    parser.addoption(
        "--tier", choices=TIERS, default="quick", help="tier of the comparison cases (default: quick)"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Find the cases."""
    config.stash[_HARNESS] = Harness(config)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One test for each check: test_case[head_on: contact time ...]."""
    if "case_check" in metafunc.fixturenames:
        pairs = metafunc.config.stash[_HARNESS].parameters()
        metafunc.parametrize(
            "case_check", pairs, indirect=True, ids=[f"{case}: {name}" for case, name in pairs]
        )


def pytest_collection_finish(session: pytest.Session) -> None:
    """Only the cases that this session asks for stand in its report."""
    harness = session.config.stash[_HARNESS]
    for item in session.items:
        if isinstance(item, pytest.Function) and "case_check" in item.fixturenames:
            parameters: dict[str, Any] = item.callspec.params
            harness.wanted.add(parameters["case_check"][0])


@pytest.fixture
def case_check(request: pytest.FixtureRequest) -> Callable[[], None]:
    """Call it: it passes, fails or skips as the check of this test does."""
    return lambda: request.config.stash[_HARNESS].check(*request.param)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Bring the report to its end, also after Ctrl-C."""
    harness = session.config.stash[_HARNESS]
    harness.close()
    output: dict[str, str] | None = getattr(session.config, "workeroutput", None)  # of pytest-xdist
    if harness.session is not None and output is not None:
        output[REPORT] = str(harness.session.directory)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    """A worker of pytest-xdist has ended: where is the report that it wrote, if it ran the cases?"""
    found = getattr(node, "workeroutput", {}).get(REPORT)
    if found is not None:
        node.config.stash[_HARNESS].reports.append(Path(found))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say where the report is."""
    harness = config.stash[_HARNESS]
    own = [harness.session.directory] if harness.session is not None else []
    for directory in own + harness.reports:
        terminalreporter.write_line(f"report: {directory / 'report.html'}")
