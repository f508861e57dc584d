"""Whether the bed is at rest when the gate goes."""

from types import SimpleNamespace

import pandas
import pytest

from comparisons.cases.dam_break import scenes as dam


def test_kinetic_energy_by_the_fall_of_the_flow(monkeypatch):
    """Catches a row after the gate has gone, spins left out, the fall of the pouring instead of the flow."""
    monkeypatch.setattr(dam, "opening", lambda run: 0.3)
    history = pandas.DataFrame(
        {
            "time": [0.0, 0.1, 0.2, 0.3, 0.4],
            "kinetic_energy": [0.0, 9.0, 0.03, 0.5, 0.7],
            "rotational_energy": [0.0, 1.0, 0.01, 0.1, 0.1],
            "potential_energy": [40.0, 20.0, 10.0, 9.0, 8.0],
        }
    )
    assert dam.unrest(SimpleNamespace(history=history)) == pytest.approx(0.04 / 2.0)
