"""The balances of energy and mass of `gpudem compare SCENE` where particles come and leave."""

from __future__ import annotations

import dataclasses

import pytest

from comparisons.harness.case import Results, Unmeasured
from comparisons.metrics import bulk
from comparisons.scene_case import checks
from comparisons.scene_case import plan as plans
from gpudem import driver
from gpudem.output.run import Run
from gpudem.scene import Scene
from tests.comparisons.test_scene_case import RAIN, rain
from tests.gpudem.test_flow_faces import leaking


def balances(scene: Scene, run: Run) -> dict[str, float]:
    """First word of the name -> what the checks of energy and mass measure of a run by gpudem."""
    results = Results("quick", {(plans.SCENE, "gpudem"): run}, {})
    made = checks.each(plans.make(scene, 2, False)).make("gpudem")
    return {
        check.name.split()[0]: check.measure(results).value  # pyright: ignore[reportAttributeAccessIssue]
        for check in made if check.name.startswith(("energy with", "mass that"))
    }  # fmt: skip


def test_balance_of_a_gas_that_leaves(monkeypatch):
    """Most of an elastic gas leaves through two sides; its energy, and all mass, are counted.

    Detects: energy that is not taken along, of another row than the last one, twice; mass left out.
    """
    scene = plans.make(leaking(output={}), 2, False).scene
    run = driver.simulate(scene, threads=1)
    assert run.history is not None
    assert run.history.removed_zlo.iloc[-1] + run.history.removed_zhi.iloc[-1] > 60
    found = balances(scene, run)
    assert found["energy"] < 0.01 < checks.ENERGY
    assert found["mass"] < checks.MASS
    late = run.history.assign(removed_mass_zlo=run.history.removed_mass_zlo.shift(1, fill_value=0.0))
    assert balances(scene, dataclasses.replace(run, history=late))["mass"] > 1e-3
    none = dataclasses.replace(run, history=run.history.drop(columns="removed_mass_zhi"))
    with pytest.raises(Unmeasured, match="does not tell removed_mass_zhi"):
        balances(scene, none)
    plain = bulk.energy_that_left
    monkeypatch.setattr(bulk, "energy_that_left", lambda *args: (0 * plain(*args)[0], 0))
    assert balances(scene, run)["energy"] > 10 * checks.ENERGY


def test_energy_that_falls_out_of_the_domain(monkeypatch):
    """Balls fall out of the domain far below the origin, where their energy is negative.

    Detects: potential energy that is not taken along, for without it the energy of those that stay grows.
    """
    wall = {"kind": "plane", "name": "left", "material": "ball", "point": (0, 0, 0), "normal": (1, 0, 0)}
    domain = {"lo": (0, 0, -1.01), "hi": (0.02, 0.02, -0.98), "sides": {"zlo": "outflow"}}
    place = [(x, y, z - 1.0) for x, y, z in RAIN["position"]]
    stated = rain(insert=[{**RAIN, "position": place}], walls=[wall], domain=domain)
    scene = plans.make(stated.replace(time={"duration": 0.025}), 2, False).scene
    run = driver.simulate(scene, threads=1)
    assert run.history is not None
    assert run.history.removed_zlo.iloc[-1] >= 2
    assert balances(scene, run)["energy"] < 0.01
    plain = bulk.energy_that_left
    monkeypatch.setattr(bulk, "energy_that_left", lambda *args: (0 * plain(*args)[0], 0))
    assert balances(scene, run)["energy"] > checks.ENERGY
