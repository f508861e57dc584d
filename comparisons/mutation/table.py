"""The table of mutations, data/mutations.toml, and the tests that have to detect them."""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path
from typing import Any

from comparisons.mutation.markers import Marked, Sources
from comparisons.mutation.operations import Operation
from gpudem.errors import GpudemError

TABLE = Path(__file__).parent / "data" / "mutations.toml"
FIELDS = ("name", "marker", "operation", "at", "defect", "first_tests")


@dataclasses.dataclass(frozen=True)
class Mutation:
    """One defect: an operation on the statement with a marker."""

    name: str
    marker: str
    operation: Operation
    defect: str
    """What the solver does then."""
    first_tests: tuple[str, ...]
    """Members of the test set that run first."""

    def applied(self, sources: Sources) -> tuple[Marked, str]:
        """The marked statement, and the text of its file with the defect in it.

        Raises GpudemError if the marker is missing or not unique, or if the operation does not apply.
        """
        try:
            marked = sources.find(self.marker)
            return marked, self.operation.applied(marked, sources.find)
        except GpudemError as error:
            raise GpudemError(f"mutation {self.name!r}: {error}") from None


@dataclasses.dataclass(frozen=True)
class TestSet:
    """The fast tests that have to detect the mutations: short name -> pytest node."""

    __test__ = False  # no test for pytest to collect

    nodes: dict[str, str]

    def short_name(self, node: str) -> str:
        """Short name of a test, given its full pytest node."""
        for name, prefix in self.nodes.items():
            if node == prefix:
                return name
        for name, prefix in self.nodes.items():
            if node.startswith(prefix):
                return f"{name}: {node.removeprefix(prefix).removeprefix('::')}"
        return node


def load(path: Path = TABLE) -> tuple[TestSet, list[Mutation]]:
    """The test set and all mutations.

    Raises GpudemError for a mutation that is incomplete, names an unknown test, or whose name is taken.
    """
    data = tomllib.loads(path.read_text())
    nodes = {}
    for kind, entry in data["test_set"].items():
        for member in entry.get("of", [""]):
            nodes[f"{kind} {member}".strip()] = entry["node"].replace("{}", member)
    mutations: list[Mutation] = []
    for row in data["mutation"]:
        mutation = _mutation(path, row)
        unknown = [test for test in mutation.first_tests if test not in nodes]
        if unknown:
            raise GpudemError(
                f"{path}: mutation {mutation.name!r}: not in the test set: {', '.join(unknown)}"
            )
        if mutation.name in {m.name for m in mutations}:
            raise GpudemError(f"{path}: there are two mutations {mutation.name!r}")
        mutations.append(mutation)
    return TestSet(nodes), mutations


def _mutation(path: Path, row: dict[str, Any]) -> Mutation:
    missing = [key for key in FIELDS if key not in row and key != "at"]
    if missing:
        raise GpudemError(f"{path}: mutation {row.get('name')!r}: missing: {', '.join(missing)}")
    options = {key: value for key, value in row.items() if key not in FIELDS}
    try:
        operation = Operation(row["operation"], row.get("at", ""), options)
    except GpudemError as error:
        raise GpudemError(f"{path}: mutation {row['name']!r}: {error}") from None
    return Mutation(row["name"], row["marker"], operation, row["defect"], tuple(row["first_tests"]))
