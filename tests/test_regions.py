"""Regions of insertions: depth and volume against membership written down again here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from comparisons.oracles.mesh_shapes import cube, faceted_sphere
from gpudem.scene.regions import FACES, REGIONS, Region, winding_number
from tests.test_mesh_files import ascii_stl

BLOCK = {"kind": "block", "lo": (-0.3, -0.2, -0.1), "hi": (0.3, 0.25, 0.4)}
SPHERE = {"kind": "sphere", "center": (0.1, 0.0, 0.1), "radius": 0.3}
CYLINDER = {"kind": "cylinder", "point": (-0.1, 0.0, -0.2), "axis": (1, 2, 2), "length": 0.5, "radius": 0.2}
CONE = {**CYLINDER, "kind": "cone", "end_radius": 0.05}
TIP = {**CYLINDER, "kind": "cone", "radius": 0.0, "end_radius": 0.3}
UNION = {"kind": "union", "parts": (BLOCK, SPHERE)}
CUT = {"kind": "cut", "part": BLOCK, "without": SPHERE}
EXACT = {"block": BLOCK, "sphere": SPHERE, "cylinder": CYLINDER, "cone": CONE, "tip": TIP}
BOUNDED = {"union": UNION, "cut": CUT}
POINTS = np.random.default_rng(5).uniform(-0.5, 0.6, (4000, 3))
#: Directions in which a surface is searched for.
WAYS = np.random.default_rng(6).normal(size=(400, 3))
WAYS /= np.linalg.norm(WAYS, axis=1)[:, None]


def made(stated: dict[str, Any]) -> Region:
    return REGIONS[stated["kind"]](**stated)


def inside(stated: dict[str, Any], x: np.ndarray) -> np.ndarray:
    """Membership from its definition."""
    match stated["kind"]:
        case "block":
            return ((x > stated["lo"]) & (x < stated["hi"])).all(axis=-1)
        case "sphere":
            return np.linalg.norm(x - stated["center"], axis=-1) < stated["radius"]
        case "cylinder" | "cone":
            axis = np.array(stated["axis"]) / np.linalg.norm(stated["axis"])
            z = (x - stated["point"]) @ axis
            rho = np.linalg.norm(np.cross(x - stated["point"], axis), axis=-1)
            end = stated.get("end_radius", stated["radius"])
            share = z / stated["length"]
            return (share > 0) & (share < 1) & (rho < stated["radius"] * (1 - share) + end * share)
        case "union":
            return np.any([inside(part, x) for part in stated["parts"]], axis=0)
        case _:
            return inside(stated["part"], x) & ~inside(stated["without"], x)


@pytest.mark.parametrize("name", [*EXACT, *BOUNDED])
def test_no_point_within_the_depth_is_on_the_other_side(name):
    """Detects: a depth above the distance from the surface, so that a particle reaches out of the region."""
    stated = {**EXACT, **BOUNDED}[name]
    depth = made(stated).depth(POINTS)
    assert np.array_equal(depth > 0, inside(stated, POINTS))
    assert 20 < (depth > 0).sum() < 3000
    around = POINTS[:, None] + 0.999 * np.abs(depth)[:, None, None] * WAYS
    assert (inside(stated, around) == (depth > 0)[:, None]).all()


@pytest.mark.parametrize("name", EXACT)
def test_the_depth_is_the_distance(name):
    """Detects: a depth below the distance, which would leave part of the region empty."""
    stated = EXACT[name]
    depth = made(stated).depth(POINTS)
    far = np.abs(depth) > 0.02
    reach = np.abs(depth[far])[:, None, None] * 1.15 + 1e-3
    across = inside(stated, POINTS[far][:, None] + reach * WAYS) != (depth[far] > 0)[:, None]
    assert across.any(axis=1).mean() > 0.93  # of 400 directions few lead to a tip


@pytest.mark.parametrize("name", [*EXACT, *BOUNDED])
def test_volume_and_bounds(name):
    """Detects: another volume, by which a volume fraction is missed; bounds that cut a part off."""
    stated = {**EXACT, **BOUNDED}[name]
    region, rng = made(stated), np.random.default_rng(8)
    points = rng.uniform(-0.6, 0.7, (400_000, 3))
    within = inside(stated, points)
    share, error = within.mean(), np.sqrt(within.mean() / len(points))
    assert region.volume == pytest.approx(share * 1.3**3, abs=4 * error * 1.3**3)
    low, high = region.bounds()
    assert ((points[within] > low) & (points[within] < high)).all()
    assert (np.ptp(points[within], axis=0) > 0.9 * (high - low)).all()


@pytest.mark.parametrize(("name", "corners"), [("cube", cube(0.4)), ("sphere", faceted_sphere(0.2, 2))])
def test_inside_of_a_mesh(name, corners, tmp_path: Path):
    """Detects: inside and outside exchanged, a mesh that is not scaled, turned or moved, another volume."""
    (tmp_path / "part.stl").write_text(ascii_stl(1000 * corners))
    region = made({"kind": "mesh", "file": str(tmp_path / "part.stl"), "scale": 1e-3, "move": (0.1, 0, 0)})
    x = POINTS - (0.1, 0, 0)
    depth = region.depth(POINTS)
    if name == "cube":
        assert np.array_equal(depth > 0, (np.abs(x) < 0.2).all(axis=1))
        assert region.volume == pytest.approx(0.4**3, rel=1e-6)
        assert depth[depth > 0] == pytest.approx((0.2 - np.abs(x).max(axis=1))[depth > 0], abs=1e-8)
    else:
        radius = np.linalg.norm(x, axis=1)
        assert (depth[radius < 0.19] > 0).all()
        assert (depth[radius > 0.2] < 0).all()
        assert region.volume == pytest.approx(4 / 3 * np.pi * 0.2**3, rel=0.05)


def test_winding_number():
    """Detects: a solid angle of another sign or factor; a surface seen from inside out counts the same."""
    for corners, sign in ((cube(1.0), 1), (cube(1.0)[:, ::-1], -1)):
        found = winding_number(np.array([(0, 0, 0), (0.4, 0.3, -0.49), (0.6, 0, 0), (5, 5, 5)]), corners)
        assert found == pytest.approx([sign, sign, 0, 0], abs=1e-12)


@pytest.mark.parametrize("change", ["open", "one face turned"])
def test_a_mesh_that_is_not_closed(change, tmp_path: Path):
    """Detects: an inside of a surface that has none."""
    corners = cube(0.4)[1:] if change == "open" else np.concatenate([cube(0.4)[:1, ::-1], cube(0.4)[1:]])
    (tmp_path / "part.stl").write_text(ascii_stl(corners))
    region = made({"kind": "mesh", "file": str(tmp_path / "part.stl")})
    with pytest.raises(
        ValueError, match=r"'part\.stl': (not closed|neighboring triangles face opposite ways)"
    ):
        region.bounds()


@pytest.mark.parametrize(
    ("stated", "area"),
    [
        ({"kind": "disc", "center": (0.1, 0, 0), "axis": (0, 3, 4), "radius": 0.3}, np.pi * 0.2**2),
        ({"kind": "rectangle", "corner": (0.1, 0, 0), "edges": ((0.3, 0, 0), (0, 0.3, 0.4))}, 0.1 * 0.3),
    ],
    ids=["disc", "rectangle"],
)
def test_faces(stated, area):
    """Detects: points beside the plane or beyond the rim, a wrong area for centers."""
    face = FACES[stated["kind"]](**stated)
    points = face.points(np.random.default_rng(1).random((20_000, 3)))
    origin = np.array(stated.get("center", stated.get("corner")))
    assert np.abs((points - origin) @ face.normal).max() < 1e-15
    depth = face.depth(points)
    share = (depth > 0.1).mean()
    side = 0.6**2 if stated["kind"] == "disc" else 0.3 * 0.5
    assert face.inner_area(0.1) == pytest.approx(area)
    assert share * side == pytest.approx(area, rel=0.05)
    low, high = face.bounds()
    kept = points[depth >= 0]
    assert ((kept >= low - 1e-12) & (kept <= high + 1e-12)).all()
    assert np.ptp(kept, axis=0) == pytest.approx(high - low, abs=0.01)
