"""The LIGGGHTS binary, asked for by name: a test that needs it says so, and never passes without it."""

from __future__ import annotations

import os

import pytest

from reference.liggghts.binary import find_liggghts
from reference.liggghts.errors import LiggghtsNotFound


@pytest.fixture
def liggghts() -> str:
    """Path of the binary. Without one the test is skipped with the install command, or fails with
    GPUDEM_REQUIRE_LIGGGHTS=1.
    """
    try:
        return find_liggghts()
    except LiggghtsNotFound as error:
        if os.environ.get("GPUDEM_REQUIRE_LIGGGHTS") == "1":
            pytest.fail(str(error))
        pytest.skip(str(error))
