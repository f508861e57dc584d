"""Whatever goes wrong with the process ends in an exception that names it; never in a shorter result."""

from __future__ import annotations

import dataclasses
import os
import signal
from pathlib import Path

import psutil
import pytest

from comparisons.cases.limits import extreme_scenes
from comparisons.harness import jobs
from reference import liggghts as code
from reference.errors import CodeNotStarted
from reference.liggghts.binary import find_liggghts, version
from reference.liggghts.deck import render
from reference.liggghts.errors import LiggghtsFailed, LiggghtsNotFound, LiggghtsTimeout
from reference.liggghts.runner import command, environment, execute
from tests.reference.scenes import R, scene, two_spheres

#: Far more steps than anyone waits for.
ENDLESS = 50_000_000


def endless():
    """Two spheres that never meet, for a very long time."""
    return scene("endless", [[0, 0, 0], [0.01, 0, 0]], [[0, 0, 0], [0, 0, 0]], steps=ENDLESS, every=10_000)


def children() -> list[psutil.Process]:
    """LIGGGHTS processes that this test started."""
    return [p for p in psutil.Process().children(recursive=True) if p.name() == "liggghts"]


def test_missing_binary(tmp_path, monkeypatch):
    monkeypatch.setenv("GPUDEM_LIGGGHTS", "/nowhere/liggghts")
    with pytest.raises(LiggghtsNotFound, match="apt-get install liggghts") as error:
        code.run(two_spheres(name="not_recorded", steps=77), tmp_path)
    assert "GPUDEM_LIGGGHTS" in str(error.value)


def test_missing_binary_on_path(monkeypatch):
    monkeypatch.delenv("GPUDEM_LIGGGHTS", raising=False)
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(LiggghtsNotFound, match="apt-get install liggghts"):
        find_liggghts()


@pytest.mark.liggghts
def test_version(liggghts):
    assert version(liggghts).startswith("LIGGGHTS-PUBLIC 3")


@pytest.mark.liggghts
@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_killed(sign, tmp_path, liggghts):
    """TERM and INT make LIGGGHTS stop early with status 0 (trap 4)."""

    def kill(step: int) -> None:
        if step >= 100_000:
            for child in children():
                os.kill(child.pid, sign)

    with pytest.raises(LiggghtsFailed, match=r"log:") as error:
        code.run(endless(), tmp_path, timeout=60, progress=kill)
    assert ("SIGKILL" if sign == signal.SIGKILL else "signal") in str(error.value)
    assert not (tmp_path / "run.json").exists()


@pytest.mark.liggghts
@pytest.mark.parametrize("ranks", [1, 2])
def test_timeout(ranks, tmp_path, liggghts):
    with pytest.raises(LiggghtsTimeout, match="did not end within 2 s"):
        code.run(endless(), tmp_path, timeout=2, ranks=ranks)
    assert children() == []


@pytest.mark.liggghts
def test_keyboard_interrupt_ends_the_process(tmp_path, liggghts):
    def interrupt(step: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        code.run(endless(), tmp_path, progress=interrupt)
    assert children() == []


@pytest.mark.liggghts
def test_nan(tmp_path, liggghts):
    """Coincident particles: LIGGGHTS goes on with NaN and status 0 (trap 3)."""
    s = scene("nan", [[0, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0, 0]], steps=100, allow=["overlap"])
    with pytest.raises(LiggghtsFailed, match="not a number"):
        code.run(s, tmp_path)


@pytest.mark.liggghts
def test_lost_particle(tmp_path, liggghts):
    """A particle leaves the box: by default LIGGGHTS would go on without it (trap 2)."""
    s = scene("lost", [[0.029, 0, 0], [0, 0, 0]], [[5.0, 0, 0], [0, 0, 0]], steps=1000)
    with pytest.raises(LiggghtsFailed, match=r"ERROR: Lost atoms"):
        code.run(s, tmp_path)


@pytest.mark.liggghts
def test_unwritable_directory(tmp_path, liggghts):
    (tmp_path / "file").write_text("")
    with pytest.raises(LiggghtsFailed, match="cannot be written"):
        code.run(two_spheres(), tmp_path / "file" / "run")


@pytest.mark.liggghts
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("pair_style      gran model hertz", "pair_style      gran model herz", "ERROR"),
        (
            "newton          off",
            "newton          ${nothing}",
            "ERROR on proc 0: Substitution for illegal variable",
        ),
        ("read_data       particles.data", "read_data       no.data", "ERROR on proc 0: Cannot open file"),
    ],
)
def test_error_names_the_deck_line(old, new, message, ranks, tmp_path, liggghts):
    """Also those errors that vanish when stdout is block-buffered (trap 5)."""
    deck = render(two_spheres(), ranks)
    broken = dataclasses.replace(deck, text=deck.text.replace(old, new))
    line = 1 + next(k for k, text in enumerate(broken.text.splitlines()) if text.startswith(new))
    with pytest.raises(LiggghtsFailed) as error:
        execute(broken, tmp_path, liggghts, ranks=ranks)
    said = str(error.value)
    assert said.replace("on proc 1", "on proc 0").startswith(message)
    if ranks == 1:  # of several ranks, one may fail before another has printed the line
        assert f"deck.in, line {line}: {' '.join(new.split())}" in said


