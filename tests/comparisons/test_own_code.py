"""examples/own_code: classical mistakes are caught, by which check; right codes are not called wrong.

The runs are those of the cases with a single contact, at their larger time steps.
"""

from __future__ import annotations

import dataclasses
import functools
import sys
from pathlib import Path

import numpy as np
import pytest

from comparisons.harness import attribution, brought, codes
from comparisons.harness.case import Results, Table
from comparisons.harness.discover import find_cases
from comparisons.harness.evaluate import Evaluation
from comparisons.harness.results import CheckResult
from comparisons.metrics import law_on_states
from gpudem.output.run import Run
from gpudem.scene import Domain, Explicit, Material, Output, Pair, Scene, Time
from reference.code import Options
from reference.process import code_of
from tests.reference.scenes import two_spheres

MY_DEM = Path(__file__).parents[2] / "examples" / "own_code" / "my_dem.py"
NAME = "my_dem"
CODES = ("gpudem", NAME)


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """The example as a code under test, for this test only."""
    monkeypatch.setitem(codes.CODES, NAME, code_of(f"{sys.executable} {MY_DEM} {{scene}} {{out}}", NAME))


@functools.cache
def case_of(name: str):
    return next(case for case in find_cases() if case.name == name)


@functools.cache
def variants_of(name: str, prefix: str, rungs: int):
    """The variants of a prefix with the largest steps, or all (0 rungs)."""
    found = [v for v in case_of(name).variants("quick") if v.label.startswith(prefix)]
    return found[-rungs:] if rungs else found


@pytest.fixture(scope="module")
def ours(tmp_path_factory):
    """gpudem's run of a variant, once."""
    kept: dict[str, Run] = {}

    def run(name: str, variant) -> Run:
        key = f"{name}_{variant.label}"
        if key not in kept:
            folder = tmp_path_factory.mktemp(key)
            kept[key] = codes.CODES["gpudem"].run(
                variant.scene, folder, Options(threads=1), lambda step: None, {}
            )
        return kept[key]

    return run


def evaluated(ours, folder: Path, options: str, name: str, prefix: str = "", rungs: int = 2) -> Evaluation:
    """A case with the runs of gpudem and of the example."""
    evaluation = Evaluation(case_of(name), "quick", CODES)
    code = code_of(f"{sys.executable} {MY_DEM} {{scene}} {{out}} {options}", NAME)
    for variant in variants_of(name, prefix, rungs):
        evaluation.runs[variant.label, "gpudem"] = ours(name, variant)
        run = code.run(variant.scene, folder / name / variant.label, Options(), lambda step: None, {})
        evaluation.runs[variant.label, NAME] = run
    return evaluation


def step_by_step(evaluation: Evaluation) -> dict[str, CheckResult]:
    """The checks of agreement step by step for which there are runs, by their column."""
    checks = [c for c in evaluation.case.checks_of("quick", CODES) if c.half_step and NAME in c.needs]
    labels = [label for label, _ in evaluation.runs]
    prefixes = {check.name: check.name.split(":")[0] if ":" in check.name else "" for check in checks}
    ran = [c for c in checks if any(label.startswith(prefixes[c.name]) for label in labels)]
    return {check.name.split(",")[0].split(": ")[-1]: evaluation.check(check) for check in ran}


def verdicts(evaluation: Evaluation) -> list[attribution.Verdict]:
    return attribution.verdicts(evaluation._results(CODES), NAME)


