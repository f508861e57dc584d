"""One code with several sets of options beside codes as they are: labels, keys, and who runs what."""

from __future__ import annotations

import dataclasses

import pytest

from comparisons.harness import codes
from comparisons.harness.configurations import Configuration, Configurations, precisions
from tests.comparisons import fake

PRECISIONS = Configurations(*precisions())


@pytest.fixture
def mine(monkeypatch):
    """A code that a user brought."""
    brought = dataclasses.replace(fake.code("gpudem"), name="mine", title="Mine", style={})
    monkeypatch.setitem(codes.CODES, "mine", brought)
    return "mine"


def test_each_runs_what_it_is_for(mine):
    """Catches a precision that runs twice, and a user's code that runs the variants of gpudem's options."""
    ran = {
        variant.label: variant.codes_of(("gpudem", "liggghts", "event_driven", mine))
        for variant in PRECISIONS.variants("bed", fake.scene())
    }
    assert ran == {
        "bed": ("gpudem", "liggghts", mine), "bed-mixed": ("gpudem",), "bed-float32": ("gpudem",)
    }  # fmt: skip


def test_every_configuration_finds_its_run(mine):
    """Catches a configuration that reads the run of another."""
    made = PRECISIONS.variants("bed", fake.scene())
    runs = {
        (v.label, code): (code, v.options.get(code, {}))
        for v in made
        for code in v.codes_of(tuple(codes.CODES))
    }
    for one in PRECISIONS.among(codes.CODES):
        assert runs[one.key("bed")] == (one.code, one.options)
    assert [one.title for one in PRECISIONS.among(("liggghts", mine, "gpudem"))] == [
        "gpudem float64", "gpudem mixed", "gpudem float32", "LIGGGHTS", "Mine",
    ]  # fmt: skip


def test_the_first_runs_beside_the_other_codes():
    """Catches a list of configurations in which none runs the variant of all codes."""
    with pytest.raises(ValueError, match="gpudem mixed"):
        PRECISIONS.variants("bed", fake.scene(), PRECISIONS.own[1:])
    assert Configuration("gpudem").key("bed") == ("bed", "gpudem")


def test_timed_runs_are_on_so_many_cores_and_live():
    """Catches a timing on all cores, of a recorded run, or beside other runs."""
    variants = Configurations(*precisions(), timed_on=2).variants("bed", fake.scene())
    assert all(variant.timed for variant in variants)
    assert variants[0].options["liggghts"] == {"ranks": 2, "use_recorded": False}
    assert variants[1].options == {"gpudem": {"threads": 2, "precision": "mixed"}}
    assert not any(variant.timed for variant in PRECISIONS.variants("bed", fake.scene()))
