"""Mutation testing: the table fits the sources, and the tools behind `make mutants` work."""

import ast
import builtins
import functools
import io
import json
import keyword
import subprocess
import textwrap
import tokenize
from pathlib import Path

import pytest
from click.testing import CliRunner

from comparisons.cases.performance import mutants as case
from comparisons.mutation import __main__ as command
from comparisons.mutation import trial
from comparisons.mutation.markers import Marked, Sources
from comparisons.mutation.operations import ALLOWED_NAMES, PLACEHOLDER, Operation
from comparisons.mutation.recorded import Record, Row, load_record
from comparisons.mutation.table import TABLE, Mutation, TestSet, load
from comparisons.mutation.trial import SourceCopy, Verdict
from gpudem.errors import GpudemError

ROOT = Path(__file__).parents[2]
TEST_SET, MUTATIONS = load()
SOURCES = Sources.read(ROOT)


# -- the table -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda m: m.name)
def test_applies_to_the_sources(mutation):
    """Detects a marker that a change of the sources lost or doubled, and a statement of another form."""
    marked, mutated = _applied(mutation.name)
    assert mutated != marked.text
    ast.parse(mutated)


def test_no_two_mutations_are_the_same():
    """Detects two operations of different names with one result: the second would show nothing new."""
    texts = [_applied(mutation.name)[1] for mutation in MUTATIONS]
    assert len(set(texts)) == len(texts)


def test_every_test_of_the_set_exists():
    """Detects: a test taken out or renamed, which ends a run of mutants once one has to try all tests."""
    for name, node in TEST_SET.nodes.items():
        file, _, function = node.partition("::")
        assert (ROOT / file).exists(), name
        tree = ast.parse((ROOT / file).read_text())
        found = {item.name for item in ast.walk(tree) if isinstance(item, ast.FunctionDef)}
        assert not function or function.partition("[")[0] in found, name


def test_every_marker_is_used():
    """Detects a marker that was left behind when its mutation was removed."""
    used = {m.marker for m in MUTATIONS}
    texts = [str(m.operation.options.get("new", "")) for m in MUTATIONS]
    used |= {match[1] for text in texts for match in PLACEHOLDER.finditer(text)}
    assert sorted(SOURCES.names - used) == []


def test_a_rename_leaves_all_mutations_as_they_are():
    """Renames every identifier of the sources; each mutation then gives the renamed form of its old result.

    Detects an operation that contains a name of the sources.
    """
    renamed = Sources({path: _renamed(text) for path, text in SOURCES.texts.items() if "mutate:" in text})
    for mutation in MUTATIONS:
        lines = _changed_lines(*mutation.applied(renamed))
        if ", name}" in mutation.operation.options.get("new", ""):  # a name as a string, which is not renamed
            continue
        assert lines == _renamed(_changed_lines(*_applied(mutation.name))), mutation.name


def test_new_text_contains_no_names_of_the_sources():
    """The same for `replace`, by what it says: all names come from placeholders, or are Python's own."""
    for mutation in MUTATIONS:
        if "new" in mutation.operation.options:
            new = PLACEHOLDER.sub("(0)", mutation.operation.options["new"])
            tree = ast.parse("0" if new == ":" else new)
            names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
            assert names <= ALLOWED_NAMES, mutation.name


@functools.cache
def _applied(name: str) -> tuple[Marked, str]:
    """A mutation of the table, applied to the sources."""
    return next(m for m in MUTATIONS if m.name == name).applied(SOURCES)


def _changed_lines(marked: Marked, mutated: str) -> str:
    """The lines of the mutated file that the original does not have, without their common indentation."""
    old, new = marked.text.splitlines(keepends=True), mutated.splitlines(keepends=True)
    while old and new and old[0] == new[0]:
        del old[0], new[0]
    while old and new and old[-1] == new[-1]:
        del old[-1], new[-1]
    return textwrap.dedent("".join(new))


