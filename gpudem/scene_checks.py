"""What a single field cannot show: materials that do not exist, overlaps, particles outside, time steps too large."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from gpudem.scene import Scene

#: Overlap at the start beyond this share of the smaller radius is an error (a settled bed has about 1 %).
MAX_START_OVERLAP = 0.1
#: Largest time step: share of the Rayleigh time, and of the Hertz contact time (5 steps in a contact).
MAX_RAYLEIGH, MAX_HERTZ = 0.5, 0.2


def problems(scene: Scene) -> list[str]:
    """Every problem of a scene whose fields are valid one by one."""
    found = _names(scene)
    if found:
        return found
    try:
        state = scene.state
    except ValueError as error:
        return [f"particles: {error}"]
    if len(state) == 0:
        return ["particles.position: no particles"]
    found += _pairs(scene) + _domain(scene) + _units(scene)
    if not found:
        found += _inside(scene) + _overlaps(scene) + _time(scene)
    return found


def _names(scene: Scene) -> list[str]:
    known = set(scene.materials)
    p = scene.particles
    used = [("particles.material", m) for m in ([p.material] if isinstance(p.material, str) else dict.fromkeys(p.material))]
    used += [(f"walls[{i}].material", w.material) for i, w in enumerate(scene.walls)]
    used += [(f"pairs[{i}].materials", m) for i, pair in enumerate(scene.pairs) for m in pair.materials]
    found = [f"{key} = {m!r}: no such material; known: {', '.join(sorted(known))}" for key, m in used if m not in known]
    planes = [w.name for w in scene.walls]
    found += [f"walls: name {n!r} given twice" for n in sorted({n for n in planes if planes.count(n) > 1})]
    keys = [frozenset(pair.materials) for pair in scene.pairs]
    found += [f"pairs: {' / '.join(sorted(k))} given twice" for k in dict.fromkeys(keys) if keys.count(k) > 1]
    for i, w in enumerate(scene.walls):
        if w.kind == "plane" and not any(w.normal):
            found.append(f"walls[{i}].normal = (0, 0, 0): has no direction")
    return found


def _pairs(scene: Scene) -> list[str]:
    found = []
    ours = scene.particle_materials
    partners = [*ours, *dict.fromkeys(w.material for w in scene.walls if w.material not in ours)]
    for a in ours:
        for b in partners:
            if scene.pair(a, b) is None and (b not in ours or ours.index(a) <= ours.index(b)):
                found.append(f"pairs: {a} / {b} can meet, and no pair gives their restitution and friction")
    if scene.contact.normal == "hertz/stiffness":
        for pair in scene.contact_pairs:
            missing = [k for k in ("kn", "kt", "gamma_n", "gamma_t") if getattr(pair, k) is None]
            if missing:
                found.append(f"pairs {pair.materials}: hertz/stiffness needs {', '.join(missing)}")
    if scene.contact.normal == "hooke" and scene.contact.characteristic_velocity is None:
        found.append("contact.characteristic_velocity: missing; hooke needs it [m/s]")
    return found


def _domain(scene: Scene) -> list[str]:
    found = []
    lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
    if not (hi > lo).all():
        return [f"domain.hi = {scene.domain.hi}: must be above domain.lo = {scene.domain.lo} [m]"]
    reach = 2 * float(scene.state.radius.max()) + scene.skin
    for k in range(3):
        if scene.domain.periodic[k] and hi[k] - lo[k] <= 2 * reach:
            found.append(
                f"domain: {'xyz'[k]} is periodic and {hi[k] - lo[k]:g} m long; must exceed"
                f" 2 (largest diameter + skin) = {2 * reach:g} m"
            )
        for plane in scene.planes:
            if scene.domain.periodic[k] and plane.normal[k] != 0:
                found.append(f"walls: {plane.name} bounds {'xyz'[k]}, which is periodic")
    return found


def _units(scene: Scene) -> list[str]:
    if "unusual_units" in scene.allow:
        return []
    found = []
    radius = float(scene.state.radius.max())
    hint = "waive with allow = ['unusual_units']"
    if radius > 1.5:
        found.append(f"particles.radius = {radius:g} m: SI wants metres ({radius:g} mm = {radius / 1e3:g}); {hint}")
    for name, m in scene.materials.items():
        if m.young < 1e4:
            found.append(f"materials.{name}.young = {m.young:g} Pa: SI wants pascals ({m.young:g} GPa = {m.young * 1e9:g}); {hint}")
        if m.density < 25:
            found.append(
                f"materials.{name}.density = {m.density:g} kg/m3: SI wants kg/m3 ({m.density:g} g/cm3 = {m.density * 1e3:g}); {hint}"
            )
    return found


def _inside(scene: Scene) -> list[str]:
    state, found = scene.state, []
    lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
    outside = ((state.position < lo) | (state.position > hi)).any(axis=1)
    if outside.any():
        i = int(np.argmax(outside))
        found.append(
            f"particles: {int(outside.sum())} outside the domain {scene.domain.lo} .. {scene.domain.hi} m,"
            f" the first: particle {i + 1} at {tuple(state.position[i].tolist())}"
        )
    for plane in scene.planes:
        overlap = state.radius - (state.position - np.array(plane.point)) @ np.array(plane.normal)
        bad = overlap > (2 if "overlap" in scene.allow else MAX_START_OVERLAP) * state.radius
        if bad.any():
            i = int(np.argmax(overlap))
            found.append(
                f"particles: {int(bad.sum())} outside wall {plane.name}; particle {i + 1} reaches"
                f" {overlap[i]:.3g} m into it (allowed: {MAX_START_OVERLAP:g} radii)"
            )
    return found


def _overlaps(scene: Scene) -> list[str]:
    if "overlap" in scene.allow:
        return []
    from scipy.spatial import cKDTree

    state = scene.state
    size = np.array(scene.domain.hi) - np.array(scene.domain.lo)
    boxsize = np.where(scene.domain.periodic, size, 0.0)
    shifted = state.position - np.array(scene.domain.lo)
    tree = cKDTree(np.where(boxsize > 0, shifted % np.where(boxsize > 0, boxsize, 1.0), shifted), boxsize=boxsize)
    reach = 2 * float(state.radius.max())
    pairs = tree.query_pairs(reach * (1 - 1e-12), output_type="ndarray")
    if not len(pairs):
        return []
    i, j = pairs.T
    d = shifted[i] - shifted[j]
    d -= np.where(boxsize > 0, boxsize * np.round(d / np.where(boxsize > 0, boxsize, 1.0)), 0.0)
    overlap = state.radius[i] + state.radius[j] - np.linalg.norm(d, axis=1)
    share = overlap / np.minimum(state.radius[i], state.radius[j])
    if share.max() <= MAX_START_OVERLAP:
        return []
    k = int(np.argmax(share))
    return [
        f"particles: {int((share > MAX_START_OVERLAP).sum())} pairs overlap at the start, the worst: {i[k] + 1} and"
        f" {j[k] + 1} by {overlap[k]:.3g} m (allowed: {MAX_START_OVERLAP:g} of the smaller radius);"
        " waive with allow = ['overlap']"
    ]


def rayleigh_time(scene: Scene) -> float:
    """Smallest Rayleigh time [s] of the particles: pi R sqrt(rho/G) / (0.1631 nu + 0.8766), G = E/(2 (1 + nu)).

    Source: LIGGGHTS manual, fix check/timestep/gran.
    """
    times = []
    for name, index in scene.material_index.items():
        mine = scene.state.radius[scene.state.material == index]
        if len(mine):
            m = scene.materials[name]
            shear = m.young / (2 * (1 + m.poisson))
            times.append(math.pi * mine.min() * math.sqrt(m.density / shear) / (0.1631 * m.poisson + 0.8766))
    return float(min(times))


def top_speed(scene: Scene) -> float:
    """Largest speed [m/s] to expect: the largest at the start, and a fall through the domain."""
    size = np.abs(np.array(scene.domain.hi) - np.array(scene.domain.lo))
    fall = math.sqrt(2 * float(np.abs(scene.gravity) @ size))
    return max(float(np.linalg.norm(scene.state.velocity, axis=1).max()), fall if scene.walls else 0.0)


def hertz_time(scene: Scene) -> float:
    """Shortest Hertz contact time [s] at twice the top speed: 2.868266 (m*^2/(R* E*^2 v))^(1/5); inf if none moves.

    Source: Hertz' elastic impact; the constant is (4/5) sqrt(pi) Gamma(2/5)/Gamma(9/10) (15/16)^(2/5).
    """
    speed = 2 * top_speed(scene)
    if speed == 0:
        return math.inf
    times = []
    for name, index in scene.material_index.items():
        mine = scene.state.radius[scene.state.material == index]
        if len(mine):
            m, r = scene.materials[name], mine.min()
            mass = m.density * 4 / 3 * math.pi * r**3
            modulus = m.young / (2 * (1 - m.poisson**2))
            times.append(2.868266 * ((mass / 2) ** 2 / (r / 2 * modulus**2 * speed)) ** 0.2)
    return float(min(times))


def _time(scene: Scene) -> list[str]:
    found = []
    dt = scene.time.step
    if dt > scene.time.duration:
        found.append(f"time.step = {dt:g} s: longer than time.duration = {scene.time.duration:g} s")
    if "time_step" in scene.allow or scene.contact.normal == "hertz/stiffness":
        return found
    for what, limit, share in (("Rayleigh time", rayleigh_time(scene), MAX_RAYLEIGH), ("Hertz contact time", hertz_time(scene), MAX_HERTZ)):
        if dt > share * limit:
            found.append(
                f"time.step = {dt:g} s: above {share:g} of the {what} {limit:.4g} s; allowed: <= {share * limit:.3g} s;"
                " waive with allow = ['time_step']"
            )
    return found
