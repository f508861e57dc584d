"""A mesh is the surface that it stands for: floor, box and cylinder; and the rules at single places."""

from __future__ import annotations

import functools
import math

import numpy as np

from comparisons import kit
from comparisons.cases.side_by_side import LIGGGHTS_RULE, OWN_RULE, mesh
from comparisons.cases.walls.scenes import (
    COLUMNS,
    RADIUS,
    every_column,
    no_contact,
    on_floor,
    scale,
    scene,
)
from comparisons.metrics.trace import largest_difference
from comparisons.oracles.mesh_contacts import LiggghtsRule, Surface
from comparisons.oracles.mesh_shapes import (
    corner,
    cube,
    faceted_cylinder,
    faceted_sphere,
    positions_near,
    rectangle,
    shuffled,
)
from comparisons.report import plots
from gpudem.output.run import Run
from gpudem.scene import Scene

DURATION = 0.05
SIDE = 0.03
#: Radius of the cylinder [m], and how many facets stand for it, by rule. The surface of n facets rises and
#: falls by (DRUM - RADIUS) pi^2/(2 n^2): 0.2 of the overlap at rest for 480, 0.8 for 240, where the ball
#: jumps.
DRUM = 0.015
FACETS = {OWN_RULE: (480, 960, 1920), LIGGGHTS_RULE: (240, 480, 960)}
BOTH = 960
#: Angles of the rules: within it contacts are one, or triangles one plane [deg]; defaults of the scene.
MERGE, CURVATURE = 21.0, 0.256235
#: Positions of each shape of the census.
COUNT: dict[kit.Tier, int] = {"quick": 125, "standard": 500, "full": 2500}
SHAPES = {
    "floor and wall": corner(np.pi / 2, 2 * RADIUS),
    "cube": shuffled(cube(4 * RADIUS), 1),
    "ridge of 10 degrees": corner(np.radians(-10), 2 * RADIUS),
    "faceted sphere": shuffled(faceted_sphere(4 * RADIUS, 0), 2),
}


def floor_of(kind: str) -> list[dict]:
    """The floor z = 0: a plane, or 512 triangles in a random order."""
    if kind == "plane":
        normal = (0, 0, 1)
        return [{"kind": "plane", "name": "floor", "material": "wall", "point": (0, 0, 0), "normal": normal}]
    flat = rectangle((-SIDE, -SIDE, 0), (2 * SIDE, 0, 0), (0, 2 * SIDE, 0), (16, 16))
    return [mesh("floor", shuffled(flat, 3))]


