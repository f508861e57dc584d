"""A finding is shown and stored, never passed, failed or counted; one that has no value is not hidden."""

from __future__ import annotations

import dataclasses
import json
import xml.etree.ElementTree as ElementTree

import pytest

from comparisons.harness import codes, execute, recorded_cases, results
from comparisons.harness.case import Finding, Measured, PerCode, Table
from comparisons.report import page as report
from tests.comparisons import fake
from tests.comparisons.test_report import Page


def speed(code: str) -> Finding:
    def measure(results):
        return Measured(results["dt_1e-05", code].timing.rate / 1e6, note="one <run>")

    return Finding(f"rate of {code}", measure, "1e6/s", "Particle-steps per second of stepping.", (code,))


def broken(results):
    raise ValueError("no such column")


def found_case(*more: Finding):
    not_selected = dataclasses.replace(speed("yade"), name="rate of yade")
    return dataclasses.replace(
        fake.case(), figures=(), tables=(), findings=(PerCode(speed), not_selected, *more)
    )


@pytest.fixture
def compared(tmp_path, fake_codes):
    """(directory, comparison) of a case with findings."""
    return tmp_path, execute.Session([found_case()], tmp_path).run()


def test_findings_are_stored_and_shown_and_not_counted(compared):
    """Catches a finding that is lost from results.json or the page, or that counts as a check."""
    directory, comparison = compared
    assert sum(comparison.counts().values()) == 4
    assert comparison.exit_code() == 0
    loaded = results.load(directory).findings
    assert [(f.name, f.status, f.value) for f in loaded] == [
        ("rate of gpudem", "ok", 1.0), ("rate of liggghts", "ok", 2.0), ("rate of yade", "left_out", None),
    ]  # fmt: skip
    assert {f["name"] for f in json.loads((directory / "results.json").read_text())["findings"]} == {
        f.name for f in loaded
    }
    page = (directory / "report.html").read_text()
    Page(page)
    assert "All 4 checks hold" in page
    shown = page[page.index("<h3>Findings</h3>") : page.index("<h3>Set-up</h3>")]
    for words in ("rate of gpudem", "1e6/s", "Particle-steps per second", "one &lt;run&gt;", "not selected"):
        assert words in shown


def test_a_finding_is_no_test_of_junit(compared):
    """Catches findings that a continuous-integration system would count."""
    tests = ElementTree.parse(compared[0] / "junit.xml").getroot().iter("testcase")
    assert len(list(tests)) == 4


def test_a_finding_that_cannot_be_measured_is_an_error_of_the_comparison(tmp_path, fake_codes):
    """Catches a finding whose measure raises and that nobody hears of."""
    bad = Finding("broken", broken, "1", "")
    comparison = execute.Session([found_case(bad)], tmp_path).run()
    (said,) = comparison.broken()
    assert said.startswith("finding 'broken' of throw: ValueError: no such column")
    assert comparison.exit_code() == 1
    assert "Could not be measured" in report.html(comparison, tmp_path)


def test_findings_are_kept_with_the_record_of_the_full_tier(tmp_path, fake_codes):
    """Catches a record from which the findings of the long run are missing."""
    for name in ("long", "short"):
        (tmp_path / name).mkdir()
    long = execute.Session([found_case()], tmp_path / "long", tier="full").run()
    recorded_cases.keep(long, tmp_path / "long", tmp_path / "kept")
    kept = recorded_cases.find("throw", tmp_path / "kept")
    assert kept is not None
    assert [f.value for f in kept.findings] == [1.0, 2.0, None]


def test_findings_follow_the_codes_at_hand():
    """Catches findings made for two names instead of for the codes that are selected."""
    names = [f.name for f in found_case().findings_of("quick", ("gpudem",))]
    assert names == ["rate of gpudem", "rate of yade"]
    assert {f.name for f in found_case().findings_of("quick")} >= {
        f"rate of {code}" for code in codes.stepped(tuple(codes.CODES))
    }


def test_a_table_of_advice_that_cannot_be_made_is_said(tmp_path, fake_codes):
    """Catches a page that cannot be written where one table of its collected advice is missing."""
    table = Table("Which step", "", broken, section="advice")
    case = dataclasses.replace(fake.case(), figures=(), tables=(table,))
    execute.Session([case], tmp_path).run()
    assert "no such column" in (tmp_path / "report.html").read_text()


def test_a_case_of_findings_only_is_not_called_left_out(tmp_path, fake_codes):
    """Catches a page that says "left out" of a case in which there is nothing to judge."""
    case = dataclasses.replace(found_case(), checks=())
    execute.Session([case], tmp_path).run()
    page = (tmp_path / "report.html").read_text()
    assert "LEFT OUT" not in page[page.index("<h2>Balls thrown upwards") :]
