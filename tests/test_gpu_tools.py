"""The check on a GPU machine, rehearsed without one: budget, summary, and every stage that the CPU can do."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tools.gpu import record, stages

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
