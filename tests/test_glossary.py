"""docs/glossary.md is up to date: every name that it gives is one of the sources."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
GLOSSARY = ROOT / "docs" / "glossary.md"
SOURCES = ("gpudem", "comparisons", "reference", "tests/event_driven")


def rows() -> list[tuple[str, str, str]]:
    """(term, meaning, names in the code) of all entries."""
    found = []
    for line in GLOSSARY.read_text().splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if line.startswith("|") and len(cells) == 3 and cells[0] != "term" and set(cells[0]) != {"-"}:
            found.append((cells[0], cells[1], cells[2]))
    return found


def test_terms_are_unique_and_explained():
    # detects: a term with two meanings, an entry without one, a table that is not read here
    terms = [term for term, _, _ in rows()]
    assert len(terms) >= 60
    assert len(set(terms)) == len(terms)
    assert [term for term, meaning, _ in rows() if len(meaning) < 15 or not meaning.endswith(".")] == []


def test_names_are_those_of_the_code():
    # detects: a rename that leaves the glossary behind
    files = [path for folder in SOURCES for path in (ROOT / folder).rglob("*.py")]
    words = {word for path in files for word in re.findall(r"\w+", path.read_text())}
    named = {name for _, _, names in rows() for name in re.findall("`([^`]+)`", names)}
    missing = [
        name for name in named if not (ROOT / name).is_dir() and not set(re.findall(r"\w+", name)) <= words
    ]
    assert len(named) > 80
    assert sorted(missing) == []
