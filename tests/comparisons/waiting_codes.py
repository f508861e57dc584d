"""Codes that worker processes can be given, for tests: one that waits for a child, one that dies.

As a program, a comparison of two runs that wait: python -m tests.comparisons.waiting_codes DIRECTORY.
"""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from comparisons import cli
from comparisons.harness import codes, discover
from comparisons.harness.case import Case, Variant
from reference.code import Code
from tests.comparisons import fake


def wait_for_child(scene: Any, directory: Path, options: Any, progress: Any, extra: Any) -> Any:
    """Wait for a process in a session of its own, as a run of LIGGGHTS is, and end it when told to."""
    child = subprocess.Popen(["sleep", "120"], start_new_session=True)
    (directory / "pids").write_text(f"{os.getpid()} {child.pid}")
    try:
        child.wait()
    finally:
        child.kill()
        child.wait()


def die(scene: Any, directory: Path, options: Any, progress: Any, extra: Any) -> Any:
    """As a crash in native code does."""
    os._exit(11)


WAITS = Code("waits", "waits", wait_for_child)
DIES = Code("dies", "dies", die)


def case(code: Code, variants: int = 2) -> Case:
    """One whose variants run through a code."""
    made = [Variant(f"v{k}", fake.scene(), (code.name,)) for k in range(variants)]
    whole = dataclasses.replace(fake.case(), figures=(), tables=())
    checks = tuple(dataclasses.replace(check, needs=(code.name,)) for check in whole.checks[:1])
    return dataclasses.replace(whole, variants=lambda tier: made, checks=checks)


def main(directory: Path) -> int:
    """Two runs that wait, side by side."""
    codes.register(WAITS)
    discover.find_cases = lambda *arguments: [case(WAITS, 3)]
    options = ["compare", "--codes", "waits", "--jobs", "2", "--out", str(directory)]
    return cli.main(options)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
