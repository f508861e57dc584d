"""The code blocks of the documentation, run as tests: each page in a folder of its own.

A block with a caption is a file of that name; `console` blocks run their `$` commands there, and what they
show must be printed, digits apart; Python blocks without a caption run in the page's own names.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from sybil import Document, Example, Region, Sybil
from sybil.parsers.myst import SkipParser

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(
    r"^```\{?(?:code-block\} )?(\w+)\}?\n((?::\w+:[^\n]*\n)*)(.*?)^```$", re.MULTILINE | re.DOTALL
)


def blocks(document: Document) -> Iterator[Region]:
    """The blocks of a page that are files, commands or Python."""
    for found in BLOCK.finditer(document.text):
        language, options, body = found.groups()
        caption = re.search(r":caption: *(\S+)", options)
        if language == "literalinclude":
            continue
        if caption:
            yield Region(found.start(), found.end(), (caption[1], body.lstrip("\n")), write_file)
        elif language == "console":
            yield Region(found.start(), found.end(), body, run_commands)
        elif language == "python":
            yield Region(found.start(), found.end(), body, run_python)


def includes(document: Document) -> Iterator[Region]:
    """Files that a page shows with a caption."""
    for found in re.finditer(
        r"^```\{literalinclude\} (\S+)\n((?::\w+:.*\n)*)```$", document.text, re.MULTILINE
    ):
        caption = re.search(r":caption: *(\S+)", found[2])
        if caption:
            text = (Path(document.path).parent / found[1]).read_text()
            yield Region(found.start(), found.end(), (caption[1], text), write_file)


def write_file(example: Example) -> None:
    """Write a block to its file."""
    name, text = example.parsed
    Path(name).write_text(text)


def run_python(example: Example) -> None:
    """Run a block in the names of its page."""
    source = "\n" * (example.line - 1) + example.parsed
    exec(compile(source, example.path, "exec"), example.namespace)


def run_commands(example: Example) -> None:
    """Run the commands of a block and compare what they print with what the page shows."""
    for command, expected, shown in commands(example.parsed):
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        done = subprocess.run(
            ["bash", "-c", command], capture_output=True, text=True, timeout=280,
            env={**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)},
        )  # fmt: skip
        printed = done.stdout + done.stderr
        assert done.returncode == expected, f"$ {command}: exit code {done.returncode}\n{printed}"
        missing = absent(shown, printed)
        assert not missing, f"$ {command}: does not print {missing!r}, but\n{printed}"


def commands(text: str) -> Iterator[tuple[str, int, list[str]]]:
    """(command, exit code, lines shown) of a console block; `# exit code N` stands behind a command."""
    for part in re.split(r"^\$ ", textwrap.dedent(text), flags=re.MULTILINE)[1:]:
        line, *shown = part.rstrip("\n").split("\n")
        code = re.search(r"# exit code (\d+)", line)
        yield line.split("  #")[0].strip(), int(code[1]) if code else 0, shown


def absent(shown: list[str], printed: str) -> str:
    """The first line shown that is not printed after the one before it; `...` stands for anything."""
    rest = plain(printed)
    for line in shown:
        pattern = r".*?".join(map(re.escape, plain(line).split("...")))
        found = re.search(pattern, rest, re.DOTALL)
        if found is None:
            return line
        rest = rest[found.end() :]
    return ""


def plain(text: str) -> str:
    """A text whose numbers are all the same."""
    return re.sub(r"\d+(\.\d+)?(e[+-]?\d+)?", "0", text)


def enter(namespace: dict[str, Any]) -> None:
    """A folder for the page, with the files of examples/."""
    folder = tempfile.TemporaryDirectory()
    for path in (ROOT / "examples").glob("*.*"):
        shutil.copy(path, folder.name)
    namespace |= {"_folder": folder, "_before": os.getcwd()}
    os.chdir(folder.name)


def leave(namespace: dict[str, Any]) -> None:
    """Back to where the tests run."""
    os.chdir(namespace["_before"])
    namespace["_folder"].cleanup()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """They compile kernels: not part of the fast tests."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker("long")


pytest_collect_file = Sybil(
    parsers=[blocks, includes, SkipParser()],
    patterns=["guide/*.md", "extending/*.md", "own_code.md"],
    setup=enter,
    teardown=leave,
).pytest()