def _renamed(text: str) -> str:
    """The source with another name for every identifier that is not Python's."""
    own = {*keyword.kwlist, *dir(builtins)}
    lines = [list(line) for line in text.splitlines(keepends=True)]
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.NAME and token.string not in own:
            row, end = token.end
            lines[row - 1][end - 1] += "_renamed"
    return "".join("".join(line) for line in lines)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            '["emulator two_sizes"]',
            '["emulator two_size"]',
            "'kick of a whole step': not in the test set: .*two_size",
        ),
        (
            'operation = "negate"',
            'operation = "invert"',
            "'pair normal turned round': unknown operation 'invert'",
        ),
        ("factor = 0.5", "by = 0.5", r"missing \['factor'\], unknown \['by'\]"),
        ('defect = "a wall pulls"', "", "'wall normal turned round': missing: defect"),
        ('name = "wall normal turned round"', 'name = "pair normal turned round"', "there are two mutations"),
    ],
)
def test_faults_of_the_table_are_errors(tmp_path, old, new, message):
    path = tmp_path / "mutations.toml"
    text = TABLE.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(GpudemError, match=message):
        load(path)


# -- markers -------------------------------------------------------------------------------------------------

EXAMPLE = """
def f(x, y):
    \"\"\"Text with µ in it.\"\"\"
    # mutate: own_line
    a = (x  # m
         - y)
    b = x * y + 1  # of the sphere [m]  # mutate: trailing
    if a < b:  # mutate: head
        # mutate: first_of_block
        a = 2.0
    elif a > 2:  # mutate: elif_head
        a += 3
    call(
        a,  # mutate: inside
        b,
    )
    return a, b  # mutate: result
"""


@pytest.mark.parametrize(
    ("marker", "statement"),
    [
        ("own_line", "a = x - y"), ("trailing", "b = x * y + 1"), ("first_of_block", "a = 2.0"),
        ("inside", "call(a, b)"), ("result", "return (a, b)"),
    ],
)  # fmt: skip
def test_statement_of_a_marker(marker, statement):
    """Detects a marker that is taken for the statement before, around or after its own."""
    assert ast.unparse(Sources({"e.py": EXAMPLE}).find(marker).statement) == statement


@pytest.mark.parametrize(("marker", "condition"), [("head", "a < b"), ("elif_head", "a > 2")])
def test_marker_at_the_head_of_a_block(marker, condition):
    statement = Sources({"e.py": EXAMPLE}).find(marker).statement
    assert isinstance(statement, ast.If)
    assert ast.unparse(statement.test) == condition


@pytest.mark.parametrize(
    ("sources", "message"),
    [
        ({"a.py": "x = 1\n"}, "mutation 'm': no source has the marker '# mutate: k'"),
        (
            {"a.py": "x = 1  # mutate: k\n", "b.py": "\ny = 2  # mutate: k\n"},
            r"'m': .* not unique: a.py:1, b.py:2",
        ),
        ({"a.py": "x = 1  # mutate: k\ny = 1  # mutate: k\n"}, "'m': .* not unique: a.py:1, a.py:2"),
        ({"a.py": "x = 'a'  # mutate: k\n"}, "mutation 'm': the number 1 occurs 0 times"),
        ({"a.py": "x = (1, 1)  # mutate: k\n"}, "mutation 'm': the number 1 occurs 2 times"),
    ],
)
def test_marker_that_cannot_be_used(sources, message):
    mutation = Mutation("m", "k", Operation("constant", "", {"from": 1, "to": 2}), "", ())
    with pytest.raises(GpudemError, match=message):
        mutation.applied(Sources(sources))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1  # mutate: Pair-Normal\n", "e.py:1: 'Pair-Normal' is no name"),
        ("x = 1  # mutate:\n", "e.py:1: '' is no name"),
        ("x = 1\n# mutate: last\n", "e.py:2: the marker 'last' belongs to no statement"),
    ],
)
def test_faulty_marker_is_an_error(text, message):
    with pytest.raises(GpudemError, match=message):
        Sources({"e.py": text})


