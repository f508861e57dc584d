"""Rules of the house that a machine can hold: imports go one way and stay light, files stay short."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
#: In order: each may import those before it, and itself.
LAYERS = ("gpudem", "reference", "comparisons", "tests")
HEAVY = {"pyvista", "vtk", "vtkmodules", "meshio", "matplotlib"}
LONGEST = 400

FILES = sorted(p for layer in LAYERS for p in (ROOT / layer).rglob("*.py"))
IDS = [str(p.relative_to(ROOT)) for p in FILES]


def imports(tree: ast.AST) -> Iterator[str]:
    """Every imported module, wherever it is imported."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def at_import(tree: ast.Module) -> ast.Module:
    """What runs when the module is imported: no function bodies, no `if TYPE_CHECKING`."""

    class Strip(ast.NodeTransformer):
        def visit_FunctionDef(self, node):
            return None

        visit_AsyncFunctionDef = visit_Lambda = visit_FunctionDef

        def visit_If(self, node):
            return None if ast.unparse(node.test).endswith("TYPE_CHECKING") else self.generic_visit(node)

    return Strip().visit(tree)


@pytest.mark.parametrize("path", FILES, ids=IDS)
def test_imports_go_one_way(path):
    layer = LAYERS.index(path.relative_to(ROOT).parts[0])
    forbidden = LAYERS[layer + 1 :]
    wrong = [name for name in imports(ast.parse(path.read_text())) if name.split(".")[0] in forbidden]
    assert not wrong, f"{LAYERS[layer]} must not know of {wrong}"


def test_the_rule_sees_nested_imports():
    tree = ast.parse("def f():\n    from comparisons import report\n    import reference.liggghts as r")
    assert list(imports(tree)) == ["comparisons.report", "reference.liggghts"]


@pytest.mark.parametrize("path", FILES, ids=IDS)
def test_heavy_packages_are_imported_where_they_are_used(path):
    wrong = [n for n in imports(at_import(ast.parse(path.read_text()))) if n.split(".")[0] in HEAVY]
    assert not wrong, f"import {wrong} inside the function that uses it"


@pytest.mark.parametrize("module", ["gpudem", "gpudem.scene", "reference.liggghts", "comparisons.cli"])
def test_import_is_light(module):
    code = f"import sys, json, {module}; print(json.dumps([m.split('.')[0] for m in sys.modules]))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not HEAVY & set(json.loads(done.stdout.splitlines()[-1]))


def test_oracles_know_nothing_of_the_contact_law():
    paths = [p for p in FILES if "oracles" in p.relative_to(ROOT).parts or p.name.startswith("oracles")]
    assert paths
    for path in paths:
        wrong = [n for n in imports(ast.parse(path.read_text())) if n.startswith("gpudem.contact")]
        assert not wrong, f"{path}: an oracle that shares the law's numbers checks nothing"


@pytest.mark.parametrize("path", FILES, ids=IDS)
def test_files_stay_short(path):
    assert len(path.read_text().splitlines()) <= LONGEST