@pytest.mark.liggghts
def test_a_binary_that_does_not_start(tmp_path, liggghts, monkeypatch):
    """MPI cannot make its session folder: an error of the machine, which a variant that may end in an error
    must not take for a result (a scene was once called unstable by it)."""
    monkeypatch.setenv("OMPI_MCA_orte_tmpdir_base", "/dev/null/none")
    with pytest.raises(CodeNotStarted, match="before the first command"):
        execute(render(two_spheres()), tmp_path, liggghts)
    assert next(end for kind, end in jobs.ENDS.items() if issubclass(CodeNotStarted, kind)) == "failed"


@pytest.mark.liggghts
def test_starts_side_by_side_share_no_folder(tmp_path, liggghts):
    """Open MPI's session folder of one run, removed at its end, was needed by another that just started."""
    with environment(1) as one, environment(1) as other:
        folders = {Path(e["OMPI_MCA_orte_tmpdir_base"]) for e in (one, other)}
        assert len(folders) == 2
        assert all(folder.is_dir() for folder in folders)
    assert not any(folder.exists() for folder in folders)


@pytest.mark.liggghts
def test_a_deck_that_stops_early(tmp_path, liggghts):
    """No ERROR, status 0, but not all steps."""
    deck = render(two_spheres())
    short = dataclasses.replace(deck, text=deck.text.replace("run             1200", "run             600"))
    with pytest.raises(LiggghtsFailed, match="ended early"):
        execute(short, tmp_path, liggghts)


@pytest.mark.liggghts
def test_a_failed_run_does_not_pass_for_the_earlier_one(tmp_path, liggghts):
    code.run(two_spheres(), tmp_path)
    s = scene(
        "nan", [[0, 0, 0], [R, 0, 0]], [[0, 0, 0], [1e4, 0, 0]], steps=100, allow=["overlap", "time_step"]
    )
    with pytest.raises(LiggghtsFailed):
        code.run(s, tmp_path)
    assert not (tmp_path / "run.json").exists()


@pytest.mark.liggghts
def test_progress_comes_while_it_runs(tmp_path, liggghts):
    steps: list[int] = []
    code.run(two_spheres(output={"history_every": None}), tmp_path, progress=steps.append)
    assert len(steps) > 50
    assert steps[-1] == 1200
    assert steps == sorted(steps)


def test_command_line_is_safe():
    """Trap 5: line-buffered; trap 6: never `-screen none`, which crashes LIGGGHTS with mesh walls."""
    assert command("liggghts", 1)[:2] == ["stdbuf", "-oL"]
    assert "-screen" not in command("liggghts", 2)


@pytest.mark.liggghts
def test_a_crushed_ball_is_said(tmp_path, liggghts):
    """The binary goes on without a word (trap 43). Detects a run whose overlaps nobody looks at."""
    crushed = next(x.scene for x in extreme_scenes.scenes() if x.name == "crushed")
    warnings = code.run(crushed, tmp_path).warnings
    assert any("overlap of 0.666 of the radius: particle 2 in wall plate" in text for text in warnings)