#: Mistake -> (case, prefix of its variants, columns that differ, what differs, part, explained by).
MISTAKES = {
    "absolute_velocity": ("oblique", "default", {"position", "velocity", "angular velocity", "force"},
                          "law", "tangential force", "friction from the absolute velocity"),
    "lever": ("oblique", "default", {"position", "velocity", "angular velocity", "force"},
              "law", "tangential force", "lever R instead of R - overlap/2"),
    "projection": ("oblique", "default", {"position", "velocity", "angular velocity", "force"},
                   "law", "normal force", "spring not projected onto the tangent plane"),
    "damping_mass": ("head_on", "", {"position", "velocity", "force"}, "law", "normal force",
                     "mass of the first particle in the damping instead of the reduced mass"),
    "wall_sphere": ("wall_restitution", "default", {"position", "velocity", "force"}, "law", "normal force",
                    "wall taken as a sphere of equal radius and mass"),
    "euler": ("head_on", "", {"position", "velocity", "force"}, "scheme or timing", "normal force", ""),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake_is_caught_and_named(ours, tmp_path, mistake):
    """Each classical mistake fails these checks, and what differs is said right."""
    name, prefix, columns, what, part, explained = MISTAKES[mistake]
    evaluation = evaluated(ours, tmp_path, f"--mistake {mistake}", name, prefix)
    found = step_by_step(evaluation)
    assert {column for column, result in found.items() if result.status == "fail"} == columns
    assert {result.status for result in found.values()} <= {"fail", "pass"}
    (verdict,) = verdicts(evaluation)
    assert (verdict.what, verdict.part, verdict.explained) == (what, part, explained)
    assert verdict.steps == 2
    assert verdict.order == pytest.approx(1.0 if mistake == "euler" else 0.0, abs=0.15)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ("", "all 3 of its checks hold; the contact law is followed"),
        (
            "--mistake damping_mass",
            "3 of its 3 checks do not hold; the contact law differs (normal force, as with mass of the first"
            " particle in the damping instead of the reduced mass)",
        ),
        (
            "--digits 6",
            "none of its checks could be judged; what differs is not known: output with 6 significant digits",
        ),
    ],
)
def test_the_sentence_for_the_top_of_the_page(ours, tmp_path, options, sentence):
    """Detects a finding on a user's code that stands in a table only, for a case and for a scene."""
    evaluation = evaluated(ours, tmp_path, options, "head_on")
    checks, differs = list(step_by_step(evaluation).values()), evaluation.differs()
    assert evaluation.headline(checks, differs) == f"my_dem: {sentence}."
    evaluation.case = dataclasses.replace(evaluation.case, headline=lambda results, checks: "As a scene.")
    assert evaluation.headline(checks, differs) == f"As a scene; my_dem: {sentence.partition('; ')[2]}."
    if not options:  # Detects a doubt at the top of the page about a code whose checks hold.
        unknown = {NAME: "what differs is not known: no contact"}
        assert evaluation.headline(checks, unknown) == "As a scene."


def test_the_sentence_says_why_a_code_did_not_run(ours, tmp_path):
    """Detects silence about a code without runs, and a verdict from the runs that are left."""
    evaluation = evaluated(ours, tmp_path, "", "head_on")
    (first, second) = [label for label, code in evaluation.runs if code == NAME]
    del evaluation.runs[first, NAME]
    evaluation.failed[first, NAME] = "status 3"
    assert evaluation.differs() == {NAME: f"what differs is not known: my_dem failed on {first}: status 3"}
    del evaluation.runs[second, NAME]
    assert evaluation.differs() == {NAME: "it failed: status 3"}
    evaluation.failed.clear()
    evaluation.unstated[first, NAME] = "no hertz"
    assert evaluation.differs() == {NAME: "it did not run: no hertz"}


def test_wall_is_named_where_contacts_of_particles_are_right(ours, tmp_path):
    """Detects a wrong wall that is taken for a wrong law."""
    (verdict,) = verdicts(evaluated(ours, tmp_path, "--mistake wall_sphere", "oblique", "default"))
    assert (verdict.what, verdict.explained) == ("wall", "wall taken as a sphere of equal radius and mass")
    assert "floor" in verdict.where


@pytest.mark.parametrize(
    ("name", "prefix", "options"),
    [("head_on", "", ""), ("oblique", "default", "--version reordered"), ("wall_restitution", "default", "")],
)
def test_right_code_agrees_step_by_step_in_any_order_of_particles(ours, tmp_path, name, prefix, options):
    """Detects a comparison by order of rows, and an attribution that finds a difference without one."""
    evaluation = evaluated(ours, tmp_path, options, name, prefix)
    found = step_by_step(evaluation)
    assert len(found) >= 3
    assert {result.status for result in found.values()} == {"pass"}
    assert [v.what for v in verdicts(evaluation)] == ["nothing"]


