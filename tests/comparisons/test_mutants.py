"""The table of mutants: up to date, and its tools say what is wrong. `make mutants` runs them."""

from pathlib import Path

import pytest

from comparisons.mutants.table import TABLE, load
from comparisons.mutants.trial import Copy
from gpudem.errors import GpudemError

ROOT = Path(__file__).parents[2]
BATTERY, MUTATIONS = load()


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda m: m.name)
def test_old_text_is_there_once(mutation):
    """A table that has rotted would break nothing and show nothing."""
    text = (ROOT / mutation.file).read_text()
    assert mutation.applied(text) != text


def test_gone_text_is_an_error():
    with pytest.raises(GpudemError, match=f"{MUTATIONS[0].name!r}: its old text stands 0 times"):
        MUTATIONS[0].applied("nothing of the kind")


def test_unknown_member_of_the_battery_is_an_error(tmp_path):
    path = tmp_path / "mutations.toml"
    path.write_text(
        TABLE.read_text().replace('look = ["emulator two_sizes"]', 'look = ["emulator two_size"]')
    )
    with pytest.raises(GpudemError, match=r"not in the battery: .'emulator two_size'"):
        load(path)


def test_names_of_the_battery():
    """Catches a node that is not found again in junit.xml: its mutants would be named by a path."""
    name = BATTERY.name("tests.gpudem.test_against_emulator", "test_agrees_to_rounding[hooke]")
    assert name == "emulator hooke"
    assert BATTERY.name("tests.gpudem.test_neighbor_list", "test_list_grows") == "list: test_list_grows"


@pytest.mark.slow
def test_a_mutant_is_caught_and_the_sound_copy_is_not(tmp_path):
    """The tools end to end on one mutant; some 20 s."""
    copy, member = Copy(ROOT, tmp_path, BATTERY), "emulator frictionless_wall"
    copy.prove([member])
    mutation = next(m for m in MUTATIONS if m.name == "wall normal turned round")
    assert copy.mutant(mutation, [member]).caught_by == [member]
    assert (copy.folder / mutation.file).read_text() == (ROOT / mutation.file).read_text()