# -- operations ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "operation", "at", "options", "result"),
    [
        ("f(x)", "drop", "", {}, "pass"),
        ("if a:\n    b = 1", "drop", "", {}, "pass"),
        ("a = b", "swap_with_next", "", {}, "z = 0  # mutate: k\na = b"),
        ("a = b - c", "negate", "", {}, "a = -(b - c)"),
        ("f(a, b)", "negate", "argument 2", {}, "f(a, -b)"),
        ("return a, b", "zero", "element 2", {}, "return (a, b - b)"),
        ("a = b", "scale", "", {"factor": 0.5}, "a = type(b)(0.5) * b"),
        ("a = 2 * f(2.0)", "constant", "", {"from": 2, "to": 3, "occurrence": 2}, "a = 2 * f(3)"),
        ("a = -1.5", "constant", "", {"from": 1.5, "to": 0.0}, "a = -0.0"),
        ("a = 7", "constant", "", {"from": 7, "to": 8}, "a = 8"),
        ("a = b - c", "operator", "", {"from": "-", "to": "+"}, "a = b + c"),
        ("a = b - (c - d)", "operator", "", {"from": "-", "to": "+", "occurrence": 2}, "a = b - (c + d)"),
        ("a -= b - c", "operator", "", {"from": "-=", "to": "+="}, "a += b - c"),
        ("a -= b - c", "operator", "", {"from": "-", "to": "+"}, "a -= b + c"),
        ("while a <= b:\n    c", "operator", "", {"from": "<=", "to": "<"}, "while a < b:\n    c"),
        ("if a is b:\n    c", "operator", "", {"from": "is", "to": "is not"}, "if a is not b:\n    c"),
        ("return a and b", "operator", "", {"from": "and", "to": "or"}, "return a or b"),
        ("if f(a):\n    b  # c", "condition", "", {"value": False}, "if False:\n    b"),
        ("a = b - c * d", "keep_left", "", {}, "a = b"),
        ("a = b - c * d", "keep_right", "", {}, "a = c * d"),
        ("a = b * c * d / e", "keep_left", "operator * 1", {}, "a = b * d / e"),
        ("a = b or c", "keep_right", "", {}, "a = c"),
        ("a = f(b, k=c)", "keep_argument", "", {"argument": 2}, "a = c"),
        ("f(b, k=c)", "drop_argument", "", {"argument": 2}, "f(b)"),
        ("f(b, c)", "drop_argument", "", {"argument": 1}, "f(c)"),
        ("a = f(b, c)", "swap_arguments", "", {}, "a = f(c, b)"),
        ("a.u[i] = b.u[j]", "own_index", "", {}, "a.u[i] = b.u[i]"),
        ("a[i] = b", "replace", "target, index", {"new": ":"}, "a[:] = b"),
        ("a = b * c", "replace", "", {"new": "{right} - {left}"}, "a = c - b"),
        ("a = b + c", "replace", "", {"new": "{} * {left}"}, "a = (b + c) * b"),
        ("a = f(b)[c]", "replace", "object, function", {"new": "{k: index}"}, "a = c(b)[c]"),
        ("a = b", "replace", "", {"new": "({k: target, name}, {other: left})"}, "a = ('a', u)"),
        ("for a in f(b):\n    c", "replace", "call 1, argument 1", {"new": "0"}, "for a in f(0):\n    c"),
        ("a = not b", "replace", "operand", {"new": "True"}, "a = not True"),
    ],
)  # fmt: skip
def test_operation(source, operation, at, options, result):
    first, *block = source.split("\n")
    text = "\n".join([f"{first}  # mutate: k", *block, "z = 0", "v = u + w  # mutate: other", ""])
    if operation != "swap_with_next":
        text = text.replace("z = 0\n", "")
    sources = Sources({"e.py": text})
    _, mutated = Mutation("m", "k", Operation(operation, at, options), "", ()).applied(sources)
    expected = "\n".join([result, "v = u + w  # mutate: other", ""])
    assert ast.dump(ast.parse(mutated)) == ast.dump(ast.parse(expected))
    assert [line for line in mutated.split("\n") if "other" in line] == ["v = u + w  # mutate: other"]


