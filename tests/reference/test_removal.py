"""Particles that leave through open sides: gpudem and the binary agree step by step; the deck."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.scene import Scene
from reference import liggghts as code
from reference.liggghts.deck import Deck, render
from reference.liggghts.errors import LiggghtsCannotState, LiggghtsFailed
from tests.gpudem.removals import conveyor
from tests.gpudem.test_flow_faces import slits
from tests.reference.test_insertion import pouring

#: Of a diameter, after some thousand steps with contacts.
TOLERANCE = 1e-9
STEP = 1e-5
#: Beside the open side, and in the middle of the box, with balls that come on both of its sides.
PLANES = [
    {"name": "gate", "point": (0.02, 0, 0), "normal": (-2, 0, 0)},
    {"name": "middle", "point": (0.06, 0, 0), "normal": (1, 0, 0)},
]
#: A disc, two rectangles of which one is tilted, and one below the balls that come, at a periodic side.
FACES = [
    {"name": name, "face": face} for name, face in {
        "hole": {"kind": "disc", "center": (0.03, 0.05, 0.014), "axis": (-2, 0, 0), "radius": 0.012},
        "slit": {"kind": "rectangle", "corner": (0.03, 0.02, 0.0), "edges": [(0, 0.05, 0), (0, 0, 0.012)]},
        "tilted": {"kind": "rectangle", "corner": (0, 0.02, 0.01), "edges": [(0, 0.06, 0), (0.06, 0, 0.04)]},
        "edge": {"kind": "rectangle", "corner": (0, 0, 0.14), "edges": [(0, 0.08, 0), (0.1, 0, 0)]},
    }.items()
]  # fmt: skip


def running_out(periodic: bool = False, open_sides: tuple[str, ...] = ("xlo",), **changes) -> Scene:
    """The balls of `pouring` come into a box that slopes down to an open side; its gate goes at 15 ms."""
    walls = [
        {"kind": "box", "name": "box", "material": "wall",
         "sides": ["zlo", "zhi", *([] if periodic else ["ylo", "yhi"]), *({"xlo", "xhi"} - set(open_sides))]},
        {"kind": "plane", "name": "gate", "material": "wall", "point": (0.001, 0, 0), "normal": (1, 0, 0),
         "removed_at": 0.015},
    ]  # fmt: skip
    domain = {"lo": (0, 0, 0), "hi": (0.1, 0.1, 0.2), "periodic": (False, periodic, False),
              "sides": dict.fromkeys(open_sides, "outflow")}  # fmt: skip
    more = {
        "gravity": (-60.0, 0, -6.0),
        "walls": walls,
        "domain": domain,
        "output": {
            "trace_every": STEP,
            "history_every": STEP,
            "frames_every": 0.01,
            "flow": [*PLANES, *FACES],
            "history": ["particles", "kinetic_energy", "potential_energy", "contacts", "centre_x"],
        },
    }
    return pouring(**{**more, "time": {"step": STEP, "duration": 0.05}, **changes})


@pytest.mark.liggghts
@pytest.mark.parametrize("options", [{}, {"periodic": True}], ids=["walls", "periodic"])
def test_agrees_with_binary(options, tmp_path, liggghts):
    """Detects: a removal in another step or of another particle, a force of one that has left."""
    scene = running_out(**options)
    run, ours = code.run(scene, tmp_path), simulate(scene)
    assert run.trace is not None
    assert ours.trace is not None
    gone = np.isnan(ours.trace["position"][-1, :, 0])
    assert 5 < gone.sum() < len(gone)
    assert np.array_equal(np.isnan(run.trace["position"]), np.isnan(ours.trace["position"])), "in every step"
    for name, scale in (("position", 0.01), ("velocity", 3.0), ("angular_velocity", 100.0)):
        difference = np.abs(run.trace[name] - ours.trace[name])
        assert np.nanmax(difference) < TOLERANCE * scale, name
    assert run.history is not None
    assert ours.history is not None
    assert list(run.history) == list(ours.history)
    assert run.history.removed_xlo.iloc[-1] == gone.sum()
    assert run.history.flow_count_gate.iloc[-1] > 3
    assert run.history.flow_count_middle.iloc[-1] < -3
    crossings = {
        face["name"]: (np.diff(run.history[f"flow_count_{face['name']}"]) != 0).sum() for face in FACES
    }
    assert min(crossings[name] for name in ("hole", "slit", "tilted")) > 0
    assert sum(crossings.values()) > 5
    for name in ours.history.columns:
        scale = np.nanmax(np.abs(ours.history[name]))
        assert np.nanmax(np.abs(run.history[name] - ours.history[name])) <= 1e-9 * scale, name
    assert [len(f["id"]) for f in run.frames] == ours.history.particles[::1000].tolist()
    assert abs(run.timing.particles - ours.timing.particles) <= 1


@pytest.mark.liggghts
def test_as_many_particles_with_other_ids(tmp_path, liggghts):
    """A ball leaves and one comes. Detects: output that LIGGGHTS is to sort; it takes the ids for those of
    its set-up, mixes the rows up, and may end by SIGSEGV.
    """
    places = [(0.003, 0.05, 0.05), *((0.02 + 0.01 * k, 0.05, 0.05) for k in range(6))]
    comes = {"kind": "list", "time": [0.002], "position": [(0.05, 0.05, 0.15)], "radius": [0.002],
             "velocity": [(0.0, 0, 0)], "material": "ball"}  # fmt: skip
    sides = ["xhi", "ylo", "yhi", "zlo", "zhi"]
    scene = running_out(
        particles={"source": "explicit", "position": places, "velocity": [(-2.0, 0, 0), *[(0, 0, 0)] * 6],
                   "radius": 0.002, "material": "ball"},
        insert=[comes], time={"step": STEP, "duration": 0.006},
        output={"trace_every": 1e-4, "frames_every": 0.002},
        walls=[{"kind": "box", "name": "box", "material": "wall", "sides": sides}],
    )  # fmt: skip
    run = code.run(scene, tmp_path)
    assert [frame["id"].tolist() for frame in run.frames] == [[*range(1, 8)], *[[*range(2, 9)]] * 3]
    ours = simulate(scene).trace
    assert run.trace is not None
    assert ours is not None
    assert np.array_equal(np.isnan(run.trace["position"]), np.isnan(ours["position"]))
    assert np.nanmax(np.abs(run.trace["position"] - ours["position"])) < 1e-12


def test_deck():
    """Detects: a scene without open sides that may lose particles, a side that is open by accident."""
    lines = render(running_out()).text.splitlines()
    words = {line.split()[0]: line for line in lines if line.split()}
    x, y = ([float(v) for v in line.split()[:2]] for line in render(running_out()).data.splitlines()[5:7])
    assert x[0] == 0.0
    assert x[1] > 0.15
    assert y[0] < -0.05
    assert "lost ignore" in words["thermo_modify"]
    assert render(running_out()).may_lose
    plain = render(pouring())
    assert "lost error" in plain.text
    assert not plain.may_lose
    assert "beyond" not in plain.text


@pytest.mark.liggghts
def test_a_closed_side_is_still_an_error(tmp_path, liggghts):
    """Detects: a particle that is lost without a word through a side that is not open."""
    walls = running_out().model_dump()["walls"]
    walls[0]["sides"] = ["zhi", "ylo", "yhi", "xhi"]
    with pytest.raises(
        LiggghtsFailed, match="left the domain through a side that is not open, in or before step"
    ):
        code.run(running_out(walls=walls), tmp_path)


def test_what_is_refused():
    """Detects: a removal that LIGGGHTS leaves out without a word."""
    removal = {"name": "old", "every": 0.01, "age": 0.01}
    with pytest.raises(
        LiggghtsCannotState, match=r"remove\.old: in LIGGGHTS particles leave through open sides"
    ):
        render(running_out(remove=[removal]))


@pytest.mark.liggghts
def test_several_open_sides(tmp_path, liggghts):
    """Detects: columns of one side with what left through another, flow without what left on either side."""
    scene = running_out(open_sides=("xlo", "xhi"))
    run, ours = code.run(scene, tmp_path), simulate(scene).history
    assert run.history is not None
    assert ours is not None
    assert not [name for name in run.history if name.startswith(("removed", "removal"))]
    assert any("removed_* and removed_mass_* are left out" in warning for warning in run.warnings)
    flows = [name for name in ours if name.startswith("flow_")]
    assert len(flows) == 3 * len([*PLANES, *FACES])
    for name in flows:
        assert np.abs(run.history[name] - ours[name]).max() <= 1e-9 * np.abs(ours[name]).max(), name


@pytest.mark.liggghts
@pytest.mark.parametrize("ranks", [1, 2])
def test_flow_at_intervals(tmp_path, liggghts, ranks):
    """Thermo lines between the rows of the history, and a run that ends between two of them.

    Detects: crossings of the steps between two lines left out or counted twice.
    """
    x, y = np.meshgrid(np.linspace(0.04, 0.09, 5), np.linspace(0.01, 0.09, 6))
    place = np.stack([x.ravel(), y.ravel(), 0.008 + 0.1 * y.ravel()], axis=1)
    start = {"source": "explicit", "position": place, "radius": 0.0055, "material": "ball"}
    output = {"history_every": 130 * STEP, "history": ["particles"], "flow": [*PLANES, *FACES]}
    walls = running_out().model_dump()["walls"]
    walls[1]["removed_at"] = (
        0.0185  # a ball passes `hole` in step 1826, and lines are written at 1846 and 1872
    )
    scene = running_out(particles=start, insert=[], output=output, walls=walls)
    run, ours = code.run(scene, tmp_path, ranks=ranks), simulate(scene).history
    assert run.history is not None
    assert ours is not None
    for name in [name for name in ours if name.startswith("flow_count")]:
        assert run.history[name].equals(ours[name]), name
    assert np.abs(ours.flow_count_slit).max() + np.abs(ours.flow_count_hole).max() > 0


@pytest.mark.liggghts
def test_the_place_of_a_crossing(tmp_path, liggghts):
    """Detects: the place before or after the step taken for that of the crossing, images forgotten."""
    scene = slits()
    run, ours = code.run(scene, tmp_path), simulate(scene).history
    assert run.history is not None
    assert ours is not None
    for name in ("slit", "beyond"):
        assert run.history[f"flow_mass_{name}"].to_numpy() == pytest.approx(
            ours[f"flow_mass_{name}"], rel=1e-12
        )


@pytest.mark.liggghts
def test_members_of_a_moving_group(tmp_path, liggghts):
    """Detects: members that leave in another step or stay; forces with the weight of those that have left."""
    scene = conveyor()
    run, ours = code.run(scene, tmp_path), simulate(scene)
    assert run.trace is not None
    assert ours.trace is not None
    assert np.array_equal(np.isnan(run.trace["position"]), np.isnan(ours.trace["position"])), "in every step"
    assert np.nanmax(np.abs(run.trace["position"] - ours.trace["position"])) < TOLERANCE * 0.01
    assert run.history is not None
    assert ours.history is not None
    assert list(run.history) == list(ours.history)
    assert ours.history.removed_xhi.iloc[-1] == 4
    for name in ours.history.columns:
        scale = np.abs(ours.history[name]).max()
        assert np.abs(run.history[name] - ours.history[name]).max() <= 1e-9 * scale, name


@pytest.mark.liggghts
def test_against_massflow_mesh(tmp_path, liggghts, monkeypatch):
    """The binary's own count through a rectangle, one fix for each direction.

    Detects: formulas of a deck whose crossings are not those of the binary.
    """
    scene, names = running_out(), ("slit", "edge")
    faces = [surface.face for surface in scene.output.flow if surface.name in names and surface.face]

    def with_meshes(*args) -> Deck:
        deck, lines, files = render(*args), [], {}
        for name, face in zip(names, faces, strict=True):
            files[f"{name}.stl"] = stl_of(face)
            lines.append(f"fix plane_{name} all mesh/surface/planar file {name}.stl type 1")
            for way, sign in (("forth", 1), ("back", -1)):
                side = " ".join(str(c) for c in sign * face.normal)
                lines.append(
                    f"fix {way}_{name} all massflow/mesh mesh plane_{name} count multiple vec_side {side}"
                )
                lines.append(f"variable {way}_{name} equal f_{way}_{name}[2]")
        found = " ".join(f"${{{way}_{name}}}" for name in names for way in ("forth", "back"))
        lines.append(f'fix tell all print 1 "{found}" file massflow.txt screen no title ""')
        text = deck.text.replace("\nthermo_style", "\n" + "\n".join([*lines, "thermo_style"]))
        return dataclasses.replace(deck, text=text, meshes=files)

    monkeypatch.setattr("reference.liggghts.render", with_meshes)
    run = code.run(scene, tmp_path, use_recorded=False)
    assert run.history is not None
    told = np.loadtxt(tmp_path / "massflow.txt")
    for k, name in enumerate(names):
        net = told[:, 2 * k] - told[:, 2 * k + 1]
        assert np.array_equal(net, run.history[f"flow_count_{name}"].to_numpy()[-len(net) :]), name
        assert net.any()


def stl_of(face) -> str:
    """A rectangle as two triangles."""
    a, (u, v) = np.array(face.corner), map(np.array, face.edges)
    facets = []
    for corners in ((a, a + u, a + u + v), (a, a + u + v, a + v)):
        lines = ["vertex " + " ".join(f"{c:.17g}" for c in corner) for corner in corners]
        facets.append("\n".join(["facet normal 0 0 0", "outer loop", *lines, "endloop", "endfacet"]))
    return "\n".join(["solid face", *facets, "endsolid face", ""])


def test_names_of_a_deck():
    """Detects: a variable of one plane taken for that of another."""
    planes = [{**PLANES[0], "name": "in"}, {**PLANES[1], "name": "mass_in"}]
    with pytest.raises(LiggghtsCannotState, match=r"output\.flow: mass_in: .* variable of this name for in"):
        render(running_out(output={"history_every": STEP, "flow": planes}))
