"""Observables: chosen in the scene, computed alone, added from outside, the same on host and device."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from gpudem.driver import resume, simulate
from gpudem.errors import GpudemError, SceneError, SimulationError
from gpudem.output import observables
from gpudem.output.run import HISTORY_COLUMNS, Run
from gpudem.output.view import VECTORS, DeviceView, View
from gpudem.scene import Output, Scene
from gpudem.simulation import Simulation
from gpudem.solver.solver import Solver
from tests.gpudem.beds import falling_bed, gas

RNG = np.random.default_rng(3)


def bed(history=None, **output) -> Scene:
    every = {"history_every": 1e-3} | output
    return falling_bed(300, time={"step": 2e-5, "duration": 6e-3}, output={"history": history, **every})


@pytest.fixture
def registry(monkeypatch):
    """What a test registers is forgotten after it."""
    monkeypatch.setattr(observables, "_registered", dict(observables._registered))


def test_default_columns():
    history = simulate(bed()).history
    assert history is not None
    assert tuple(history) == HISTORY_COLUMNS
    assert history.contacts.dtype == int


def test_chosen_columns_have_the_values_of_the_default_ones(tmp_path):
    """In the scene's order, in memory and on disk; no warning of energies that are not there."""
    chosen = ["centre_z", "largest_speed", "kinetic_energy", "contacts"]
    whole, some = simulate(bed(frames_every=1e-3), tmp_path / "a"), simulate(bed(chosen), tmp_path / "b")
    assert whole.history is not None
    assert some.history is not None
    assert list(some.history) == ["step", "time", *chosen]
    for name in ("centre_z", "kinetic_energy", "contacts"):
        assert some.history[name].equals(whole.history[name])
    speeds = [np.sqrt((frame["velocity"] ** 2).sum(axis=1).max()) for frame in whole.frames]
    assert some.history.largest_speed.tolist() == speeds
    assert min(speeds) > 0.1
    assert Run.load(tmp_path / "b").history.equals(some.history)  # type: ignore[union-attr]
    assert not [w for w in some.warnings if "energy" in w]


def test_momentum():
    """m v by hand; elastic gas: the sum stays."""
    names = ["momentum_x", "momentum_y", "momentum_z"]
    run = simulate(
        gas(time={"step": 2e-6, "duration": 4e-4}, output={"history_every": 1e-4, "history": names})
    )
    assert run.history is not None
    start = run.scene.masses @ run.scene.state.velocity
    assert np.allclose(run.history[names].to_numpy(), start, rtol=0, atol=1e-12 * np.abs(start).max())
    assert np.abs(start).min() > 0


BAD = {
    "unknown": (["kinetic"], "history[0] = 'kinetic': unknown observable; did you mean 'kinetic_energy'?"),
    "always there": (["step"], "history[0] = 'step': is a column of every history"),
    "twice": (["contacts", "contacts"], "'contacts' is named more than once"),
    "not a list": ("contacts", "must be a list"),
    "empty": ([], "at least 1"),
    "a number": ([1], "history[0] = 1: must be text in quotes"),
}


@pytest.mark.parametrize(("names", "message"), BAD.values(), ids=BAD)
def test_names_are_checked(names, message):
    with pytest.raises(SceneError) as error:
        Output(history_every=1.0, history=names)
    assert message in str(error.value)


def test_a_choice_without_a_history_has_no_effect_and_is_an_error():
    with pytest.raises(SceneError, match=r"has no effect without output\.history_every"):
        Output(history=("contacts",))


def test_only_what_is_asked_for_is_computed(monkeypatch):
    """No torque for an energy; nothing at all at a step that is only a restart's."""
    asked, plain = [], Solver.column

    def column(self, name):
        asked.append((self.step_count, name))
        return plain(self, name)

    monkeypatch.setattr(Solver, "column", column)
    monkeypatch.setattr(Solver, "frame", None)
    simulate(bed(["kinetic_energy", "contacts"], history_every=2e-3))
    assert {name for step, name in asked if step < 300} == {"velocity"}
    assert {step for step, _ in asked} == {0, 100, 200, 300}


def test_a_restart_only_step_builds_nothing(monkeypatch, tmp_path):
    """No view of the state, and no column of it."""
    asked, plain = [], Simulation.view
    monkeypatch.setattr(Simulation, "view", lambda self, step: asked.append(step) or plain(self, step))
    simulate(bed(history_every=None, restart_every=1e-3), tmp_path)
    assert set(asked) == {0, 300}, "the frames of start and end"


