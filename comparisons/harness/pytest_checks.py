"""Checks as tests of pytest: the cases run at the first check, the report is written as they end.

Their runs go side by side as in `gpudem compare`, in processes that exist during that first check only; a
case that times programs runs alone, at its own first check. `comparisons.pytest_plugin` registers `Checks`
where its options select some. With pytest-xdist all checks run in one worker, which writes the report.
"""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any, cast

import pytest

from comparisons.harness import codes, execute, provenance
from comparisons.harness.case import TIERS, Case, Tier
from comparisons.harness.discover import cases_to_run
from comparisons.harness.results import CheckResult
from comparisons.scene_case import build
from gpudem.errors import GpudemError

#: The test of a case beside its checks: that it ran, and that its figures, tables and findings could be made.
WHOLE = "runs and is shown"
#: Name of the collector and of the marker of its tests.
NAME = "gpudem"
#: Time limit of a run of the code behind --gpudem-with [s].
WITH_TIMEOUT = 600.0
#: Name under which a worker of pytest-xdist says where its report is.
REPORT = "gpudem_report"


class Checks:
    """Plug-in of a pytest session: collects a test for each check, runs the cases, writes the report."""

    def __init__(self, config: pytest.Config):
        """Raises pytest.UsageError: unknown case, code or tier, a package that does not load."""
        self.config = config
        self.reports: list[Path] = []
        """Folders of comparisons that workers of pytest-xdist have run."""
        self._session: execute.Session | None = None
        tier = config.getoption("gpudem_tier") or TIERS[0]
        if tier not in TIERS:
            raise pytest.UsageError(f"--gpudem-tier {tier}: choose from {', '.join(TIERS)}")
        self.tier: Tier = cast(Tier, tier)
        jobs: str | None = config.getoption("gpudem_jobs")
        if jobs is not None and not (jobs.isdecimal() and int(jobs)):
            raise pytest.UsageError(f"--gpudem-jobs {jobs}: a whole number from 1 on is needed")
        self.workers = execute.default_workers(codes.Options()) if jobs is None else int(jobs)
        try:
            self.cases = self._selected()
            self.codes = codes.select(self._given("code") or codes.CODES)
            if command := config.getoption("gpudem_with"):
                self.codes = (*self.codes, codes.register_command(command, "own_code", WITH_TIMEOUT))
            if not self.cases:
                raise GpudemError(f"no case in the {tier} tier")
        except GpudemError as error:
            raise pytest.UsageError(f"gpudem: {error}") from error
        config.addinivalue_line("markers", f"{NAME}: a check of a case of gpudem (--gpudem-case)")

    def _selected(self) -> list[Case]:
        """The cases that the options name, and one for each scene."""
        names, packages, scenes = (self._given(option) for option in ("case", "cases", "scene"))
        cases = cases_to_run(names, self.tier, packages) if names or packages else []
        return cases + build.from_files(scenes, [case.name for case in cases])

    def _given(self, option: str) -> list[str]:
        return self.config.getoption(f"gpudem_{option}") or []

    # -- collection ------------------------------------------------------------------------------------------

    @pytest.hookimpl(wrapper=True)  # before others select, mark and sort
    def pytest_collection_modifyitems(
        self, session: pytest.Session, items: list[pytest.Item]
    ) -> Generator[None, None, None]:
        """Add the checks to what was found in files."""
        items += Collected.from_parent(session, name=NAME, nodeid=NAME, checks=self).collect()
        return (yield)

    def run(self, case: Case, wanted: list[Case]) -> dict[str, CheckResult]:
        """The results of a case by check; it runs at the first call, with others that are wanted."""
        if self._session is None:
            self._session = self._begin(wanted)
        comparison = self._session.comparison
        if next(c for c in comparison.cases if c.name == case.name).status == "waiting":
            self._session.run_with_others(case)
        return {found.name: found for found in comparison.checks if found.case == case.name}

    def problems(self, case: Case) -> list[str]:
        """What went wrong in a case outside its checks, once it has run."""
        assert self._session is not None
        comparison = self._session.comparison
        result = next(c for c in comparison.cases if c.name == case.name)
        wrong = [result.why] if result.status == "error" else []
        wrong += [f"{a.kind} {a.title!r}: {a.why}" for a in result.artefacts if a.status == "error"]
        mine = [f for f in comparison.findings if f.case == case.name and f.status == "error"]
        return wrong + [f"finding {f.name!r}: {f.why}" for f in mine]

    def _begin(self, wanted: list[Case]) -> execute.Session:
        """A comparison of the cases that are wanted. Raises GpudemError: no folder for it."""
        out: str | None = self.config.getoption("gpudem_out")
        if out is None:
            directory = execute.new_directory(self.config.rootpath / "runs", provenance.commit()[0])
        else:
            directory = execute.own_directory(self.config.invocation_params.dir / out)
        worker = getattr(self.config, "workerinput", None)  # of pytest-xdist
        arguments = worker["mainargv"][1:] if worker else self.config.invocation_params.args
        return execute.Session(
            wanted, directory, tier=self.tier, selected=self.codes, command=["pytest", *map(str, arguments)],
            workers=self.workers,
        )  # fmt: skip

    def time_limit(self) -> float:
        """Of a test that runs cases [s]: that of pytest-timeout for each of them; 0: none."""
        if not self.config.pluginmanager.hasplugin("timeout"):
            return 0.0
        given = self.config.getoption("timeout")
        return float(self.config.getini("timeout") or 0.0 if given is None else given) * len(self.cases)

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_make_scheduler(self, config: pytest.Config, log: Any) -> Any:
        """Modes of pytest-xdist that send each test where there is room: the checks go to one worker."""
        if config.getoption("dist") not in ("load", "loadgroup", "worksteal"):
            return None  # those by file or scope keep them together: see `Collected`
        from xdist.scheduler import LoadGroupScheduling

        class Scheduling(LoadGroupScheduling):
            def _split_scope(self, nodeid: str) -> str:
                return NAME if nodeid.startswith(f"{NAME}::") else super()._split_scope(nodeid)

        return Scheduling(config, log)

    # -- the report ------------------------------------------------------------------------------------------

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Bring the report to its end, also after Ctrl-C."""
        if self._session is None:
            return
        waiting = any(case.status == "waiting" for case in self._session.comparison.cases)
        self._session.interrupted() if waiting else self._session.finished()
        output: dict[str, str] | None = getattr(session.config, "workeroutput", None)  # of pytest-xdist
        if output is None:
            self.reports.append(self._session.directory)
        else:
            output[REPORT] = str(self._session.directory)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any, error: object) -> None:
        """A worker of pytest-xdist has ended: where is the report that it wrote, if it ran the cases?"""
        found = getattr(node, "workeroutput", {}).get(REPORT)
        if found is not None:
            self.reports.append(Path(found))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Say where the report is, and what concerns all of it."""
        for line in self._session.comparison.notices if self._session else ():
            terminalreporter.write_line(line)
        for directory in self.reports:
            terminalreporter.write_line(f"report: {directory / 'report.html'}")


