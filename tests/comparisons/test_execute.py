import dataclasses
import importlib.metadata
import io
import json
import sys
import types

import pytest

from comparisons.harness import codes, discover, execute, progress, results
from comparisons.harness.case import Case, Check, Variant
from comparisons.harness.discover import cases_to_run, find_cases, known_cases, select
from comparisons.harness.evaluate import holds
from gpudem.errors import GpudemError
from reference.errors import CodeTimeout
from tests.comparisons import fake


def run(directory, *cases, **options):
    return execute.Session(
        [dataclasses.replace(c, figures=(), tables=()) for c in cases], directory, **options
    ).run()


def status(comparison, name):
    return next(c for c in comparison.checks if c.name == name)


def test_a_good_comparison_holds(tmp_path, fake_codes):
    comparison = run(tmp_path, fake.case())
    assert comparison.counts() == {"pass": 4, "fail": 0, "error": 0, "left_out": 0}
    assert comparison.exit_code() == 0
    assert {p.name for p in tmp_path.iterdir()} == {"results.json", "report.html", "junit.xml", "throw"}
    assert (tmp_path / "throw" / "dt_1e-05" / "liggghts" / "run.pvd").is_file()


def test_every_status_and_what_it_says(finished):
    _, comparison = finished
    assert comparison.counts() == {"pass": 7, "fail": 2, "error": 1, "left_out": 1}
    assert comparison.exit_code() == 1
    assert "ValueError: <script>" in status(comparison, "a check that raises").why
    assert status(comparison, "a check that is not a number").status == "fail"
    assert "yade, which was not selected" in status(comparison, "a check of a code that was not selected").why
    assert comparison.broken() == [
        line
        for line in comparison.broken()
        if line.startswith("figure 'A figure that cannot be drawn' of troubled")
    ]
    assert len(comparison.broken()) == 1


def test_a_code_that_cannot_run_is_an_error_and_the_other_cases_go_on(tmp_path, fake_codes):
    fake_codes(liggghts={"fails": "no binary: install it"})
    comparison = run(tmp_path, fake.case("first"), fake.case("second"))
    assert comparison.exit_code() == 3
    assert comparison.counts() == {"pass": 6, "fail": 0, "error": 2, "left_out": 0}
    lost = status(comparison, "position, largest difference of the codes")
    assert lost.why == "LIGGGHTS failed on dt_1e-05: no binary: install it"
    assert (tmp_path / "first" / "dt_1e-05" / "liggghts" / "error.txt").read_text()


def test_a_variant_may_end_early(tmp_path, fake_codes):
    """What the code said is a result; one that does not come to an end is an error all the same."""
    fake_codes(liggghts={"fails": "it blew up"})
    case = fake.case()
    said = Check(
        "said", lambda r: float(r.ended[r.labels()[0], "liggghts"] == "it blew up"), 1.0, "1", "nobody", "R",
        "", "", needs=("gpudem", "liggghts"), lo=1.0,
    )  # fmt: skip
    variants = case.variants
    case = dataclasses.replace(
        case, checks=(said,), variants=lambda t: [dataclasses.replace(v, may_end=True) for v in variants(t)]
    )
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
    comparison = run(tmp_path / "one", case)
    assert comparison.exit_code() == 0
    assert {(r.code, r.status) for r in comparison.runs} == {("gpudem", "ok"), ("liggghts", "ended")}
    fake_codes(liggghts={"fails": "it takes too long", "error_kind": CodeTimeout})
    assert run(tmp_path / "two", case).exit_code() == 3


def test_a_failed_run_never_makes_a_shorter_result(tmp_path, fake_codes):
    """A measure over all runs must not pass on those that are left."""
    fake_codes(liggghts={"fails": "gone"})
    both = ("gpudem", "liggghts")
    all_runs = Check(
        "over all", lambda r: len(list(r.of("liggghts"))), 9, "1", "x", "X", "r", "c", needs=both
    )
    labels = Check("labels", lambda r: len(r.labels("liggghts")), 9, "1", "x", "X", "r", "c", needs=both)
    comparison = run(tmp_path, dataclasses.replace(fake.case(), checks=(all_runs, labels)))
    assert [c.status for c in comparison.checks] == ["error", "error"]