def test_a_view_knows_its_columns():
    view = View.of_frame(bed(), 3, {name: np.zeros((300, 3)) for name in VECTORS}, contacts=5)
    assert view.time == 3 * 2e-5
    assert view.contacts == 5
    assert view.position.shape == (300, 3)
    assert np.shares_memory(view.mass, view.scene.masses)
    assert view.min("velocity") == view.max("velocity") == (0.0, 0.0, 0.0)
    with pytest.raises(AttributeError, match="no column 'speed'; known: position"):
        view.speed  # noqa: B018


# -- through periodic sides ----------------------------------------------------------------------------------


def test_centre_of_mass_follows_through_periodic_sides():
    """Drift of a whole gas by several boxes: x of the centre and of the front is start + v t."""
    one = gas(time={"step": 2e-6, "duration": 1.2e-2})
    drift = [10.0, -7.0, 0.0]
    still = one.state
    particles = {
        "source": "explicit", "position": still.position, "velocity": still.velocity + drift,
        "radius": still.radius, "material": "ball",
    }  # fmt: skip
    names = ["centre_x", "centre_y", "centre_z", "front_x", "potential_energy"]
    moving = one.replace(
        particles=particles, output={"history_every": 1e-3, "history": names}, allow=["speed"]
    )
    history = simulate(moving).history
    assert history is not None
    mass = one.masses
    start = mass @ still.position / mass.sum()
    mean = mass @ (still.velocity + drift) / mass.sum()
    expected = start + mean * history.time.to_numpy()[:, None]
    assert np.allclose(history[["centre_x", "centre_y", "centre_z"]], expected, rtol=0, atol=1e-9)
    assert history.centre_x.iloc[-1] > 0.1
    ahead = still.position[:, 0].max() + mean[0] * history.time.to_numpy()
    assert np.abs(history.front_x - ahead).max() < 0.02
    assert (history.potential_energy == 0).all()


# -- from outside --------------------------------------------------------------------------------------------


def heat(view) -> float:
    """Kinetic energy of the motion against the centre of mass."""
    mass, momentum = view.total("mass"), view.sum("velocity", weight="mass")
    return 0.5 * (view.sum("velocity", weight="mass", squared=True) - momentum @ momentum / mass)


def test_an_observable_of_the_user(registry):
    """Registered and named in a scene: nothing else of gpudem is touched."""
    found = observables.observable("heat", "J")(heat)
    assert found.description.startswith("Kinetic energy of the motion")
    history = simulate(bed(["heat", "kinetic_energy"])).history
    assert history is not None
    assert (history.heat < history.kinetic_energy).all()
    state, mass = bed().state, bed().masses
    v = state.velocity - mass @ state.velocity / mass.sum()
    assert history.heat[0] == pytest.approx(0.5 * mass @ (v**2).sum(axis=1), rel=1e-12)


def test_an_observable_of_an_installed_package(tmp_path):
    """Found by its entry point, in a process of its own; TOML names it."""
    (tmp_path / "hot.py").write_text(
        "from gpudem.output.observables import observable\n\n"
        "@observable('fastest', '1', integer=True)\ndef fastest(view):\n"
        "    'Id of the fastest particle.'\n"
        "    return int((view.numpy('velocity') ** 2).sum(axis=1).argmax()) + 1\n"
    )
    info = tmp_path / "hot-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hot\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[gpudem.observables]\nfastest = hot:fastest\n")
    program = (
        "import gpudem\nfrom tests.gpudem.beds import falling_bed\n"
        "s = falling_bed(300, time={'step': 2e-5, 'duration': 4e-5},"
        " output={'history_every': 2e-5, 'history': ['fastest']})\n"
        "h = gpudem.simulate(gpudem.Scene.from_json(s.to_json())).history\n"
        "print(list(h), h.fastest.dtype, h.fastest[0], (s.state.velocity**2).sum(axis=1).argmax() + 1)"
    )
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2])])
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    words = done.stdout.split()
    assert " ".join(words[:4]) == "['step', 'time', 'fastest'] int64"
    assert words[4] == words[5]


