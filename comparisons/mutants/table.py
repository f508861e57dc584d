"""The ways to break the solver, as data: data/mutations.toml."""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path

from gpudem.errors import GpudemError

TABLE = Path(__file__).parent / "data" / "mutations.toml"


@dataclasses.dataclass(frozen=True)
class Mutation:
    """One wrong: a text of one source file replaced by another."""

    name: str
    file: str
    """Path below the repository's root."""
    old: str
    """Occurs exactly once in the file; else the table is out of date, which is an error."""
    new: str
    wrong: str
    """What is wrong then, and what it would do."""
    look: tuple[str, ...]
    """Members of the battery that are tried first."""

    def applied(self, text: str) -> str:
        """The file with the wrong in it. Raises GpudemError where `old` is not there exactly once."""
        found = text.count(self.old)
        if found != 1:
            raise GpudemError(f"mutation {self.name!r}: its old text stands {found} times in {self.file}")
        return text.replace(self.old, self.new)


@dataclasses.dataclass(frozen=True)
class Battery:
    """The fast checks that a broken solver has to pass: short name -> pytest node."""

    nodes: dict[str, str]

    def name(self, classname: str, test: str) -> str:
        """Short name of a test from its entry in junit.xml."""
        node = f"{classname.replace('.', '/')}.py::{test}"
        for name, prefix in self.nodes.items():
            if node == prefix:
                return name
        for name, prefix in self.nodes.items():
            if node.startswith(prefix):
                return f"{name}: {node.removeprefix(prefix).removeprefix('::')}"
        return node


def load(path: Path = TABLE) -> tuple[Battery, list[Mutation]]:
    """The battery and all mutations. Raises GpudemError for a name that stands twice or is unknown."""
    data = tomllib.loads(path.read_text())
    templates, nodes = data["battery"], {}
    for kind, entry in templates.items():
        for member in entry.get("of", [""]):
            nodes[f"{kind} {member}".strip()] = entry["node"].replace("{}", member)
    mutations = [Mutation(**{**m, "look": tuple(m["look"])}) for m in data["mutation"]]
    names = [m.name for m in mutations]
    twice = sorted({n for n in names if names.count(n) > 1})
    unknown = sorted({look for m in mutations for look in m.look if look not in nodes})
    if twice or unknown:
        raise GpudemError(f"{path}: twice: {twice}; not in the battery: {unknown}")
    return Battery(nodes), mutations
