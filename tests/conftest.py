"""Tests that need LIGGGHTS, a GPU or a browser: skipped where it is missing, failed where it is required.

In a run of several workers (`make test`), tests that measure time have the machine for themselves.
"""

from __future__ import annotations

import gc
import os
import re
import shutil
import signal
from collections.abc import Generator
from importlib.metadata import entry_points

import pytest

from comparisons.harness.pytest_checks import CheckItem
from tests.machine import machine
from tests.slow_rows import SLOW_ROWS

#: The plug-in comes with the installed package; from a tree that is not installed it is named here.
pytest_plugins = [] if entry_points(group="pytest11", name="gpudem") else ["comparisons.pytest_plugin"]


def pytest_configure() -> None:
    """Take back SIGINT, which a shell lets a command in the background (cron, nohup, &) ignore, and so all of
    its children: tests that interrupt a process would wait for its end in vain.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _gpu() -> bool:
    from comparisons.harness.provenance import gpus

    return bool(gpus())


def _liggghts() -> bool:
    return shutil.which(os.environ.get("GPUDEM_LIGGGHTS", "liggghts")) is not None


def _browser() -> bool:
    return shutil.which("chromium") is not None and shutil.which("chromedriver") is not None


#: marker -> (is it here, environment variable that makes its absence a failure, what is missing).
NEEDS = {
    "gpu": (_gpu, "GPUDEM_REQUIRE_GPU", "no CUDA device"),
    "liggghts": (_liggghts, "GPUDEM_REQUIRE_LIGGGHTS", "no liggghts binary (apt-get install liggghts)"),
    "browser": (_browser, "GPUDEM_REQUIRE_BROWSER", "no chromium (apt-get install chromium chromium-driver)"),
}


def pytest_runtest_setup(item: pytest.Item) -> None:
    for marker, (here, variable, missing) in NEEDS.items():
        if item.get_closest_marker(marker) and not here():
            if os.environ.get(variable) == "1":
                pytest.fail(f"{missing}, and {variable}=1 requires it", pytrace=False)
            pytest.skip(missing)


@pytest.hookimpl(tryfirst=True)  # before -m selects
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    rows = re.compile("|".join(SLOW_ROWS))
    for item in items:
        if rows.search(item.nodeid):
            item.add_marker("slow")
        if isinstance(item, CheckItem):
            item.add_marker("cases")
            if item.case.timed:
                item.add_marker("timing")


def pytest_collection_finish() -> None:
    """Look for garbage seldom, and not among what stays: modules and tests. The kernels that Warp generates
    are many small objects, over which the collector goes again and again: 0.14 s of CPU time for each.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    file = item.config.rootpath / ".pytest_cache" / "machine"
    workers = file if hasattr(item.config, "workerinput") else None
    with machine(workers, exclusive=item.get_closest_marker("timing") is not None):
        return (yield)