def test_what_cannot_be_registered(registry):
    with pytest.raises(GpudemError, match="is not an Observable"):
        observables.register(heat)  # type: ignore[arg-type]
    with pytest.raises(GpudemError, match="another one of this name"):
        observables.observable("contacts", "1")(heat)
    for name in ("time", "two words", "größe", ""):
        with pytest.raises(GpudemError, match="not a name"):
            observables.Observable(name, "1", heat)
    with pytest.raises(GpudemError, match="no observable 'speed'; known: kinetic_energy"):
        observables.get("speed")


def test_an_observable_may_be_no_number_and_survives_a_restart(registry, tmp_path):
    """A mean over no contacts is NaN, which is no lost particle."""

    def mean(view):
        return view.wall_work or float("nan")

    observables.observable("mean", "1")(mean)
    one = bed(["mean", "contacts"], restart_every=2e-3)
    whole = simulate(one, tmp_path).history
    assert whole is not None
    assert whole["mean"].isna().all()
    assert resume(tmp_path).history.equals(whole)  # type: ignore[union-attr]


def test_a_particle_that_is_no_number_is_named(monkeypatch):
    """NaN in one column of the history ends the run, with the particle."""
    plain = Solver.column

    def column(self, name):
        values = plain(self, name).copy()
        if name in ("velocity", "angular_velocity"):
            values[6] = np.nan
        return values

    monkeypatch.setattr(Solver, "column", column)
    with pytest.raises(SimulationError, match=r"particle 7 has a velocity that .* \(NaN\) at t = 0 s"):
        simulate(bed(["rotational_energy"]))


# -- on a device ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("n", [1, 300, 9001])
def test_reductions_on_a_device(n, precision):
    """Against NumPy; rehearsed on the CPU. Catches rows left out or taken twice, extremes from 0."""
    particles = {
        "source": "explicit", "material": "ball", "radius": RNG.uniform(0.002, 0.003, n),
        "position": RNG.uniform(0.1, 1, (n, 3)),
    }  # fmt: skip
    one = falling_bed(
        particles=particles, walls=(), allow=["overlap"], domain={"lo": (0, 0, 0), "hi": (2, 2, 2)}
    )
    dtype, real = (wp.vec3d, np.float64) if precision == "float64" else (wp.vec3f, np.float32)
    columns = {name: (RNG.normal(size=(n, 3)) - 5.0).astype(real) for name in VECTORS}
    arrays = {name: wp.array(values, dtype=dtype, device="cpu") for name, values in columns.items()}
    exact = {name: values.astype(np.float64) for name, values in columns.items()}
    host = View(one, 0, exact.__getitem__, lambda: 7)
    scalars: dict = {}
    device = DeviceView(one, 0, arrays.__getitem__, scalars, lambda: 7)
    again = DeviceView(one, 0, arrays.__getitem__, scalars, lambda: 7)
    for name in observables.names():
        value = observables.get(name)(device)
        assert value == pytest.approx(observables.get(name)(host), rel=1e-12, abs=1e-300), name
        assert value == observables.get(name)(again), "the same bits"
    assert device.max("position") == host.max("position")
    assert device.min("position") == host.min("position")
    assert max(device.max("position")) < 0, "all values are below 0: a maximum that starts at 0 would show"
    assert isinstance(device.position, wp.array)
    assert device.numpy("force").dtype == np.float64


def test_a_device_downloads_nothing_for_the_default_columns():
    one = bed()
    arrays = {name: wp.zeros(300, dtype=wp.vec3d, device="cpu") for name in VECTORS}
    view = DeviceView(one, 0, arrays.__getitem__, {})
    view.numpy = None  # type: ignore[assignment]
    for name in ("kinetic_energy", "rotational_energy", "front_x", "largest_speed", "momentum_x"):
        observables.get(name)(view)


# -- of another code -----------------------------------------------------------------------------------------


def test_columns_that_another_code_does_not_compute_are_left_out_with_a_warning():
    import pandas

    table = pandas.DataFrame(np.ones((3, len(HISTORY_COLUMNS))), columns=list(HISTORY_COLUMNS))
    same, warnings = observables.select(table, None, "LIGGGHTS")
    assert same is table
    assert warnings == []
    some, warnings = observables.select(table, ("momentum_x", "contacts"), "LIGGGHTS")
    assert list(some) == ["step", "time", "contacts"]
    assert warnings == ["history column 'momentum_x' is left out: LIGGGHTS does not compute it"]
