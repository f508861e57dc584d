"""What other packages may add, and how: a contact law and a kind of wall, each in one file of their own."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pytest
import warp as wp

import gpudem
import gpudem.event_driven
from gpudem.contact import registry as laws
from gpudem.contact.law import NormalLaw, Parameter, TangentialLaw
from gpudem.errors import GpudemError, SceneError
from gpudem.scene import Scene
from gpudem.scene.types import Vector, positive, vector
from gpudem.scene.walls import Wall
from gpudem.walls import registry as walls
from gpudem.walls.registry import WallKind
from reference.liggghts import deck
from reference.liggghts.errors import LiggghtsCannotState

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[1]

#: A package of somebody else: a linear spring with a dashpot of its own, k [N/m] and c [N s/m] as stated.
LAW = '''
"""Linear spring and dashpot, both stated."""
from typing import Any
import math
import warp as wp
from gpudem.contact.law import NormalLaw, Parameter


@wp.func
def linear(c: Any, p: Any):
    return p.k_normal, p.k_tangential, p.c_normal, p.c_tangential


@wp.func
def linear_damping(c: Any, p: Any, overlap: Any):
    return p.c_normal * overlap


class Linear(NormalLaw):
    name = "linear"
    uses_moduli = False
    parameters = (
        Parameter("spring", "N/m", 0, open_lo=True),
        Parameter("dashpot", "N s/m", 0, 1e6, default=0.0),
    )

    def coefficients_of(self, inputs):
        k, c = (inputs.value(p) for p in self.parameters)
        return {"k_normal": k, "k_tangential": k, "c_normal": c, "c_tangential": c}

    def contact_time(self, inputs, radius, mass, speed):
        return math.pi * math.sqrt(mass / inputs.value(self.parameters[0]))

    def release_speed(self, inputs, radius, mass, overlap):
        return overlap * math.sqrt(inputs.value(self.parameters[0]) / mass)

    def restitution(self, inputs, radius, mass, speed):
        k, c = (inputs.value(p) for p in self.parameters)
        return math.exp(-math.pi * c / math.sqrt(4 * mass * k - c * c))


LAW = Linear(linear, linear_damping)
'''

SCENE = """name = "linear"
materials.a = {young = 5e6, poisson = 0.3, density = 2500.0}
pairs = [{materials = ["a", "a"], spring = 1e4, dashpot = 0.3}]
contact = {normal = "linear", tangential = "off"}
domain = {lo = [-0.1, -0.1, -0.1], hi = [0.1, 0.1, 0.1]}
time = {step = 1e-7, duration = 3e-3}
output = {trace_every = 3e-3}
[particles]
source = "explicit"
position = [[-0.0051, 0.0, 0.0], [0.0051, 0.0, 0.0]]
velocity = [[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]]
radius = 0.005
material = "a"
"""


def wheel(folder: Path) -> Path:
    """A wheel of that package, with its entry point."""
    path, info = folder / "their_laws-1.0-py3-none-any.whl", "their_laws-1.0.dist-info"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("their_laws.py", LAW)
        file.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: their-laws\nVersion: 1.0\n")
        file.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        file.writestr(f"{info}/entry_points.txt", "[gpudem.laws]\nlinear = their_laws:LAW\n")
        file.writestr(f"{info}/RECORD", "")
    return path


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """A folder in which pip has installed it."""
    folder = tmp_path_factory.mktemp("their_laws")
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index", "--target"]
    subprocess.run([*pip, str(folder / "site"), str(wheel(folder))], check=True, capture_output=True)
    (folder / "scene.toml").write_text(SCENE)
    return folder


def command(
    folder: Path, *words: str, program: tuple[str, ...] = ("-m", "comparisons")
) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(folder / "site"), str(ROOT)])
    return subprocess.run(
        [sys.executable, *program, *words], cwd=folder, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": path}, check=False,
    )  # fmt: skip


def test_a_law_of_an_installed_package(installed):
    """Named in TOML, run, and right: e = exp(-pi c / sqrt(4 m* k - c^2)) of a linear contact in closed form.

    Catches a registry that the scene, the kernel or the time step does not ask.
    """
    done = command(installed, "run", "scene.toml", "-q", "--out", "out")
    assert done.returncode == 0, done.stderr
    mass = 4 / 3 * np.pi * 0.005**3 * 2500 / 2
    restitution = np.exp(-np.pi * 0.3 / np.sqrt(4 * mass * 1e4 - 0.09))
    with np.load(installed / "out" / "trace.npz") as trace:
        v = trace["velocity"][-1, :, 0]
    assert 0.5 < restitution < 0.9
    assert v[1] == pytest.approx(0.5 * restitution, rel=1e-3)
    assert v[0] == -v[1]


def test_it_is_refused_for_liggghts_by_name(installed):
    done = command(installed, "deck", "scene.toml")
    assert done.returncode == 3 or done.returncode == 2
    assert "contact.normal = 'linear': LIGGGHTS has no such law" in done.stderr
    assert "Traceback" not in done.stderr


#: What is changed in the scene, into what, and the message; none where it stays right.
MISTAKES = (
    ('"linear"\n', '"linaer"\n', ""),
    ('normal = "linear"', 'normal = "linea"', "contact.normal = 'linea': unknown; did you mean 'linear'"),
    ("spring = 1e4, ", "", "pairs: a / a: linear needs spring"),
    ("spring = 1e4", "spring = 0", "pairs[0].spring = 0: out of range; allowed: 0 < value [N/m]"),
    ("dashpot = 0.3", "dashpot = 2e6", "pairs[0].dashpot = 2000000.0: out of range; allowed: 0 <= value"),
    ("dashpot = 0.3", "dashpt = 0.3", "pairs[0].dashpt: unknown key; did you mean 'dashpot'?"),
    ('tangential = "off"', 'tangential = "off", spring = 1', "contact.spring: unknown key"),
    ("step = 1e-7", "step = 1e-3", "time.step = 0.001 s: above 0.2 of the contact time (linear)"),
)  # fmt: skip
#: `gpudem validate` of several files, in one process: (exit code, what it says) of each.
VALIDATE = """
import contextlib, io, json, sys
from comparisons.cli import main
found = []
for name in sys.argv[1:]:
    with contextlib.redirect_stderr(io.StringIO()) as said, contextlib.redirect_stdout(io.StringIO()):
        code = main(["validate", name])
    found.append((code, said.getvalue()))
