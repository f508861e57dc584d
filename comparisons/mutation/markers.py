"""Markers: comments `# mutate: NAME` in the sources; each names the statement that a mutation changes.

A marker trails its statement, or stands on a line of its own above it. A name is unique in all sources.
"""

from __future__ import annotations

import ast
import dataclasses
import functools
import io
import itertools
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

from gpudem.errors import GpudemError

#: Packages whose sources are searched for markers.
PACKAGES = ("gpudem", "reference")
COMMENT = re.compile(r"#\s*mutate:\s*(.*?)\s*$")
NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclasses.dataclass(frozen=True)
class Marked:
    """A marked statement: where it stands, and its syntax tree within that of the file."""

    path: str
    """Below the root of the sources."""
    line: int
    """Of the statement."""
    text: str
    """The whole file."""
    tree: ast.Module
    statement: ast.stmt

    def span(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        """First byte of a node in the UTF-8 text, and the byte after its last."""
        starts = _line_starts(self.text)
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset

    def source(self, node: ast.expr | ast.stmt) -> str:
        """The text of a node."""
        first, last = self.span(node)
        return self.text.encode()[first:last].decode()

    def replaced(self, first: int, last: int, new: str) -> str:
        """The file with the bytes from `first` to `last` replaced."""
        data = self.text.encode()
        return (data[:first] + new.encode() + data[last:]).decode()

    def next_statement(self) -> ast.stmt | None:
        """The statement after this one in the same block; None if it is the last."""
        for node in ast.walk(self.tree):
            for _, block in ast.iter_fields(node):
                if isinstance(block, list) and self.statement in block:
                    after = block[block.index(self.statement) + 1 :]
                    return after[0] if after else None
        raise AssertionError("the statement is not in its tree")


class Sources:
    """Source files, and the statements that carry markers in them."""

    def __init__(self, texts: dict[str, str]):
        self.texts = texts
        self._marked: dict[str, list[Marked]] = {}
        for path, text in texts.items():
            for name, marked in _markers(path, text):
                self._marked.setdefault(name, []).append(marked)

    @classmethod
    def read(cls, root: Path) -> Sources:
        """The sources of PACKAGES below a root folder."""
        files = sorted(path for package in PACKAGES for path in (root / package).rglob("*.py"))
        return cls({path.relative_to(root).as_posix(): path.read_text() for path in files})

    @property
    def names(self) -> set[str]:
        """All names of markers."""
        return set(self._marked)

    def find(self, name: str) -> Marked:
        """The statement of a marker. Raises GpudemError if no source has it, or more than one place."""
        found = self._marked.get(name, [])
        if not found:
            raise GpudemError(f"no source has the marker '# mutate: {name}'")
        if len(found) > 1:
            places = ", ".join(f"{m.path}:{m.line}" for m in found)
            raise GpudemError(f"the marker '# mutate: {name}' is not unique: {places}")
        return found[0]


@functools.cache
def _line_starts(text: str) -> tuple[int, ...]:
    """First byte of each line of the UTF-8 text."""
    lengths = [len(line) + 1 for line in text.encode().split(b"\n")]
    return tuple(itertools.accumulate(lengths, initial=0))


@functools.cache
def _markers(path: str, text: str) -> tuple[tuple[str, Marked], ...]:
    if "mutate:" not in text:
        return ()
    tree = ast.parse(text)
    return tuple(
        (name, Marked(path, statement.lineno, text, tree, statement))
        for name, statement in _statements(path, text, tree)
    )


def _statements(path: str, text: str, tree: ast.Module) -> Iterator[tuple[str, ast.stmt]]:
    statements = [node for node in ast.walk(tree) if isinstance(node, ast.stmt)]
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        match = COMMENT.search(token.string) if token.type == tokenize.COMMENT else None
        if match is None:
            continue
        line, name = token.start[0], match[1]
        if not NAME.fullmatch(name):
            raise GpudemError(f"{path}:{line}: {name!r} is no name of a marker: a-z, 0-9 and _ only")
        alone = not token.line[: token.start[1]].strip()
        statement = _statement_at(statements, line, alone)
        if statement is None:
            raise GpudemError(f"{path}:{line}: the marker {name!r} belongs to no statement")
        yield name, statement


def _statement_at(statements: list[ast.stmt], line: int, alone: bool) -> ast.stmt | None:
    """The statement that a comment on `line` trails; if it is alone there, the next statement."""
    around = [s for s in statements if s.lineno <= line <= _last_line(s)]
    if around:  # within its lines too, if it spans several
        return max(around, key=lambda s: s.lineno)
    after = [s for s in statements if s.lineno > line]
    return min(after, key=lambda s: (s.lineno, s.col_offset)) if alone and after else None


def _last_line(statement: ast.stmt) -> int:
    """Last line of a statement; of one with a block, the last line of its head."""
    if not hasattr(statement, "body"):
        return statement.end_lineno or statement.lineno
    blocks = (ast.stmt, ast.ExceptHandler, ast.match_case)
    heads = [node for node in ast.iter_child_nodes(statement) if not isinstance(node, blocks)]
    lines = [getattr(node, "end_lineno", 0) for head in heads for node in ast.walk(head)]
    return max(statement.lineno, *lines) if lines else statement.lineno