def test_a_code_that_is_not_selected_leaves_its_checks_out(tmp_path, fake_codes):
    comparison = run(tmp_path, fake.case(), selected=("gpudem",))
    assert status(comparison, "position, largest difference of the codes").status == "left_out"
    assert comparison.exit_code() == 0
    assert {r.code for r in comparison.runs} == {"gpudem"}


def test_a_check_of_a_code_that_no_variant_runs_is_an_error(tmp_path, fake_codes):
    case = dataclasses.replace(
        fake.case(), variants=lambda tier: [Variant("dt_1e-05", fake.scene(), ("gpudem",))]
    )
    comparison = run(tmp_path, case)
    lost = status(comparison, "position, largest difference of the codes")
    assert lost.status == "error"
    assert lost.why == "no variant of the quick tier runs through LIGGGHTS"


def test_a_case_whose_scenes_are_wrong_is_an_error(tmp_path, fake_codes):
    case = dataclasses.replace(fake.case(), variants=lambda tier: [Variant("v", fake.scene(dt=1.0))])
    comparison = run(tmp_path, case, fake.case("good"))
    assert comparison.cases[0].status == "error"
    assert "time.step" in comparison.cases[0].why
    assert comparison.counts() == {"pass": 4, "fail": 0, "error": 4, "left_out": 0}
    assert comparison.exit_code() == 1


def test_variants_that_depend_on_results_and_the_sentence(tmp_path, fake_codes):
    """Detects: follow-up variants that do not run or do not reach the checks; a sentence that gets lost."""
    case = fake.case()

    def more(results):
        assert results["dt_1e-05", "gpudem"].trace is not None
        return [Variant("later", fake.scene(), ("gpudem",))]

    def say(results, checks):
        codes = ", ".join(results.codes("later"))
        return f"{len(checks)} checks, later: {codes} <b>"

    later = Check("later", lambda r: 0.0 * r["later", "gpudem"].scene.n_steps, 1.0, "1", "x", "X", "r", "c")
    case = dataclasses.replace(case, checks=(*case.checks, later), follow_up=more, headline=say)
    comparison = run(tmp_path, case)
    assert comparison.counts()["pass"] == 5
    assert comparison.cases[0].headline == "5 checks, later: gpudem <b>"
    assert results.load(tmp_path).cases[0].headline == comparison.cases[0].headline
    page = (tmp_path / "report.html").read_text()
    assert page.count("5 checks, later: gpudem &lt;b&gt;") == 2
    broken = dataclasses.replace(case, headline=lambda results, checks: str(1 / 0))
    (tmp_path / "b").mkdir()
    assert "ZeroDivisionError" in run(tmp_path / "b", broken).cases[0].headline


def test_the_sentence_learns_what_did_not_run(tmp_path, fake_codes):
    """Detects: a headline that takes a failed code for one that agrees."""
    fake_codes(liggghts={"fails": "no binary"})
    case = dataclasses.replace(fake.case(), headline=lambda r, checks: str(sorted(set(r.failed.values()))))
    assert run(tmp_path, case).cases[0].headline == "['no binary']"


def test_interrupt_keeps_what_is_done(tmp_path, fake_codes):
    def stop(results):
        raise KeyboardInterrupt

    stopping = dataclasses.replace(
        fake.case("second"), checks=(dataclasses.replace(fake.case().checks[0], measure=stop),)
    )
    comparison = run(tmp_path, fake.case("first"), stopping, fake.case("third"))
    assert comparison.state == "interrupted"
    assert comparison.exit_code() == 130
    assert [c.status for c in comparison.cases] == ["done", "interrupted", "interrupted"]
    stored = results.load(tmp_path)
    assert stored.counts() == {"pass": 4, "fail": 0, "error": 0, "left_out": 5}
    assert "Interrupted" in (tmp_path / "report.html").read_text()


