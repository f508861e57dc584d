"""Particles from files: what is read, and the message for each file that cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gpudem.output.vtu import read_vtu, write_vtu
from gpudem.scene import Scene, SceneError
from gpudem.scene.particle_files import read_particles
from tests.bad_scenes import EXPLICIT, GOOD

MATERIALS = {"a": 0, "b": 1}

# fmt: off
PARTICLE_FILES = [
    ("missing", "p.csv", None, ("no such file",)),
    ("suffix", "p.xlsx", b"x,y,z\n", ("unknown suffix; known: .csv, .npz, .vtu",)),
    ("no columns", "p.csv", b"a,b\n1,2\n", ("columns x, y, z needed; found: a, b",)),
    ("empty", "p.csv", b"", ("columns x, y, z needed; found: none",)),
    ("ragged", "p.csv", b"x,y,z,radius\n0,0,0.1,0.003\n0,0\n", ("row 2 has 2 columns; must be 4",)),
    ("not a number", "p.csv", b"x,y,z,radius\n0,0,0.1,0.003\n0,zero,0.1,0.003\n",
        ("y in row 2 is 'zero'; must be a number",)),
    ("nan", "p.csv", b"x,y,z,radius\n0,0,nan,0.003\n", ("position: row 1 is not a finite number [m]",)),
    ("no radius", "p.csv", b"x,y,z\n0,0,0.1\n", ("radius: missing [m]", "has no column radius")),
    ("negative radius", "p.csv", b"x,y,z,radius\n0,0,0.1,-1\n",
        ("radius: row 1 = -1 out of range; allowed: 0 < value [m]",)),
    ("unknown column", "p.csv", b"x,y,z,radios\n0,0,0.1,1\n", ("unknown or repeated column 'radios'",)),
    ("rows without particles", "p.csv", b"x,y,z,radius\n", ("no particles",)),
    ("not npz", "p.npz", b"PK garbage", ("not an .npz archive",)),
    ("not vtu", "p.vtu", b"<VTKFile", ("truncated or corrupted VTU",)),
    ("two of three components", "p.csv", b"x,y,z,radius,vx,vy\n0,0,0.1,0.003,1,2\n",
        ("columns vx, vy, vz belong together; missing: vz",)),
    ("one of three components", "p.csv", b"x,y,z,radius,wy\n0,0,0.1,0.003,1\n", ("missing: wx, wz",)),
    ("semicolons", "p.csv", b"x;y;z;radius\n0;0;0,1;0,003\n",
        ("columns are separated by ';'; must be separated by ','",)),
    ("tabs", "p.csv", b"x\ty\tz\tradius\n0\t0\t0.1\t0.003\n", ("columns are separated by '\\t'",)),
    ("blanks", "p.csv", b"x y z radius\n0 0 0.1 0.003\n", ("columns are separated by ' '",)),
    ("two headers the same", "p.csv", b"x,y,z,radius,x\n0,0,0.1,0.003,1\n",
        ("unknown or repeated column 'x'",)),
    ("Latin-1", "p.csv", b"x,y,z,radius\n0,0,0.1,0.003\xe9\n", ("not a text file: byte 26 is not UTF-8",)),
    ("UTF-16", "p.csv", "x,y,z,radius\n0,0,0.1,0.003\n".encode("utf-16"),
        ("not a text file: byte 0 is not UTF-8",)),
    ("binary", "p.csv", b"x,y,z,radius\n0,0,0.1,\x00\n", ("radius in row 1 is", "must be a number")),
    ("field without end", "p.csv", b"x,y,z,radius\n0,0,0.1," + b"1" * 200_000,
        ("not a table separated by commas",)),
    ("digit groups", "p.csv", b"x,y,z,radius\n0,0,0.1,1_000\n",
        ("radius in row 1 is '1_000'; must be a number",)),
    ("far away", "p.csv", b"x,y,z,radius\n0,0,1e19,0.003\n",
        ("position: row 1 is too large", "<= 1e+18 [m]")),
    ("radius of a metre in a column of millimetres", "p.csv", b"x,y,z,radius\n0,0,0.1,1e20\n",
        ("radius: row 1 is too large", "<= 1e+18 [m]")),
    ("spin without end", "p.csv", b"x,y,z,radius,wx,wy,wz\n0,0,0.1,0.003,0,inf,0\n",
        ("angular_velocity: row 1 is not a finite number [rad/s]",)),
    ("unknown material", "p.csv", b"x,y,z,radius,material\n0,0,0.1,0.003,steel\n",
        ("material: row 1 is 'steel'; must be the name or the index of a material", "0 or ps, 1 or acrylic")),
    ("index of no material", "p.csv", b"x,y,z,radius,material\n0,0,0.1,0.003,0\n0,0.02,0.1,0.003,2\n",
        ("material: row 2 is '2'; must be",)),
    ("half a material", "p.csv", b"x,y,z,radius,material\n0,0,0.1,0.003,0.5\n",
        ("material: row 1 is '0.5'",)),
    ("ids of a part", "p.csv", b"id,x,y,z,radius\n2,0,0,0.1,0.003\n3,0.02,0,0.1,0.003\n",
        ("id: found 2; must be 1 to 2, each once; leave the column out",)),
    ("id twice", "p.csv", b"id,x,y,z,radius\n1,0,0,0.1,0.003\n1,0.02,0,0.1,0.003\n",
        ("id: found 1; must be 1 to 2",)),
    ("npz named csv", "p.csv", b"PK\x03\x04\x14\x00\x00\x00\xff\xfe", ("not a text file",)),
    ("csv named npz", "p.npz", b"x,y,z\n0,0,0\n", ("not an .npz archive",)),
    ("csv named vtu", "p.vtu", b"x,y,z\n0,0,0\n", ("truncated or corrupted VTU",)),
    ("empty npz", "p.npz", b"", ("not an .npz archive",)),
    ("empty vtu", "p.vtu", b"", ("truncated or corrupted VTU",)),
    ("nul in the name", "p\x00.csv", None, ("p\\x00.csv': ",)),
    ("name longer than any", "p" * 300 + ".csv", None, ("cannot be read: File name too long",)),
]
# fmt: on


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [row[1:] for row in PARTICLE_FILES],
    ids=[row[0] for row in PARTICLE_FILES],
)
def test_particle_file(name: str, content: bytes | None, expected: tuple[str, ...], tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    path = tmp_path / "scene.toml"
    escaped = name.replace("\x00", "\\u0000")
    path.write_text(GOOD.replace(EXPLICIT, f'source = "file"\npath = "{escaped}"\n'))
    with pytest.raises(SceneError) as caught:
        Scene.from_toml(path)
    assert len(caught.value.problems) == 1
    for fragment in (str(tmp_path) if name in str(caught.value) else "particles", *expected):
        assert fragment in str(caught.value)


def test_csv_columns_arrive_where_they_belong(tmp_path: Path) -> None:
    """Columns in any order, radius and spin included; y taken for z would show."""
    (tmp_path / "p.csv").write_text("radius,z,y,x,wx,wy,wz,vx,vy,vz\n0.003,0.1,0.02,0.01,1,2,3,4,5,6\n")
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace(EXPLICIT, 'source = "file"\npath = "p.csv"\n').replace("1e-5", "1e-6"))
    state = Scene.from_toml(path).state
    assert state.position.tolist() == [[0.01, 0.02, 0.1]]
    assert state.velocity.tolist() == [[4, 5, 6]]
    assert state.angular_velocity.tolist() == [[1, 2, 3]]
    assert state.radius.tolist() == [0.003]


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"], ids=["plain", "byte order mark"])
@pytest.mark.parametrize("end", [b"\n", b"\r\n"], ids=["lf", "crlf"])
def test_csv_as_spreadsheets_write_it(mark: bytes, end: bytes, tmp_path: Path) -> None:
    """A byte order mark, quoted headers, blanks and blank lines are no part of the numbers or names."""
    text = mark + end.join([b'x,"y", z,radius', b"0.01, 0.02 ,0.1,0.003", b"", b"0.04,0.02,0.1,0.003", b""])
    (tmp_path / "P.CSV").write_bytes(text)
    state = read_particles(tmp_path / "P.CSV", MATERIALS, "b").state
    assert state.position.tolist() == [[0.01, 0.02, 0.1], [0.04, 0.02, 0.1]]
    assert state.material.tolist() == [1, 1]


ARRAYS = {"position": np.array([[0.0, 0, 0.1], [0.02, 0, 0.1]]), "radius": np.full(2, 0.003)}
# fmt: off
BAD_ARRAYS = [
    ("unknown", {"velocities": np.zeros((2, 3))}, "unknown array 'velocities'; known: position, velocity,"),
    ("complex", {"velocity": np.ones((2, 3)) * 1j}, r"velocity: must be numbers, shape \(n, 3\) \[m/s\]"),
    ("text", {"velocity": np.full((2, 3), "1")}, "velocity: must be numbers"),
    ("booleans", {"radius": np.array([True, True])}, "radius: must be numbers"),
    ("dates", {"radius": np.array(["2026-01-01"] * 2, "datetime64[D]")}, "radius: must be numbers"),
    ("record", {"radius": np.zeros(2, [("r", float)])}, "radius: must be numbers"),
    ("0-d position", {"position": np.array(1.0)}, r"position: has shape \(\); must be \(n, 3\)"),
    ("0-d velocity", {"velocity": np.array(1.0)}, r"velocity: has shape \(\)"),
    ("0-d complex radius", {"radius": np.array(1j)}, r"radius: must be a number \[m\]"),
    ("0-d radius of 0", {"radius": np.array(0.0)}, "radius: out of range"),
    ("flat position", {"position": np.zeros(6)}, r"position: has shape \(6,\)"),
    ("two components", {"velocity": np.zeros((2, 2))}, r"velocity: has shape \(2, 2\)"),
    ("column vector", {"radius": np.full((2, 1), 0.003)}, r"radius: has shape \(2, 1\); must be \(n,\)"),
    ("one row short", {"velocity": np.zeros((1, 3))}, "velocity has 1 rows; must have one for each of the 2"),
    ("radius row", {"radius": np.full(3, 0.003)}, "radius has 3 rows"),
    ("nan", {"velocity": np.full((2, 3), np.nan)}, "velocity: row 1 is not a finite number"),
    ("long double", {"velocity": np.full((2, 3), np.longdouble("1e4000"))},
        "velocity: row 1 is not a finite"),
    ("material of bytes", {"material": np.array([b"a", b"b"])}, "material: must be the name or the index"),
    ("material of booleans", {"material": np.array([True, False])},
        "material: must be the name or the index"),
    ("negative material", {"material": np.array([0, -1])}, "material: row 2 is -1; must be"),
    ("material table", {"material": np.zeros((2, 1), int)}, r"material: has shape \(2, 1\)"),
    ("material row", {"material": np.zeros(3, int)}, "material has 3 rows"),
    ("ids from 0", {"id": np.array([0, 1])}, "id: found 0; must be 1 to 2, each once"),
    ("id row", {"id": np.array([1])}, "id: must be 1 to 2"),
    ("points elsewhere", {"points": np.zeros((3, 3))}, "position: has 2 rows; the file has 3 points"),
]
# fmt: on


@pytest.mark.parametrize(
    ("arrays", "expected"), [row[1:] for row in BAD_ARRAYS], ids=[row[0] for row in BAD_ARRAYS]
)
def test_array_that_cannot_be_used(arrays: dict, expected: str, tmp_path: Path) -> None:
    """Refused by name, and with nothing of NumPy's own: no cast of complex numbers, text or booleans."""
    np.savez(tmp_path / "p.npz", **(ARRAYS | arrays))
    with pytest.raises(ValueError, match=expected) as caught:
        read_particles(tmp_path / "p.npz", MATERIALS, "a")
    assert str(caught.value).startswith(f"path = '{tmp_path / 'p.npz'}': ")


