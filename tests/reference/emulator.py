"""LIGGGHTS' contact laws and integrator in plain NumPy: all pairs, no neighbour list, from the formulas
alone.

An oracle for both codes: it agrees with the LIGGGHTS binary to rounding (see test_agreement.py), and is
written from the published formulas, not from either code. For few particles: every pair is looked at in
every step.

    m dv/dt = sum F + m g,  I dw/dt = sum T,  I = 2/5 m R^2     velocity Verlet; forces see half-step
    velocities n from j to i, overlap d = Ri + Rj - r, q = sqrt(R* d) Fn = kn d - cn vn,  Ft = -kt s (- ct
    vt while sticking),  |kt s| <= mu |Fn|
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from comparisons.oracles.cohesion import circle, linear
from comparisons.oracles.tangential import RULES
from gpudem.scene import Pair, Scene


@dataclasses.dataclass(frozen=True)
class Flat:
    """A plane wall as the scene file states it, or one side of a box."""

    name: str
    material: str
    point: np.ndarray
    normal: np.ndarray
    """Of length one, towards the particles."""
    last: float
    """Last step [1] in which it is there; infinite for a wall that stays."""
    own: tuple[tuple[str, str], ...] = ()
    """(slot, law) where it has another contact law than the particles."""


def flats(scene: Scene) -> list[Flat]:
    """All walls of a scene from its primary inputs: boxes side by side, gates by the nearest step."""
    found = []
    for wall in scene.walls:
        facts = wall.model_dump()
        if facts["kind"] == "plane":
            normal = np.array(facts["normal"]) / np.linalg.norm(facts["normal"])
            last = math.inf if facts["removed_at"] is None else np.rint(facts["removed_at"] / scene.time.step)
            own = tuple((slot, name) for slot, name in (facts["contact"] or {}).items() if name)
            found.append(
                Flat(facts["name"], facts["material"], np.array(facts["point"]), normal, float(last), own)
            )
            continue
        for side in facts["sides"]:
            axis, low = "xyz".index(side[0]), side[1:] == "lo"
            corner = (facts["lo"] or scene.domain.lo) if low else (facts["hi"] or scene.domain.hi)
            unit = np.eye(3)[axis]
            point, normal = corner[axis] * unit, unit if low else -unit
            found.append(Flat(f"{facts['name']}_{side}", facts["material"], point, normal, math.inf))
    return found


def steps_and_stride(scene: Scene) -> tuple[int, int]:
    """(steps of the run, steps between rows of the trace) from times and the step alone."""

    def nearest(seconds: float) -> int:
        return int(np.rint(seconds / scene.time.step))

    frames, trace = scene.output.frames_every, scene.output.trace_every
    total = max(1, nearest(scene.time.duration))
    if frames:
        whole = max(1, nearest(frames))
        total = -(-total // whole) * whole
    return total, max(1, nearest(trace)) if trace else 1


def laws_of(scene: Scene, plane: Flat | None) -> dict[str, str]:
    """Slot -> law, between spheres (None) or at a plane."""
    usual = {slot: getattr(scene.contact, slot) for slot in ("normal", "tangential", "rolling", "cohesion")}
    return usual | dict(plane.own if plane else ())


def any_pair_with(scene: Scene, name: str, laws: dict[str, str]) -> bool:
    """Whether a pair of materials that can meet under these laws has a property above 0."""
    names = list(scene.materials)
    balls = {names[k] for k in scene.state.material.tolist()}
    others = balls if laws == laws_of(scene, None) else set()
    others = others | {flat.material for flat in flats(scene) if laws_of(scene, flat) == laws}
    return any(
        getattr(p, name) > 0 and any(a in balls and b in others for a, b in (p.materials, p.materials[::-1]))
        for p in scene.pairs
    )


@dataclasses.dataclass
class Contacts:
    """Everything that can touch: pairs of spheres, or spheres and one plane; one row each."""

    i: np.ndarray
    j: np.ndarray | None
    """Second sphere; None for a plane."""
    plane: Flat | None
    mass: np.ndarray
    """Effective mass m* [kg]; a wall's is infinite."""
    radius: np.ndarray
    """Effective radius R* [m]; a wall's is infinite."""
    young: np.ndarray
    shear: np.ndarray
    """Effective moduli E* and G* [Pa]."""
    pair: list[Pair]
    spring: np.ndarray
    """Tangential displacement s of i against j [m], shape (rows, 3)."""
    rolling: np.ndarray
    """Rolling torque kept by `epsd`, `epsd2`, `epsd3` [N m], shape (rows, 3)."""
    inertia: np.ndarray
    """7/5 m R^2 of the two, as m* is of masses [kg m2]."""
    laws: dict[str, str]
    """Law of each slot."""
    frictional: bool
    """Whether the tangential law acts at all: one pair that can meet under these laws has friction."""

    known: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    """Pair properties that were asked for."""

    def of(self, name: str) -> np.ndarray:
        """A pair property, one value per row."""
        if name not in self.known:
            self.known[name] = np.array([getattr(p, name, 0.0) or 0.0 for p in self.pair], float)
        return self.known[name]