def over_floor(kind: str, rule: str) -> Scene:
    """Along a row of nodes, along edges, across faces at an angle, and one that bounces."""
    deep, _ = on_floor()
    high = RADIUS - deep
    position = [[-0.02, 0.0, high], [-0.02, 0.0113, high], [0.017, -0.019, high], [0.02, -0.0075, 0.0045]]
    velocity = [[0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [-0.43, 0.11, 0.0], [-0.3, 0.0, -0.3]]
    spin = [[20.0, -30.0, 5.0], [0.0, 0.0, 0.0], [50.0, 50.0, 0.0], [0.0, 0.0, 40.0]]
    name = f"floor_{kind}"
    return scene(name, floor_of(kind), position, velocity, spin, duration=DURATION, rule=rule)


def in_box(kind: str, rule: str) -> Scene:
    """Into edges and corners of a box: two and three contacts at once."""
    half = 0.012
    walls = [mesh("box", shuffled(cube(2 * half), 4))]
    if kind == "plane":
        walls = [{"kind": "box", "name": "box", "material": "wall", "lo": (-half,) * 3, "hi": (half,) * 3}]
    position = [[0.0, 0.0, -0.0075], [0.0, 0.007, 0.0], [-0.005, -0.006, 0.003]]
    velocity = [[0.9, 0.8, -0.2], [0.8, 0.9, 0.8], [-0.7, -0.6, 0.5]]
    return scene(f"box_{kind}", walls, position, velocity, 30.0, duration=DURATION, rule=rule)


def in_drum(facets: int | None, rule: str = "unique") -> Scene:
    """Down the inside of a lying cylinder, or of its facets, from rest at 60 degrees."""
    walls = [{"kind": "cylinder", "name": "drum", "material": "wall", "radius": DRUM, "point": (0, 0, 0),
              "axis": (0, 1, 0)}]  # fmt: skip
    if facets:
        walls = [mesh("drum", faceted_cylinder(facets, DRUM, 0.02))]
    way, deep = DRUM - RADIUS, on_floor()[0]
    place = [[-(way + deep / 2) * np.sin(np.pi / 3), 0.001, -(way + deep / 2) * np.cos(np.pi / 3)]]
    return scene("drum", walls, place, 0.0, duration=2 * DURATION, rule=rule)


@functools.cache
def places(shape: str, count: int) -> np.ndarray:
    """Random places [m] at which a ball touches a shape."""
    return positions_near(SHAPES[shape], RADIUS, count, seed=5)


def census(shape: str, tier: kit.Tier, rule: str) -> Scene:
    """A ball at each place, each at a copy of the shape of its own; the forces of the set-up count."""
    corners, position = SHAPES[shape], places(shape, COUNT[tier])
    count = int(np.ceil(len(position) ** (1 / 3)))
    pitch = 2 * float(np.abs(corners).max()) + 6 * RADIUS
    at = pitch * (np.stack(np.unravel_index(np.arange(len(position)), (count,) * 3), 1) - (count - 1) / 2)
    copies = (corners + at[:, None, None, :]).reshape(-1, 3, 3)
    return scene(
        "census", [mesh("copies", copies)], position + at, 0.0, duration=1e-5, rule=rule, friction=0.0,
        restitution=1.0, half=pitch * (count + 1) / 2, gravity=(0.0, 0.0, 0.0), allow=("overlap",),
    )  # fmt: skip


def by_rule(shape: str, tier: kit.Tier, rule: str) -> np.ndarray:
    """Sum of the Hertz forces of the contacts that a rule states, by brute force [N], shape (n, 3)."""
    corners, (_, c) = SHAPES[shape], on_floor()

    def contacts(x: np.ndarray) -> list[tuple[float, np.ndarray]]:
        if rule == OWN_RULE:
            return Surface(corners).unique_contacts(x, RADIUS, np.radians(MERGE))
        return LiggghtsRule(corners, np.radians(CURVATURE)).contacts(x, RADIUS)

    return np.array([
        sum((c.normal_constant * (RADIUS - gap) ** 1.5 * n for gap, n in contacts(x)), np.zeros(3))
        for x in places(shape, COUNT[tier])
    ])  # fmt: skip


def variants(tier: kit.Tier) -> list[kit.Variant]:
    """Planes once; meshes by both rules, that of gpudem's own through gpudem alone."""
    own = ("gpudem",)
    found = [kit.Variant("plane_floor", over_floor("plane", "unique"))]
    found += [kit.Variant("plane_box", in_box("plane", "unique"))]
    found += [kit.Variant("cylinder", in_drum(None))]
    for rule, codes in ((OWN_RULE, own), (LIGGGHTS_RULE, None)):
        found += [kit.Variant(f"{rule}_floor", over_floor("mesh", rule), codes)]
        found += [kit.Variant(f"{rule}_box", in_box("mesh", rule), codes)]
        found += [
            kit.Variant(f"{rule}_census_{shape.replace(' ', '_')}", census(shape, tier, rule), codes)
            for shape in SHAPES
        ]
        found += [kit.Variant(f"{rule}_facets_{n}", in_drum(n, rule), codes) for n in FACETS[rule]]
    return found


def from_surface(results: kit.Results, code: str) -> dict[str, float]:
    """Largest difference of a mesh from the plane or box, all columns, relative."""
    found = {}
    for what in ("floor", "box"):
        plane = results[f"plane_{what}", code]
        found[f"{what}, plane {no_contact(plane)}"] = math.nan if no_contact(plane) else 0.0
        for rule in FACETS:
            if (f"{rule}_{what}", code) in results.runs:
                run = results[f"{rule}_{what}", code]
                found[f"{what}, {rule}"] = max(
                    largest_difference(run.trace[c], plane.trace[c], scale(plane, c)) for c in COLUMNS
                )
    return found


def census_error(results: kit.Results, code: str, rule: str) -> dict[str, np.ndarray]:
    """Error of the force at each place, by the largest force of the shape."""

    def compute() -> dict[str, np.ndarray]:
        found = {}
        for shape in SHAPES:
            label = f"{rule}_census_{shape.replace(' ', '_')}"
            want = by_rule(shape, results.tier, rule)
            gap = np.linalg.norm(results[label, code].trace["force"][0] - want, axis=1)
            found[shape] = gap / np.linalg.norm(want, axis=1).max()
        return found

    return results.once(("census", code, rule), compute)


def differ(results: kit.Results, code: str, rule: str) -> kit.Measured:
    """Share of places at which the force is not that of the rule."""
    errors = np.concatenate(list(census_error(results, code, rule).values()))
    return kit.Measured(float((errors > 1e-6).mean()), note=f"{len(errors)} places, {len(SHAPES)} shapes")


def from_cylinder(results: kit.Results, label: str, code: str) -> float:
    """Largest distance of the ball from its way in the cylinder, by the radius of the ball."""
    way, there = (results[name, code].trace["position"] for name in (label, "cylinder"))
    return largest_difference(way, there, RADIUS)


def order(results: kit.Results) -> kit.Measured:
    """Order in the number of facets in which the way of the ball tends to that in the cylinder."""
    facets = FACETS["unique"]
    errors = [from_cylinder(results, f"unique_facets_{n}", "gpudem") for n in facets]
    value = -float(np.polyfit(np.log(facets), np.log(errors), 1)[0])
    return kit.Measured(value, note=", ".join(f"{n}: {e:.2g} R" for n, e in zip(facets, errors, strict=True)))


def nothing(run: Run) -> str:
    """The same for any variant; balls of the census stay where they are, and all feel a force."""
    if run.scene.name != "census":
        return no_contact(run)
    return "" if np.linalg.norm(run.trace["force"][0], axis=-1).all() else "a ball without contact"


def rules_apart(results: kit.Results) -> kit.Measured:
    """Largest error of the ball's way over the finest facets by LIGGGHTS' rule, beside that of gpudem's."""
    ours, theirs = (from_cylinder(results, f"{r}_facets_{BOTH}", "gpudem") for r in FACETS)
    return kit.Measured(theirs / ours, note=f"{theirs:.2g} R and {ours:.2g} R with {BOTH} facets")


def draw(results: kit.Results) -> plots.Figure:
    """Ways over floor and in the box from above, of planes and meshes; distance from the cylinder."""
    figure, axes = plots.figure(1, 3, width=plots.WHOLE, height=2.9)
    for axis, what in zip(axes, ("floor", "box"), strict=False):
        labels = {"plane": f"plane_{what}", "mesh": f"liggghts_{what}"}
        for k, (name, label) in enumerate(labels.items()):
            for code in results.codes(label):
                x = 1e3 * results[label, code].trace["position"]
                for row in range(x.shape[1]):
                    look = plots.style(code, markevery=(100 * k, 400))
                    look |= {"label": f"{plots.name(code)}, {name}" if row == 0 else None}
                    axis.plot(x[:, row, 0], x[:, row, 1], **look)
        axis.set(title=what, xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    for rule, facets in FACETS.items():
        for code in results.codes(f"{rule}_facets_{BOTH}"):
            far = [from_cylinder(results, f"{rule}_facets_{n}", code) for n in facets]
            look = plots.style(code, marker="s" if rule == OWN_RULE else "o", markerfacecolor="none")
            axes[2].loglog(facets, far, **look | {"label": f"{plots.name(code)}, '{rule}'"})
    counts = sorted(set().union(*FACETS.values()))
    axes[2].set(title="off the way in the cylinder", xlabel="facets", ylabel="distance / R")
    axes[2].set_xticks(counts, [str(n) for n in counts])
    axes[2].minorticks_off()
    plots.legend(axes[2])
    return figure


CASE = kit.Case(
    name="mesh_plane",
    title="Meshes and the surfaces they stand for",
    purpose=(
        "Balls roll and bounce over a floor of 512 triangles in a random order, along edges and through"
        " nodes, and into edges and corners of a box of 12: as on planes, to rounding, by both rules of mesh"
        " contacts. Down the inside of a cylinder of facets a ball goes as in the cylinder, the closer the"
        " finer the facets, by gpudem's rule 'unique'; LIGGGHTS keeps a face while the ball is over it, and"
        " its error does not tend to zero. At random places about four shapes each force is that of the"
        " stated rule."
    ),
    source=(
        "Planes and the cylinder of the same code; both rules in NumPy by brute force"
        " (comparisons/oracles/mesh_contacts.py), that of LIGGGHTS as its binary shows it."
    ),
    variants=variants,
    checks=(
        *every_column(
            {
                "position": "another order of the Verlet step",
                "velocity": "a contact lost or counted twice at an edge or a node",
                "angular_velocity": "a spring lost where a ball goes to the next triangle",
                "force": "an active edge or node of the wrong triangle; a face that does not keep its"
                " contact",
            },
            defect=nothing, tolerance=1e-9,
            reason="same law, scheme and rule: rounding. On the finest facets, 100 times as long as wide, a"
            " nearest point errs by 100 units of rounding of 0.02 m, 4e-16 m, of an overlap of 1.2e-6 m:"
            " 5e-10 of the force",
        ),
        kit.per_code(
            "mesh against plane and box, all columns, largest difference over all steps, relative",
            from_surface, tolerance=1e-12, against="the same code on planes",
            reason="nearest points of faces parallel to the axes are exact: rounding at most",
            catches="a double force on a seam, a gap at an edge or a node, a spring that is not handed on, an"
            " inner edge of a box counted beside its faces",
        ),
        kit.check(
            "share of random places at which the force is not that of rule 'unique' (gpudem)",
            lambda results: differ(results, "gpudem", "unique"), tolerance=0.0, unit="1",
            against="brute force over triangles",
            reason="to 1e-6 of the largest force; two faces of one distance have the same force",
            catches="a local minimum of the distance missed or counted twice; contacts merged beyond the"
            " angle",
        ),
        kit.per_code(
            "share of random places at which the force is not that of rule 'liggghts'",
            lambda results, code: differ(results, code, LIGGGHTS_RULE), tolerance=0.0,
            against="LIGGGHTS' rule in six lines, brute force",
            reason="to 1e-6 of the largest force",
            catches="an active edge or node of a triangle of lower index; coplanar faces counted twice",
        ),
        kit.check(
            "order in the number of facets, 480 to 1920, in which the way tends to that in the cylinder"
            " (gpudem)",
            order, lo=1.8, tolerance=2.2, against="cylinder",
            reason="the overlap is off by (DRUM - RADIUS) pi^2/(2 n^2), and slopes of pi/n over a way of 2"
            " pi/n change the speed by n^-2: order 2. The next term is 0.2 of it or less: log 1.2/log 4",
            catches="two contacts of a ball that touches two facets: order 0, as in LIGGGHTS",
        ),
    ),
    findings=(
        kit.Finding(
            "way over 960 facets by rule 'liggghts', error / that by rule 'unique'", rules_apart, "1",
            "By LIGGGHTS' rule a finer drum is not a better one: a face keeps its contact while the ball is"
            " over it, so forces jump however fine the facets are.",
        ),
    ),
    figures=(
        kit.Figure(
            "Over meshes and over what they stand for",
            "Ways of the balls from above: lines of meshes lie on those of planes. Right: distance of the"
            " way in a faceted cylinder from that in the cylinder.",
            draw,
        ),
    ),
    features=("wall mesh", "wall plane", "wall cylinder", "tangential history", "rotation"),
    order=35,
)  # fmt: skip
