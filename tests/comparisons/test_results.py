import dataclasses
import json
import math
import xml.etree.ElementTree as ElementTree

import pytest

from comparisons.harness import results
from comparisons.harness.results import CheckResult
from comparisons.report import junit
from gpudem.errors import GpudemError


def test_results_survive_the_file(finished):
    directory, comparison = finished
    stored = results.load(directory)
    nan = next(c for c in stored.checks if c.name == "a check that is not a number")
    assert math.isnan(nan.value)
    clear = [dataclasses.replace(c, value=0.0) if c.value != c.value else c for c in comparison.checks]
    assert [dataclasses.replace(c, value=0.0) if c.value != c.value else c for c in stored.checks] == clear
    for field in ("cases", "timings", "runs", "provenance", "tier", "state", "options"):
        assert getattr(stored, field) == getattr(comparison, field), field


def test_the_file_is_plain_json_with_a_schema_version(finished):
    directory, _ = finished

    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    data = json.loads((directory / "results.json").read_text(), parse_constant=refuse)
    assert data["schema_version"] == results.SCHEMA_VERSION
    assert set(data["checks"][0]) >= {
        "case", "name", "value", "measured", "expected", "unit", "tolerance", "lo", "reason", "against",
        "mark", "catches", "status", "why",
    }  # fmt: skip
    assert set(data["timings"][0]) >= {
        "case", "variant", "code", "version", "device", "cores", "precision", "particles", "steps",
        "stepping_s", "compile_s", "setup_s", "output_s", "peak_memory_bytes", "rate",
    }  # fmt: skip
    assert set(data["provenance"]) >= {"commit", "dirty", "command", "hardware", "packages", "os", "date"}
    assert set(data["runs"][0]) >= {"scene_hash", "state_hash", "deck_hash", "seed", "recorded", "warnings"}


def check(value, tolerance, lo=None):
    return CheckResult("c", "n", "pass", "1", tolerance, "x", "A", "r", "w", ("gpudem",), value=value, lo=lo)


@pytest.mark.parametrize(
    ("value", "tolerance", "lo", "ratio"),
    [
        (0.5, 2.0, None, 0.25),
        (0.0, 0.0, None, 0.0),
        (1.0, 0.0, None, math.inf),
        (1.5, 2.0, 1.0, 0.0),
        (2.0, 2.0, 1.0, 1.0),
        (0.5, 2.0, 1.0, 2.0),
        (4.0, math.inf, 1.0, 0.25),
        (math.nan, 1.0, None, None),
        (None, 1.0, None, None),
    ],
)
def test_ratio(value, tolerance, lo, ratio):
    assert check(value, tolerance, lo).ratio == ratio


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, r"results\.json is missing; is this the folder of a comparison"),
        ("{", "not JSON"),
        ("[]", "schema None; this gpudem reads schema 1"),
        ('{"schema_version": 99}', "schema 99"),
        ('{"schema_version": 1}', "Field required"),
    ],
)
def test_a_file_that_is_not_results(tmp_path, text, message):
    if text is not None:
        (tmp_path / "results.json").write_text(text)
    with pytest.raises(GpudemError, match=message):
        results.load(tmp_path)


def test_junit_has_a_test_for_each_check_and_its_numbers(finished):
    directory, comparison = finished
    root = ElementTree.parse(directory / "junit.xml").getroot()
    tests = root.findall("testsuite/testcase")
    assert len(tests) == len(comparison.checks)
    suite = root.find("testsuite[@name='troubled']")
    assert {k: suite.get(k) for k in ("tests", "failures", "errors", "skipped")} == {
        "tests": "7", "failures": "2", "errors": "1", "skipped": "1",
    }  # fmt: skip
    properties = {p.get("name"): p.get("value") for p in tests[0].findall("properties/property")}
    assert float(properties["value"]) <= float(properties["tolerance"])
    assert properties["against"] == "closed form"


def test_junit_takes_any_text(finished):
    _, comparison = finished
    bad = dataclasses.replace(comparison.checks[0], status="error", why="\x00\x1b[31m <&> \ud800")
    changed = dataclasses.replace(comparison, checks=[bad])
    assert ElementTree.fromstring(junit.xml(changed)).find("testsuite/testcase/error") is not None


@pytest.mark.parametrize(
    ("value", "tolerance", "lo", "text"),
    [
        (2.5e-7, 1e-9, None, "2.5e-07, allowed: ≤ 10⁻⁹"),
        (0.5, 2.0, 1.0, "0.5, allowed: 1 to 2"),
        (0.001, math.inf, 0.01, "0.001, allowed: ≥ 0.01"),
    ],
)
def test_verdict_in_words(value, tolerance, lo, text):
    assert check(value, tolerance, lo).verdict == text