def emulate(scene: Scene) -> dict[str, np.ndarray]:
    """Run a scene; the trace in the form of `Run.trace`, one row each trace interval (each step without one).

    The row at a gate removal is the one before the new set-up. Periodic positions lie in lo <= x < hi.
    """
    state, dt = scene.state, scene.time.step
    x, v, w = state.position.copy(), state.velocity.copy(), state.angular_velocity.copy()
    m = _mass(scene)[:, None]
    inertia = 0.4 * m * state.radius[:, None] ** 2
    spheres, planes = _sphere_contacts(scene), flats(scene)
    walls = {p.name: _wall_contacts(scene, p) for p in planes}
    total, stride = steps_and_stride(scene)
    rows, weight = [], m * np.array(scene.gravity)

    def forces(step: float, update: bool) -> tuple[np.ndarray, np.ndarray]:
        f, t = np.zeros_like(x), np.zeros_like(x)
        for contacts in [spheres, *(walls[p.name] for p in planes if p.last >= step)]:
            _add_contacts(scene, contacts, x, v, w, f, t, update)
        return f + weight, t

    # set-up: full-step velocities, springs left alone; at the start and where a gate has gone
    f, t = forces(0.5, update=False)
    rows.append((0, x.copy(), v.copy(), w.copy(), f, t))
    for step in range(1, total + 1):
        v += dt / (2 * m) * f
        w += dt / (2 * inertia) * t
        x += dt * v
        f, t = forces(step, update=True)
        v += dt / (2 * m) * f
        w += dt / (2 * inertia) * t
        if step % stride == 0:
            rows.append((step, x.copy(), v.copy(), w.copy(), f, t))
        if any(p.last == step for p in planes):
            f, t = forces(step + 0.5, update=False)
    steps = np.array([row[0] for row in rows])
    names = ("position", "velocity", "angular_velocity", "force", "torque")
    trace = {name: np.array([row[1 + k] for row in rows]) for k, name in enumerate(names)}
    lo, size = np.array(scene.domain.lo), np.array(scene.domain.hi) - np.array(scene.domain.lo)
    turns = np.where(scene.domain.periodic, np.floor((trace["position"] - lo) / size), 0.0)
    return {"step": steps, "time": steps * dt, **trace, "position": trace["position"] - turns * size}


def _mass(scene: Scene) -> np.ndarray:
    density = np.array([m.density for m in scene.materials.values()])[scene.state.material]
    return density * 4 / 3 * math.pi * scene.state.radius**3


def _contacts(scene: Scene, i, j, plane: Flat | None) -> Contacts:
    names, materials, state, mass = (
        list(scene.materials),
        list(scene.materials.values()),
        scene.state,
        _mass(scene),
    )
    a, laws = state.material[i], laws_of(scene, plane)
    b = state.material[j] if plane is None else np.full(len(i), scene.material_index[plane.material])
    e, nu = np.array([m.young for m in materials]), np.array([m.poisson for m in materials])
    together = lambda q: q[i] * q[j] / (q[i] + q[j]) if plane is None else q[i]  # noqa: E731
    return Contacts(
        i, j, plane, together(mass), together(state.radius),
        young=1 / ((1 - nu[a] ** 2) / e[a] + (1 - nu[b] ** 2) / e[b]),
        shear=1 / (2 * (2 - nu[a]) * (1 + nu[a]) / e[a] + 2 * (2 - nu[b]) * (1 + nu[b]) / e[b]),
        pair=[scene.pair(names[p], names[q]) for p, q in zip(a, b, strict=True)],
        inertia=together(1.4 * mass * state.radius**2),
        spring=np.zeros((len(i), 3)), rolling=np.zeros((len(i), 3)),
        laws=laws, frictional=laws["tangential"] != "off" and any_pair_with(scene, "friction", laws),
    )  # fmt: skip