def test_arrays_of_other_kinds_of_number(tmp_path: Path) -> None:
    """Integers, float32, byte-swapped, one radius and one material for all: used with their values."""
    np.savez(tmp_path / "p.npz", position=np.array([[1, 2, 3], [4, 5, 6]], ">i2"), material=np.array("b"),
             velocity=np.full((2, 3), 0.1, np.float32), radius=np.array(0.25, ">f4"))  # fmt: skip
    state = read_particles(tmp_path / "p.npz", MATERIALS).state
    assert state.position.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert state.velocity[0, 0] == float(np.float32(0.1))
    assert state.radius.tolist() == [0.25, 0.25]
    assert state.material.tolist() == [1, 1]
    assert all(column.flags.c_contiguous and not column.flags.writeable for column in vars(state).values())


@pytest.mark.parametrize(
    "column", [["b", "a"], [1, 0], [1.0, 0.0], ["1.0", "a"]], ids=["names", "indices", "floats", "both"]
)
@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_material_column_acts(column: list, suffix: str, tmp_path: Path) -> None:
    """Names or indices in order of statement, over what the scene states, which then has a warning."""
    path = tmp_path / f"p{suffix}"
    if suffix == ".npz":
        np.savez(path, **ARRAYS, material=np.array(column))
    else:
        whole = [int(m) if isinstance(m, float) else m for m in column]
        path.write_text(
            "x,y,z,radius,material\n" + "".join(f"{k},0,1,0.003,{m}\n" for k, m in enumerate(whole))
        )
    assert read_particles(path, MATERIALS).state.material.tolist() == [1, 0]
    assert read_particles(path, MATERIALS).warnings == ()
    found = read_particles(path, MATERIALS, "a", 0.5)
    assert found.state.material.tolist() == [1, 0]
    assert found.warnings == (
        "particles.radius = 0.5 m: no effect, the file has a column radius",
        "particles.material = 'a': no effect, the file has a column material (0 is 'a', the scene's first)",
    )
    np.savez(tmp_path / "same.npz", **ARRAYS, material=[0, 0])
    assert read_particles(tmp_path / "same.npz", MATERIALS, "a", 0.003).warnings == ()


