"""Checks that are built for the codes at hand: what each reads, whom it names, when it must not hold."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from comparisons.harness import check_builders as build
from comparisons.harness import codes, configurations
from comparisons.harness.case import Case, Check, Measured, Results, largest, median, relative
from gpudem.output.run import Run, Timing
from tests.comparisons import fake

STEPS = (4e-5, 2e-5, 1e-5)


def run(code: str, step: float, error: float = 0.0) -> Run:
    """A run that is off by `error` times the step, in each direction and at any time."""
    scene = fake.scene(step)
    time = np.linspace(0.0, 0.05, 11)
    trace = {"time": time, "position": fake.exact(scene, time) + error * step}
    return Run(code, "0.0", scene, Path(), Timing(3, scene.n_steps, 1.0), trace=trace)


def measured(check: Check, results: Results) -> Measured:
    found = check.measure(results)
    assert isinstance(found, Measured)
    return found


@pytest.fixture(scope="module")
def results() -> Results:
    """gpudem exact; LIGGGHTS off by dt at any time; both at three steps, and a variant that only one ran."""
    runs = {(f"dt_{dt:g}", "gpudem"): run("gpudem", dt) for dt in STEPS}
    runs |= {(f"dt_{dt:g}", "liggghts"): run("liggghts", dt, 1.0) for dt in STEPS}
    return Results("quick", runs | {("alone", "gpudem"): run("gpudem", 8e-5)})


def checks(item, codes: tuple[str, ...]) -> list[Check]:
    """What a case makes of it for these codes."""
    case = Case("name", "title", "purpose", "source", lambda tier: [], (item,))
    return case.checks_of("quick", codes)


def trace_check(**fields) -> Check:
    facts = {"tolerance": 1.0, "reason": "", "catches": ""} | fields
    item = build.step_by_step("position", "position", lambda run: math.sqrt(3), **facts)
    [check] = checks(item, ("gpudem", "liggghts"))
    return check


def test_codes_agree_over_all_variants_that_both_ran(results):
    """A pair that is compared in one variant only, or by the wrong scale."""
    check = trace_check()
    found = measured(check, results)
    assert found.value == pytest.approx(max(STEPS))
    assert "3 variants" in found.note
    assert f"dt_{max(STEPS):g}" in found.note
    assert (check.needs, check.against, check.mark) == (("gpudem", "liggghts"), "LIGGGHTS", "X")


def test_one_variant_is_chosen_by_its_prefix(results):
    """A check of one ladder that reads another."""
    found = measured(trace_check(prefix="dt_1e-05"), results)
    assert found.value == pytest.approx(1e-5)


def test_a_run_that_shows_nothing_fails(results):
    """A check that holds although nothing happened."""
    found = measured(trace_check(defect=lambda run: "no contact"), results)
    assert math.isnan(found.value)
    assert "no contact" in found.note


def test_no_common_variant_is_an_error(results):
    """A check that holds on no runs at all."""
    with pytest.raises(ValueError, match="nothing"):
        measured(trace_check(prefix="alone"), results)


def test_order_in_the_step(results):
    """An order computed from the runs of another code, or with steps and errors in different order."""

    def error(results: Results, label: str, code: str) -> float:
        trace = results[label, code].trace
        return float(np.abs(trace["position"] - fake.exact(fake.scene(), trace["time"])).max())

    item = build.observed_order(
        "order", error, (0.9, 1.1), prefix="dt_", against="exact", reason="", catches=""
    )
    [check] = checks(item, ("liggghts",))
    found = measured(check, results)
    assert found.value == pytest.approx(1.0, abs=1e-6)
    assert (check.name, check.needs, check.lo) == ("order (liggghts)", ("liggghts",), 0.9)


def test_one_check_for_each_code():
    """Two codes judged by the runs of one."""
    item = build.per_code(
        "x", lambda results, code: len(code), tolerance=1, against="", reason="", catches=""
    )
    made = checks(item, ("gpudem", "liggghts", "event_driven"))
    nothing = Results("quick", {})
    assert [(c.name, c.measure(nothing)) for c in made] == [("x (gpudem)", 6), ("x (liggghts)", 8)]


def test_finest_variant(results):
    assert results.finest("dt_") == "dt_1e-05"
    assert results.labels("liggghts") == [f"dt_{dt:g}" for dt in STEPS]
    assert "alone" in results.labels("gpudem")


def test_relative_errors():
    """A largest error that overlooks one that is not a number."""
    found = largest({"a": relative(1.1, 1.0), "b": relative(2.0, 1.0), "c": relative(1.0, 1.0)})
    assert (found.value, found.measured, found.expected, found.note) == (1.0, 2.0, 1.0, "largest in b")
    worst = largest({"a": relative(2.0, 1.0), "b": relative(math.nan, 1.0)})
    assert math.isnan(worst.value)
    assert worst.note == "largest in b"


def test_median_with_its_range():
    """A mean in place of the median; a range that leaves out the first or the last."""
    found = median([3.0, 1.0, 10.0], "seeds")
    assert (found.value, found.note) == (3.0, "3 seeds, 1.00 to 10.00")


def test_several_errors_count_by_the_largest():
    """A check that sees the first of several errors only."""

    def errors(results: Results, code: str) -> dict[str, Measured]:
        return {"small": relative(1.1, 1.0), code: relative(1.5, 1.0)}

    [check] = checks(build.per_code("x", errors, tolerance=1, against="", reason="", catches=""), ("gpudem",))
    found = measured(check, Results("quick", {}))
    assert (found.value, found.note) == (0.5, "largest in gpudem")


def test_a_tolerance_for_each_tier():
    """A tier held to the tolerance of another, or a tier without one that is checked nevertheless."""
    made = build.checks(
        "x",
        lambda results: {"a": 1.0, "b": 3.0},
        {"quick": 0.1, "full": 0.01},
        against="",
        reason="",
        catches="",
    )
    assert [(c.tolerance, c.tiers) for c in made] == [(0.1, ("quick",)), (0.01, ("full",))]
    assert measured(made[0], Results("quick", {})).value == 3.0


def test_one_check_for_each_configuration():
    """A configuration that is judged by another's runs or tolerance, or left out without being named."""
    double, mixed, single = configurations.precisions()
    item = build.per_configuration(
        configurations.Configurations(double, mixed, single), "x", lambda results, one: len(one.title),
        without=(single,), changes={mixed.title: {"tolerance": 2.0}}, tolerance=1.0, against="", reason="",
        catches="",
    )  # fmt: skip
    made = checks(item, ("gpudem", "liggghts"))
    nothing = Results("quick", {})
    assert [(c.name, c.measure(nothing), c.tolerance, c.needs) for c in made] == [
        ("x (gpudem float64)", 14, 1.0, ("gpudem",)),
        ("x (gpudem mixed)", 12, 2.0, ("gpudem",)),
        ("x (LIGGGHTS)", 8, 1.0, ("liggghts",)),
    ]