@pytest.mark.cases
@pytest.mark.parametrize("version", ["full_step", "half_the_step"])
def test_right_code_in_another_scheme_is_not_called_wrong(ours, tmp_path, version):
    """Detects agreement to rounding, or LIGGGHTS' order in the step, demanded of another right scheme."""
    evaluation = evaluated(ours, tmp_path, f"--version {version}", "head_on", rungs=0)
    results = [evaluation.check(c) for c in evaluation.case.checks_of("quick", CODES) if NAME in c.needs]
    assert len(results) > 10
    assert {result.status for result in results} == {"pass", "left_out"}
    for result in results:
        if result.status == "left_out":
            assert version in result.why, result.name
    assert sum("step by step is required only of the half-step scheme" in r.why for r in results) == 3
    assert [v.what for v in verdicts(evaluation)] == ["scheme or timing"]


def test_wrong_law_in_another_scheme_fails(ours, tmp_path):
    """Detects a declared scheme that excuses everything."""
    evaluation = evaluated(ours, tmp_path, "--mistake damping_mass --version full_step", "head_on", rungs=0)
    results = [evaluation.check(c) for c in evaluation.case.checks_of("quick", CODES) if NAME in c.needs]
    assert [r.name for r in results if r.status == "fail"]
    (verdict,) = verdicts(evaluation)
    assert verdict.what == "law"


def test_few_digits_are_not_an_error_of_physics(ours, tmp_path):
    """Detects rounded output that fails a check."""
    evaluation = evaluated(ours, tmp_path, "--digits 6", "head_on", rungs=0)
    results = [evaluation.check(c) for c in evaluation.case.checks_of("quick", CODES) if NAME in c.needs]
    assert not [(r.name, r.value) for r in results if r.status not in ("pass", "left_out")]
    assert all("6" in result.why for result in results if result.status == "left_out")
    (verdict,) = verdicts(evaluation)
    assert verdict.what == "not known: output with 6 significant digits"


def test_column_that_is_not_written_is_left_out(ours, tmp_path):
    """Detects a missing column that becomes an error or a pass."""
    evaluation = evaluated(ours, tmp_path, "", "head_on")
    for run in evaluation.runs.values():
        if run.code == NAME:
            run.trace = {k: v for k, v in run.trace.items() if k != "force"}
            run.notes["not_written"] = ["force"]
    found = step_by_step(evaluation)
    assert (found["force"].status, found["force"].why) == ("left_out", "my_dem does not write force")
    assert found["position"].status == "pass"
    assert brought.not_written(KeyError("another"), evaluation.runs, {}) == ""


def test_figure_of_a_failed_run_is_left_out(ours, tmp_path):
    """Detects a failed run of a user's code that breaks figures and tables of the other codes."""
    evaluation = evaluated(ours, tmp_path, "", "head_on", rungs=1)
    (label,) = {label for label, _ in evaluation.runs}
    del evaluation.runs[label, NAME]
    evaluation.failed[label, NAME] = "status 3"

    def of_all(results: Results):
        return [results[label, code] for code in CODES]

    table = evaluation.table(Table("t", "c", of_all), tmp_path, 1)  # type: ignore[arg-type]
    assert (table.status, table.why) == ("left_out", f"my_dem failed on {label}")
    differs = evaluation.table(attribution.tables((NAME,))[0], tmp_path, 2)
    assert (differs.status, differs.why) == ("left_out", f"my_dem failed on {label}: status 3")


@pytest.mark.parametrize("law", ["history_rotated", "history_capped", "no_history"])
def test_another_tangential_law_is_not_judged_by_history(law):
    """Detects forces of another law that are called a mistake, since they are not those of `history`."""
    assert "only for hertz with history" in law_on_states.judged(two_spheres(contact={"tangential": law}), {})


def test_a_contact_between_two_searches_is_found():
    """Detects pairs that are searched only where the particles are at the time of a search."""
    scene = three_in_a_row()
    position = np.zeros((200, 3, 3))
    position[:, 2] = (0.0, 0.2, 0.0)
    position[:, 1] = (0.04, 0.0, 0.0)
    middle = law_on_states.SEARCHED // 2
    position[middle - 10 : middle + 10, 1, 0] = np.linspace(-0.04, 0.04, 20)
    assert [(c.i, c.other) for c in law_on_states.contacts(scene, position)] == [(0, 1)]


