"""Results of the full tier, kept in the project and shown, as recorded, by reports of a shorter tier."""

import dataclasses
import importlib
import json
import shutil
import sys
from pathlib import Path

import pytest

from comparisons import cli
from comparisons.harness import discover, execute, recorded_cases, results, sources
from comparisons.harness.case import Table
from comparisons.harness.discover import find_cases
from comparisons.report import page as report
from gpudem.errors import GpudemError
from tests.comparisons import fake
from tests.comparisons.test_report import Page

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def record(tmp_path_factory) -> Path:
    """Where the first test that needs it leaves the recorded case for the others."""
    return tmp_path_factory.mktemp("record") / "full"


@pytest.fixture
def kept(tmp_path, monkeypatch, fake_codes, capsys, record):
    """A folder with one recorded case."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GPUDEM_NO_RENDER", "1")
    monkeypatch.setattr(discover, "find_cases", lambda: [fake.case()])
    folder = tmp_path / "full"
    for name in ("keep", "find"):
        monkeypatch.setattr(getattr(recorded_cases, name), "__defaults__", (folder,))
    if record.exists():
        return shutil.copytree(record, folder)
    assert cli.main(["compare", "-q", "--tier", "full", "--record"]) == 0
    assert f"kept: {folder / 'throw.json'}" in capsys.readouterr().err
    shutil.copytree(folder, record)
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


def test_edited_words_of_a_record_are_said_to_be(kept, tmp_path):
    """Detects a record whose texts were changed later and are shown as those of its run."""
    (tmp_path / "quick").mkdir()
    (case,) = execute.Session([fake.case()], tmp_path / "quick", tier="quick").run().cases
    assert case.recorded is not None
    for edited in ("", "2026-11-27"):
        shown = dataclasses.replace(case, recorded=dataclasses.replace(case.recorded, edited=edited))
        comparison = dataclasses.replace(results.load(tmp_path / "quick"), cases=[shown])
        page = report.html(comparison, tmp_path / "quick")
        said = "The wording of its texts was edited on 2026-11-27, no number." in page
        assert said == bool(edited)


def advising(recorded: bool = True):
    """The fake case with a figure and a table that are kept, the table one of advice."""
    import pandas

    one = fake.case()

    def table(results):
        return pandas.DataFrame(
            [("step", f"take a short one, says {results.tier}")], columns=["choose", "by"]
        )

    return dataclasses.replace(
        one, figures=(dataclasses.replace(one.figures[0], recorded=recorded),),
        tables=(Table("Advice", "Of this run.", table, section="advice", recorded=recorded),),
    )  # fmt: skip


def test_figures_and_tables_are_kept(kept, tmp_path):
    """Catches a record without its picture, or with another one."""
    folder, long = tmp_path / "kept", tmp_path / "long"
    long.mkdir()
    session = execute.Session([advising()], long, tier="full")
    recorded_cases.keep(session.run(), long, folder)
    found = recorded_cases.find("throw", folder)
    assert found is not None
    assert [a.kind for a in found.artefacts] == ["figure", "table"]
    live = next((long / "throw").rglob("*.svg")).read_text()
    assert (folder / found.artefacts[0].file).read_text() == live


def test_advice_stands_first_and_the_full_tier_speaks(kept, tmp_path, monkeypatch):
    """Catches advice of a short run where the long one is known, and a section that nobody fills."""
    monkeypatch.setattr(report.recorded_cases, "FOLDER", kept)
    (tmp_path / "short").mkdir()
    session = execute.Session([advising()], tmp_path / "short", tier="quick")
    session.run()
    page = (tmp_path / "short" / "report.html").read_text()
    assert "take a short one, says quick" in page
    assert page.index('<section id="advice"') < page.index('<section id="overview"')
    (tmp_path / "long").mkdir()
    recorded_cases.keep(
        execute.Session([advising()], tmp_path / "long", tier="full").run(), tmp_path / "long", kept
    )
    (tmp_path / "again").mkdir()
    execute.Session([advising()], tmp_path / "again", tier="quick").run()
    page = (tmp_path / "again" / "report.html").read_text()
    Page(page)
    assert "take a short one, says full" in page
    assert "take a short one, says quick" not in page


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
        names = {check.name for check in cases[path.stem].checks_of("full")}
        assert {check.name for check in recorded.checks} <= names, path.stem
        assert json.loads(path.read_text())["provenance"]["commit"] != "unknown"


@pytest.fixture
def their_case(tmp_path, monkeypatch):
    """Writes a package of cases, with additions to its modules, and gives the hashes of its two checks."""
    package = tmp_path / "their_cases"
    package.mkdir()
    monkeypatch.syspath_prepend(tmp_path)

    def hashes(helper="", other="", scenes=""):
        texts = {
            "__init__": "",
            "helper": f"LIMIT = 1.0\n{helper}",
            "other": f"from tests.comparisons import fake\nCHECK = fake.case().checks[0]\n{other}",
            "scenes": f"def variants(tier):\n    return []\n{scenes}",
            "one": (
                "import dataclasses\nfrom comparisons.harness.case import Case\nfrom . import other, scenes\n"
                "def measure(results):\n    from their_cases.helper import LIMIT\n    return LIMIT\n"
                "mine = dataclasses.replace(other.CHECK, name='mine', measure=measure)\n"
                "CASE = Case('one', 'One', '', '', scenes.variants, (mine, other.CHECK))\n"
            ),
        }
        for name, text in texts.items():
            (package / f"{name}.py").write_text(text)
        for name in [name for name in sys.modules if name.split(".")[0] == "their_cases"]:
            del sys.modules[name]
        importlib.invalidate_caches()
        for cached in (sources._hash, sources._imports, sources._file):
            cached.cache_clear()
        return sources.hashes(importlib.import_module("their_cases.one").CASE)

    yield hashes
    for name in [name for name in sys.modules if name.split(".")[0] == "their_cases"]:
        del sys.modules[name]


def test_the_code_of_a_check_and_of_what_it_imports(their_case):
    """Catches a change in a helper, imported within a function or relatively, that leaves the hash."""
    first = their_case()
    theirs = fake.case().checks[0].name
    assert set(first) == {"mine", theirs}
    assert their_case() == first
    helper = their_case(helper="LIMIT = 2.0\n")
    assert helper["mine"] != first["mine"]
    assert helper[theirs] == first[theirs]
    assert their_case(other="X = 1\n")["mine"] != first["mine"]
    scenes = their_case(scenes="Y = 1\n")
    assert scenes["mine"] != first["mine"]
    assert scenes[theirs] != first[theirs]


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (lambda now: now, "The code of its checks has not changed since."),
        (lambda now: {}, "has changed since is not known"),
        (lambda now: dict.fromkeys(now, "0"), "The code of all its checks (scenes"),
        (lambda now: {**now, "apex": "0"}, "The code of 1 of its 4 checks (scenes"),
    ],
    ids=["same", "not kept", "all", "one"],
)
def test_the_page_says_which_checks_have_changed(kept, tmp_path, code, text):
    data = json.loads((kept / "throw.json").read_text())
    data["code"] = code(data["code"])
    (kept / "throw.json").write_text(json.dumps(data))
    (tmp_path / "quick").mkdir()
    execute.Session([fake.case()], tmp_path / "quick", tier="quick").run()
    page = (tmp_path / "quick" / "report.html").read_text()
    assert text in page
    assert ("has changed since: apex." in page) is ("of 1 of" in text)
