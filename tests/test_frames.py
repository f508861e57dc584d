"""Frames on disk: exact round trip, physical time, walls, and a plain error for each kind of broken file."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from gpudem.errors import GpudemError
from gpudem.output.frames import Frames, FrameWriter
from gpudem.output.run import Run, Timing
from gpudem.output.vtu import Frame, FrameError, read_vtu, write_pvd, write_vtu
from gpudem.scene import Domain, Explicit, Material, Output, Pair, Plane, Scene, Time

RNG = np.random.default_rng(7)


def frame(n: int = 5) -> Frame:
    columns = {
        k: RNG.normal(size=(n, 3)) for k in ("position", "velocity", "angular_velocity", "force", "torque")
    }
    return columns | {
        "id": np.arange(1, n + 1),
        "material": np.zeros(n, np.int32),
        "radius": RNG.uniform(1, 2, n),
    }


@pytest.fixture
def scene() -> Scene:
    """A ball over a floor; a tilted gate goes at 0.02 s; a frame each 0.01 s."""
    return Scene(
        name="frames",
        materials={"ps": Material(young=3e7, poisson=0.3, density=1000)},
        pairs=[Pair(materials=("ps", "ps"))],
        particles=Explicit(position=[[0, 0, 0.5]], radius=0.01, material="ps"),
        walls=[
            Plane(name="floor", material="ps", point=(0, 0, 0), normal=(0, 0, 1)),
            Plane(name="gate", material="ps", point=(0.9, 0, 0), normal=(-1, 0, 1), removed_at=0.02),
        ],
        domain=Domain(lo=(-1, -2, 0), hi=(1, 2, 3)),
        time=Time(step=1e-4, duration=0.04),
        output=Output(frames_every=0.01),
    )


@pytest.fixture
def written(scene: Scene, tmp_path: Path) -> Path:
    """Five frames of the scene, the ball moving 0.1 m in x from each to the next."""
    writer = FrameWriter(tmp_path, scene)
    for k in range(5):
        writer.add(k * scene.frame_stride, frame(1) | {"position": np.array([[0.1 * k, 0, 0.5]])})
    return tmp_path


def test_round_trip_is_exact(tmp_path: Path) -> None:
    """Every column comes back to the last bit, type and order: float32 points would show."""
    one = frame(1000)
    one["position"] = np.nextafter(one["position"], 2)
    write_vtu(tmp_path / "p.vtu", one)
    back = read_vtu(tmp_path / "p.vtu")
    for name, column in one.items():
        assert back[name].tobytes() == column.tobytes(), name
        assert back[name].dtype == column.dtype, name
        assert back[name].shape == column.shape, name
    assert back["points"].tobytes() == one["position"].tobytes()
    assert [p.name for p in tmp_path.iterdir()] == ["p.vtu"], "no half-written file stays"


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.9, 0.999])
def test_truncated_frame(share: float, tmp_path: Path) -> None:
    path = tmp_path / "p.vtu"
    write_vtu(path, frame(200))
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(FrameError, match=r"p\.vtu: truncated or corrupted VTU"):
        read_vtu(path)


def test_array_cut_inside_whole_xml(tmp_path: Path) -> None:
    """An array that lost its tail while the XML around it is whole must not come back shorter."""
    array = re.compile(r'(<DataArray[^>]*Name="radius"[^>]*>)(.*?)(</DataArray>)', re.DOTALL)
    write_vtu(tmp_path / "p.vtu", frame(3))
    short = array.search((tmp_path / "p.vtu").read_text())
    write_vtu(tmp_path / "p.vtu", frame(4))
    assert short is not None
    (tmp_path / "p.vtu").write_text(array.sub(short[0], (tmp_path / "p.vtu").read_text()))
    with pytest.raises(FrameError, match=r"p\.vtu: truncated or corrupted VTU .* = 4, but .*radius.* = 3"):
        read_vtu(tmp_path / "p.vtu")


@pytest.mark.parametrize("content", [b"", b"\x00\x01" * 50, b"<VTKFile/>", b"<html><body/></html>"])
def test_file_that_is_no_frame(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "p.vtu").write_bytes(content)
    with pytest.raises(FrameError, match=r"p\.vtu: truncated or corrupted VTU"):
        read_vtu(tmp_path / "p.vtu")


def test_missing_frame(written: Path) -> None:
    frames = Frames.open(written)
    (written / frames.names[2]).unlink()
    with pytest.raises(FrameError, match=r"p_000000200\.vtu: no such frame"):
        frames[2]


def test_frames_by_time_and_number(written: Path) -> None:
    frames = Frames.open(written)
    np.testing.assert_array_equal(frames.times, np.arange(5) * 100 * 1e-4)
    assert len(frames) == 5
    assert [f["position"][0, 0] for f in frames] == [0.1 * k for k in range(5)]
    assert frames.at(0.021)["position"][0, 0] == 0.2
    assert frames[-1]["position"][0, 0] == 0.4


def test_an_aborted_run_still_opens(scene: Scene, tmp_path: Path) -> None:
    """The .pvd is brought up to date after every frame, not at the end."""
    writer = FrameWriter(tmp_path, scene)
    for k in range(3):
        writer.add(100 * k, frame(1))
        assert len(Frames.open(tmp_path)) == k + 1


def test_walls_present_at_each_time(written: Path) -> None:
    """The gate is drawn up to and with the step it is removed at, and not after."""
    import meshio
    import pyvista

    reader = pyvista.PVDReader(written / "run.pvd")
    counts = []
    for time in reader.time_values:
        reader.set_active_time_value(time)
        _, walls = reader.read()
        counts.append(walls.n_cells)
    assert counts == [2, 2, 2, 1, 1]
    quads = meshio.read(written / "frames" / "walls_0.vtu").points.reshape(2, 4, 3)
    assert (quads[0][:, 2] == 0).all(), "the floor lies in its plane"
    assert np.ptp(quads[0], axis=0).tolist() == [2, 4, 0], "and is as large as the domain"
    np.testing.assert_allclose((quads[1] - [0.9, 0, 0]) @ [-1, 0, 1], 0, atol=1e-12)


def test_pvd_opens_in_pyvista_with_physical_time(written: Path) -> None:
    import pyvista

    reader = pyvista.PVDReader(written / "run.pvd")
    np.testing.assert_array_equal(reader.time_values, Frames.open(written).times)
    reader.set_active_time_value(reader.time_values[3])
    particles, _ = reader.read()
    assert particles["position"][0, 0] == 0.1 * 3
    assert {"velocity", "radius", "id", "material"} <= set(particles.array_names)


@pytest.mark.skipif(shutil.which("pvpython") is None, reason="no ParaView (apt-get install python3-paraview)")
def test_pvd_opens_in_paraview(written: Path) -> None:
    code = (
        "from paraview.simple import *\n"
        f"r = OpenDataFile({str(written / 'run.pvd')!r}); r.UpdatePipeline()\n"
        "print('times', list(r.TimestepValues))\n"
        "r.UpdatePipeline(r.TimestepValues[3])\n"
        "print('points', r.GetDataInformation().GetNumberOfPoints())\n"
    )
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    done = subprocess.run(
        ["pvpython", "-c", code], capture_output=True, text=True, timeout=120, env=environment, check=True
    )
    assert f"times {Frames.open(written).times.tolist()}" in done.stdout
    assert "points 5" in done.stdout, "one particle and the four corners of the floor"


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"<VTKFile><Collection><DataSet",
        b"<VTKFile><Collection><DataSet part='0'/></Collection></VTKFile>",
    ],
)
def test_broken_pvd(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "run.pvd").write_bytes(content)
    with pytest.raises(FrameError, match=r"run\.pvd: truncated or corrupted"):
        Frames.open(tmp_path)


OUTSIDE = ["/etc/passwd", "../other/p.vtu", "frames/../../p.vtu", "C:/p.vtu", "..\\p.vtu", "//host/p.vtu"]


@pytest.mark.parametrize("name", OUTSIDE)
def test_a_pvd_that_points_out_of_its_folder(name: str, tmp_path: Path) -> None:
    """Of a foreign folder: nothing outside it is opened, whatever its run.pvd says."""
    write_pvd(tmp_path / "run.pvd", [(0.0, 0, "frames/p.vtu"), (1.0, 0, name)])
    with pytest.raises(FrameError, match=r"run\.pvd: file = .* is outside the folder of the run; not read"):
        Frames.open(tmp_path)


def test_a_pvd_with_dots_in_its_names(tmp_path: Path) -> None:
    write_pvd(tmp_path / "run.pvd", [(0.0, 0, "frames/p..vtu"), (1.0, 0, "./a.b/..p.vtu")])
    assert len(Frames.open(tmp_path)) == 2


def test_a_pvd_in_an_unknown_encoding(tmp_path: Path) -> None:
    (tmp_path / "run.pvd").write_bytes(b"<?xml version='1.0' encoding='nonsense'?><VTKFile/>")
    with pytest.raises(FrameError, match=r"run\.pvd: truncated or corrupted"):
        Frames.open(tmp_path)


def test_no_pvd(tmp_path: Path) -> None:
    with pytest.raises(FrameError, match=r"run\.pvd: no such file"):
        Frames.open(tmp_path)


def test_pvd_times_keep_all_digits(tmp_path: Path) -> None:
    write_pvd(tmp_path / "run.pvd", [(0.1 + 0.2, 0, "a.vtu"), (1e-7 / 3, 0, "b.vtu")])
    assert Frames.open(tmp_path).times.tolist() == [0.1 + 0.2, 1e-7 / 3]


# -- the whole run on disk -----------------------------------------------------------------------------------


def test_run_round_trip(scene: Scene, written: Path) -> None:
    import pandas

    trace = {"step": np.arange(3), "time": np.arange(3) * 1e-4, "position": RNG.normal(size=(3, 1, 3))}
    history = pandas.DataFrame({"time": [0.1 + 0.2, 1 / 3], "contacts": [0, 1]})
    timing = Timing(particles=1, steps=400, stepping_s=2.0)
    one = Run("gpudem", "0.1.0", scene, written, timing, ["careful"], {"rebuilds": 3}, trace, history)
    one.save()
    back = Run.load(written)
    assert back.scene == scene
    assert back.timing == timing
    assert back.timing.rate == 200.0
    assert (back.warnings, back.notes) == (["careful"], {"rebuilds": 3})
    assert back.history is not None
    assert back.history["time"].tolist() == [0.1 + 0.2, 1 / 3]
    assert back.trace is not None
    assert back.trace["position"].tobytes() == trace["position"].tobytes()
    assert len(back.frames) == 5


@pytest.mark.parametrize("name", ["run.json", "scene.json"])
@pytest.mark.parametrize("how", ["missing", "cut"])
def test_run_that_is_not_whole(name: str, how: str, scene: Scene, tmp_path: Path) -> None:
    Run("gpudem", "0.1.0", scene, tmp_path, Timing(1, 1, 1.0)).save()
    path = tmp_path / name
    path.unlink() if how == "missing" else path.write_text(path.read_text()[:40])
    with pytest.raises(
        GpudemError, match=name if how == "missing" or name == "scene.json" else str(tmp_path)
    ):
        Run.load(tmp_path)


def test_run_with_a_broken_trace(scene: Scene, tmp_path: Path) -> None:
    Run("gpudem", "0.1.0", scene, tmp_path, Timing(1, 1, 1.0), trace={"time": np.zeros(3)}).save()
    content = (tmp_path / "trace.npz").read_bytes()
    (tmp_path / "trace.npz").write_bytes(content[: len(content) // 2])
    with pytest.raises(GpudemError, match="not a complete run"):
        Run.load(tmp_path)
