"""`gpudem diff`, and the published schema of results.json.

Catches: a check that fails now, or is not judged any more, with exit code 0; a change hidden by rounding or
a band; noise of run times called a change, or a change called noise; a schema that is not that of the file.
"""

import copy
import dataclasses
import json
import math
import shutil

import jsonschema
import numpy as np
import pytest

from comparisons import cli
from comparisons.harness import difference, results
from comparisons.harness.results import TimingResult


def changed(comparison, place, **fields):
    """The comparison with other values in one of its checks."""
    checks = list(comparison.checks)
    checks[place] = dataclasses.replace(checks[place], **fields)
    return dataclasses.replace(comparison, checks=checks)


@pytest.fixture
def before(finished):
    return copy.deepcopy(finished[1])


def place(comparison, status):
    return next(k for k, c in enumerate(comparison.checks) if c.status == status and c.lo is None)


def test_nothing_changed(before):
    found = difference.difference(before, before)
    assert dataclasses.replace(found, speeds=[]) == difference.Difference([], [], [], [], [], [])
    assert {s.factor for s in found.speeds} == {1.0}
    assert not any(s.significant for s in found.speeds)
    assert not found.worse


@pytest.mark.parametrize(
    ("was", "now", "worse"),
    [
        ("pass", "fail", True), ("pass", "error", True), ("pass", "left_out", True), ("fail", "pass", False),
        ("left_out", "fail", True), ("left_out", "pass", False), ("fail", "error", False),
        ("error", "left_out", False),
    ],
)  # fmt: skip
def test_verdicts_that_flip(before, was, now, worse):
    k = place(before, was)
    found = difference.difference(before, changed(before, k, status=now))
    assert [(v.before, v.after, v.worse) for v in found.verdicts] == [
        (was.replace("_", " "), now.replace("_", " "), worse)
    ]
    assert found.worse is worse


@pytest.mark.parametrize(("status", "gone", "new"), [("pass", True, False), ("fail", False, True)])
def test_checks_that_are_new_or_gone(before, status, gone, new):
    k = place(before, status)
    less = dataclasses.replace(before, checks=before.checks[:k] + before.checks[k + 1 :])
    assert difference.difference(before, less).worse is gone
    assert difference.difference(less, before).worse is new


@pytest.mark.parametrize(
    ("one", "two", "shift"),
    [
        ({"value": 1.0, "tolerance": 2.0}, {"value": 1.1}, None),
        ({"value": 1.0, "tolerance": 2.0}, {"value": 1.3}, 0.15),
        ({"value": 1.4, "tolerance": 2.0, "lo": 1.0}, {"value": 1.6}, 0.4),
        ({"value": 4.0, "tolerance": math.inf, "lo": 2.0}, {"value": 3.0}, 0.5),
        ({"value": 0.0, "tolerance": 0.0}, {"value": 1e-16}, math.inf),
        ({"value": 1.0, "tolerance": 2.0}, {"value": math.nan}, math.inf),
        ({"value": math.nan, "tolerance": 2.0}, {"value": math.nan}, None),
        ({"value": 1.0, "tolerance": 2.0}, {"tolerance": 4.0}, 0.0),
    ],
    ids=[
        "small",
        "large",
        "across the middle of a band",
        "no upper end",
        "exact",
        "nan",
        "still nan",
        "allowed",
    ],
)
def test_values(before, one, two, shift):
    k = place(before, "pass")
    first = changed(before, k, **one)
    found = difference.difference(first, changed(first, k, **two)).values
    assert [v.shift for v in found] == ([] if shift is None else [pytest.approx(shift)])


def timings(factor, noise, n=8, case="c"):
    rng = np.random.default_rng(3)
    took = [factor * math.exp(noise * x) for x in rng.normal(size=n)]
    facts = {"version": "1", "device": "cpu", "cores": 1, "precision": "float64", "particles": 1, "steps": 1}
    none = dict.fromkeys(("compile_s", "setup_s", "output_s", "wall_s", "peak_memory_bytes", "rate"), 0)
    return [TimingResult(case, f"v{k}", "gpudem", **facts, stepping_s=t, **none) for k, t in enumerate(took)]


