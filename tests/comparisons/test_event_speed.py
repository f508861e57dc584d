"""The case event_speed: the C program beside the engine, and what is said where there is no compiler."""

from __future__ import annotations

import dataclasses
import math
import shutil

import pytest

from comparisons.cases.performance import c_reference as event_speed
from comparisons.cases.performance import event_speed as case
from comparisons.harness.evaluate import Evaluation
from gpudem.errors import GpudemError

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


@needs_cc
def test_c_does_the_same_work_and_another_scene_is_seen(tmp_path):
    # catches: a C program that does less; a check that would hold for any two programs
    reference, start = event_speed.CReference(tmp_path), event_speed.problem(60)
    own = event_speed.engine_run(start, 2.0)
    same = reference.run(reference.write(start), 2.0)
    assert own.events > 2000
    assert (same.events, same.collisions) == (own.events, own.collisions)
    assert same.height == pytest.approx(own.height, abs=1e-13)
    softer = dataclasses.replace(start, restitution=start.restitution * 0.999)
    other = reference.run(reference.write(softer), 2.0)
    assert other.collisions != own.collisions


@needs_cc
def test_what_the_c_program_says_is_an_error(tmp_path):
    # catches: a failed run taken for a fast one
    reference = event_speed.CReference(tmp_path)
    with pytest.raises(GpudemError, match="No such file"):
        reference.run(reference.folder / "missing.txt", 1.0)
    path = reference.write(event_speed.problem(60))
    path.write_text(path.read_text()[:-200])
    with pytest.raises(GpudemError, match="a number is missing"):
        reference.run(path, 1.0)


def test_without_a_compiler_the_checks_are_left_out_and_say_so(monkeypatch):
    # catches: a ratio that passes, or an error, where nothing was measured
    monkeypatch.setenv("CC", "no-such-compiler")
    evaluation = Evaluation(case.CASE, "quick", ("gpudem",))
    checks = [c for c in case.CASE.checks_of("quick") if " of C" in c.name]
    found = [*map(evaluation.check, checks)]
    found += [evaluation.finding(f) for f in case.CASE.findings_of("quick") if " of C" in f.name]
    assert len(found) == 3
    assert {c.status for c in found} == {"left_out"}
    assert all("no C compiler here (no-such-compiler)" in c.why for c in found)


def test_the_fits_find_what_they_look_for():
    # catches: a growth read off the wrong axis
    numbers = [10, 100, 1000, 10000]
    assert case.exponent({n: 1e-6 * n**1.5 for n in numbers}) == pytest.approx(1.5)
    assert case.exponent({n: 1.0 if n < 100 else n for n in numbers}, least=100) == pytest.approx(1.0)
    assert case.logarithm({n: 2.0 + 0.5 * math.log2(n) for n in numbers}) == pytest.approx((2.0, 0.5))


def test_three_searches_one_sequence():
    # catches: a comparison of lists that are empty or short
    found = event_speed.same_sequence(20, 100)
    assert {len(rows) >= 100 for rows in found.values()} == {True}
    assert found["tree"][:100] == found["scan"][:100] == found["pairs"][:100]
