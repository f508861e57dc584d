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
from typing import Any

import pytest
import warp as wp

from gpudem.solver import device
from gpudem.solver.neighbor_kernels import cell_starts


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


def test_a_module_that_another_process_compiles_is_waited_for():
    """Detects modules that each of several processes compiles, all for the same cache."""
    kernel: Any = cell_starts
    compiled, module = threading.Event(), kernel.module.name

    def compile_it() -> None:
        device.compile_kernels(device.find_device("cpu"), [kernel])
        compiled.set()

    compile_it()
    names = (f"module {k}" for k in range(100))
    with compiling(next(name for name in names if device.lock_of(name) != device.lock_of(module))) as other:
        compile_it()
        other.kill()
    with compiling(module) as other:
        compiled.clear()
        thread = threading.Thread(target=compile_it)
        thread.start()
        waits = not compiled.wait(0.2)
        other.kill()  # its lock ends with it
        thread.join(5)
        assert compiled.is_set()
        assert waits


def compiling(name: str) -> subprocess.Popen[str]:
    """A process that holds the lock of a module."""
    file = str(device.lock_of(name))
    program = f"""
import fcntl
file = open({file!r}, "ab")
fcntl.flock(file, fcntl.LOCK_EX)
print()
input()
"""
    started = subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert started.stdout is not None
    started.stdout.readline()
    return started
