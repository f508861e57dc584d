"""Without a reference code: what needs it is left out, page, terminal and junit.xml say so and how to get it;
recorded output stands in where there is some.
"""

from __future__ import annotations

import importlib.util
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from comparisons import cli
from comparisons.harness import discover, execute, results
from comparisons.harness.case import Unmeasured
from comparisons.harness.evaluate import Runs
from reference.errors import CodeMissing
from reference.liggghts.binary import VARIABLE
from tests.comparisons import fake

ROOT = Path(__file__).parents[2]
INSTALL = "no program `liggghts` on the path; install it: apt-get install liggghts"


@pytest.fixture
def hidden(monkeypatch):
    """The real codes, the binary hidden."""
    monkeypatch.setenv(VARIABLE, "/hidden/liggghts")


def test_a_missing_code_leaves_its_checks_out_and_everything_says_so(
    tmp_path, fake_codes, monkeypatch, capsys
):
    """Would detect: an error or a silent pass where a code is missing; a page that does not name the cure."""
    fake_codes(liggghts={"fails": INSTALL, "error_kind": CodeMissing})
    monkeypatch.setattr(discover, "find_cases", lambda *arguments: [fake.case()])
    assert cli.main(["compare", "--out", str(tmp_path / "c"), "--jobs", "1"]) == 0
    said = capsys.readouterr().out
    assert "1 left out" in said
    assert f"LIGGGHTS is missing: {INSTALL}" in said
    stored = results.load(tmp_path / "c")
    assert stored.missing == {"liggghts": INSTALL}
    left_out = [c for c in stored.checks if c.status == "left_out"]
    assert [c.name for c in left_out] == ["position, largest difference of the codes"]
    assert INSTALL in left_out[0].why
    assert {(r.code, r.status) for r in stored.runs} == {("gpudem", "ok"), ("liggghts", "left_out")}
    suite = ElementTree.parse(tmp_path / "c" / "junit.xml").getroot()[0]
    assert (suite.get("skipped"), suite.get("failures"), suite.get("errors")) == ("1", "0", "0")
    assert INSTALL in next(suite.iter("skipped")).get("message", "")
    page = (tmp_path / "c" / "report.html").read_text()
    assert "LIGGGHTS is missing: no program" in page.partition("</header>")[0]
    assert "apt-get install liggghts" in page.partition("</header>")[0]


def test_nothing_is_said_to_be_missing_where_nothing_is(finished):
    directory, comparison = finished
    assert comparison.missing == {}
    assert "is missing:" not in (directory / "report.html").read_text()


def test_recorded_output_stands_in_for_the_binary(tmp_path, hidden):
    """Checks against LIGGGHTS hold on its recorded output; what asks for its times is left out."""
    cases = [c for c in discover.find_cases() if c.name in ("head_on", "slide_to_roll")]
    comparison = execute.Session(cases, tmp_path, selected=("gpudem", "liggghts")).run()
    assert comparison.exit_code() == 0
    assert set(comparison.missing) == {"liggghts"}
    assert {r.recorded for r in comparison.runs if r.code == "liggghts"} == {True}
    against = [c for c in comparison.checks if c.mark == "X"]
    assert len(against) >= 5
    assert {c.status for c in against} == {"pass"}
    assert {t.code for t in comparison.timings} == {"gpudem"}
    timed = next(a for c in comparison.cases for a in c.artefacts if a.title == "Error against stepping time")
    assert timed.status == "left_out"
    assert "recorded output of another machine says nothing of speed here" in timed.why


def test_a_measure_that_looks_whether_there_is_a_run_is_left_out_too():
    """Would detect: a count of runs that went wrong which finds none since none was made."""
    runs = Runs({}, failed={}, absent={("v", "liggghts"): INSTALL}, unstated={})
    with pytest.raises(Unmeasured, match="install it"):
        runs.get(("v", "liggghts"))
    assert runs.get(("w", "liggghts")) is None


def test_a_figure_that_finds_a_run_of_a_missing_code_which_it_does_not_name_is_left_out():
    """Would detect: an error of a figure of all codes, where one is missing on some variants only."""
    runs = Runs({}, failed={}, absent={}, unstated={}, unneeded={("v", "liggghts"): INSTALL})
    assert list(runs) == []
    with pytest.raises(Unmeasured, match="install it"):
        runs["v", "liggghts"]


def test_every_deck_of_the_quick_tier_has_a_record():
    """To renew after a change of a scene or of the deck: python tools/record_liggghts.py."""
    path = ROOT / "tools" / "record_liggghts.py"
    spec = importlib.util.spec_from_file_location("record_liggghts", path)
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = tool
    spec.loader.exec_module(tool)
    wanted = tool.decks()
    missing, left_over = tool.differences(wanted)
    assert len(wanted) > 50
    assert not missing, f"{sorted(missing.values())}: python tools/record_liggghts.py"
    assert not left_over, f"records that no deck has: {left_over}: python tools/record_liggghts.py"
