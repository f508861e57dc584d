"""The deck: golden text, only what the scene needs, nothing of free text, and what cannot be stated."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from comparisons.cases.limits.extreme_scenes import R, on_mesh
from gpudem.scene import Scene
from reference.liggghts.deck import data, render
from reference.liggghts.decomposition import processors
from reference.liggghts.errors import LiggghtsCannotState
from tests.reference.scenes import (
    AGREEMENT,
    FLOOR,
    LATER_LAWS,
    OURS,
    STIFFNESS,
    gate_removal,
    two_spheres,
    wall_bounce,
)

GOLDEN = Path(__file__).parent / "golden"
HOSTILE = ['"; shell rm -rf /', "a\nshell touch owned", "${x}", "$(1+1)", "& \\", "{{ scene }}", "# run 1"]


@pytest.mark.parametrize("name", ["two_spheres", "gate_removal", "stiffness_wall", "frictionless"])
def test_golden(name):
    """To renew after a wanted change: python -m tests.reference.renew."""
    assert render(AGREEMENT[name]()).text == (GOLDEN / f"{name}.in").read_text()


@pytest.mark.parametrize("title", HOSTILE)
def test_no_title_reaches_the_deck(title):
    plain, hostile = render(two_spheres()), render(two_spheres(title=title))
    assert (plain.text, plain.data, plain.hash) == (hostile.text, hostile.data, hostile.hash)


def test_deck_has_only_harmless_characters():
    for make in AGREEMENT.values():
        text = render(make()).text
        assert re.fullmatch(r"[A-Za-z0-9_ .,:;#%*/()<>=\"\[\]\n+-]*", text), set(text)
        assert not re.search(r"\b(shell|include|jump|\$)\b", text)


def test_only_what_is_needed():
    text = render(two_spheres()).text
    for word in (
        "gravity",
        "wall/gran",
        "touch_",
        "rolling",
        "processors",
        "limitForce",
        "unfix",
        "history_",
    ):
        assert word not in text, word
    assert "tangential history" in text
    assert "tangential history" not in render(AGREEMENT["frictionless"]()).text
    assert "gravity" in render(wall_bounce()).text
    assert "trace" not in render(two_spheres(output={"trace_every": None})).text


def test_every_deck_has_what_guards_against_silence():
    """Traps 1, 2, 11, 12."""
    for make in AGREEMENT.values():
        s = make()
        text = render(s).text
        assert "neigh_modify    delay 0 contact_distance_factor 1.01" in text
        assert "thermo_modify   lost error norm no flush yes" in text
        assert f"timestep        {s.time.step!r}\n" in text
        assert "hard_particles  yes" in text
        assert "newton          off\ncommunicate     single vel yes" in text


def test_soft_particles_only_where_needed():
    soft = {"ball": {"young": 1e6, "poisson": 0.3, "density": 1000.0}}
    assert "soft_particles" not in render(two_spheres()).text
    assert "soft_particles  yes" in render(two_spheres(materials=soft)).text


def test_lists_hold_all_triangles_of_a_mesh():
    """Detects a run that LIGGGHTS ends since more than 2000 triangles are near one ball."""
    fine = on_mesh("fine", "fine", (1.2 * R, 1.2 * R), (40, 40)).scene
    assert "neigh_modify    one 3200 page 32000\n" in render(fine).text
    coarse = on_mesh("coarse", "coarse", (1.2 * R, 1.2 * R), (10, 10)).scene
    assert " one " not in render(coarse).text


def test_wall_switches_come_after_primitive():
    """Trap 14; the pair style has them too."""
    text = render(wall_bounce(contact={"limit_force": True, "tangential_damping": False})).text
    assert re.search(
        r"wall_floor .* primitive type 2 zplane 0.0 limitForce on tangential_damping off\n", text
    )
    assert re.search(r"pair_style .* limitForce on tangential_damping off\n", text)


def test_materials_that_cannot_meet_get_harmless_values():
    text = render(wall_bounce()).text
    assert "coefficientRestitution peratomtypepair 2 0.5 0.6 0.6 1.0\n" in text
    assert "coefficientFriction peratomtypepair 2 0.3 0.2 0.2 0.0\n" in text


def test_data_round_trip_is_exact():
    rng = np.random.default_rng(1)
    n = 50
    x, (y, z) = np.arange(n) * 0.01 + np.pi / 1e3, rng.uniform(-0.1, 0.1, (2, n))
    s = Scene(
        name="exact",
        materials={"a": {"young": 1e7, "poisson": 0.3, "density": 1234.5678901234567}},
        pairs=[{"materials": ("a", "a")}],
        particles={
            "source": "explicit", "material": "a", "radius": rng.uniform(0.001, 0.002, n),
            "position": np.stack([x, y, z], axis=1),
            "velocity": rng.normal(size=(n, 3)), "angular_velocity": rng.normal(size=(n, 3)) * 1e3,
        },
        domain={"lo": (-1, -1, -1), "hi": (1, 1, 1)},
        time={"step": 1e-6, "duration": 1e-5},
    )  # fmt: skip
    atoms, velocities = (
        np.array([line.split() for line in part.split("\n\n")[1].strip().splitlines()], float)
        for part in re.split("Atoms|Velocities", data(s))[1:]
    )
    assert atoms[:, 0].tolist() == list(range(1, n + 1))
    assert np.array_equal(atoms[:, 2] / 2, s.state.radius)
    assert set(atoms[:, 3]) == {1234.5678901234567}
    assert np.array_equal(atoms[:, 4:], s.state.position)
    assert np.array_equal(velocities[:, 1:4], s.state.velocity)
    assert np.array_equal(velocities[:, 4:], s.state.angular_velocity)


@pytest.mark.parametrize("tilt", [0.1, 1e-4, 1e-9, 1e-11, -1e-11])
def test_tilted_plane_is_refused_by_name(tilt):
    """However small: 1 + tilt^2 rounds to 1, and the deck would take the first axis that is not 0."""
    with pytest.raises(LiggghtsCannotState, match=r"walls\.slope: normal"):
        render(wall_bounce(walls=[{**FLOOR, "name": "slope", "normal": (tilt, 0, 1)}]))


@pytest.mark.parametrize("normal", [(6e-17, 0, 1), (0, -1.8e-16, 1), (0, 0, 0.3), (3e-14, 0, 1e2)])
def test_rounding_of_a_normal_is_no_tilt(normal):
    assert render(wall_bounce(walls=[{**FLOOR, "normal": normal}])).text == render(wall_bounce()).text


def test_low_restitution_is_refused_by_name():
    with pytest.raises(LiggghtsCannotState, match=r"pairs ball / ball: restitution = 0.05"):
        render(two_spheres(pair={"restitution": 0.05}))
    render(two_spheres(pair={"restitution": 0.05, **STIFFNESS}, contact={"normal": "hertz/stiffness"}))


def test_rolling_stiffness_by_pair_is_refused():
    """Trap 34: LIGGGHTS has one number; the message names both. Below 1 it is refused as well."""
    scene = LATER_LAWS["epsd3_resting"]()
    assert "rollingStiffness scalar 1.5\n" in render(scene).text
    pairs = [{**p.model_dump(), "rolling_stiffness": 2.0 + k} for k, p in enumerate(scene.pairs)]
    with pytest.raises(LiggghtsCannotState, match=r"rolling_stiffness: 2, 3 with contact\.rolling = 'epsd3'"):
        render(scene.replace(pairs=pairs))
    with pytest.raises(LiggghtsCannotState, match=r"rolling_stiffness = 0\.5: LIGGGHTS wants at least 1"):
        render(scene.replace(pairs=[{**p, "rolling_stiffness": 0.5} for p in pairs]))


def test_words_of_cohesion():
    """Trap 32: before the rolling friction; switches where a law reads them; a wall's own slot."""
    text = render(LATER_LAWS["sjkr_reduce"]()).text
    assert re.search(
        r"pair_style .*tangential history cohesion sjkr rolling_friction epsd2 tangential_reduce on\n", text
    )
    assert "cohesionEnergyDensity peratomtypepair 2 20000.0 14000.0 14000.0 0.0\n" in text
    text = render(LATER_LAWS["own_sjkr_off"]()).text
    assert re.search(r"wall_floor .*model hertz tangential history rolling_friction epsd primitive", text)
    assert re.search(r"wall_side .*model hertz tangential history cohesion sjkr2 primitive", text)
    assert re.search(r"pair_style .* torsionTorque on\n", render(LATER_LAWS["torsion_epsd"]()).text)


