"""Particles from files: what is read, and the message for each file that cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gpudem.scene import Scene, SceneError
from tests.bad_scenes import EXPLICIT, GOOD

# fmt: off
PARTICLE_FILES = [
    ("missing", "p.csv", None, ("no such file",)),
    ("suffix", "p.xlsx", b"x,y,z\n", ("unknown suffix; known: .csv, .npz, .vtu",)),
    ("no columns", "p.csv", b"a,b\n1,2\n", ("columns x, y, z needed; found: a, b",)),
    ("empty", "p.csv", b"", ("columns x, y, z needed; found: none",)),
    ("ragged", "p.csv", b"x,y,z,radius\n0,0,0.1,0.003\n0,0\n", ("row 2 has 2 columns; must be 4",)),
    ("not a number", "p.csv", b"x,y,z,radius\n0,0,0.1,0.003\n0,zero,0.1,0.003\n",
        ("y in row 2 is 'zero'; must be a number",)),
    ("nan", "p.csv", b"x,y,z,radius\n0,0,nan,0.003\n", ("position in row 1 is", "must be finite")),
    ("no radius", "p.csv", b"x,y,z\n0,0,0.1\n", ("radius: missing [m]", "has no column radius")),
    ("negative radius", "p.csv", b"x,y,z,radius\n0,0,0.1,-1\n",
        ("radius in row 1 is -1.0; must be finite and positive",)),
    ("unknown column", "p.csv", b"x,y,z,radios\n0,0,0.1,1\n", ("unknown or repeated column 'radios'",)),
    ("rows without particles", "p.csv", b"x,y,z,radius\n", ("no particles",)),
    ("not npz", "p.npz", b"PK garbage", ("not an .npz file",)),
    ("not vtu", "p.vtu", b"<VTKFile", ("truncated or corrupted VTU",)),
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
    path.write_text(GOOD.replace(EXPLICIT, f'source = "file"\npath = "{name}"\n'))
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


def test_npz_without_position(tmp_path: Path) -> None:
    np.savez(tmp_path / "p.npz", place=np.zeros((1, 3)))
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace(EXPLICIT, 'source = "file"\npath = "p.npz"\n'))
    with pytest.raises(SceneError, match="array position needed; found: place"):
        Scene.from_toml(path)
