"""Tests that need LIGGGHTS, a GPU or a browser: skipped where it is missing, failed where it is required."""

from __future__ import annotations

import os
import shutil

import pytest

pytest_plugins = ["comparisons.pytest_plugin"]


def _gpu() -> bool:
    from comparisons.provenance import gpus

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
