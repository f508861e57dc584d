"""Runs the test set, in a process of its own, on a copy of the sources with one mutation in it."""

from __future__ import annotations

import ast
import dataclasses
import os
import re
import shutil
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

from comparisons.mutation.markers import Sources
from comparisons.mutation.table import Mutation, TestSet
from gpudem.errors import GpudemError

#: A defective solver may run forever: the tests are ended after this time [s], or twice that of the baseline.
TIME_LIMIT = 240.0
#: A test of a case fails with the list of the checks that failed.
FAILED_CHECKS = re.compile(r"assert (\[.*?\]) == \[\]", re.DOTALL)
#: A line of `pytest -vv` about a test that failed.
FAILED_TEST = re.compile(r"^(\S+\.py::.+?) (?:FAILED|ERROR)\b", re.MULTILINE)

CAUGHT, SURVIVED, UNKNOWN = "caught", "survived", "unknown"


@dataclasses.dataclass
class Verdict:
    """Result of the tests on one copy of the sources."""

    tried: list[str]
    """Members of the test set that ran."""
    caught_by: list[str]
    """Tests that failed."""
    seconds: float
    timed_out: bool = False
    """The tests were ended at the time limit."""

    @property
    def outcome(self) -> str:
        """`caught` if a test failed; `unknown` if none did before the time limit; else `survived`."""
        if self.caught_by:
            return CAUGHT
        return UNKNOWN if self.timed_out else SURVIVED


class SourceCopy:
    """A copy of the sources, the baseline, in which one mutation after the other is made and undone.

    Each mutant gets the kernel cache of the baseline as hard links: Warp names kernels by the hash of their
    source, so only the kernels that a mutation changes are compiled, into a cache that is deleted after it.
    """

    def __init__(self, root: Path, folder: Path, test_set: TestSet, time_limit: float = TIME_LIMIT):
        self.folder, self.test_set, self.time_limit = folder / "copy", test_set, time_limit
        self._verified: set[str] = set()
        self._baseline_seconds = 0.0
        self.cache, self.mutant_cache = folder / "cache", folder / "mutant_cache"
        names = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard", "--", "*.py", "*.toml", "*.j2", "*.css",
             "*.npz", "*.json", "*.csv", "*.in", "*.data"],
            cwd=root, capture_output=True, text=True, check=True,
        ).stdout.splitlines()  # fmt: skip
        for name in names:
            if (root / name).is_file():
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(root / name, self.folder / name)
        self.sources = Sources.read(self.folder)
        self.cache.mkdir()

    def verify_baseline(self, members: list[str]) -> float:
        """Run members of the test set on the baseline, each once; fills the kernel cache. Returns seconds.

        Raises GpudemError if a test fails.
        """
        new = [name for name in members if name not in self._verified]
        if not new:
            return 0.0
        verdict = self._run(new, self.cache, None)
        if verdict.caught_by:
            raise GpudemError(f"the baseline fails: {', '.join(verdict.caught_by)}")
        self._verified.update(new)
        self._baseline_seconds += verdict.seconds
        return verdict.seconds

    def test(self, mutation: Mutation, first: list[str]) -> Verdict:
        """Run the test set with a mutation made: members `first`, then all others if none of those fails."""
        began = time.monotonic()
        verdict = self._test(mutation, first)
        rest = [name for name in self.test_set.nodes if name not in first]
        if verdict.outcome != CAUGHT and rest:
            timed_out, verdict = verdict.timed_out, self._test(mutation, rest)
            verdict.tried = [*first, *rest]
            verdict.timed_out |= timed_out
        return dataclasses.replace(verdict, seconds=time.monotonic() - began)

    def _test(self, mutation: Mutation, members: list[str]) -> Verdict:
        self.verify_baseline(members)
        marked, mutated = mutation.applied(self.sources)
        path = self.folder / marked.path
        path.write_text(mutated)
        try:
            shutil.copytree(self.cache, self.mutant_cache, copy_function=os.link)
            return self._run(members, self.mutant_cache, max(self.time_limit, 2 * self._baseline_seconds))
        except GpudemError as error:
            raise GpudemError(f"mutation {mutation.name!r}: {error}") from None
        finally:
            path.write_text(marked.text)
            shutil.rmtree(self.mutant_cache, ignore_errors=True)

    def _run(self, members: list[str], cache: Path, limit: float | None) -> Verdict:
        report = self.folder / "test_set.xml"
        report.unlink(missing_ok=True)
        command = [sys.executable, "-m", "pytest", "-vv", "-p", "no:cacheprovider", f"--junitxml={report}"]
        variables = {
            "PYTHONPATH": str(self.folder),
            "WARP_CACHE_PATH": str(cache),
            "PYTHONDONTWRITEBYTECODE": "1",
            "PYTHONUNBUFFERED": "1",  # what failed before the time limit is read from the output
            "COLUMNS": "400",
        }
        began = time.monotonic()
        try:
            done = subprocess.run(
                [*command, *(self.test_set.nodes[m] for m in members)],
                cwd=self.folder, env={**os.environ, **variables}, timeout=limit,
                stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired as error:
            return Verdict(
                members, self._failed_tests(error.stdout), time.monotonic() - began, timed_out=True
            )
        seconds = time.monotonic() - began
        if done.returncode < 0:
            crash = f"crash, status {done.returncode}"
            return Verdict(members, [*self._failed_tests(done.stdout), crash], seconds)
        if done.returncode > 1:  # pytest itself failed
            raise GpudemError(f"the tests could not run:\n{done.stdout[-3000:]}{done.stderr[-1000:]}")
        return Verdict(members, self._failures(report), seconds)

    def _failed_tests(self, output: Any) -> list[str]:
        """Tests that had failed according to the output of a run that was cut short."""
        if isinstance(output, bytes):  # of a TimeoutExpired, even where text was asked for
            output = output.decode(errors="replace")
        return [self.test_set.short_name(node) for node in FAILED_TEST.findall(output or "")]

    def _failures(self, report: Path) -> list[str]:
        found = []
        for case in ElementTree.parse(report).iter("testcase"):
            failure = case.find("failure")
            failure = case.find("error") if failure is None else failure
            if failure is None:
                continue
            module = case.get("classname", "").replace(".", "/")
            name = self.test_set.short_name(f"{module}.py::{case.get('name', '')}")
            listed = FAILED_CHECKS.search(failure.get("message", "") or "")
            checks = _names(listed[1]) if listed else []
            found += [f"{name}: {check}" for check in checks] or [name]
        return found


def _names(text: str) -> list[str]:
    try:
        return [item for item in ast.literal_eval(text) if isinstance(item, str)]
    except (ValueError, SyntaxError):
        return []
