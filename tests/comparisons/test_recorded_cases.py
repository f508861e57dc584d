"""Results of the full tier, kept in the project and shown, as recorded, by reports of a shorter tier."""

import json

import pytest

from comparisons import cli, discover, execute, recorded_cases
from comparisons.discover import find_cases
from gpudem.errors import GpudemError
from tests.comparisons import fake
from tests.comparisons.test_report import Page


@pytest.fixture
def kept(tmp_path, monkeypatch, fake_codes, capsys):
    """A folder with one recorded case."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GPUDEM_NO_RENDER", "1")
    monkeypatch.setattr(discover, "find_cases", lambda: [fake.case()])
    folder = tmp_path / "full"
    for name in ("keep", "find"):
        monkeypatch.setattr(getattr(recorded_cases, name), "__defaults__", (folder,))
    assert cli.main(["compare", "-q", "--tier", "full", "--record"]) == 0
    assert f"kept: {folder / 'throw.json'}" in capsys.readouterr().err
    return folder


def test_a_shorter_tier_shows_what_was_kept(kept, tmp_path):
    session = execute.Session([fake.case()], tmp_path / "quick", tier="quick")
    (tmp_path / "quick").mkdir()
    comparison = session.run()
    recorded = comparison.cases[0].recorded
    assert recorded is not None
    assert recorded.checks
    assert {c.status for c in recorded.checks} == {"pass"}
    assert recorded.provenance["hardware"]["cores"] > 0
    page = (tmp_path / "quick" / "report.html").read_text()
    Page(page)
    assert "Full tier, recorded" in page
    assert recorded.provenance["date"][:10] in page
    assert comparison.counts()["pass"] == len(comparison.checks)  # those kept are not counted again


def test_the_full_tier_shows_itself_alone(kept, tmp_path):
    (tmp_path / "long").mkdir()
    session = execute.Session([fake.case()], tmp_path / "long", tier="full")
    assert session.run().cases[0].recorded is None


def test_a_broken_file_is_named(kept):
    (kept / "throw.json").write_text("{}")
    with pytest.raises(GpudemError, match=r"throw\.json: Field required"):
        recorded_cases.find("throw", kept)


def test_only_the_full_tier_is_kept(kept, capsys):
    assert cli.main(["compare", "-q", "--record"]) == 2
    assert "--record: keeps results of the full tier, this is quick" in capsys.readouterr().err


def test_what_the_project_keeps_is_of_its_cases():
    """A case renamed or a check removed makes a record out of date; a failure is never kept unseen."""
    cases = {case.name: case for case in find_cases()}
    for path in recorded_cases.FOLDER.glob("*.json"):
        recorded = recorded_cases.find(path.stem)
        assert recorded is not None
        names = {check.name for check in cases[path.stem].checks if "full" in check.tiers}
        assert {check.name for check in recorded.checks} <= names, path.stem
        assert json.loads(path.read_text())["provenance"]["commit"] != "unknown"
