"""Rules that a machine can hold: imports go one way, in no circle, and stay light; functions fit on a screen.

Each rule is also tried on small examples that break it.
"""

from __future__ import annotations

import ast
import functools
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
#: Lines of a function, and of a kernel, which Warp cannot split freely.
LONGEST, LONGEST_KERNEL = 60, 120

FILES = sorted(p for layer in LAYERS for p in (ROOT / layer).rglob("*.py"))


@functools.cache
def parsed(path: Path) -> ast.Module:
    """The syntax tree of a file. Not to be changed."""
    return ast.parse(path.read_text())


def is_type_checking(node: ast.AST) -> bool:
    """Whether it is `if TYPE_CHECKING`."""
    return isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")


def walk(tree: ast.AST, types: bool = True, functions: bool = True) -> Iterator[ast.AST]:
    """All nodes; on demand without what only the type checker reads, and without bodies of functions."""
    bodies = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)
    for node in ast.iter_child_nodes(tree):
        if (types or not is_type_checking(node)) and (functions or not isinstance(node, bodies)):
            yield node
            yield from walk(node, types, functions)


def imports(tree: ast.AST, types: bool = True, functions: bool = True) -> Iterator[str]:
    """Every imported module or name."""
    for node in walk(tree, types, functions):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute: the rules here read no others"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def module_name(path: Path) -> str:
    """gpudem/scene/__init__.py -> gpudem.scene."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def import_graph(trees: dict[str, ast.AST]) -> dict[str, set[str]]:
    """Module -> modules of the same set that it names in an import, also within functions.

    The package of an imported submodule is not named by that: `from gpudem.scene import model` names
    gpudem.scene.model, `from gpudem.scene import Scene` names gpudem.scene.
    """
    return {
        name: {
            found
            for target in imports(tree, types=False)
            for found in (target if target in trees else target.rpartition(".")[0],)
            if found in trees
        }
        for name, tree in trees.items()
    }


def circles(graph: dict[str, set[str]]) -> set[frozenset[str]]:
    """Strongly connected components: sets of modules each of which reaches each, or one that names itself."""
    reached: dict[str, set[str]] = {}
    for name in graph:
        waiting, reached[name] = list(graph[name]), set()
        while waiting:
            at = waiting.pop()
            if at not in reached[name]:
                reached[name].add(at)
                waiting += graph[at]
    return {
        frozenset(other for other in reached[name] if name in reached[other])
        for name in graph
        if name in reached[name]
    }


def long_functions(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """(name, lines) of functions that are too long; what is defined within one counts for itself."""
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    for node in ast.walk(tree):
        if isinstance(node, functions):
            lines = set(range(node.lineno, (node.end_lineno or 0) + 1))
            for inner in ast.walk(node):
                if inner is not node and isinstance(inner, (*functions, ast.ClassDef)):
                    first = min([inner.lineno, *(d.lineno for d in inner.decorator_list)])
                    lines -= set(range(first, (inner.end_lineno or 0) + 1))
            kernel = any("kernel" in ast.unparse(d) for d in node.decorator_list)
            if len(lines) > (LONGEST_KERNEL if kernel else LONGEST):
                yield node.name, len(lines)


def test_imports_go_one_way():
    found = {}
    for path in FILES:
        forbidden = LAYERS[LAYERS.index(path.relative_to(ROOT).parts[0]) + 1 :]
        found[path] = [name for name in imports(parsed(path)) if name.split(".")[0] in forbidden]
    assert not {path: names for path, names in found.items() if names}


def test_the_rule_sees_nested_imports():
    tree = ast.parse("def f():\n    from comparisons import report\n    import reference.liggghts as r")
    assert list(imports(tree)) == ["comparisons.report", "reference.liggghts"]


def heavy(tree: ast.AST) -> list[str]:
    """Packages that take seconds to import, imported with the module."""
    return [n for n in imports(tree, types=False, functions=False) if n.split(".")[0] in HEAVY]


def test_heavy_packages_are_imported_where_they_are_used():
    found = {path: heavy(parsed(path)) for path in FILES}
    assert not {path: names for path, names in found.items() if names}


def test_the_rule_sees_heavy_packages():
    tree = ast.parse(
        "if TYPE_CHECKING:\n    import vtk\ndef f():\n    import meshio\n"
        "class C:\n    import pyvista\ntry:\n    from matplotlib import pyplot\nexcept ImportError:\n    pass"
    )
    assert heavy(tree) == ["pyvista", "matplotlib.pyplot"]


@pytest.mark.parametrize("module", ["gpudem", "gpudem.scene", "reference.liggghts", "comparisons.cli"])
def test_import_is_light(module):
    code = f"import sys, json, {module}; print(json.dumps([m.split('.')[0] for m in sys.modules]))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not HEAVY & set(json.loads(done.stdout.splitlines()[-1]))


def test_oracles_know_nothing_of_the_contact_law():
    paths = [p for p in FILES if "oracles" in p.relative_to(ROOT).parts or p.name.startswith("oracles")]
    assert paths
    for path in paths:
        wrong = [n for n in imports(parsed(path)) if n.startswith("gpudem.contact")]
        assert not wrong, f"{path}: an oracle that shares the law's numbers checks nothing"


@pytest.mark.parametrize("layer", LAYERS)
def test_no_import_circle(layer):
    trees = {module_name(p): parsed(p) for p in (ROOT / layer).rglob("*.py")}
    assert circles(import_graph(trees)) == set()


def test_the_rule_sees_circles():
    """Lazy imports count, also through a package; those for types do not, nor a submodule for its package."""
    sources = {
        "p": "from p.a import A",  # ...and p.a names a submodule of p: no circle
        "p.a": "from p import b",
        "p.b": "def f():\n    from p.c import C",
        "p.c": "if TYPE_CHECKING:\n    from p.b import f\nimport numpy",
        "p.d": "import p.e",
        "p.e": "def f():\n    if True:\n        import p.d",
        "p.f": "from p import A",  # a name of the package
        "p.g": "from p.g import itself",
    }
    assert circles(import_graph({name: ast.parse(text) for name, text in sources.items()})) == {
        frozenset({"p.d", "p.e"}),
        frozenset({"p.g"}),
    }
    sources["p.c"] = "from p import A"  # p -> p.a -> p.b -> p.c -> p
    assert frozenset({"p", "p.a", "p.b", "p.c"}) in circles(
        import_graph({name: ast.parse(text) for name, text in sources.items()})
    )


def test_functions_fit_on_a_screen():
    found = {
        f"{module_name(path)}.{name}": lines for path in FILES for name, lines in long_functions(parsed(path))
    }
    assert not found


def test_the_rule_sees_long_functions():
    def lines(n, indent="    "):
        return (indent + "x = 1\n") * n

    text = (
        f"def fits():\n{lines(59)}\ndef long():\n{lines(60)}\n"
        f"@wp.kernel(module='unique')\ndef kernel():\n{lines(119)}"
        f"@wp.kernel\ndef long_kernel():\n{lines(120)}\n@wp.func\ndef long_func():\n{lines(119)}"
        f"def factory():\n{lines(30)}    @wp.kernel\n    def inner():\n{lines(100, ' ' * 8)}\n{lines(27)}"
        f"def long_factory():\n{lines(30)}    def inner():\n{lines(10, ' ' * 8)}{lines(30)}"
        f"class C:\n    def method(self):\n{lines(60, ' ' * 8)}"
    )
    found = dict(long_functions(ast.parse(text)))
    assert found == {"long": 61, "long_kernel": 121, "long_func": 120, "long_factory": 61, "method": 61}


def settings_of_warp(tree: ast.AST) -> Iterator[str]:
    """Assignments to Warp's settings, which belong to the user's process, and kernels with an adjoint.

    An adjoint is half the code to compile; each kernel says itself that it has none.
    """
    for node in ast.walk(tree):
        for text in map(ast.unparse, getattr(node, "decorator_list", [])):
            if text.startswith("wp.kernel") and "enable_backward=False" not in text:
                yield text
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            if (text := ast.unparse(node)).startswith(("wp.config.", "warp.config.")):
                yield text


def test_the_settings_of_warp_are_the_users():
    files = [path for path in FILES if path.relative_to(ROOT).parts[0] != "tests"]
    found = {path: list(settings_of_warp(parsed(path))) for path in files}
    assert not {path: texts for path, texts in found.items() if texts}


def test_the_rule_sees_settings_of_warp():
    text = (
        "wp.config.quiet = True\nlevel = wp.config.log_level\n"
        "@wp.kernel\ndef f():\n    warp.config.mode = 'debug'\n"
        "@wp.kernel(module='unique', enable_backward=False)\ndef g(): pass\n@wp.func\ndef h(): pass"
    )
    assert sorted(settings_of_warp(ast.parse(text))) == ["warp.config.mode", "wp.config.quiet", "wp.kernel"]


def names_of_liggghts(tree: ast.AST) -> list[int]:
    """Lines with the name of LIGGGHTS' code as a string."""
    constants = (node for node in ast.walk(tree) if isinstance(node, ast.Constant))
    return [node.lineno for node in constants if node.value == "liggghts"]


def test_the_harness_and_the_cases_know_no_code_by_its_name():
    """Detects a check, figure or option made for one reference code instead of for those at hand."""
    files = [path for path in (ROOT / "comparisons").rglob("*.py") if path.parent.name != "liggghts_findings"]
    found = {path: names_of_liggghts(parsed(path)) for path in files}
    assert not {path: lines for path, lines in found.items() if lines}


def test_the_rule_sees_the_name():
    text = "def f():\n    'results[label, liggghts]'\n    return {'liggghts': 1}, 'LIGGGHTS'"
    assert names_of_liggghts(ast.parse(text)) == [3]
