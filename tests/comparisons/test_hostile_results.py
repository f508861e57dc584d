"""`gpudem report` on a folder from elsewhere: nothing outside it is read, nothing in it runs or is endless.

Each row is one thing that somebody could put there. Catches: a name joined to the folder unseen, a link or a
pipe that is followed, text that becomes HTML, a value that ends in a traceback, a file that fills the memory.
"""

import base64
import json
import os
import re
import shutil

import numpy as np
import pytest

from comparisons import cli
from comparisons.harness import folder
from gpudem.output.archive import ArchiveError, read_npz
from gpudem.output.atomic import write_text
from tests.comparisons.test_report import Page

pytestmark = pytest.mark.long

#: Stands in a file outside of the folder, and in nothing that may be shown.
SECRET = "the-secret-of-somebody-else"


@pytest.fixture
def hostile(finished, tmp_path):
    """hostile(change) changes the results (a dictionary, in place), and gives the folder."""
    (tmp_path / "secret.csv").write_text(SECRET)
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "deck.in").write_text(SECRET)
    copy = tmp_path / "theirs"
    shutil.copytree(finished[0], copy)

    def make(change):
        data = json.loads((copy / "results.json").read_text())
        change(data, copy)
        (copy / "results.json").write_text(json.dumps(data))
        return copy

    return make


def artefact(data, kind="table"):
    return next(a for c in data["cases"] for a in c["artefacts"] if a["kind"] == kind and a["status"] == "ok")


def stated(name, kind="table"):
    """A figure or table that lies at another place."""
    return lambda data, root: artefact(data, kind).update(file=name)


def placed(make):
    """Something else in the place of a table; make(path) makes it."""

    def change(data, root):
        path = root / artefact(data)["file"]
        path.unlink()
        make(path)

    return change


def deck_in(name):
    return lambda data, root: data["runs"][0].update(directory=name)


def linked_folder(data, root):
    (root / "throw" / "away").symlink_to(root.parent / "outside")
    data["runs"][0]["directory"] = "throw/away"


def large(data, root):
    with (root / artefact(data)["file"]).open("r+b") as file:
        file.truncate(folder.TABLE + 1)


REFUSED = {
    "absolute path": (stated("/etc/passwd"), "not a path inside the folder"),
    "absolute figure": (stated("/etc/passwd", "figure"), "not a path inside the folder"),
    "parent": (stated("../secret.csv"), "not a path inside the folder"),
    "parent within": (stated("throw/../../secret.csv"), "not a path inside the folder"),
    "no name": (stated(""), "not a path inside the folder"),
    "the folder itself": (stated("."), "not a path inside the folder"),
    "end of text": (stated("a\0b"), "not a path inside the folder"),
    "a folder": (stated("throw"), "throw: not a file"),
    "long name": (stated("a" * 5000), "File name too long"),
    "link": (placed(lambda path: path.symlink_to("../../../secret.csv")), "a link out of the folder"),
    "link to itself": (placed(lambda path: path.symlink_to(path.name)), "is missing"),
    "pipe": (placed(os.mkfifo), "not a file; not read"),
    "device": (placed(lambda path: path.symlink_to("/dev/zero")), "a link out of the folder"),
    "large table": (large, "at most 4 MiB are read"),
    "long cell": (placed(lambda path: path.write_text("x" * 200_000)), "not a table: field larger"),
    "run elsewhere": (deck_in("../outside"), "not a path inside the folder"),
    "run at an absolute place": (deck_in("/etc"), "not a path inside the folder"),
    "run behind a link": (linked_folder, "a link out of the folder"),
}


@pytest.mark.parametrize("change", [v[0] for v in REFUSED.values()], ids=list(REFUSED))
def test_files_outside_are_not_read(hostile, change, request, capsys):
    message = REFUSED[request.node.callspec.id][1]
    root = hostile(change)
    assert cli.main(["report", str(root)]) == 0
    page = (root / "report.html").read_text()
    assert message in page
    assert SECRET not in page
    assert "root:x:" not in page
    Page(page)


def test_all_that_a_page_embeds_is_limited(hostile, monkeypatch):
    root = hostile(lambda data, root: None)
    monkeypatch.setattr(folder, "PAGE", (root / "results.json").stat().st_size)
    assert cli.main(["report", str(root)]) == 0
    assert "a page holds no more" in (root / "report.html").read_text()


SCRIPT = "<script>alert(1)</script><img src=x onerror=alert(2)>\"'>"


