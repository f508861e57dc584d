"""Random small scenes with whatever goes together: laws, sizes, walls, motions, insertions, groups, phases.

Twenty balls fall, meet one another and the walls for 0.03 s: long enough for some hundred contacts, short
enough that rounding has not grown. Each number states a scene, the same on every machine.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gpudem.scene import Scene

DT = 5e-6
STEPS = 6000
SIZE = 0.1
BALLS = 20
MATERIALS = {
    "a": {"young": 5e6, "poisson": 0.3, "density": 2000.0},
    "b": {"young": 2e7, "poisson": 0.25, "density": 3000.0},
    "w": {"young": 1e7, "poisson": 0.4, "density": 1000.0},
}
#: Per row of the table: `kn`, `kt`, `gamma_n`, `gamma_t`, times a random number from 0.5 to 2.
STIFFNESS = {"hertz/stiffness": (1e6, 5e5, 1e4, 1e4), "hooke/stiffness": (2e3, 1e3, 100.0, 100.0)}
TURN = {"axis": (0, 0, 1), "point": (0.05, 0.05, 0.01)}
MOTIONS: list[dict[str, Any]] = [
    {"type": "linear", "velocity": (0.01, 0.02, 0.1)},
    {"type": "rotate", **TURN, "period": 0.05},
    {"type": "oscillate", "amplitude": (0.001, 0.0, 0.002), "period": 0.01},
    {"type": "swing", **TURN, "axis": (0.3, 1, 0.2), "period": 0.02, "amplitude": 0.03},
    {"type": "table", "time": [0, 0.005, 0.01], "velocity": [[0, 0, 0], [0.2, 0, 0.1], [0, 0, -0.1]]},
]
INSERTIONS: list[dict[str, Any]] = [
    {"kind": "list", "time": [0.002, 0.002, 0.006], "velocity": [(0, 0, -2)] * 3, "material": "a",
     "position": [(0.03, 0.03, 0.15), (0.06, 0.06, 0.15), (0.05, 0.03, 0.17)],
     "radius": [0.005, 0.007, 0.006]},
    {"kind": "pack", "region": {"kind": "block", "lo": (0.01, 0.01, 0.12), "hi": (0.09, 0.09, 0.16)},
     "count": 8, "time": 0.001, "radius": {"kind": "uniform", "lo": 0.004, "hi": 0.007}, "material": "a",
     "velocity": (0, 0, -1), "velocity_spread": 0.1},
    {"kind": "stream", "velocity": (0, 0, -2.0), "number_rate": 300.0, "end": 0.02, "material": "a",
     "face": {"kind": "disc", "center": (0.05, 0.05, 0.17), "axis": (0, 0, 1), "radius": 0.02},
     "radius": 0.006},
]  # fmt: skip
#: When a wall is there [s].
PRESENT = [[0, 0.008], [0.004], [0.003, 0.009]]
#: `[[remove]]`: which of them a scene has is drawn.
REMOVALS: list[dict[str, Any]] = [
    {"name": "low", "every": 5e-5,
     "region": {"kind": "block", "lo": (0.03, 0.03, 0), "hi": (0.05, 0.06, 0.03)}},
    {"name": "up", "every": 1e-4, "point": (0, 0, 0.1), "normal": (0, 0, 1)},
    {"name": "old", "every": 2e-4, "age": 0.008},
]  # fmt: skip


class Draw:
    """Random choices of one scene."""

    def __init__(self, number: int):
        self.rng = np.random.default_rng(number)

    def of(self, *choices: Any) -> Any:
        """One of the choices."""
        return choices[self.rng.integers(len(choices))]

    def yes(self, share: float = 0.5) -> bool:
        """True in so many cases."""
        return bool(self.rng.random() < share)

    def between(self, lo: float, hi: float) -> float:
        """A number, all equally likely."""
        return float(self.rng.uniform(lo, hi))


def random_scene(number: int, **changes: Any) -> Scene:
    """The scene of a number; `changes`: keys stated in the place of those drawn."""
    draw = Draw(number)
    several = draw.yes()
    contact = _contact(draw)
    periodic = [draw.yes(0.3), draw.yes(0.3), False]
    sides = {draw.of("xlo", "xhi"): "outflow"} if not periodic[0] and draw.yes(0.3) else {}
    particles = _particles(draw, several)
    data: dict[str, Any] = {
        "name": f"random_{number}",
        "materials": {k: m for k, m in MATERIALS.items() if several or k != "b"},
        "pairs": _pairs(draw, contact, "abw" if several else "aw"),
        "contact": contact,
        "particles": particles,
        "gravity": (draw.between(-4, 4), draw.between(-4, 4), -20.0),
        "walls": _walls(draw, periodic, sides),
        "domain": {"lo": (0, 0, 0), "hi": (SIZE, SIZE, 0.2), "periodic": periodic, "sides": sides},
        "time": {"step": DT, "duration": STEPS * DT},
        "output": {"trace_every": 10 * DT, "history_every": 10 * DT, "frames_every": STEPS * DT / 2},
        "allow": ["large_overlap", "overlap", "time_step"],
    }
    if draw.yes(0.4):
        data["insert"] = [{**draw.of(*INSERTIONS)}]
    if draw.yes(0.3):
        held = {"frozen": True} if draw.yes() else {"motion": [MOTIONS[2]]}
        data["groups"] = [{"name": "held", "ids": [1, 2, 5], **held}]
        for name in ("velocity", "angular_velocity"):
            particles[name][[0, 1, 4]] = 0
    # a set-up finds a spring that a clipped force has cut exactly at its limit: rounding decides (trap 49)
    tie = contact["limit_force"] and contact["tangential_reduce"]
    if draw.yes(0.3) and not tie:
        data["phases"] = [{"start": 0.007, "gravity": (1.0, 2.0, -15.0)}]
        if contact["tangential"] != "off":
            data["phases"][0]["pairs"] = [{"materials": ("a", "w"), "friction": 0.5}]
    return Scene(**{**data, **changes})


def richer_scene(number: int, removes: bool = False) -> Scene:
    """The scene of a number with more: laws of single walls, a second source, walls that change in a phase,
    forces on walls and groups, a flow; `removes`: a cone and removal too, which LIGGGHTS does not know.
    """
    draw, base = Draw(10_000 + number), random_scene(number)
    data = base.model_dump()
    walls, output = list(data["walls"]), dict(data["output"])
    for wall in walls:
        off = [slot for slot in ("rolling", "cohesion") if data["contact"][slot] != "off" and draw.yes(0.3)]
        if off and wall["kind"] != "mesh":
            wall["contact"] = dict.fromkeys(off, "off")
    if draw.yes(0.3):
        data["insert"] = [INSERTIONS[0], {**INSERTIONS[2], "start": 0.012}]
    closed = not any(base.domain.periodic) and not base.domain.sides
    changes = [change for wall in walls[1:] if len(change := _change(draw, wall, closed)) > 1]
    if changes and not (base.contact.limit_force and base.contact.tangential_reduce):
        first = data["phases"][0] if data["phases"] else {"start": draw.between(0.002, 0.02)}
        data["phases"] = [{**first, "walls": changes}]
    if draw.yes():
        output["wall_forces"] = tuple(wall.name for wall in base.wall_elements)
    if draw.yes(0.4):
        output["flow"] = [{"name": "middle", "point": (0, 0, 0.04), "normal": (0, 0, -1)}]
    if data["groups"] and draw.yes():
        output["group_forces"] = ("held",)
    if removes:
        if closed and draw.yes(0.4):
            walls.append({"kind": "cone", "name": "cone", "material": "w", "point": (0.05, 0.05, 0),
                          "axis": (0, 0, 1), "length": 0.2, "radius": 0.062, "end_radius": 0.07})  # fmt: skip
        data["remove"] = [rule for rule in REMOVALS if draw.yes() and (data["insert"] or "age" not in rule)]
    return Scene(**{**data, "name": f"richer_{number}", "walls": walls, "output": output})


def _change(draw: Draw, wall: dict[str, Any], closed: bool) -> dict[str, Any]:
    """What a phase changes of a wall, beside its name perhaps nothing."""
    found = {"name": wall["name"]}
    if wall["kind"] == "mesh" and closed and draw.yes():
        found["motion"] = draw.of([draw.of(*MOTIONS)], MOTIONS[2:4], [] if wall["motion"] else MOTIONS[:1])
    if wall["surface_velocity"] and draw.yes(0.6):
        found["surface_velocity"] = draw.of((0, 0, 0), (0, 0.4, 0))
    if not wall["present"] and draw.yes(0.2):
        found["present"] = False
    return found


def _contact(draw: Draw) -> dict[str, Any]:
    tangential = draw.of("off", "no_history", "history", "history")
    contact = {
        "normal": draw.of("hertz", "hertz", "hooke", "hertz/stiffness", "hooke/stiffness"),
        "tangential": tangential,
        "rolling": draw.of("off", "cdt", "epsd", "epsd2", "epsd3") if tangential != "off" else "off",
        "cohesion": draw.of("off", "off", "sjkr", "sjkr2"),
        "limit_force": draw.yes(0.3),
        "mesh_contacts": "liggghts",
    }
    contact["tangential_reduce"] = contact["cohesion"] != "off" and tangential != "off" and draw.yes(0.4)
    contact["torsion"] = contact["rolling"] != "off" and draw.yes(0.3)
    if contact["normal"] == "hooke":
        contact["characteristic_velocity"] = 1.0
    return contact


def _pairs(draw: Draw, contact: dict[str, Any], materials: str) -> list[dict[str, Any]]:
    found = []
    for k, first in enumerate(materials):
        for second in materials[k:]:
            pair: dict[str, Any] = {"materials": (first, second)}
            if contact["normal"] in STIFFNESS:
                usual = zip(("kn", "kt", "gamma_n", "gamma_t"), STIFFNESS[contact["normal"]], strict=True)
                pair |= {name: value * draw.between(0.5, 2) for name, value in usual}
            else:
                pair["restitution"] = draw.between(0.3, 0.95)
            if contact["tangential"] != "off":
                pair["friction"] = draw.between(0.1, 0.8)
            if contact["rolling"] != "off":
                pair["rolling_friction"] = draw.between(0.05, 0.3)
            if contact["rolling"] in ("epsd", "epsd3"):
                pair["rolling_viscous_damping"] = draw.between(0.1, 0.5)
            if contact["rolling"] == "epsd3":
                pair["rolling_stiffness"] = 3.0  # LIGGGHTS has one for all pairs
            if contact["cohesion"] != "off":
                pair["cohesion_energy_density"] = draw.between(1e3, 2e4)
            found.append(pair)
    return found


def _particles(draw: Draw, several: bool) -> dict[str, Any]:
    sites = [(x, y, z) for z in (0.045, 0.065, 0.085) for x in (2, 5, 8) for y in (2, 5, 8)][:BALLS]
    position = np.array(sites) * (0.01, 0.01, 1) + draw.rng.uniform(-1e-3, 1e-3, (BALLS, 3))
    two = np.where(np.arange(BALLS) % 2, 0.005, 0.008)
    return {
        "source": "explicit", "position": position,
        "radius": draw.of(0.007, two, draw.rng.uniform(0.004, 0.0085, BALLS)),
        "material": [draw.of("a", "b") if several else "a" for _ in range(BALLS)],
        "velocity": 1.5 * draw.rng.normal(size=(BALLS, 3)),
        "angular_velocity": 20.0 * draw.rng.normal(size=(BALLS, 3)),
    }  # fmt: skip


def _walls(draw: Draw, periodic: list[bool], sides: dict[str, str]) -> list[dict[str, Any]]:
    closed = [f"{a}{end}" for a, p in zip("xyz", periodic, strict=True) if not p for end in ("lo", "hi")]
    found = [
        {"kind": "box", "name": "box", "material": "w", "sides": [s for s in closed if s not in sides]},
    ]
    if draw.yes():
        found.append({"kind": "plane", "name": "shelf", "point": (0.05, 0.05, 0.012), "normal": (0, 0, 1)})
    if draw.yes(0.3) and not any(periodic):
        found.append({"kind": "cylinder", "name": "tube", "point": (0.05, 0.05, 0), "axis": (0, 0, 1),
                      "radius": 0.062})  # fmt: skip
    if draw.yes(0.6):
        found.append({"kind": "mesh", "name": "ground", **_ground(draw)})
        if draw.yes() and not sides and not any(periodic):
            found[-1]["motion"] = [draw.of(*MOTIONS) for _ in range(draw.rng.integers(1, 3))]
    for wall in found[1:]:
        wall["material"] = "w"
        if draw.yes(0.3):
            wall["present"] = draw.of(*PRESENT)
        if draw.yes(0.3) and wall["name"] == "shelf":
            wall["surface_velocity"] = (0.3, 0, 0)
    return found


def _ground(draw: Draw, count: int = 5) -> dict[str, Any]:
    """Uneven ground of 2 count^2 triangles, 10 to 18 mm high."""
    line = np.linspace(5e-4, SIZE - 5e-4, count + 1)
    x, y = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    rows = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    a, b, c, d = rows[:-1, :-1].ravel(), rows[1:, :-1].ravel(), rows[1:, 1:].ravel(), rows[:-1, 1:].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    z = 0.01 + 0.008 * draw.rng.random(x.size)
    return {"vertices": np.stack([x, y, z], 1), "triangles": triangles}
