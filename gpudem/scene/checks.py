"""What a single field cannot show: missing materials, overlaps, particles outside, time steps too large.

Each check reads some sections of a scene and returns its problems, one line each.
"""

from __future__ import annotations

import collections
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

import numpy as np

from gpudem.contact import registry
from gpudem.contact.law import AdhesiveLaw, RollingLaw
from gpudem.errors import GpudemError
from gpudem.scene import flow, groups, law_parameters, phases, removal, wall_checks, wall_phases
from gpudem.scene.overlaps import MAX_START_OVERLAP, find_overlaps, lattice_within
from gpudem.scene.scene_warnings import rounded_times, unexpected, without_effect
from gpudem.scene.sections import MAX_PARTICLES
from gpudem.scene.sources import Source
from gpudem.scene.time_step import (
    USUAL_CONTACT,
    USUAL_RAYLEIGH,
    contact_time,
    position_spacing,
    rayleigh_time,
    uses_moduli,
)

if TYPE_CHECKING:
    from gpudem.scene.model import Scene
    from gpudem.scene.phases import PairChange
    from gpudem.scene.sections import Pair

#: Largest time step: share of the Rayleigh time, and of the contact time (5 steps in a contact).
MAX_RAYLEIGH, MAX_CONTACT = 0.5, 0.2
#: Largest distance of neighboring positions in floating-point numbers, relative to the smallest radius.
MAX_SPACING = 0.01
#: A trace [bytes] above this may fill the memory: 15 float64 numbers for each particle and row.
MAX_TRACE = 4e9

_WAIVE_UNITS = "waive with allow = ['unusual_units']"


def problems(scene: Scene, invalid: Collection[str] = ()) -> list[str]:
    """Every problem of a scene whose fields are valid one by one.

    `invalid` names the sections that are not valid (and missing from `scene`): checks that read them are left
    out, as are checks whose answer would only repeat an earlier problem.
    """
    found: list[str] = []

    def run_check(check: Callable[[Scene], list[str]], *sections: str) -> bool:
        if not set(sections).isdisjoint(invalid):
            return False
        new = check(scene)
        found.extend(new)
        return not new

    particles = run_check(_particle_materials, "materials", "particles")
    walls = run_check(_wall_materials, "materials", "walls")
    pairs = run_check(_pair_materials, "materials", "pairs")
    pairs = run_check(law_parameters.problems, "pairs", "contact") and pairs
    pairs = pairs and run_check(phases.problems, "phases", "time")
    domain = run_check(_domain, "domain")
    walls = walls and run_check(wall_checks.meshes, "walls")
    walls = walls and domain and run_check(wall_checks.statements, "walls", "domain")
    walls = walls and (not scene.phases or run_check(wall_phases.problems, "phases", "time", "materials"))
    if walls:
        run_check(removal.problems, "walls", "domain", "time", "insert", "remove")
    if domain:
        run_check(flow.problems, "domain", "output")
    units = run_check(_material_units, "materials", "allow")
    units = run_check(_gravity_units, "gravity", "phases", "allow") and units
    run_check(_pair_units, "pairs", "phases", "allow")
    speed = run_check(_speed_units, "contact", "allow")
    run_check(_duration, "time")
    drawn = any(isinstance(insert, Source) for insert in scene.insert)
    if not (
        particles
        and run_check(_state, *(("time", "gravity", "phases", "domain", "materials") if drawn else ()))
    ):
        return found
    grouped = walls and run_check(groups.problems, "groups", "output", "gravity")
    paired = pairs and walls and run_check(_pairs, "contact")
    periodic = domain and run_check(
        lambda scene: _periodic(scene, scene.contact_range if paired else 0.0), "solver"
    )
    if run_check(_radius_units) and units and domain:
        if run_check(_inside) and periodic and grouped:
            run_check(_overlaps, "allow")
            run_check(_inserted_overlaps, "allow", "time")
        if walls and run_check(wall_checks.sizes, "allow"):
            if grouped:
                run_check(_behind_walls, "allow", "time")
            run_check(wall_checks.reachable)
            reach = scene.contact_range if paired else 0.0
            run_check(lambda scene: wall_checks.across_periodic_sides(scene, reach))
            if paired and speed and grouped:
                run_check(_time_step, "time", "contact", "gravity", "allow")
            run_check(_vibration, "time", "solver", "allow")
            run_check(wall_checks.motions, "time", "allow")
        run_check(_trace, "time", "output", "allow")
        run_check(wall_checks.forces, "walls", "output", "domain")
        run_check(_position_spacing, "solver", "allow")
    return found


