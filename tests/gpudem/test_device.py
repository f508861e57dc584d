"""gpudem beside a user's own program: without the extras, without a change to Warp's global settings.

Catches: a package of an extra that `import gpudem`, a run, its frames or tables need; `wp.config` set at
import or by a run, which takes the adjoint from a user's own kernels; Warp's greeting or "Module ... load"
lines among what gpudem prints.
"""

import json
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import warp as wp

from gpudem.solver import device


@pytest.fixture(scope="module")
def printed():
    """Lines that the program prints."""
    command = [sys.executable, "-m", "tests.user_program"]
    done = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_runs_without_the_extras(printed):
    found = json.loads(printed[-1])
    assert found["extras"] == []
    assert found["particles"] == [2, 2]
    assert found["kinetic"] == pytest.approx([0.64, 0.64], rel=1e-3)  # one collision at restitution 0.8


def test_settings_are_unchanged_and_a_users_kernel_has_its_adjoint(printed):
    found = json.loads(printed[-1])
    assert found["changed"] == []
    assert found["gradient"] == [2.0, 4.0, 6.0]


def test_no_message_of_warp_on_our_output(printed):
    assert len(printed) == 1, printed


def test_the_level_is_restored_after_an_error_and_by_the_last_of_two_threads():
    before, inside = wp.config.log_level, threading.Event()

    def long():
        with device.quiet():
            inside.set()
            time.sleep(0.05)

    thread = threading.Thread(target=long)
    thread.start()
    assert inside.wait(5)

    def second():
        with device.quiet():  # asked for while the other has it
            thread.join()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        second()
    assert wp.config.log_level == before


@pytest.mark.parametrize("name", ["LOG_DEBUG", "LOG_INFO", "LOG_ERROR"])
def test_what_a_user_set_up_for_debugging_stays(name):
    with wp.ScopedLogLevel(getattr(wp, name)):
        with device.quiet():
            assert wp.config.log_level == (wp.LOG_DEBUG if name == "LOG_DEBUG" else wp.LOG_ERROR)
        assert wp.config.log_level == getattr(wp, name)
