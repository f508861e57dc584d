"""The check on a GPU machine, rehearsed without one: budget, summary, and every stage that the CPU can do."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import tarfile
from importlib import metadata
from pathlib import Path

import pytest

from tools.gpu import record, stages, trim

ROOT = Path(__file__).parents[1]


def commands_of(seconds: dict[str, list[str]]):
    """Stands in for `stages.commands`: stage -> Python statements, each a command."""
    return lambda stage, out, rehearse: [[sys.executable, "-c", code] for code in seconds[stage]]


def test_a_stage_that_hangs_costs_its_limit_and_no_more(tmp_path, monkeypatch):
    """Detects a check that loses what other stages found: a hang, a failure, a program that is not there."""
    monkeypatch.setattr(stages, "LIMITS", {"hangs": 1.5, "fails": 9, "works": 9, "nothing": 9})
    code = {
        "hangs": ["import time; print('so far', flush=True); time.sleep(60)"],
        "fails": ["print(1)", "raise SystemExit(3)"],
        "works": ["print('found')"],
        "nothing": [],
    }
    monkeypatch.setattr(stages, "commands", commands_of(code))
    rows = stages.check(["hangs", "fails", "works", "nothing"], tmp_path, 60, False)
    assert [row["status"] for row in rows] == ["stopped", "failed", "ended", "left out: nothing to run"]
    assert json.loads((tmp_path / "summary.json").read_text()) == rows
    assert "so far" in (tmp_path / "hangs.log").read_text()
    assert rows[0]["seconds"] < 5
    assert stages.run(["no-such-profiler"], tmp_path / "none.log", 5) == "failed"


def test_a_spent_budget_is_said(tmp_path, monkeypatch):
    """Detects stages that run past the time that is lent, or vanish from the summary."""
    monkeypatch.setattr(stages, "LIMITS", {"long": 60, "late": 60})
    monkeypatch.setattr(
        stages, "commands", commands_of({"long": ["import time; time.sleep(60)"], "late": ["1"]})
    )
    rows = stages.check(["long", "late"], tmp_path, 2, False)
    assert [row["status"] for row in rows] == ["stopped", "left out: the budget is spent"]


@pytest.mark.slow
def test_every_stage_is_rehearsed(tmp_path):
    """Detects a stage that reaches for a name that has moved: it would be found on the GPU's time."""
    options = ["--rehearse", "--budget", "600", *stages.LIMITS]
    command = [sys.executable, str(ROOT / "tools/gpu/stages.py"), str(tmp_path), *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-2000:]
    status = {row["stage"]: row["status"] for row in json.loads((tmp_path / "summary.json").read_text())}
    assert {stage for stage in status if status[stage] == "ended"} == set(stages.LIMITS) - {"turns", "ncu"}
    assert len(json.loads((tmp_path / "bench.json").read_text())["rows"]) == 2
    assert len(json.loads((tmp_path / "paper.json").read_text())) == 3
    (tmp_path / "source.txt").write_text("0123456789\nchanged:  M README.md\n")
    facts, sides = record.collect(tmp_path)
    assert (facts["commit"], facts["dirty"], len(facts["paper"]), len(sides)) == ("0123456", True, 3, 3)


def library(containers: list[list[tuple[int, int, bytes]]]) -> bytearray:
    """A 64-bit ELF file with a section .nv_fatbin: containers of entries (kind, architecture, payload)."""
    body = b""
    for entries in containers:
        inside = b"".join(
            struct.pack("<HHIQIIHHI32x", kind, 0x101, 64, len(code), 0, 8, 1, 0, arch) + code
            for kind, arch, code in entries
        )
        body += b"\0" * 8 + struct.pack("<IHHQ", trim.MAGIC, 1, 16, len(inside)) + inside
    names = b"\0.shstrtab\0.nv_fatbin\0"
    at = 64 + len(body)
    header = (
        b"\x7fELF\x02\x01\x01"
        + bytes(9 + 24)
        + struct.pack("<Q4xHHHHHH", at + len(names), 64, 0, 0, 64, 3, 1)
    )
    sections = [(0, 0, 0), (1, at, len(names)), (11, 64, len(body))]
    return bytearray(
        header + body + names
        + b"".join(struct.pack("<I20xQQ24x", name, offset, size) for name, offset, size in sections)
    )  # fmt: skip


def test_of_a_library_one_architecture_is_left():
    """Detects code of the card's architecture that is lost, or a pack that carries the others."""
    one, other, ptx = bytes(range(1, 65)), bytes(range(65, 129)), bytes(range(129, 193))
    data = library([[(1, 90, ptx), (2, 80, other), (2, 90, one)], [(2, 90, one[::-1]), (2, 120, other)]])
    size = len(data)
    assert trim.trim(data, 90) == 3 * 64
    assert len(data) == size
    assert one in data
    assert one[::-1] in data
    assert other not in data
    assert ptx not in data
    with pytest.raises(ValueError, match="no machine code for sm_100"):
        trim.trim(data, 100)
    with pytest.raises(ValueError, match="ELF"):
        trim.trim(bytearray(b"text"), 90)


@pytest.mark.slow
@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no repository: `git ls-files` names the sources")
def test_packed_sources_are_whole_and_a_pack_has_a_limit(tmp_path):
    """Detects a module that is left out of the pack with recorded output, which the GPU machine would miss; a
    pack that is larger than what may travel.
    """
    version = metadata.version("warp-lang")
    (tmp_path / f"warp-{version}-sm_90.tar.xz").write_bytes(b"in its place")
    environment = {**os.environ, "WHEELS": " ", "PYTHON": sys.executable, "MOST": "1"}
    command = [str(ROOT / "tools/gpu/pack.sh"), str(tmp_path)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=100)
    assert done.returncode == 1
    assert "bytes are more than MOST=1 MiB" in done.stderr
    done = subprocess.run(
        command, env={**environment, "MOST": "9"}, capture_output=True, text=True, timeout=100
    )
    assert done.returncode == 0, done.stderr
    with tarfile.open(tmp_path / "source.tar.xz") as file:
        file.extractall(tmp_path / "source", filter="data")
    needed = (
        "import comparisons.cli, comparisons.cases.dam_break.scenes, tests.conftest, tests.gpudem.test_cuda"
    )
    needed += "; assert comparisons.__file__.startswith(sys.argv[1])"
    command = [sys.executable, "-B", "-c", f"import sys; sys.path.insert(0, sys.argv[1]); {needed}"]
    subprocess.run([*command, str(tmp_path / "source")], cwd=tmp_path, check=True, timeout=100)