def test_a_file_without_materials_needs_one(tmp_path: Path) -> None:
    np.savez(tmp_path / "p.npz", **ARRAYS)
    with pytest.raises(ValueError, match="has no column material; material: missing"):
        read_particles(tmp_path / "p.npz", MATERIALS)


def test_particles_come_in_order_of_id(tmp_path: Path) -> None:
    """Particle k of the scene is particle k of the file in all columns; a sort of some would mix them."""
    np.savez(tmp_path / "p.npz", id=[3, 1, 2], position=np.eye(3), velocity=2 * np.eye(3), radius=[3, 1, 2],
             angular_velocity=3 * np.eye(3), material=[1, 0, 0])  # fmt: skip
    state = read_particles(tmp_path / "p.npz", MATERIALS).state
    expected = np.eye(3)[[1, 2, 0]]
    assert np.array_equal(state.position, expected)
    assert np.array_equal(state.velocity, 2 * expected)
    assert np.array_equal(state.angular_velocity, 3 * expected)
    assert state.radius.tolist() == [1, 2, 3]
    assert state.material.tolist() == [0, 0, 1]


def frame(n: int = 4) -> dict[str, np.ndarray]:
    """A frame with all columns that the codes write, of two materials and radii."""
    rng = np.random.default_rng(2)
    vectors = {
        name: rng.normal(size=(n, 3)) for name in ("position", "velocity", "angular_velocity", "force")
    }
    return {
        "id": np.arange(1, n + 1), "material": np.arange(n, dtype=np.int32) % 2, **vectors,
        "torque": rng.normal(size=(n, 3)), "radius": 0.003 + 0.001 * np.arange(n),
    }  # fmt: skip