# -- names -------------------------------------------------------------------------------------------------


def _unknown(used: list[tuple[str, str]], scene: Scene) -> list[str]:
    return [
        f"{key} = {name!r}: no such material; known: {', '.join(sorted(scene.materials))}"
        for key, name in used
        if name not in scene.materials
    ]


def _particle_materials(scene: Scene) -> list[str]:
    if scene.particles is None and not scene.insert:
        return ["particles: missing; or state what is inserted ([[insert]])"]
    material = scene.particles.material if scene.particles is not None else ()
    names = [material] if isinstance(material, str) else dict.fromkeys(material or ())
    used = [("particles.material", name) for name in names]
    for k, insert in enumerate(scene.insert):
        used += [(f"insert[{k}].{key}", name) for key, name in insert.material_names]
    return _unknown(used, scene)


def _wall_materials(scene: Scene) -> list[str]:
    return _unknown([(f"walls[{i}].material", wall.material) for i, wall in enumerate(scene.walls)], scene)


def _pair_materials(scene: Scene) -> list[str]:
    used = [(f"pairs[{i}].materials", name) for i, pair in enumerate(scene.pairs) for name in pair.materials]
    keys = collections.Counter(tuple(sorted(pair.materials)) for pair in scene.pairs)
    twice = [key for key, count in keys.items() if count > 1]
    return _unknown(used, scene) + [f"pairs: {' / '.join(key)} given twice" for key in twice]


def _pairs(scene: Scene) -> list[str]:
    found = []
    ours = scene.particle_materials
    walls = dict.fromkeys(w.material for at in scene.phase_scenes for w in at.walls)
    partners = [*ours, *(name for name in walls if name not in ours)]
    for a in ours:
        for b in partners:
            if scene.pair(a, b) is None and (b not in ours or ours.index(a) <= ours.index(b)):
                found.append(f"pairs: {a} / {b} can meet, and no pair gives their restitution and friction")
    for names, inputs in scene.contact_groups.items() if scene.materials else ():
        for law in names.laws:
            for pair in inputs:
                if missing := law.missing(pair):
                    found.append(
                        f"pairs: {' / '.join(pair.pair.materials)}: {law.name} needs {', '.join(missing)}"
                    )
            if isinstance(law, RollingLaw) and scene.contact.torsion and law.with_torsion is None:
                found.append(
                    f"contact.torsion = true: contact.rolling = {law.name!r} has no twisting friction"
                )
        law = names.normal_law
        if "characteristic_velocity" in law.reads and scene.contact.characteristic_velocity is None:
            found.append(f"contact.characteristic_velocity: missing; {law.name} needs it [m/s]")
    return found or [*_ranges(scene), *_adhesion(scene)]


def _ranges(scene: Scene) -> list[str]:
    """A wall of another normal law beside one that acts across gaps."""
    others = {name for name, names in scene.wall_laws.items() if names.normal != scene.contact.normal}
    return [
        f"walls: {name}.contact.normal: a law that acts across a gap must be that of all contacts"
        for name in sorted(others)
        if scene.contact_range > 0
    ]


def _adhesion(scene: Scene) -> list[str]:
    """What a law with adhesion does not go with."""
    contact, name = scene.contact, scene.contact.normal
    if not isinstance(scene.normal_law, AdhesiveLaw):
        return []
    key = f"contact.normal = {name!r}"
    rolling = {names.rolling for names in scene.contact_groups}
    cohesive = {names.cohesion for names in scene.contact_groups} - {registry.OFF}
    refused = {
        "solver.integrator = 'path': its force jumps where contacts begin and break, and a step across a jump"
        " is of first order, which a damping along the path does not mend; use 'half_step'":
            scene.solver.integrator == "path",
        "contact.limit_force = true: would take its attraction away": contact.limit_force,
        f"contact.cohesion = {', '.join(map(repr, sorted(cohesive)))}: it has an attraction of its own":
            bool(cohesive),
        "contact.rolling = 'cdt': its torque k_n overlap mu_r R* would drive a contact of negative overlap":
            "cdt" in rolling,
        "contact.mesh_contacts = 'liggghts': LIGGGHTS has no law with adhesion to agree with; use 'unique'":
            bool(scene.meshes) and contact.mesh_contacts == "liggghts",
    }  # fmt: skip
    return [f"{key}: {what}" for what, wrong in refused.items() if wrong]


