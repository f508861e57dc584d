"""The documentation builds, and what is made for it is complete. Its code blocks: docs/conftest.py."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from gpudem.scene.wall_kinds import BUILT_IN

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"


def load(path: Path) -> ModuleType:
    """A module of docs/, which is no package."""
    spec = importlib.util.spec_from_file_location(f"docs_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.long
def test_it_builds_without_a_warning_and_asks_no_network(tmp_path):
    """Catches broken links and references, and pages that load something from elsewhere."""
    build = [
        sys.executable,
        "-m",
        "sphinx",
        "-q",
        "-W",
        "--keep-going",
        "-b",
        "html",
        str(DOCS),
        str(tmp_path),
    ]
    done = subprocess.run(build, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for page in tmp_path.rglob("*.html"):
        text = page.read_text()
        assert 'src="http' not in text, page
        assert '<link rel="stylesheet" type="text/css" href="http' not in text, page
    theory = (tmp_path / "theory" / "contact.html").read_text()
    assert "<math" in theory
    assert "\\frac" not in theory, "an equation that was not converted"


def test_every_key_of_a_scene_has_a_meaning():
    """Catches a new key without a docstring, which the scene reference would show empty."""
    generated = load(DOCS / "_extensions" / "generated.py")
    rows = [line for line in generated.scene_page().splitlines() if line.startswith("| `")]
    assert len(rows) > 60
    assert not [row for row in rows if row.endswith("|  |")]


def test_every_kind_of_wall_has_a_valid_example_and_a_picture():
    """Catches a kind that the guide leaves out, an example that is no wall, a picture that shows nothing."""
    drawing = load(DOCS / "_extensions" / "wall_pictures.py")
    examples = drawing.examples(DOCS / "guide" / "walls.md")
    assert set(examples) == set(BUILT_IN)
    pictures = drawing.pictures(DOCS / "guide" / "walls.md")
    assert pictures == drawing.pictures(DOCS / "guide" / "walls.md")
    for kind, text in pictures.items():
        assert text.count("<path") > (40 if kind in ("cylinder", "cone") else 0), kind
        assert f"../generated/walls/{kind}.svg" in (DOCS / "guide" / "walls.md").read_text()


def test_bold_letters_are_characters():
    """Browsers draw `mathvariant="bold"` as italic: vectors would look like numbers."""
    mathml = load(DOCS / "_extensions" / "mathml.py").mathml
    assert "\U0001d431" in mathml(r"\mathbf x", "inline")
    assert "\U0001d6da" in mathml(r"\boldsymbol\omega", "inline")
    assert 'mathvariant="bold' not in mathml(r"\mathbf F_i + \boldsymbol\omega", "inline")


@pytest.mark.parametrize(
    ("shown", "found"),
    [
        (["steps: 12"], True),
        (["steps: ..."], True),
        (["steps: 99", "done in 1.5 s"], True),
        (["done in 2 s", "steps: 12"], False),
        (["stops: 12"], False),
    ],
)
def test_what_a_page_shows_is_compared_with_what_is_printed(shown, found):
    """Digits apart, in order: a page that shows another output is detected."""
    absent = load(DOCS / "conftest.py").absent
    assert (absent(shown, "steps: 15\nrate\ndone in 0.1 s\n") == "") is found