def test_nothing_of_theirs_runs(hostile):
    """Every text of the results is a script, a figure holds one, and a folder's name is a link that runs."""

    def change(data, root):
        def spoil(value, key=""):
            if isinstance(value, dict):
                return {k: spoil(v, k) for k, v in value.items()}
            if isinstance(value, list):
                return [spoil(v, key) for v in value]
            kept = (
                "status",
                "kind",
                "section",
                "mark",
                "tier",
                "state",
                "file",
                "directory",
                "code",
                "codes",
            )
            free = isinstance(value, str) and key not in kept and value not in ("NaN", "Infinity")
            return SCRIPT if free else value

        file, path = artefact(data, "figure")["file"], "javascript:alert(1)"
        (root / file).write_text(f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 9 9'>{SCRIPT}</svg>")
        (root / path).mkdir()
        (root / path / "log").touch()
        data |= spoil(data)
        data["runs"][0]["directory"] = path

    root = hostile(change)
    assert cli.main(["report", str(root)]) == 0
    text = (root / "report.html").read_text()
    page = Page(text)
    assert page.tags.count("script") == 1
    assert not [name for name in page.attributes if name.startswith("on")]
    assert "svg" not in page.tags
    sources = [base64.b64decode(s.partition("base64,")[2]) for s in page.sources if "svg+xml" in s]
    assert any(b"alert(1)" in source for source in sources), "it is there, as an image"
    assert [
        s for s in page.sources if not s.startswith(("#", "data:", "./", "results.json", "junit.xml"))
    ] == []
    assert "./javascript%3Aalert%281%29/log" in page.links
    assert "default-src &#39;none&#39;" in text or "default-src 'none'" in text


def set_to(value, *keys):
    def change(data, root):
        for key in keys[:-1]:
            data = data[key]
        data[keys[-1]] = value

    return change


def deep(n):
    value = []
    for _ in range(n):
        value = [value]
    return value


WRONG = {
    "wrong type": (set_to("many", "checks", 0, "value"), r"checks\.0\.value: Input should be a valid number"),
    "no list": (set_to({}, "checks"), "checks: Input should be a valid list"),
    "unknown status": (set_to("perfect", "checks", 0, "status"), r"checks\.0\.status: Input should be"),
    "no machine": (set_to({}, "provenance"), r"provenance\.commit: Field required"),
    "no provenance": (set_to(None, "provenance"), "provenance: Input should be a valid dictionary"),
    "text for a set-up": (set_to("x", "cases", 0, "setup"), r"cases\.0\.setup"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_value_is_named(hostile, name, capsys):
    change, message = WRONG[name]
    assert cli.main(["report", str(hostile(change))]) == 2
    assert re.search(message, capsys.readouterr().err)


@pytest.mark.parametrize(
    "change",
    [
        set_to("NaN", "checks", 0, "value"), set_to("NaN", "checks", 0, "tolerance"),
        set_to("Infinity", "wall_s"), set_to("NaN", "wall_s"), set_to("-Infinity", "checks", 0, "lo"),
        set_to("NaN", "timings", 0, "stepping_s"), set_to(1e308, "timings", 0, "rate"),
        set_to(10**400, "timings", 0, "peak_memory_bytes"), set_to(-1, "timings", 0, "cores"),
        set_to({"a": deep(50)}, "options"), set_to("\x00\x1b", "checks", 0, "name"),
        set_to([], "cases"), set_to([], "runs"), set_to("", "cases", 0, "name"),
        set_to("x" * 10**6, "checks", 0, "why"),
    ],
)  # fmt: skip
def test_odd_values_are_shown_or_named(hostile, change, capsys):
    """Either a page or one line; never a traceback, which would leave this test by itself."""
    root = hostile(change)
    (root / "report.html").unlink()
    code = cli.main(["report", str(root)])
    assert code in (0, 2)
    if code:
        assert len(capsys.readouterr().err.splitlines()) == 1
    else:
        Page((root / "report.html").read_text())


def write(text):
    return lambda path: path.write_text(text)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (write("[" * 100_000), "not JSON"),
        (write('{"schema_version": 1, "options": ' + "[" * 5000 + "]" * 5000 + "}"), "not JSON"),
        (write('{"schema_version": ' + "9" * 5000 + "}"), "(not JSON|schema)"),
        (lambda path: path.write_bytes(b"\xff\xfe\x00"), "not JSON"),
        (write('{"schema_version": 1, "tier": "\\ud800"}'), "not JSON"),
        (lambda path: path.symlink_to("/etc/passwd"), "a link out of the folder"),
        (os.mkfifo, "not a file"),
        (lambda path: path.mkdir(), "not a file"),
        (
            lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_RDWR), folder.RESULTS + 1),
            "at most 64 MiB",
        ),
    ],
    ids=["open", "deep", "digits", "bytes", "surrogate", "link", "pipe", "folder", "large"],
)
def test_results_that_are_none(tmp_path, make, message, capsys):
    make(tmp_path / "results.json")
    assert cli.main(["report", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert re.search(message, error)
    assert "root:x:" not in error
    assert len(error) < 500


def test_writing_does_not_follow_a_link_that_waits(tmp_path):
    """The temporary name of a file is known: a link there must not lead what is written elsewhere."""
    (tmp_path / "secret").write_text(SECRET)
    (tmp_path / ".report.html.part").symlink_to("secret")
    write_text(tmp_path / "report.html", "page")
    assert (tmp_path / "secret").read_text() == SECRET
    assert (tmp_path / "report.html").read_text() == "page"


def test_an_archive_that_unpacks_to_far_more_is_refused(tmp_path, monkeypatch):
    np.savez_compressed(tmp_path / "bomb.npz", x=np.zeros(10**6))
    assert len(read_npz(tmp_path / "bomb.npz")["x"]) == 10**6
    monkeypatch.setattr("gpudem.output.archive._LARGE", 10**6)
    with pytest.raises(ArchiveError, match="MiB that unpack to"):
        read_npz(tmp_path / "bomb.npz")
    np.savez(tmp_path / "large.npz", x=np.arange(10**6))
    assert len(read_npz(tmp_path / "large.npz")["x"]) == 10**6
    np.savez_compressed(tmp_path / "plain.npz", x=np.random.default_rng(0).random(10**6))
    assert len(read_npz(tmp_path / "plain.npz")["x"]) == 10**6