# -- space -------------------------------------------------------------------------------------------------


def _state(scene: Scene) -> list[str]:
    try:
        state = scene.stated_particles
    except (ValueError, GpudemError) as error:
        return [f"{error}" if str(error).startswith("insert[") else f"particles.{error}"]
    except MemoryError:
        return ["particles: more than fits in the memory of this machine"]
    if len(state) > MAX_PARTICLES:
        return [f"particles: {len(state)} are too many for 32-bit indices; allowed: <= {MAX_PARTICLES}"]
    if not len(state):
        return ["particles.position: no particles"]
    if scene.particles is not None and not len(state) - len(scene.inserted.step if scene.insert else ()):
        return ["particles.position: no particles; leave the section out"]
    return []


def _domain(scene: Scene) -> list[str]:
    if all(b > a for a, b in zip(scene.domain.lo, scene.domain.hi, strict=True)):
        return []
    return [f"domain.hi = {scene.domain.hi}: must be above domain.lo = {scene.domain.lo} in x, y and z [m]"]


def _periodic(scene: Scene, contact_range: float) -> list[str]:
    reach = 2 * float(scene.state.radius.max()) + contact_range + scene.skin
    return [
        f"domain: {axis} is periodic and {b - a:g} m long;"
        f" must exceed 2 (largest diameter + skin) = {2 * reach:g} m"
        for axis, a, b, periodic in zip(
            "xyz", scene.domain.lo, scene.domain.hi, scene.domain.periodic, strict=True
        )
        if periodic and b - a <= 2 * reach
    ]


def _inside(scene: Scene) -> list[str]:
    state, found = scene.state, []
    lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
    outside = ((state.position < lo) | (state.position > hi)).any(axis=1)
    if outside.any():
        i = int(np.argmax(outside))
        found.append(
            f"particles: {int(outside.sum())} outside the domain {scene.domain.lo} .. {scene.domain.hi} m,"
            f" the first: particle {i + 1} at {tuple(state.position[i].tolist())} m"
        )
    return found


def _behind_walls(scene: Scene) -> list[str]:
    """Particles in walls that are there when they come; where a wall has moved to by then, a run tells."""
    state, steps, found = scene.state, scene.arrival_steps, []
    allowed = 2 if "overlap" in scene.allow else MAX_START_OVERLAP
    for wall in scene.wall_elements:
        there = np.array([scene.is_present(wall, step) for step in (0, *scene.insertion_steps)])
        still = wall.name not in scene.moving_walls
        there = there[np.searchsorted((0, *scene.insertion_steps), steps)] & (still | (steps == 0))
        if not there.any():
            continue
        overlap = np.where(there, wall.overlap(state.position, state.radius), 0.0)
        bad = (overlap > allowed * state.radius) & (scene.held == groups.FREE)
        for what, when, group in (("particles", "", steps == 0), ("insert", " at insertion", steps > 0)):
            if not (bad & group).any():
                continue
            i = int(np.argmax(np.where(group, overlap, 0.0)))
            where = "outside" if wall.kind == "plane" else "in"
            found.append(
                f"{what}: {int((bad & group).sum())} {where} wall {wall.name}{when}; particle {i + 1} reaches"
                f" {overlap[i]:.3g} m into it (allowed: {allowed:g} radii)"
            )
    return found


def _overlaps(scene: Scene) -> list[str]:
    state, lo = scene.particles_at_start, np.array(scene.domain.lo)
    if "overlap" in scene.allow or len(state) < 2 or lattice_within(scene):
        return []
    period = np.where(scene.domain.periodic, np.array(scene.domain.hi) - lo, 0.0)
    free = scene.held[: len(state)] == groups.FREE
    found = find_overlaps(state.position - lo, state.radius, period, MAX_START_OVERLAP, free)
    if found is None:
        return []
    i, j = found.worst
    return [
        f"particles: {'' if found.complete else 'at least '}{found.count} pairs overlap at the start,"
        " the worst:"
        f" {i + 1} and {j + 1} by {found.overlap:.3g} m"
        f" (allowed: {MAX_START_OVERLAP:g} of the smaller radius); waive with allow = ['overlap']"
    ]