def test_low_characteristic_velocity_is_refused():
    with pytest.raises(LiggghtsCannotState, match=r"characteristic_velocity = 0\.009"):
        render(two_spheres(contact={"normal": "hooke", "characteristic_velocity": 0.009}))


def test_ranks_are_not_cut_across_the_pile():
    """Trap 16: left to itself LIGGGHTS cuts x, where all grains stand behind the gate."""
    assert processors(gate_removal(), 2) == (1, 2, 1)
    assert "processors      1 2 1" in render(gate_removal(), 2).text
    assert processors(two_spheres(), 2) == (2, 1, 1)  # no gate, no gravity: one ball each


def test_hash_is_of_the_physics():
    assert render(two_spheres()).hash == render(two_spheres(name="other")).hash
    assert render(two_spheres()).hash != render(two_spheres(pair={"friction": 0.31})).hash


def test_thermo_stride_divides_the_history_interval():
    assert "thermo          12\n" in render(two_spheres(output={"history_every": None})).text
    assert "thermo          10\n" in render(two_spheres(output={"history_every": 7e-5})).text


@pytest.mark.parametrize("name", [name for name in OURS if name.endswith("resting")])
def test_a_law_of_gpudem_alone_is_refused_by_name(name):
    """Detects a law without words in LIGGGHTS that is written as another one."""
    law = name.removesuffix("_resting")
    with pytest.raises(LiggghtsCannotState, match=rf"contact.tangential = '{law}': LIGGGHTS has no such law"):
        render(OURS[name]())
