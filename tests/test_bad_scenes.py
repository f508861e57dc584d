"""Bad scene files and the message each gets: key, value, unit, allowed range, and nothing else.

The number of problems is exact: a check that also fires on consequences of the first mistake fails the test,
as does one that stops firing.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from gpudem.scene import Explicit, Material, Scene, SceneError, checks, model, sections
from gpudem.solver.neighbor_kernels import CACHE_SIZE
from tests.bad_groups import GROUPS
from tests.bad_insertions import INSERTIONS, SOURCES
from tests.bad_phases import PHASES
from tests.bad_removals import REMOVALS
from tests.bad_scenes import CONE, CYLINDER, EXPLICIT, FIELDS, GOOD, LATTICE, MESH, MOTIONS, WALLS, WHOLE, Bad


def test_the_good_scene_is_good(tmp_path: Path) -> None:
    """Every row below differs from this one by its edits only."""
    path = tmp_path / "scene.toml"
    path.write_text(GOOD)
    assert len(Scene.from_toml(path).state) == 2
    for wall in (MESH, CYLINDER, CONE):
        path.write_text(GOOD.replace("[domain]", f"[[walls]]\n{wall}[domain]"))
        assert len(Scene.from_toml(path).wall_elements) == 2


ROWS = FIELDS + WHOLE + WALLS + MOTIONS + INSERTIONS + SOURCES + GROUPS + PHASES + REMOVALS


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_message(row: Bad, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(row.text())
    with pytest.raises(SceneError) as caught:
        Scene.from_toml(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: {row.problems} problem"), message
    for fragment in row.expected:
        assert fragment in message, message
    assert len(message.splitlines()) == row.problems + 1


FILES = [
    ("not TOML", b"name = \n[", "not TOML: Invalid value (at line 1"),
    ("binary", bytes(range(256)) * 20, "not a text file: byte 128 is not UTF-8"),
    ("empty", b"", "name: missing"),
    ("duplicate key", b"name = 'a'\nname = 'b'\n", "not TOML: Cannot overwrite a value (at line 2"),
]


@pytest.mark.parametrize(("content", "expected"), [row[1:] for row in FILES], ids=[row[0] for row in FILES])
def test_file_that_is_no_scene(content: bytes, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(content)
    with pytest.raises(SceneError) as caught:
        Scene.from_toml(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert expected in str(caught.value)


def test_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"gone\.toml: 1 problem\n  - no such file"):
        Scene.from_toml(tmp_path / "gone.toml")


def test_folder_instead_of_file(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="cannot be read: Is a directory"):
        Scene.from_toml(tmp_path)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("{", "not JSON"), ("[1]", "a scene is a JSON object, not list")],
    ids=["cut", "list"],
)
def test_json(text: str, expected: str) -> None:
    with pytest.raises(SceneError, match=expected):
        Scene.from_json(text, "scene.json")


def test_sections_made_in_python_say_the_same() -> None:
    """A section made by hand raises the same kind of error as a file, all its problems at once."""
    with pytest.raises(SceneError) as caught:
        Material(young=-1, poisson=0.6, density=1050)
    assert caught.value.problems == [
        "young = -1: out of range; allowed: 0 < value [Pa]",
        "poisson = 0.6: out of range; allowed: 0 <= value <= 0.5 [1]",
    ]
    with pytest.raises(SceneError, match=r"Explicit: 1 problem\n  - position = .*: must be numbers"):
        Explicit(position=[["0", "0", "1"]], radius=1, material="ps")


def test_what_is_unusual_can_be_waived(tmp_path: Path) -> None:
    """A heavy sphere of a published benchmark, a centrifuge, a rock: no limit without a way past it."""
    text = GOOD.replace("density = 1050.0", "density = 1.05e8").replace("young = 3.25e7", "young = 3.25e15")
    text = text.replace("restitution = 0.9", "friction = 1e3\nrolling_friction = 20").replace("-9.81", "-6e4")
    text = text.replace("radius = 0.003", "radius = 2e3").replace(
        "lo = [-0.1, -0.1, 0.0]", "lo = [-1e5, -1e5, 0.0]"
    )
    text = text.replace("hi = [0.1, 0.1, 0.2]", "hi = [1e5, 1e5, 1e5]").replace(
        "[0.02, 0.0, 0.01]]", "[5e4, 0, 4e3]]"
    )
    text = text.replace("[[0.0, 0.0, 0.01], ", "[[0.0, 0.0, 4e3], ")
    path = tmp_path / "scene.toml"
    path.write_text(text)
    with pytest.raises(SceneError, match="6 problems") as caught:
        Scene.from_toml(path)
    assert all("waive with allow = ['unusual_units']" in problem for problem in caught.value.problems)
    path.write_text('allow = ["unusual_units"]\n' + text)
    assert Scene.from_toml(path).masses[0] == pytest.approx(1.05e8 * 4 / 3 * np.pi * 2e3**3)


def test_more_particles_than_indices(monkeypatch: pytest.MonkeyPatch) -> None:
    """Listed ones too; the limit is what the neighbor search can number."""
    assert sections.MAX_PARTICLES * int(CACHE_SIZE) <= 2**31
    monkeypatch.setattr(checks, "MAX_PARTICLES", 1)
    with pytest.raises(SceneError, match="particles: 2 are too many for 32-bit indices; allowed: <= 1"):
        Scene(**tomllib.loads(GOOD))


def test_a_lattice_beyond_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_memory(*arguments: object) -> None:
        raise MemoryError

    monkeypatch.setattr(model, "lattice", no_memory)
    text = GOOD.replace(EXPLICIT, LATTICE)
    with pytest.raises(SceneError, match="particles: more than fits in the memory of this machine"):
        Scene(**tomllib.loads(text))


def test_a_waived_check_is_not_made(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        'allow = ["time_step", "overlap"]\n'
        + GOOD.replace("1e-5", "1e-4").replace("[[0.0, 0.0, 0.01], [0.02,", "[[0.0, 0.0, 0.01], [0.005,")
    )
    Scene.from_toml(path)