def _inserted_overlaps(scene: Scene) -> list[str]:
    """Overlaps of particles that come in one step; with those that are there already only a run can tell."""
    if "overlap" in scene.allow or not scene.insert:
        return []
    state, lo = scene.state, np.array(scene.domain.lo)
    period = np.where(scene.domain.periodic, np.array(scene.domain.hi) - lo, 0.0)
    for step in scene.insertion_steps:
        a, b = scene.count_at(step - 1), scene.count_at(step)
        if b - a < 2:
            continue
        found = find_overlaps(state.position[a:b] - lo, state.radius[a:b], period, MAX_START_OVERLAP)
        if found is not None:
            i, j = found.worst
            return [
                f"insert: {'' if found.complete else 'at least '}{found.count} pairs inserted in step {step}"
                f" ({step * scene.time.step:.6g} s) overlap, the worst: {a + i + 1} and {a + j + 1} by"
                f" {found.overlap:.3g} m (allowed: {MAX_START_OVERLAP:g} of the smaller radius);"
                " waive with allow = ['overlap']"
            ]
    return []


# -- units and time ----------------------------------------------------------------------------------------


# Values that suggest millimetres, gigapascals or g/cm3, or a slip of the exponent.


def _material_units(scene: Scene) -> list[str]:
    if "unusual_units" in scene.allow:
        return []
    found = []
    for name, m in scene.materials.items():
        key = f"materials.{name}"
        if m.young < 1e4:
            found.append(
                f"{key}.young = {m.young:g} Pa: {m.young:g} GPa is {m.young * 1e9:g} Pa; {_WAIVE_UNITS}"
            )
        if m.density < 10:
            found.append(
                f"{key}.density = {m.density:g} kg/m3: {m.density:g} g/cm3 is {m.density * 1e3:g} kg/m3;"
                f" {_WAIVE_UNITS}"
            )
        found += _above(f"{key}.young", m.young, 1e14, "Pa") + _above(
            f"{key}.density", m.density, 1e6, "kg/m3"
        )
    return found


def _above(key: str, value: float | None, usual: float, unit: str) -> list[str]:
    """The problem of a value above all usual ones; none for an empty field."""
    if value is None or value <= usual:
        return []
    return [f"{key} = {value:g} {unit}: unusual, above {usual:g} {unit}; {_WAIVE_UNITS}"]


def _pair_units(scene: Scene) -> list[str]:
    if "unusual_units" in scene.allow:
        return []
    stated: dict[str, Pair | PairChange] = {f"pairs[{i}]": pair for i, pair in enumerate(scene.pairs)}
    for k, phase in enumerate(scene.phases):
        stated |= {f"phases[{k}].pairs[{i}]": change for i, change in enumerate(phase.pairs)}
    return [
        problem
        for where, pair in stated.items()
        for key in ("friction", "rolling_friction")
        for problem in _above(f"{where}.{key}", getattr(pair, key), 10, "[1]")
    ]


def _speed_units(scene: Scene) -> list[str]:
    speed = scene.contact.characteristic_velocity
    return (
        [] if "unusual_units" in scene.allow else _above("contact.characteristic_velocity", speed, 1e4, "m/s")
    )


def _gravity_units(scene: Scene) -> list[str]:
    stated = {"gravity": scene.gravity}
    stated |= {f"phases[{k}].gravity": phase.gravity for k, phase in enumerate(scene.phases) if phase.gravity}
    largest = {key: max(map(abs, gravity)) for key, gravity in stated.items()}
    if "unusual_units" in scene.allow:
        return []
    return [
        f"{key} = {g:g} m/s2: {g:g} mm/s2 is {g / 1e3:g} m/s2; {_WAIVE_UNITS}"
        for key, g in largest.items()
        if g > 5000
    ]


def _radius_units(scene: Scene) -> list[str]:
    radius = scene.stated_particles.radius
    largest = float(radius.max())
    if largest <= 1.5 or "unusual_units" in scene.allow:
        return []
    inserted = scene.insert and largest > radius[: len(radius) - len(scene.inserted.step)].max(initial=0.0)
    key = "insert: radius" if inserted else "particles.radius"
    return [f"{key} = {largest:g} m: {largest:g} mm is {largest / 1e3:g} m; {_WAIVE_UNITS}"]


def _duration(scene: Scene) -> list[str]:
    step, duration = scene.time.step, scene.time.duration
    return [f"time.step = {step:g} s: longer than time.duration = {duration:g} s"] if step > duration else []


def _time_step(scene: Scene) -> list[str]:
    if "time_step" in scene.allow:
        return []
    limit, what = step_limit(scene, MAX_RAYLEIGH, MAX_CONTACT)
    if scene.time.step <= limit:
        return []
    return [
        f"time.step = {scene.time.step:g} s: above {what}, {limit:.3g} s; waive with allow = ['time_step']"
    ]