class Collected(pytest.Collector):
    """The checks of the selected cases; stands beside the files of tests."""

    def __init__(self, *, checks: Checks, **rest: Any):
        super().__init__(**rest)
        self.checks = checks

    def collect(self) -> list[pytest.Item]:
        """A test for each check, and one for each case as a whole."""
        return list(self._items())

    def _items(self) -> Iterator[pytest.Item]:
        limit = self.checks.time_limit()
        for case in self.checks.cases:
            for name in [*(c.name for c in case.checks_of(self.checks.tier, self.checks.codes)), WHOLE]:
                # one "::" in its id: what stands before it is a file to pytest-xdist, and kept together
                item = CheckItem.from_parent(
                    self, name=f"{case.name}: {name}".replace("::", ":"), case=case, check=name
                )
                item.add_marker(NAME)
                if limit:
                    item.add_marker(pytest.mark.timeout(limit))
                yield item


class CheckItem(pytest.Item):
    """One check of one case: passes, fails or is skipped as the check was."""

    def __init__(self, *, case: Case, check: str, **rest: Any):
        super().__init__(**rest)
        self.case, self.check = case, check

    def runtest(self) -> None:
        """Run the case if no check has yet."""
        assert isinstance(self.parent, Collected)
        checks = self.parent.checks
        here = [item.case for item in self.session.items if isinstance(item, CheckItem)]
        found = checks.run(self.case, list({case.name: case for case in here}.values()))
        if self.check == WHOLE:
            if problems := checks.problems(self.case):
                pytest.fail("\n".join(problems), pytrace=False)
            return
        result = found[self.check]
        if result.status == "left_out":
            pytest.skip(result.why)
        if result.status == "error":
            pytest.fail(result.why, pytrace=False)
        if result.status == "fail":
            message = f"{result.verdict}, against {result.against}; it would catch: {result.catches}"
            pytest.fail(message, pytrace=False)

    def reportinfo(self) -> tuple[Path, None, str]:
        """Where the case comes from, and the name of the test."""
        module = sys.modules.get(getattr(self.case.variants, "__module__", ""))
        return Path(getattr(module, "__file__", None) or self.path), None, self.name

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Errors of ours in one line; others with their traceback."""
        if isinstance(excinfo.value, GpudemError):
            return f"gpudem: {excinfo.value}"
        return super().repr_failure(excinfo, style)