def test_a_frame_comes_back_to_the_bit(tmp_path: Path) -> None:
    """All columns of our own frames are known; force and torque follow from the state."""
    write_vtu(tmp_path / "p.vtu", frame())
    np.savez(tmp_path / "p.npz", **read_vtu(tmp_path / "p.vtu"))
    for name in ("p.vtu", "p.npz"):
        found = read_particles(tmp_path / name, MATERIALS)
        assert found.warnings == ()
        for column, values in vars(found.state).items():
            assert np.array_equal(values, frame()[column])


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_moved_points_are_used_and_said(dtype: type, tmp_path: Path) -> None:
    """ParaView's filters move points, not the array `position`; float32 points are no move."""
    one = frame()
    moved = one["position"] + [0.0, 0.25, 0.0]
    np.savez(tmp_path / "p.npz", **one, points=moved.astype(dtype))
    found = read_particles(tmp_path / "p.npz", MATERIALS)
    assert np.array_equal(found.state.position, moved.astype(dtype))
    assert len(found.warnings) == 1
    assert "points of the file lie up to 0.25 m from its array position" in found.warnings[0]
    np.savez(tmp_path / "p.npz", **one, points=one["position"].astype(np.float32))
    found = read_particles(tmp_path / "p.npz", MATERIALS)
    assert np.array_equal(found.state.position, one["position"])
    assert found.warnings == ()