def test_the_report_is_there_from_the_start_and_after_every_case(tmp_path, fake_codes):
    seen = []

    def look(results):
        stored = json.loads((tmp_path / "results.json").read_text())
        seen.append(
            (stored["state"], len(stored["checks"]), (tmp_path / "report.html").stat().st_size > 1000)
        )
        return 0.0

    check = dataclasses.replace(fake.case().checks[0], measure=look)
    cases = [dataclasses.replace(fake.case(name), checks=(check,)) for name in ("first", "second")]
    run(tmp_path, *cases)
    assert seen == [("running", 0, True), ("running", 1, True)]


@pytest.mark.parametrize(
    ("value", "lo", "good"),
    [
        (1.0, None, True),
        (1.1, None, False),
        (-5.0, None, True),
        (float("nan"), None, False),
        (0.4, 0.5, False),
        (0.5, 0.5, True),
    ],
)
def test_what_holds(value, lo, good):
    assert holds(dataclasses.replace(fake.case().checks[0], tolerance=1.0, lo=lo), value) is good


def test_runs_never_overwrite_one_another(tmp_path):
    made = [execute.new_directory(tmp_path, "abc1234") for _ in range(3)]
    assert len(set(made)) == 3
    assert (tmp_path / "latest").resolve() == made[-1].resolve()
    (made[0] / "x").touch()
    with pytest.raises(GpudemError, match="not empty; runs never overwrite"):
        execute.own_directory(made[0])


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(GpudemError, match="file"):
        execute.new_directory(tmp_path / "file", "abc")
    with pytest.raises(GpudemError, match="cannot write there"):
        execute.own_directory(tmp_path / "file" / "below")