def test_text_around_the_statement_stays():
    """Detects places counted in characters where the parser counts bytes: `µ` takes two."""
    sources = Sources({"e.py": "u = 'µm'; x = a - b  # µ\n# mutate: k\ny = 'µ' + c  # µ\nz = 'µ'\n"})
    _, mutated = Mutation("m", "k", Operation("negate"), "", ()).applied(sources)
    assert mutated == "u = 'µm'; x = a - b  # µ\n# mutate: k\ny = -('µ' + c)  # µ\nz = 'µ'\n"


@pytest.mark.parametrize(
    ("source", "operation", "at", "options", "message"),
    [
        ("pass", "negate", "", {}, "'Pass' has no value"),
        ("pass", "drop", "", {}, "it changes nothing"),
        ("if a:\n    b\nelif c:  # mutate: e\n    d", "drop", "", {}, "'elif' cannot be dropped"),
        ("a = b", "swap_with_next", "", {}, "no statement follows"),
        ("a = b", "keep_left", "", {}, "'b' has no operands"),
        ("a = b", "condition", "", {"value": True}, "has no condition"),
        ("a = f(b)", "keep_argument", "", {"argument": 2}, r"'f\(b\)' has no argument 2"),
        ("a = f(b)", "swap_arguments", "", {}, "has 1 arguments"),
        ("a = b", "own_index", "", {}, r"not of the form a\[i\] = b\[j\]"),
        ("a = b", "negate", "left", {}, "there is no 'left' in 'b'"),
        ("a = b", "negate", "sideways", {}, "unknown step 'sideways'"),
        ("a = b", "negate", "element", {}, "one number from 1"),
        ("a = b + c", "operator", "", {"from": "-", "to": "+"}, "operator '-' occurs 0 times"),
        ("a = b + c", "operator", "", {"from": "+", "to": "<"}, "'<' cannot take the place of '\\+'"),
        ("a = b + c", "operator", "", {"from": "+", "to": "plus"}, "unknown operator 'plus'"),
        ("a = b + c", "operator", "", {"from": "+=", "to": "-="}, r"no operator '\+='"),
        ("a = b + b", "constant", "", {"from": 1, "to": 2, "occurrence": 1}, "there is no occurrence 1"),
        ("a = b", "replace", "", {"new": "{} +"}, "which is no expression"),
        ("a = b", "replace", "", {"new": "{nowhere: left}"}, "no source has the marker"),
        ("a = b", "replace", "", {"new": "{}"}, "it changes nothing"),
    ],
)  # fmt: skip
def test_operation_that_does_not_apply(source, operation, at, options, message):
    """Detects an operation that silently does nothing, or something else, on a statement of another form."""
    text = (
        source + "\n"
        if "# mutate: e" in source
        else source.replace("\n", "  # mutate: e\n", 1) + "  # mutate: e\n"
    )
    mutation = Mutation("m", "e", Operation(operation, at, options), "", ())
    with pytest.raises(GpudemError, match=f"mutation 'm': .*{message}"):
        mutation.applied(Sources({"e.py": text}))


# -- running the tests ---------------------------------------------------------------------------------------


def test_short_names_of_tests():
    """Detects a test of junit.xml that is not found in the test set: its name would be a path."""
    node = "tests/gpudem/test_against_emulator.py::test_agrees_to_rounding[hooke]"
    assert TEST_SET.short_name(node) == "emulator hooke"
    assert TEST_SET.short_name("tests/gpudem/test_neighbor_list.py::test_x[a]") == "list: test_x[a]"