def test_missed_steps_of_a_contact_are_of_the_list(ours, tmp_path):
    """Detects a contact that was not acted upon for a while and is taken for a wrong law."""
    evaluation = evaluated(ours, tmp_path, "", "head_on", rungs=1)
    (run,) = (run for run in evaluation.runs.values() if run.code == NAME)
    trace, dt = run.trace, run.scene.time.step
    touch = law_on_states.Touch(0, 1)
    first = int(np.argmax(law_on_states.overlap(run.scene, trace["position"], touch)[1] > 0))
    late = first + 8  # the pair flies on for eight steps, then rebounds as it did
    for name in ("position", "velocity", "force"):
        trace[name] = trace[name].copy()
    start = run.scene.state
    flight = np.arange(late)[:, None, None] * dt * start.velocity[None, :2]
    trace["position"][:late, :2] = start.position[:2] + flight
    trace["velocity"][:late, :2] = start.velocity[:2]
    compared = law_on_states.compare(run.scene, trace, touch, True)
    assert compared.absent() >= 6


def test_example_refuses_what_it_cannot_run(tmp_path):
    """Detects an example that runs a scene without its rolling friction."""
    from reference.errors import CannotState

    contact = {"normal": "hooke", "characteristic_velocity": 1.0}
    scene = variants_of("head_on", "", 1)[0].scene.replace(contact=contact)
    with pytest.raises(CannotState, match="cannot run hooke"):
        codes.CODES[NAME].run(scene, tmp_path, Options(), lambda step: None, {})


def test_example_is_short():
    """150 lines are what a reader takes in."""
    assert len(MY_DEM.read_text().splitlines()) <= 150


def three_in_a_row() -> Scene:
    """Two balls in contact, the third hits them off its axis: the middle one has two contacts at a time."""
    return Scene(
        name="row", materials={"ball": Material(young=3e8, poisson=0.3, density=2500)},
        pairs=[Pair(materials=("ball", "ball"), restitution=0.7, friction=0.2)],
        particles=Explicit(
            position=[[0, 0, 0], [0.0101, 0, 0], [0.0201, 0, 0]], radius=0.005, material="ball",
            velocity=[[1.0, 0.3, 0], [0, 0, 0], [0, 0, 0]],
        ),
        domain=Domain(lo=(-0.05, -0.05, -0.05), hi=(0.1, 0.05, 0.05)),
        time=Time(step=1e-6, duration=4e-4), output=Output(trace_every=1e-6),
    )  # fmt: skip


#: Change of the table (step, force) -> (forces, listed) -> what differs.
TABLES = {
    "as computed": (lambda step, force: force, "nothing"),
    "forces of another law": (lambda step, force: 1.05 * force, attribution.ONE_STEP),
    "no contact for a while": (lambda step, force: force if step > 150 else None, "list"),
}


@pytest.mark.parametrize(("change", "what"), TABLES.values(), ids=TABLES)
def test_stated_contacts_judge_particles_with_several(tmp_path, change, what):
    """Detects a table of contacts that is not read, or read for the wrong particle or with the wrong sign."""
    run = codes.CODES["gpudem"].run(three_in_a_row(), tmp_path, Options(threads=1), lambda step: None, {})
    run = dataclasses.replace(run, code=NAME, notes={"scheme": "half_step", "digits": 17})

    def verdict() -> attribution.Verdict:
        (found,) = attribution.verdicts(Results("quick", {("row", NAME): run}), NAME)
        return found

    assert verdict().what.startswith("not known: contacts of particles that have several at a time")
    rows = ["step,id,other,fx,fy,fz"]  # the outer particles have one contact each: their whole force
    for step, forces in zip(run.trace["step"].tolist(), run.trace["force"], strict=True):
        for row, other in ((0, 2), (2, 2)):
            stated = change(step, forces[row])
            if forces[row].any() and stated is not None:
                rows.append(",".join([str(step), str(row + 1), str(other), *map(repr, stated.tolist())]))
    (tmp_path / "contacts.csv").write_text("\n".join(rows) + "\n")
    run.notes["contacts"] = "contacts.csv"
    assert verdict().what == what
    assert verdict().contacts == 2