def _sphere_contacts(scene: Scene) -> Contacts:
    return _contacts(scene, *np.triu_indices(len(scene.state), 1), None)


def _wall_contacts(scene: Scene, plane: Flat) -> Contacts:
    return _contacts(scene, np.arange(len(scene.state)), None, plane)


def _coefficients(scene: Scene, c: Contacts, overlap: np.ndarray) -> tuple[np.ndarray, ...]:
    """kn, kt [N/m], cn, ct [N s/m] at an overlap [m]."""
    q = np.sqrt(c.radius * overlap)
    damping = scene.contact.tangential_damping
    if c.laws["normal"] == "hooke/stiffness":
        return c.of("kn"), c.of("kt"), c.mass * c.of("gamma_n"), c.mass * c.of("gamma_t") * damping
    if c.laws["normal"] == "hertz/stiffness":
        return (
            q * c.of("kn"),
            q * c.of("kt"),
            q * c.mass * c.of("gamma_n"),
            q * c.mass * c.of("gamma_t") * damping,
        )
    log_e = np.log(c.of("restitution"))
    beta = log_e / np.sqrt(log_e**2 + math.pi**2)
    if c.laws["normal"] == "hooke":
        speed = scene.contact.characteristic_velocity
        kn = 16 / 15 * np.sqrt(c.radius) * c.young
        kn = kn * (15 * c.mass * speed**2 / (16 * np.sqrt(c.radius) * c.young)) ** 0.2
        cn = np.sqrt(4 * c.mass * kn) * np.abs(beta)
        return kn, kn, cn, cn * damping
    sn, st = 2 * c.young * q, 8 * c.shear * q
    cn, ct = (-2 * math.sqrt(5 / 6) * beta * np.sqrt(s * c.mass) for s in (sn, st))
    return 2 / 3 * sn, st, cn, ct * damping