@pytest.mark.parametrize("brought", [True, False])
def test_codes_of_a_user_are_compared_unless_the_check_says_otherwise(brought: bool, monkeypatch):
    """A limit of gpudem's scheme that is asked of a code with another; a user's code that nothing judges."""
    monkeypatch.setitem(
        codes.CODES, "mine", dataclasses.replace(codes.CODES["gpudem"], name="mine", title="mine")
    )
    fields = {"tolerance": 1, "reason": "", "catches": ""}
    asked = configurations.Configurations(*configurations.precisions()[:1], brought=brought)
    one = build.per_configuration(asked, "x", lambda results, one: 0, against="", **fields)
    pair = build.per_pair("{other}", lambda results, a, b: 0, brought=brought, **fields)
    names = [check.name for item in (one, pair) for check in checks(item, ("gpudem", "liggghts", "mine"))]
    ours = ["x (gpudem float64)", "x (LIGGGHTS)", "LIGGGHTS"]
    assert set(ours) <= set(names)
    assert (len(names) > len(ours)) == brought


def test_table_of_what_was_found(results):
    """A number under the name of another code, or without what was expected."""

    def speeds(results: Results, code: str) -> dict[str, Measured]:
        return {"slow": relative(len(code), 10.0), "fast": relative(2 * len(code), 20.0)}

    frame = build.table("title", "caption", {"speed [m/s]": speeds}).make(results)
    assert list(frame.columns) == [
        "impact",
        "closed form: speed [m/s]",
        "gpudem: speed [m/s]",
        "LIGGGHTS: speed [m/s]",
    ]
    assert frame.to_numpy().tolist() == [["slow", 10.0, 6, 8], ["fast", 20.0, 12, 16]]


def test_a_pair_counts_by_its_relative_error():
    """A number held against the tolerance itself, instead of by what it should be."""
    assert build.error((1.5, 1.0)) == relative(1.5, 1.0)
    found = build.error({"near": (1.1, 1.0), "off": 0.7, "far": (4.0, 2.0)})
    assert isinstance(found, Measured)
    assert (found.value, found.measured, found.expected, found.note) == (1.0, 4.0, 2.0, "largest in far")


def test_engines_and_what_is_read_beside():
    """A check of an engine that is left out, or made twice; one that does not say which runs it reads."""
    facts = {"tolerance": 1, "against": "", "reason": "", "catches": ""}
    item = build.per_code(
        "x", lambda results, code: len(code), also=("event_driven",), beside=("c",), **facts
    )
    names = {"x (gpudem)": ("gpudem", "c"), "x (event_driven)": ("event_driven", "c")}
    assert {check.name: check.needs for check in checks(item, ("gpudem",))} == names
    assert [c.name for c in checks(item, ("gpudem", "event_driven"))] == list(names)


def test_one_check_for_each_quantity():
    """A check of one quantity that reads another's, or keeps the reason of another."""

    def observe(results: Results, code: str) -> dict[str, dict[str, build.Compared]]:
        return {"spin [rad/s]": {"a": (1.5, 1.0)}, "speed [m/s]": {"a": (1.0, 1.0)}}

    facts = {"tolerance": 1, "against": "", "reason": ""}
    items = build.per_quantity(observe, {"speed [m/s]": "slow", "spin [rad/s]": "dizzy"}, "{} off", **facts)
    made = [check for item in items for check in checks(item, ("gpudem",))]
    assert [(c.name, c.catches) for c in made] == [
        ("speed off (gpudem)", "slow"), ("spin off (gpudem)", "dizzy")
    ]  # fmt: skip
    assert [measured(c, Results("quick", {})).value for c in made] == [0.0, 0.5]


def test_table_of_what_is_observed(results):
    """A column under the name of another quantity; a pair turned round."""

    def observe(results: Results, code: str) -> dict[str, dict[str, build.Compared]]:
        return {"spin": {"a": (len(code), 1.0)}, "speed": {"a": Measured(0.0, 3.0, 4.0)}}

    [row] = build.table("title", "caption", observe, rows="ball").make(results).to_dict("records")
    assert row == {
        "ball": "a", "closed form: spin": 1.0, "gpudem: spin": 6, "LIGGGHTS: spin": 8,
        "closed form: speed": 4.0, "gpudem: speed": 3.0, "LIGGGHTS: speed": 3.0,
    }  # fmt: skip