print(json.dumps(found))
"""


def test_its_parameters_are_checked(installed):
    """As those of the built-in laws: catches keys that go unread."""
    names = []
    for k, (before, after, _) in enumerate(MISTAKES):
        assert before in SCENE
        names.append(f"bad_{k}.toml")
        (installed / names[-1]).write_text(SCENE.replace(before, after))
    done = command(installed, *names, program=("-c", VALIDATE))
    assert done.returncode == 0, done.stderr
    for (code, said), (_, after, message) in zip(json.loads(done.stdout), MISTAKES, strict=True):
        assert message in said, after
        assert code == (2 if message else 0), after


def test_without_the_package_its_law_is_unknown(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    with pytest.raises(SceneError, match=r"contact\.normal = 'linear': unknown"):
        Scene.from_toml(tmp_path / "scene.toml")


def test_register_refuses_what_is_no_law_or_a_second_one():
    hertz = laws.law("normal", "hertz")
    laws.register(hertz)  # the same object: nothing changes
    second = type("Second", (NormalLaw,), {"name": "hertz"})(None, None)
    off = type("Off", (TangentialLaw,), {"name": "off"})(None)
    for law in (second, off, "hertz", Parameter("k", "N/m")):
        with pytest.raises(GpudemError, match=r"there is another law of this name|is not a contact law"):
            laws.register(law)  # type: ignore[arg-type]


# -- a kind of wall, as another package would write it ------------------------------------------------------


class Ball(Wall):
    """The inside of a spherical shell."""

    kind: Literal["ball"]  # type: ignore[assignment]
    point: Annotated[Vector, vector("m")]
    radius: Annotated[float, positive("m")]

    def shape(self) -> tuple[Vector, Vector, Vector]:
        return (0.0, 0.0, 0.0), self.point, (self.radius, 0.0, 0.0)

    def gap(self, points: np.ndarray) -> np.ndarray:
        return self.radius - np.linalg.norm(points - np.array(self.point), axis=1)

    def outline(self, lo: np.ndarray, hi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        polar, angle = np.meshgrid(np.linspace(0, np.pi, 13), np.linspace(0, 2 * np.pi, 25), indexing="ij")
        unit = [np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar)]
        points = np.array(self.point) + self.radius * np.stack(unit, axis=-1).reshape(-1, 3)
        k = np.arange(12 * 25).reshape(12, 25)[:, :-1].ravel()
        return points, np.stack([k, k + 1, k + 26, k + 25], axis=1)


@wp.func
def ball(walls: Any, w: wp.int32, x: Any):
    d = x - walls.point[w]
    r = wp.length(d)
    return walls.size[w][0] - r, -d / r


KIND = WallKind("ball", ball, Ball)
# -- end of that file ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module", autouse=True)
def registered():
    """The kind is known in this file only."""
    walls.register(KIND)
    yield
    del walls._registered["ball"]


def bowl(**changes: Any) -> Scene:
    """Particles fall inside a ball of which a slice of 20 mm is left between two planes."""
    data: dict[str, Any] = {
        "name": "bowl", "gravity": (0, 0, -9.81),
        "materials": {"a": {"young": 5e6, "poisson": 0.3, "density": 2500.0}},
        "pairs": [{"materials": ("a", "a"), "restitution": 0.3, "friction": 0.4}],
        "particles": {"source": "lattice", "material": "a", "count": 60, "radius": 0.003, "seed": 1,
                      "lo": (-0.02, 0.0, -0.02), "hi": (0.02, 0.02, 0.02), "velocity_rms": 0.1},
        "walls": [
            {"kind": "ball", "name": "bowl", "material": "a", "radius": 0.03, "point": (0, 0.01, 0)},
            {"kind": "plane", "name": "front", "material": "a", "point": (0, 0, 0), "normal": (0, 1, 0)},
            {"kind": "plane", "name": "back", "material": "a", "point": (0, 0.02, 0), "normal": (0, -1, 0)},
        ],
        "domain": {"lo": (-0.031, -0.001, -0.031), "hi": (0.031, 0.021, 0.031)},
        "time": {"step": 2e-5, "duration": 0.3}, "output": {"frames_every": 0.3, "history_every": 0.01},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def test_a_wall_kind_from_outside(tmp_path):
    """It holds the balls, through restart files and frames; catches a kind that only the kernel knows."""
    run = gpudem.simulate(bowl(), tmp_path / "run")
    x = run.frames[-1]["position"]
    assert np.linalg.norm(x - [0, 0.01, 0], axis=1).max() < 0.03 - 0.003 + 1e-4
    assert x[:, 2].mean() < -0.01
    assert run.history.kinetic_energy.iloc[-1] < 1e-3 * run.history.kinetic_energy.max()
    assert gpudem.Run.load(tmp_path / "run").scene == run.scene
    assert (tmp_path / "run" / "frames" / "walls_0.vtu").is_file()


def test_the_rest_position_in_a_ball_is_that_on_a_plane():
    """At its lowest point it is a plane: one ball rests at the same height, with the same force."""
    one = {"source": "explicit", "material": "a", "radius": 0.003, "position": [[0, 0.01, -0.0268]]}
    floor = {"kind": "plane", "name": "floor", "material": "a", "point": (0, 0, -0.03), "normal": (0, 0, 1)}
    output = {"trace_every": 0.3}
    curved = gpudem.simulate(bowl(particles=one, output=output)).trace
    flat = gpudem.simulate(bowl(particles=one, walls=[floor], output=output)).trace
    assert np.abs(curved["position"][-1] - flat["position"][-1]).max() < 1e-12


def test_a_particle_outside_it_is_refused():
    one = {"source": "explicit", "material": "a", "radius": 0.003, "position": [[0.029, 0.01, 0]]}
    with pytest.raises(SceneError, match=r"particle 1 reaches 0.002 m into"):
        bowl(particles=one)


def test_a_wall_kind_is_refused_where_it_cannot_be_stated():
    with pytest.raises(
        LiggghtsCannotState, match=r"walls\.bowl\.kind = 'ball': LIGGGHTS gets planes, endless"
    ):
        deck.render(bowl())
    with pytest.raises(SceneError, match="ball"):
        gpudem.event_driven.run(bowl(pairs=[{"materials": ("a", "a"), "restitution": 0.3}]))


def test_an_unknown_kind_names_those_known():
    with pytest.raises(SceneError) as error:
        bowl(walls=[{"kind": "bal", "name": "bowl", "material": "a"}])
    assert "walls[0].kind = 'bal': unknown; did you mean 'ball'?" in str(error.value)
    with pytest.raises(GpudemError, match="another kind named 'plane'"):
        walls.register(WallKind("plane", ball, Ball))
