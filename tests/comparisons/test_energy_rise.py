"""The energy of a dam break may only fall, but for a ball amid an impact."""

from types import SimpleNamespace

import numpy as np
import pandas
import pytest

from comparisons import dam


def run_with(total: np.ndarray) -> SimpleNamespace:
    """A run whose potential energy falls from 10 to 5 while the sum of energies is as given."""
    n = len(total)
    potential = np.linspace(10.0, 5.0, n)
    history = pandas.DataFrame(
        {"time": 1.0 + 0.1 * np.arange(n), "kinetic_energy": total - potential, "rotational_energy": 0.0,
         "potential_energy": potential}
    )  # fmt: skip
    return SimpleNamespace(history=history)


@pytest.mark.parametrize(
    ("change", "rise"),
    [
        ({}, 0.0),
        ({20: -0.4}, 0.0),  # one row: an impact, whose energy is in the contact
        ({20: -0.4, 21: -0.4, 22: -0.4}, 0.4 - 0.1),  # three rows, while the sum falls by 0.02 a row
    ],
)
def test_a_dip_of_one_row_is_no_lowest_value(change, rise, monkeypatch):
    """Catches a filter so wide that energy fed in passes for an impact."""
    monkeypatch.setattr(dam, "opening", lambda run: 0.0)
    total = 10.0 - 0.02 * np.arange(50)
    for row, by in change.items():
        total[row] += by
    assert dam.energy_rise(run_with(total), few=True) == pytest.approx(rise / 5.0, abs=0.02)


def test_energy_fed_in_is_seen(monkeypatch):
    monkeypatch.setattr(dam, "opening", lambda run: 0.0)
    total = np.concatenate([10.0 - 0.05 * np.arange(25), 8.8 + 0.02 * np.arange(25)])
    for few in (False, True):
        assert dam.energy_rise(run_with(total), few) == pytest.approx(0.48 / 5.0, rel=0.05)
