"""Bad scene files and the message each gets: key, value, unit, allowed range, and nothing else.

The number of problems is exact: a check that also fires on consequences of the first mistake fails the test,
as does one that stops firing.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from gpudem.scene import Explicit, Material, Scene, SceneError
from tests.bad_scenes import FIELDS, GOOD, WHOLE, Bad


def test_the_good_scene_is_good(tmp_path: Path) -> None:
    """Every row below differs from this one by its edits alone."""
    path = tmp_path / "scene.toml"
    path.write_text(GOOD)
    assert len(Scene.from_toml(path).state) == 2


@pytest.mark.parametrize("row", FIELDS + WHOLE, ids=lambda row: row.name)
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
        "young = -1: out of range; allowed: 0 < value <= 1e+14 [Pa]",
        "poisson = 0.6: out of range; allowed: 0 <= value <= 0.5 [1]",
    ]
    with pytest.raises(SceneError, match=r"Explicit: 1 problem\n  - position = .*: must be numbers"):
        Explicit(position=[["0", "0", "1"]], radius=1, material="ps")


def test_a_waived_check_is_not_made(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        'allow = ["time_step", "overlap"]\n'
        + GOOD.replace("1e-5", "1e-4").replace("[[0.0, 0.0, 0.01], [0.02,", "[[0.0, 0.0, 0.01], [0.005,")
    )
    Scene.from_toml(path)