@pytest.mark.parametrize(
    ("factor", "noise", "n", "significant"),
    [
        (1.3, 0.02, 8, True),
        (1.02, 0.1, 8, False),
        (1.0, 0.3, 8, False),
        (1.3, 0.0, 8, True),
        (3.0, 0.1, 2, False),
    ],
    ids=["slower", "within noise", "noise alone", "without noise", "too few"],
)
def test_times_with_their_spread(before, factor, noise, n, significant):
    first = dataclasses.replace(before, timings=timings(1.0, 0.0, n))
    found = difference.difference(
        first, dataclasses.replace(before, timings=timings(factor, noise, n))
    ).speeds
    assert [(s.code, s.case, s.runs) for s in found] == [("gpudem", "", n)]
    assert [s.significant for s in found] == [significant]
    if n >= 3:
        assert all(s.low <= factor * 1.0001 and s.high >= factor * 0.9999 for s in found)


def test_times_by_case(before):
    """One case twice as slow is seen beside one that is not."""
    first = dataclasses.replace(before, timings=timings(1.0, 0.01) + timings(1.0, 0.01, case="d"))
    second = dataclasses.replace(before, timings=timings(2.0, 0.02) + timings(1.0, 0.02, case="d"))
    found = {s.case: s for s in difference.difference(first, second).speeds}
    assert {case: s.significant for case, s in found.items()} == {"": True, "c": True, "d": False}
    assert found["c"].factor == pytest.approx(2.0, rel=0.02)
    assert found[""].factor == pytest.approx(math.sqrt(2.0), rel=0.02)


def test_runs_of_other_work_are_not_compared(before):
    other = [dataclasses.replace(t, steps=2) for t in timings(1.0, 0.0)]
    first = dataclasses.replace(before, timings=timings(1.0, 0.0))
    assert difference.difference(first, dataclasses.replace(before, timings=other)).speeds == []


def test_versions_inputs_and_what_broke(before):
    runs = [dataclasses.replace(r, version="9.9", scene_hash="f" * 64) for r in before.runs]
    made = {**before.provenance, "packages": {**before.provenance["packages"], "numpy": "99"}}
    artefacts = [dataclasses.replace(before.cases[0].artefacts[0], status="error", why="no font")]
    cases = [dataclasses.replace(before.cases[0], artefacts=artefacts), *before.cases[1:]]
    found = difference.difference(
        before, dataclasses.replace(before, runs=runs, provenance=made, cases=cases, tier="full")
    )
    text = "\n".join(difference.text(found))
    assert len(found.inputs) == len(before.runs)
    for line in (
        "version of gpudem: 0.0 -> 9.9",
        "package numpy: ",
        "made with tier: quick -> full",
        "no font",
    ):
        assert line in text
    assert found.worse


@pytest.fixture
def folders(finished, tmp_path):
    """Two folders, the second with a check that fails now."""
    worse = tmp_path / "worse"
    shutil.copytree(finished[0], worse)
    changed(finished[1], place(finished[1], "pass"), status="fail", value=9.0).save(worse)
    return str(finished[0]), str(worse)


def test_the_command(folders, capsys):
    one, two = folders
    assert cli.main(["diff", one, one]) == 0
    assert "0 verdicts changed, 0 for the worse" in capsys.readouterr().out
    assert cli.main(["diff", one, two]) == 1
    assert capsys.readouterr().out.startswith(
        "WORSE throw: height, largest error: pass -> fail (9 m, allowed"
    )
    assert cli.main(["diff", two, one]) == 0
    capsys.readouterr()
    assert cli.main(["diff", one, two, "--json"]) == 1
    data = json.loads(capsys.readouterr().out)
    assert [(v["check"], v["worse"]) for v in data["verdicts"]] == [("height, largest error", True)]
    assert data["values"][0]["after"] == 9.0
    assert cli.main(["diff", one, "nowhere"]) == 2


def test_results_are_of_their_schema(finished, capsys):
    """Made by the command, for a file with NaN, infinity, checks of every status and a figure that failed."""
    assert cli.main(["schema", "results"]) == 0
    schema = json.loads(capsys.readouterr().out)
    validator = jsonschema.validators.validator_for(schema)
    validator.check_schema(schema)
    data = json.loads((finished[0] / results.RESULTS).read_text())
    validator(schema).validate(data)
    assert data["schema_version"] == results.SCHEMA_VERSION
    for spoil in (
        lambda d: d["checks"][0].update(status="perfect"), lambda d: d.update(schema_version=99),
        lambda d: d["checks"][0].update(value="much"), lambda d: d["provenance"].pop("commit"),
        lambda d: d["timings"][0].pop("stepping_s"), lambda d: d.pop("cases"),
    ):  # fmt: skip
        wrong = copy.deepcopy(data)
        spoil(wrong)
        with pytest.raises(jsonschema.ValidationError):
            validator(schema).validate(wrong)