@pytest.fixture
def small_copy(tmp_path):
    """A copy of a small project: one source, and a test set of three."""
    root = tmp_path / "root"
    for folder in ("gpudem", "tests"):
        (root / folder).mkdir(parents=True)
    (root / "gpudem" / "sound.py").write_text(
        "import time\n\ndef value():\n    return 1  # mutate: value\n\n"
        "def wait():\n    pause = 0  # mutate: pause\n    time.sleep(pause)\n"
    )
    (root / "tests" / "test_a.py").write_text(
        "import sound\n\ndef test_value():\n    assert sound.value() == 1\n\n"
        "def test_wait():\n    sound.wait()\n"
    )
    (root / "tests" / "test_b.py").write_text("import sound\n\ndef test_wait():\n    sound.wait()\n")
    (root / "tests" / "conftest.py").write_text(
        "import sys, pathlib\nsys.path.insert(0, str(pathlib.Path(__file__).parents[1] / 'gpudem'))\n"
    )
    subprocess.run(["git", "init", "-q"], cwd=root, check=True)
    test_set = TestSet({"a": "tests/test_a.py", "b": "tests/test_b.py"})
    return SourceCopy(root, tmp_path / "work", test_set, time_limit=4.0)


def _mutation(marker: str, new: str, *first: str) -> Mutation:
    return Mutation(marker, marker, Operation("replace", "", {"new": new}), "", first)


@pytest.mark.slow
def test_outcomes(small_copy):
    """Detects a mutant without a result within the time limit that counts as caught, or as a survivor."""
    caught = small_copy.test(_mutation("value", "2"), ["b"])  # by the rest of the test set
    assert (caught.outcome, caught.caught_by, caught.tried) == ("caught", ["a: test_value"], ["b", "a"])
    survived = small_copy.test(_mutation("value", "1.0"), ["a"])
    assert (survived.outcome, survived.tried) == ("survived", ["a", "b"])
    unknown = small_copy.test(_mutation("pause", "1e6"), ["b"])
    assert (unknown.outcome, unknown.caught_by, unknown.timed_out) == ("unknown", [], True)


PASSED, FAILED = "tests/test_a.py::test_wait PASSED [ 50%]", "tests/test_a.py::test_value FAILED [ 99%]"


@pytest.mark.parametrize(
    ("output", "outcome", "caught_by"),
    [
        (f"{PASSED}\n{FAILED}\n".encode(), "caught", ["a: test_value"]),
        (f"{PASSED}\ntests/test_a.py::test_value ".encode(), "unknown", []),
        (None, "unknown", []),
    ],
)
def test_at_the_time_limit(small_copy, monkeypatch, output, outcome, caught_by):
    """Detects a run without an end that counts as caught, and failures before it that are lost."""

    def no_end(command, timeout, **options):
        raise subprocess.TimeoutExpired(command, timeout, output=output)

    monkeypatch.setattr(trial.subprocess, "run", no_end)
    verdict = small_copy._run(["a"], small_copy.cache, 1.0)
    assert (verdict.outcome, verdict.caught_by, verdict.timed_out) == (outcome, caught_by, True)


@pytest.mark.slow
def test_a_baseline_that_fails_is_an_error(small_copy):
    """Detects a mutant that counts as caught by a test that fails without it."""
    path = small_copy.folder / "gpudem" / "sound.py"
    path.write_text(path.read_text().replace("return 1", "return 3"))
    with pytest.raises(GpudemError, match="the baseline fails: a: test_value"):
        small_copy.test(_mutation("pause", "0.0"), ["a"])


@pytest.mark.slow
def test_a_mutant_of_the_solver_is_caught(tmp_path):
    """The tools on one mutant of the table; some 20 s."""
    copy, member = SourceCopy(ROOT, tmp_path, TEST_SET), "emulator frictionless_wall"
    copy.verify_baseline([member])
    mutation = next(m for m in MUTATIONS if m.name == "wall normal turned round")
    assert copy.test(mutation, [member]).caught_by == [member]
    path = mutation.applied(SOURCES)[0].path
    assert (copy.folder / path).read_text() == (ROOT / path).read_text()


@pytest.mark.parametrize(
    ("verdicts", "code", "lines"),
    [
        (["caught"], 0, ["1 of 1 caught"]),
        (["caught", "unknown"], 3, ["1 of 2 caught", "unknown: m1"]),
        (["survived", "unknown"], 1, ["0 of 2 caught", "survived: m0", "unknown: m1"]),
    ],
)
def test_summary_and_exit_code(monkeypatch, verdicts, code, lines):
    rows = [{"name": f"m{k}", "outcome": verdict} for k, verdict in enumerate(verdicts)]
    monkeypatch.setattr(command, "load", lambda: (TEST_SET, MUTATIONS[:1]))
    monkeypatch.setattr(command, "_test_all", lambda *_: (rows, 1.0))
    result = CliRunner().invoke(command.main, [])
    assert result.exit_code == code
    assert [line for line in lines if line not in result.output] == []