def test_cases_are_found_in_order_and_a_broken_one_says_so(tmp_path, monkeypatch):
    package = tmp_path / "fake_cases"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "good.py").write_text(
        "from tests.comparisons import fake\nCASE = fake.case('good', order=3)\n"
    )
    (package / "broken.py").write_text("import no_such_module\n")
    (package / "family").mkdir()
    (package / "family" / "__init__.py").touch()
    (package / "family" / "scenes.py").write_text("from tests.comparisons import fake\n")
    (package / "family" / "deep.py").write_text(
        "from tests.comparisons import fake\nCASE = fake.case('deep', order=2)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    import fake_cases

    found = find_cases(fake_cases)
    assert [case.name for case in found] == ["broken", "deep", "good"]
    comparison = run(tmp_path, found[0])
    assert "fake_cases.broken does not load: ModuleNotFoundError" in comparison.cases[0].why
    assert comparison.exit_code() == 1


@pytest.fixture
def their_cases(tmp_path, monkeypatch):
    """A package `their_cases` that can be imported from the current folder; write(module, text) fills it."""
    package = tmp_path / "their_cases"
    package.mkdir()
    (package / "__init__.py").touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    for name in [name for name in sys.modules if name.split(".")[0] == "their_cases"]:
        monkeypatch.delitem(sys.modules, name)
    yield lambda module, text: (package / f"{module}.py").write_text(text)
    for name in [name for name in sys.modules if name.split(".")[0] == "their_cases"]:
        del sys.modules[name]


def test_cases_and_codes_of_a_package_named(their_cases, fake_codes, monkeypatch):
    """Catches: a package in the current folder not found, its code unknown, other cases run too."""
    monkeypatch.setattr(discover, "find_cases", find_cases)
    their_cases("one", "from tests.comparisons import fake\nCASE = fake.case('one')\n")
    their_cases("two", "from tests.comparisons import fake\nCODE = fake.code('gpudem', fails='x')\n"
                       "import dataclasses\nCODE = dataclasses.replace(CODE, name='mine')\n")  # fmt: skip
    assert [case.name for case in cases_to_run((), "quick", ["their_cases"])] == ["one"]
    assert codes.CODES["mine"].name == "mine"
    assert [c.name for c in cases_to_run(("head_on", "one"), "quick", ["their_cases"])] == ["head_on", "one"]
    assert [case.name for case in cases_to_run((), "quick", ["their_cases.one"])] == ["one"]
    with pytest.raises(GpudemError, match=r"no case in comparisons\.metrics"):
        cases_to_run((), "quick", ["comparisons.metrics"])
    their_cases("three", "from tests.comparisons import fake\nCASE = fake.case('head_on')\n")
    with pytest.raises(GpudemError, match="two cases are called 'head_on'"):
        known_cases(["their_cases"])


class _Entry:
    """An entry point of another package."""

    name, value = "theirs", "their_cases"

    def __init__(self, added):
        self.added = added

    def load(self):
        if isinstance(self.added, Exception):
            raise self.added
        return self.added


@pytest.mark.parametrize(
    ("added", "found"),
    [
        (fake.case("entered"), "entered"),
        (types.SimpleNamespace(), "neither a package, a module nor a Case"),
        (RuntimeError("no licence"), r"entry point 'theirs' of gpudem.cases \(their_cases\): RuntimeError"),
    ],
    ids=["case", "something", "broken"],
)
def test_cases_by_entry_points(monkeypatch, added, found):
    monkeypatch.setattr(
        importlib.metadata, "entry_points", lambda group: [_Entry(added)] if group == "gpudem.cases" else []
    )
    if isinstance(added, Case):
        assert found in [case.name for case in known_cases()]
    else:
        with pytest.raises(GpudemError, match=found):
            known_cases()


@pytest.mark.parametrize(
    "name", ["", "..", ".hidden", "a/b", "a b", "/etc", "-x", "a\\b", "a\nb", "\u00e9", "a\x00"]
)
def test_names_that_are_no_folders_are_refused(name):
    """A name becomes a folder and a link: one with a path in it would write elsewhere."""
    with pytest.raises(GpudemError, match="names a folder; allowed are letters"):
        fake.case(name)
    with pytest.raises(GpudemError, match="names a folder; allowed are letters"):
        Variant(name, fake.scene())


def test_selecting_cases():
    cases = [fake.case("one"), dataclasses.replace(fake.case("two"), tiers=("full",))]
    assert [c.name for c in select(cases, (), "quick")] == ["one"]
    assert [c.name for c in select(cases, ("two",), "full")] == ["two"]
    with pytest.raises(GpudemError, match="did you mean 'one'"):
        select(cases, ("onne",), "quick")
    with pytest.raises(GpudemError, match="'two' has no quick tier"):
        select(cases, ("two",), "quick")


def test_pace_counts_from_the_first_step():
    now = [100.0]
    pace = progress.Pace("x", particles=10, steps=1000, clock=lambda: now[0])
    now[0] = 150.0  # compiling
    pace.update(0)
    assert pace.rate is None
    now[0] = 160.0
    pace.update(500)
    assert pace.rate == pytest.approx(500.0)
    assert pace.left == pytest.approx(10.0)
    assert str(pace) == "x   50 %  500 particle-steps/s  10 s left"


def test_plain_progress_is_one_line_now_and_then():
    stream = io.StringIO()
    reporter = progress.Plain(stream, every=0.0)
    pace = reporter.begin("case variant code", 10, 100)
    reporter.step(pace, 0)
    reporter.step(pace, 50)
    lines = stream.getvalue().splitlines()
    assert len(lines) == 2
    assert "case variant code   50 %" in lines[1]


def test_case_dataclass_is_what_the_harness_expects():
    assert {f.name for f in dataclasses.fields(Case)} >= {
        "variants",
        "checks",
        "figures",
        "tables",
        "features",
        "order",
        "tiers",
    }
