"""Decks that differ in one named way: a closed list, each differing in that way alone."""

import dataclasses
import difflib

import pytest

from gpudem.errors import GpudemError
from reference.liggghts import deviations
from reference.liggghts.deck import render
from tests.reference.scenes import two_spheres


@pytest.mark.parametrize(
    ("name", "gone", "new"),
    [
        ("default_contact_distance_factor", "neigh_modify    delay 0 contact_distance_factor 1.01",
         ["neigh_modify    delay 0"]),
        ("two_runs", "run             1200", ["run             450", "run             750"]),
        ("unguarded", "thermo_modify   lost error norm no flush yes format float %.16e",
         ["thermo_modify   norm no flush yes format float %.16e"]),
    ],
)  # fmt: skip
def test_differs_in_its_line_alone(name, gone, new):
    """Catches an edit that finds nothing, or changes more than it says."""
    deck = render(two_spheres())
    other = deviations.DEVIATIONS[name].edit(deck)
    diff = list(difflib.ndiff(deck.text.splitlines(), other.text.splitlines()))
    assert [line[2:] for line in diff if line.startswith("- ")] == [gone]
    assert [line[2:] for line in diff if line.startswith("+ ")] == new
    assert other.data == deck.data
    assert other.segments[-1].last == deck.segments[-1].last


def test_unknown_deviation_is_an_error(tmp_path):
    with pytest.raises(GpudemError, match="deviation = 'faster': unknown; known: default_contact_distance"):
        deviations.run(two_spheres(), tmp_path, "faster")


def test_words_that_are_gone_are_an_error():
    """A template that no longer says what a deviation leaves out."""
    deck = dataclasses.replace(render(two_spheres()), text="run 1\n")
    for name in ("default_contact_distance_factor", "two_runs", "unguarded"):
        with pytest.raises(GpudemError):
            deviations.DEVIATIONS[name].edit(deck)


@pytest.mark.liggghts
def test_unwatched_run_tells_its_end(tmp_path, liggghts):
    notes = deviations.run(two_spheres(steps=100), tmp_path, "unguarded").notes
    assert (notes["exit_status"], notes["lost"], notes["nan"], notes["steps"]) == (0, 0, False, 100)