# -- the record ----------------------------------------------------------------------------------------------


def test_records_before_and_after_outcomes_were_stored(tmp_path, monkeypatch):
    """Detects an old time-out that is read as caught: 'skin ignored' once passed for that."""
    path = tmp_path / "mutants.json"
    old = {"file": "a.py", "old": "x", "new": "y", "wrong": "w"}
    mutants = [
        {"name": "a", **old, "caught_by": ["list: t"]},
        {"name": "b", **old, "caught_by": []},
        {"name": "c", **old, "caught_by": ["no end within 240 s"]},
        {
            "name": "d",
            "marker": "k",
            "operation": "drop",
            "defect": "w",
            "outcome": "unknown",
            "caught_by": [],
        },
    ]
    hardware = {"cpu": "c", "cores": 2}
    provenance = {"date": "d", "commit": "c", "hardware": hardware}
    path.write_text(json.dumps({"provenance": provenance, "seconds": 60, "mutants": mutants}))
    record = load_record(path)
    assert [row.outcome for row in record.rows] == ["caught", "survived", "unknown", "unknown"]
    assert {row.defect for row in record.rows} == {"w"}
    monkeypatch.setattr(case, "load_record", lambda: record)
    assert (case.survivors({}).value, case.unknown({}).value) == (1, 2)
    assert [row["caught by"] for row in case.table({})] == ["list", "", "", ""]


def test_record_of_another_operation_counts_as_missing(monkeypatch):
    """Detects a result that is shown for a mutation that has changed since."""
    first, second, third, *others = MUTATIONS
    rows = [
        {"name": first.name, "marker": first.marker, "operation": str(first.operation)},
        {"name": second.name, "marker": second.marker, "operation": "drop"},
        {"name": third.name, "wrong": "row of the format before markers"},
    ]
    record = Record({}, 0.0, [Row(row["name"], "", "caught", ("t",), row) for row in rows])
    monkeypatch.setattr(case, "load_record", lambda: record)
    missing = case.not_recorded({})
    assert missing.value == len(others) + 1
    assert missing.note.startswith(f"{second.name}, {others[0].name}")


def test_verdict():
    assert [Verdict([], c, 0.0, t).outcome for c, t in ((["x"], True), ([], True), ([], False))] == [
        "caught", "unknown", "survived",
    ]  # fmt: skip


def test_recording_some_mutants_replaces_their_rows_only(tmp_path, monkeypatch):
    """Detects a partial run that deletes the rest of the record or loses rows of the old format."""
    path = tmp_path / "mutants.json"
    first, second = MUTATIONS[0].name, MUTATIONS[1].name
    rows = [
        {"name": n, "file": "a", "old": "x", "new": "y", "wrong": "w", "caught_by": ["t"]}
        for n in (second, first)
    ]
    path.write_text(json.dumps({"provenance": {"date": "d"}, "seconds": 60, "mutants": rows}))
    monkeypatch.setattr(command, "RECORDED", path)
    monkeypatch.setattr(command, "load_record", lambda: load_record(path))
    command._record([{"name": first, "outcome": "caught"}], 1.0, MUTATIONS, merge=True)
    data = json.loads(path.read_text())
    assert data["mutants"] == [{"name": first, "outcome": "caught"}, rows[0]]
    assert (data["provenance"], data["seconds"]) == ({"date": "d"}, 60)


def test_every_mutation_is_recorded_as_caught():
    """Catches a new or changed mutation that was not run, and one that no test detects."""
    measured = {f.__name__: f({}) for f in (case.not_recorded, case.survivors, case.unknown)}
    assert {name: found.note for name, found in measured.items() if found.value != 0} == {}
