"""A copy of the sources that can be broken, and the battery run on it in a process of its own."""

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

from comparisons.mutants.table import Battery, Mutation
from gpudem.errors import GpudemError

#: A broken solver may never end [s].
PATIENCE = 240.0
#: A report check of a case that fails says so in the list its test finds not empty.
FAILED_CHECKS = re.compile(r"assert (\[.*?\]) == \[\]", re.DOTALL)


@dataclasses.dataclass
class Verdict:
    """What the battery said of one copy."""

    tried: list[str]
    caught_by: list[str]
    seconds: float


class Copy:
    """The sources in a folder of their own, with kernels compiled once and shared by what is not broken.

    Each mutant gets the cache of the sound copy as hard links: Warp names kernels by the hash of their
    source, so only what is broken is compiled anew, and what it compiles is thrown away.
    """

    def __init__(self, root: Path, folder: Path, battery: Battery):
        self.folder, self.battery = folder / "copy", battery
        self._sound: set[str] = set()
        self.cache, self.own_cache = folder / "cache", folder / "mutant_cache"
        names = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard", "--", "*.py", "*.toml", "*.j2", "*.css",
             "*.npz", "*.json", "*.csv", "*.in", "*.data"],
            cwd=root, capture_output=True, text=True, check=True,
        ).stdout.splitlines()  # fmt: skip
        for name in names:
            if (root / name).is_file():
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(root / name, self.folder / name)
        self.cache.mkdir()

    def prove(self, members: list[str]) -> float:
        """Run members on the sound copy, each once; fills the cache. Seconds; GpudemError if one fails."""
        new = [name for name in members if name not in self._sound]
        if not new:
            return 0.0
        verdict = self._run(new, self.cache)
        if verdict.caught_by:
            raise GpudemError(f"the sound copy fails: {', '.join(verdict.caught_by)}")
        self._sound.update(new)
        return verdict.seconds

    def mutant(self, mutation: Mutation, first: list[str]) -> Verdict:
        """The battery on the copy with one wrong in it: `first`, and all the rest if nothing catches it."""
        began = time.monotonic()
        verdict = self._broken(mutation, first)
        rest = [name for name in self.battery.nodes if name not in first]
        if not verdict.caught_by and rest:
            verdict = self._broken(mutation, rest)
            verdict.tried = [*first, *rest]
        return dataclasses.replace(verdict, seconds=time.monotonic() - began)

    def _broken(self, mutation: Mutation, members: list[str]) -> Verdict:
        self.prove(members)
        path = self.folder / mutation.file
        text = path.read_text()
        path.write_text(mutation.applied(text))
        try:
            shutil.copytree(self.cache, self.own_cache, copy_function=os.link)
            return self._run(members, self.own_cache)
        finally:
            path.write_text(text)
            shutil.rmtree(self.own_cache, ignore_errors=True)

    def _run(self, members: list[str], cache: Path) -> Verdict:
        report = self.folder / "battery.xml"
        report.unlink(missing_ok=True)
        command = [sys.executable, "-m", "pytest", "-vv", "-p", "no:cacheprovider", f"--junitxml={report}"]
        variables = {
            "PYTHONPATH": str(self.folder),
            "WARP_CACHE_PATH": str(cache),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        began = time.monotonic()
        try:
            done = subprocess.run(
                [*command, *(self.battery.nodes[m] for m in members)],
                cwd=self.folder, env={**os.environ, **variables}, timeout=PATIENCE,
                stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return Verdict(members, [f"no end within {PATIENCE:g} s"], PATIENCE)
        seconds = time.monotonic() - began
        if done.returncode not in (0, 1):  # 2 to 5: pytest's own trouble; below 0: killed
            if done.returncode < 0:
                return Verdict(members, [f"crash, status {done.returncode}"], seconds)
            raise GpudemError(f"the battery could not run:\n{done.stdout[-3000:]}{done.stderr[-1000:]}")
        return Verdict(members, self._failures(report), seconds)

    def _failures(self, report: Path) -> list[str]:
        found = []
        for case in ElementTree.parse(report).iter("testcase"):
            wrong = case.find("failure")
            wrong = case.find("error") if wrong is None else wrong
            if wrong is None:
                continue
            name = self.battery.name(case.get("classname", ""), case.get("name", ""))
            said = FAILED_CHECKS.search(wrong.get("message", "") or "")
            checks = _names(said[1]) if said else []
            found += [f"{name}: {check}" for check in checks] or [name]
        return found


def _names(text: str) -> list[str]:
    try:
        return [item for item in ast.literal_eval(text) if isinstance(item, str)]
    except (ValueError, SyntaxError):
        return []