def _vibration(scene: Scene) -> list[str]:
    """What the soft solver cannot do with a moving plane; teeth of few steps can be waived: hard spheres have
    no step.
    """
    found, step = [], scene.time.step
    for plane in scene.planes:
        vibration, key = plane.vibration, f"walls: {plane.name}.vibration"
        if vibration is None:
            continue
        if scene.solver.integrator == "path":
            found.append(f"{key}: solver.integrator = 'path' knows no moving plane; use 'half_step'")
        stroke, radius = vibration.speed * step, float(scene.state.radius.min())
        if stroke >= radius:
            found.append(f"{key}.speed = {vibration.speed:g} m/s: moves {stroke:.3g} m in a step;"
                         f" allowed: < the smallest radius, {radius:g} m")  # fmt: skip
        period = vibration.amplitude / vibration.speed
        if 0 < period < wall_checks.MIN_PERIOD * step and "time_step" not in scene.allow:
            found.append(f"{key}: a period A / U = {period:.3g} s is {period / step:.3g} time steps; allowed:"
                         f" >= {wall_checks.MIN_PERIOD}, or amplitude = 0 for a fast floor;"
                         " waive with allow = ['time_step']")  # fmt: skip
    return found


def step_limit(scene: Scene, rayleigh: float, contact: float) -> tuple[float, str]:
    """(longest step [s], what limits it) for these shares of the Rayleigh and the contact time.

    With `hertz/stiffness` the moduli of the materials do not act, and the Rayleigh time means nothing.
    """
    law = ", ".join(dict.fromkeys(names.normal for names in scene.contact_groups))
    kind = "Hertz contact time" if law == "hertz" else f"contact time ({law})"
    limits = [(contact * contact_time(scene), f"{contact:g} of the {kind}")]
    if uses_moduli(scene):
        limits.append((rayleigh * rayleigh_time(scene), f"{rayleigh:g} of the Rayleigh time"))
    return min(limits)


def warnings(scene: Scene) -> list[str]:
    """What a valid scene states and a user may not expect, one sentence each: the same wherever it is shown.

    A step that is stable and above the usual limits, times that are rounded or extended, settings without
    effect, a scene in which nothing can move or everything leaves. Waived checks are not listed.
    """
    return [*step_warnings(scene), *scene_warnings(scene)]


def scene_warnings(scene: Scene) -> list[str]:
    """The warnings of a scene without `step_warnings`: for codes whose time step only sets when to write."""
    found = [*rounded_times(scene), *without_effect(scene), *unexpected(scene)]
    return list(dict.fromkeys(found))


def step_warnings(scene: Scene) -> list[str]:
    """A step that is stable and still above what is usual."""
    limit, what = step_limit(scene, USUAL_RAYLEIGH, USUAL_CONTACT)
    if scene.time.step <= limit * (1 + 1e-12):
        return []
    return [f"time.step = {scene.time.step:g} s: above the usual {what}, {limit:.3g} s"]


def _position_spacing(scene: Scene) -> list[str]:
    """Positions too coarse to resolve an overlap: floating-point numbers at the far corner of the domain."""
    spacing, corner = position_spacing(scene)
    smallest = float(scene.state.radius.min())
    if spacing <= MAX_SPACING * smallest or "rounding" in scene.allow:
        return []
    return [
        f"solver.precision = {scene.solver.precision!r}: positions at {corner:g} m (domain) are"
        f" {spacing:.2g} m apart, more than {MAX_SPACING:g} of the smallest radius, {smallest:g} m: put the"
        " domain near the origin, or take 'mixed' or 'float64'; waive with allow = ['rounding']"
    ]


def _trace(scene: Scene) -> list[str]:
    stride = scene.stride(scene.output.trace_every)
    if stride is None:
        return []
    rows = scene.n_steps // stride + 1
    size = 15 * 8 * rows * len(scene.state)
    if size <= MAX_TRACE or "memory" in scene.allow:
        return []
    return [
        f"output.trace_every = {scene.output.trace_every:g} s: {rows} rows of {len(scene.state)} particles"
        f" take {size / 1e9:.3g} GB; allowed: <= {MAX_TRACE / 1e9:g} GB; give a longer interval,"
        " use frames_every, or waive with allow = ['memory']"
    ]
