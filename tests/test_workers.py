"""Workers of one run of the tests share the machine, unless one measures time.

Catches: a measurement beside other tests, two of them at once, one that waits for ever while others go on.
"""

import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from tests.machine import machine

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[1]
#: A worker: holds the lock from when it says so until it is asked to end.
WORKER = """
import sys
from pathlib import Path
from tests.machine import machine
print("asks", flush=True)
with machine(Path(sys.argv[1]), exclusive=sys.argv[2] == "alone"):
    print("in", flush=True)
    sys.stdin.readline()
print("out", flush=True)
"""


@pytest.fixture
def worker(tmp_path):
    """Starts one: worker("alone")."""
    started = []

    def start(how):
        command = [sys.executable, "-c", WORKER, str(tmp_path / "lock"), how]
        pipe = subprocess.PIPE
        process = subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe, text=True)
        started.append(process)
        assert process.stdout.readline() == "asks\n"
        return process

    yield start
    for process in started:
        process.communicate(timeout=30)


def end(process, after):
    """Ask a worker to end in so many seconds: (thread that does, event that is set when it does)."""
    asked = threading.Event()

    def ask():
        asked.set()
        process.stdin.write("\n")
        process.stdin.flush()

    timer = threading.Timer(after, ask)
    timer.start()
    return timer, asked


@pytest.mark.parametrize(
    ("first", "exclusive", "waits"),
    [("shared", False, False), ("shared", True, True), ("alone", False, True), ("alone", True, True)],
)
def test_which_pairs_wait(worker, tmp_path, first, exclusive, waits):
    other = worker(first)
    assert other.stdout.readline() == "in\n"
    timer, asked = end(other, 0.1 if waits else 1.0)
    with machine(tmp_path / "lock", exclusive=exclusive):
        waited = asked.is_set()
    timer.join()
    assert waited == waits


def test_the_next_test_does_not_overtake_one_that_waits(worker, tmp_path):
    other, timed = worker("shared"), worker("alone")
    assert other.stdout.readline() == "in\n"
    time.sleep(0.1)  # by now the second waits
    (first, _), (second, asked) = end(other, 0.1), end(timed, 0.2)
    with machine(tmp_path / "lock", exclusive=False):
        waited = asked.is_set()
    first.join()
    second.join()
    assert waited


def test_one_worker_locks_nothing(tmp_path):
    with machine(None, exclusive=True), machine(None, exclusive=True):
        assert not list(tmp_path.iterdir())
