"""Codes that worker processes can be given, for tests: one that waits for a child, some that die.

As a program, a comparison of two runs that wait: python -m tests.comparisons.waiting_codes DIRECTORY.
"""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from comparisons import cli
from comparisons.harness import codes, discover
from comparisons.harness.case import Case, Variant
from gpudem.output.run import Run, Timing
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


def fall(scene: Any, directory: Path, options: Any, progress: Any, extra: Any) -> Run:
    """The scene by its closed form; as told by the name of the variant, the process ends in the middle."""
    match directory.parent.name.partition("_")[0]:
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "ended":
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(60.0)
        case "exits":
            sys.exit(7)
    progress(scene.n_steps)
    steps = np.arange(0, scene.n_steps + 1, scene.stride(scene.output.trace_every))
    position = fake.exact(scene, steps * scene.time.step)
    trace = {"step": steps, "time": steps * scene.time.step, "position": position, "velocity": 0.0 * position}
    made = Run("falls", "1", scene, directory, Timing(3, scene.n_steps, 1e-3), trace=trace)
    made.save()
    return made


FALLS = Code("falls", "falls", fall)
WAITS = Code("waits", "waits", wait_for_child)


def case(code: Code, *labels: str) -> Case:
    """One whose variants run through a code."""
    made = [Variant(label, fake.scene(), (code.name,)) for label in labels]
    whole = dataclasses.replace(fake.case(), figures=(), tables=())
    checks = tuple(dataclasses.replace(check, needs=(code.name,)) for check in whole.checks[:1])
    return dataclasses.replace(whole, variants=lambda tier: made, checks=checks)


def main(directory: Path) -> int:
    """Two runs that wait, side by side."""
    codes.register(WAITS)
    discover.find_cases = lambda *arguments: [case(WAITS, "v0", "v1", "v2")]
    options = ["compare", "--codes", "waits", "--jobs", "2", "--out", str(directory)]
    return cli.main(options)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