def test_an_array_twice_is_refused(tmp_path: Path) -> None:
    """A reader of XML gives the last of two arrays of one name."""
    write_vtu(tmp_path / "p.vtu", frame())
    content = (tmp_path / "p.vtu").read_bytes()
    assert content.count(b'Name="velocity"') == 1
    (tmp_path / "p.vtu").write_bytes(content.replace(b'Name="force"', b'Name="velocity"'))
    with pytest.raises(ValueError, match=r"p\.vtu': array 'velocity' given twice"):
        read_particles(tmp_path / "p.vtu", MATERIALS)


def test_points_alone_are_positions(tmp_path: Path) -> None:
    """A .vtu of another program has its positions as points only; arrays of cells are refused by name."""
    import meshio

    points, cells = np.eye(3), [("vertex", np.arange(3).reshape(-1, 1))]
    meshio.Mesh(points, cells).write(tmp_path / "p.vtu")
    state = read_particles(tmp_path / "p.vtu", MATERIALS, "b", 0.25).state
    assert np.array_equal(state.position, points)
    assert state.radius.tolist() == [0.25] * 3
    meshio.Mesh(points, cells, cell_data={"velocity": [np.ones((3, 3))]}).write(tmp_path / "p.vtu")
    with pytest.raises(ValueError, match="array 'velocity' belongs to cells; particles are points"):
        read_particles(tmp_path / "p.vtu", MATERIALS, "b", 0.25)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed], ids=["stored", "compressed"])
def test_a_damaged_archive_is_a_scene_error(save, tmp_path: Path) -> None:
    """Catches zlib.error and its like reaching the user."""
    save(tmp_path / "p.npz", **ARRAYS)
    content = bytearray((tmp_path / "p.npz").read_bytes())
    content[150:200] = bytes(50)
    (tmp_path / "p.npz").write_bytes(content)
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace(EXPLICIT, 'source = "file"\npath = "p.npz"\n'))
    with pytest.raises(SceneError, match=r"p\.npz: truncated or corrupted \.npz archive") as caught:
        Scene.from_toml(path)
    assert len(caught.value.problems) == 1


def test_npz_without_position(tmp_path: Path) -> None:
    np.savez(tmp_path / "p.npz", place=np.zeros((1, 3)))
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace(EXPLICIT, 'source = "file"\npath = "p.npz"\n'))
    with pytest.raises(SceneError, match="array position needed; found: place"):
        Scene.from_toml(path)