def _geometry(scene: Scene, c: Contacts, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normal from j (or the plane) to i, and overlap [m], of every row."""
    radius = scene.state.radius
    if c.plane is not None:
        normal = c.plane.normal
        return np.broadcast_to(normal, (len(c.i), 3)), radius[c.i] - (x[c.i] - c.plane.point) @ normal
    d = x[c.i] - x[c.j]
    if any(scene.domain.periodic):
        size = np.array(scene.domain.hi) - np.array(scene.domain.lo)
        d = d - np.where(scene.domain.periodic, size * np.round(d / size), 0.0)
    r = np.sqrt(np.sum(d * d, axis=1))
    return d / r[:, None], radius[c.i] + radius[c.j] - r


def _add_contacts(scene: Scene, c: Contacts, x, v, w, f, t, update: bool) -> None:
    """Add forces f [N] and torques t [N m] of all touching rows; `update`: the springs follow the motion."""
    n, overlap = _geometry(scene, c, x)
    touching = overlap > 0
    c.spring[~touching] = 0.0
    c.rolling[~touching] = 0.0
    if not touching.any():
        return
    kn, kt, cn, ct = (k[touching] for k in _coefficients(scene, c, np.maximum(overlap, 0.0)))
    if not scene.contact.frictionless_dashpot:
        ct = np.where(c.of("friction")[touching] > 0, ct, 0.0)
    n, overlap, i = n[touching], overlap[touching], c.i[touching]
    j = None if c.j is None else c.j[touching]
    arm_i = scene.state.radius[i] - overlap / 2
    relative, spin = v[i], arm_i[:, None] * w[i]
    if j is not None:
        arm_j = scene.state.radius[j] - overlap / 2
        relative, spin = v[i] - v[j], spin + arm_j[:, None] * w[j]
    vn = _dot(relative, n)
    fn = kn * overlap - cn * vn
    if scene.contact.limit_force:
        fn = np.maximum(fn, 0.0)
    pull = _cohesion(scene, c, touching, overlap)
    load = np.abs(fn - pull if scene.contact.tangential_reduce else fn)
    vt = relative - vn[:, None] * n - _cross(spin, n)
    ft = _tangential(scene, c, touching, n, vt, kt, ct, c.of("friction")[touching] * load, update)
    force, turn = (fn - pull)[:, None] * n + ft, _cross(n, ft)
    if j is None:
        turning = (arm_i / (scene.state.radius[i] - overlap))[:, None] * w[i]
    else:
        turning = w[i] - w[j]
    if c.laws["rolling"].startswith("epsd"):
        resist = _rolling_spring(scene, c, touching, n, (kn, kt), load, turning, update)
    else:
        resist = _rolling(scene, c, touching, n, kn * overlap, turning)
    np.add.at(f, i, force)
    np.add.at(t, i, -arm_i[:, None] * turn - resist)
    if j is not None:
        np.add.at(f, j, -force)
        np.add.at(t, j, -arm_j[:, None] * turn + resist)


def _tangential(scene, c, touching, n, vt, kt, ct, limit, update: bool) -> np.ndarray:
    """Tangential force on i [N]; `limit` = mu |Fn|."""
    if not c.frictional:
        return np.zeros_like(vt)
    if c.laws["tangential"] == "no_history":
        speed = np.sqrt(_dot(vt, vt))
        return (
            -np.minimum(ct, np.divide(limit, speed, out=np.full_like(speed, np.inf), where=speed > 0))[
                :, None
            ]
            * vt
        )
    rule = RULES[c.laws["tangential"]]
    slide = vt * scene.time.step if update else np.zeros_like(vt)
    force, spring = rule(c.spring[touching], slide, vt, n, kt, ct, limit)
    if update:
        c.spring[touching] = spring
    return force


def _rolling(scene, c, touching, n, elastic, spin) -> np.ndarray:
    """Constant-torque rolling resistance [N m] against the relative spin, without its part along n."""
    if c.laws["rolling"] == "off":
        return np.zeros_like(spin)
    size = np.sqrt(_dot(spin, spin))
    magnitude = (c.of("rolling_friction") * c.radius)[touching] * elastic
    torque = (magnitude / np.where(size > 0, size, 1.0))[:, None] * spin
    return torque if scene.contact.torsion else torque - _dot(torque, n)[:, None] * n


def _rolling_spring(scene, c, touching, n, stiffness, load, spin, update: bool) -> np.ndarray:
    """Elastic-plastic rolling resistance [N m]: a spring of torque, cut at mu_r |Fn| R*.

    `epsd2`: k_r = k_t R*^2; `epsd`, `epsd3`: k_r = 2.25 (or as stated) k_n mu_r^2 R*^2, and below the cut a
    dashpot 2 eta sqrt(I k_r). `stiffness` = k_n, k_t [N/m].
    """
    radius, torque, mu = c.radius[touching], c.rolling[touching], c.of("rolling_friction")[touching]
    if not scene.contact.torsion:
        spin = spin - _dot(spin, n)[:, None] * n
    if c.laws["rolling"] == "epsd2":
        rigid = stiffness[1] * radius**2
    else:
        share = c.of("rolling_stiffness")[touching] if c.laws["rolling"] == "epsd3" else 2.25
        rigid = share * stiffness[0] * (mu * radius) ** 2
    torque = torque + rigid[:, None] * spin * scene.time.step  # at set-up too, but then it is not kept
    limit = mu * load * radius
    size = np.sqrt(_dot(torque, torque))
    slips = size > limit
    torque = torque * np.where(slips, limit / np.where(size > 0, size, 1.0), 1.0)[:, None]
    if update:
        c.rolling[touching] = torque
    if c.laws["rolling"] == "epsd2":
        return torque
    dashpot = 2 * c.of("rolling_viscous_damping")[touching] * np.sqrt(c.inertia[touching] * rigid)
    return torque + np.where(slips, 0.0, dashpot)[:, None] * spin


def _cohesion(scene, c, touching, overlap) -> np.ndarray:
    """Attraction [N] of touching rows: energy density times an area."""
    if c.laws["cohesion"] == "off":
        return np.zeros_like(overlap)
    area = circle if c.laws["cohesion"] == "sjkr" else linear
    first = scene.state.radius[c.i[touching]]
    second = np.full_like(first, np.inf) if c.j is None else scene.state.radius[c.j[touching]]
    distance = first - overlap + (0.0 if c.j is None else second)
    rows = zip(distance.tolist(), first.tolist(), second.tolist(), strict=True)
    return c.of("cohesion_energy_density")[touching] * np.array([area(*row) for row in rows])


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(axis=-1)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b of rows; `np.cross` takes ten times as long for a few."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    found = np.empty_like(a)
    found[:, 0], found[:, 1], found[:, 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return found
