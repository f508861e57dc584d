"""gpudem animate: all frames of a run in one file, with the particles in them, or one clear error."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from comparisons import cli
from comparisons.report import animate, render
from gpudem import driver, event_driven
from gpudem.errors import GpudemError
from gpudem.scene import Output, Scene
from reference import liggghts
from tests.event_driven import scenes

pytestmark = pytest.mark.long

FRAMES = 4


def flying() -> Scene:
    """One ball flies from left to right through a flat box, at constant speed."""
    return scenes.scene(
        [[-0.2, 0, 0.1]], [[1.0, 0, 0]], lo=(-0.3, -0.05, 0), hi=(0.3, 0.05, 0.2), duration=0.3,
        output=Output(frames_every=0.1),
    )  # fmt: skip


@pytest.fixture(scope="module")
def hard(tmp_path_factory) -> Path:
    directory = tmp_path_factory.mktemp("hard")
    event_driven.run(flying(), directory)
    return directory


def pictures(path: Path) -> list[np.ndarray]:
    """The frames of a GIF without the line of text above."""
    with Image.open(path) as film:
        found = []
        for k in range(getattr(film, "n_frames", 1)):
            film.seek(k)
            found.append(np.asarray(film.convert("RGB"), int)[26:])
        return found


def coloured(picture: np.ndarray) -> np.ndarray:
    """Columns of the pixels that are neither white nor grey: the ball."""
    return np.nonzero(np.ptp(picture, axis=2) > 40)[1]


@pytest.mark.parametrize("engine", ["pyvista", "circles"])
def test_the_ball_flies_through_the_film(hard, tmp_path, monkeypatch, engine):
    # catches: particles not drawn, one frame over and over, a picture mirrored or out of place
    if engine == "circles":
        monkeypatch.setattr(render, "can_render", lambda: False)
    elif not render.can_render():
        pytest.skip("no off-screen rendering here")
    out = tmp_path / "film.gif"
    assert animate.animate(hard, out, width=240) == FRAMES
    found = pictures(out)
    assert len(found) == FRAMES
    places = [float(coloured(picture).mean()) for picture in found]
    metre = 240 / 0.6
    np.testing.assert_allclose(places, 120 + metre * np.array([-0.2, -0.1, 0.0, 0.1]), atol=5)
    # the disk of a ball, as large as it is
    sizes = [coloured(picture).size for picture in found]
    np.testing.assert_allclose(sizes, np.pi * (scenes.RADIUS * metre) ** 2, rtol=0.25)


@pytest.mark.liggghts
def test_liggghts_frames_are_drawn_alike(hard, tmp_path):
    # catches: columns that one code lacks
    liggghts.run(flying(), tmp_path / "run")
    for directory, name in ((tmp_path / "run", "theirs.gif"), (hard, "ours.gif")):
        animate.animate(directory, tmp_path / name, width=160)
    theirs, ours = (pictures(tmp_path / name) for name in ("theirs.gif", "ours.gif"))
    assert len(theirs) == len(ours) == FRAMES
    for a, b in zip(theirs, ours, strict=True):
        assert coloured(a).mean() == pytest.approx(coloured(b).mean(), abs=1)


def test_the_command(tmp_path, capsys):
    # catches: options that do not arrive; the view from above has another height
    driver.simulate(flying(), tmp_path, device="cpu")
    common = ["animate", str(tmp_path), "--width", "160", "--fps", "5", "--color", "velocity"]
    assert cli.main([*common, "--out", str(tmp_path / "a.gif")]) == 0
    assert cli.main([*common, "--out", str(tmp_path / "b.gif"), "--view", "oblique"]) == 0
    assert "4 frames" in capsys.readouterr().err
    with Image.open(tmp_path / "a.gif") as a, Image.open(tmp_path / "b.gif") as b:
        assert a.info["duration"] == 200
        assert a.size != b.size


def test_mp4_says_what_to_install(hard, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(GpudemError, match=r"pip install .gpudem\[video\]"):
        animate.animate(hard, tmp_path / "film.mp4")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # imageio-ffmpeg's own pipes
def test_mp4(hard, tmp_path):
    encoder = pytest.importorskip("imageio_ffmpeg")
    out = tmp_path / "film.mp4"
    animate.animate(hard, out, width=241, fps=10)
    reader = encoder.read_frames(str(out))
    facts = next(reader)
    films = [np.frombuffer(data, np.uint8).reshape(*facts["size"][::-1], 3).astype(int) for data in reader]
    assert len(films) == FRAMES
    places = [coloured(film[26:]).mean() for film in films]
    assert np.all(np.diff(places) > 20)


@pytest.mark.parametrize(
    ("out", "color", "message"),
    [
        ("film.avi", "speed", "unknown ending '.avi'; known: .gif, .mp4"),
        (
            "film.gif",
            "spede",
            "color = 'spede': no such column in the frames; known: speed, angular_velocity",
        ),
        ("no/such/film.gif", "speed", "cannot be written"),
    ],
)
def test_errors_say_what_is_wrong(hard, tmp_path, out, color, message):
    with pytest.raises(GpudemError, match=message):
        animate.animate(hard, tmp_path / out, color=color, width=120)


def test_a_folder_without_a_run(tmp_path):
    with pytest.raises(GpudemError, match=r"scene\.json: no such file: not the folder of a run"):
        animate.animate(tmp_path, tmp_path / "film.gif")
