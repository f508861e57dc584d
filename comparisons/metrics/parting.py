"""Where two runs of one scene separate: the time, the contact, and what differs in it, from their traces."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from comparisons.metrics import contacts
from comparisons.metrics.growth import first_beyond
from gpudem.scene import Scene
from gpudem.scene.groups import FREE
from gpudem.scene.placed import Surface, normal_of, walls_at

Trace = Mapping[str, np.ndarray]

#: Force differences below this share of the largest force so far are not significant.
FORCE_FLOOR = 1e-9
#: Share of a force difference along the normal, above which it is called normal, below 1 - it tangential.
ALONG = 0.9
#: Relative distance from mu F_n at which a tangential force counts as being at the friction limit.
AT_LIMIT = 1e-6
#: Times of the trace over which the past of a contact is followed at most.
MOST_AGE = 200


@dataclasses.dataclass(frozen=True)
class Parting:
    """The first significant difference of two codes."""

    time: float
    """[s]"""
    before: float
    """Last time [s] of the trace without a significant difference."""
    particle: int
    """id of a particle that it concerns."""
    partner: str
    """"particle 7", "wall floor", or "" where no contact is found."""
    what: str
    """Kind of the difference: "normal force", "friction limit", "list", ..."""
    detail: str
    """Its numbers, in words."""

    @property
    def sentence(self) -> str:
        """Where and in what they separate."""
        where = f"between particle {self.particle} and {self.partner}" if self.partner else (
            f"of particle {self.particle}"
        )  # fmt: skip
        return f"{self.what} {where} at {self.time:.6g} s ({self.detail})"


def differences(scene: Scene, a: Trace, b: Trace) -> dict[str, np.ndarray]:
    """Differences of two traces, each (t, n): position [m], speed [m/s]; force [N], torque [N m] if in both.

    Positions to the nearest image. "speed" is the larger one of the differences of velocity and of surface
    velocity R omega. Of particles that are in neither run (yet, or any more) all are 0; that are in one of
    them only, infinite. Raises ValueError for traces of different shape or steps.
    """
    if a["position"].shape != b["position"].shape or not np.array_equal(a["step"], b["step"]):
        raise ValueError("traces of different steps or particles")
    shift = contacts.nearest_image(a["position"] - b["position"], period(scene))
    spin = np.linalg.norm(a["angular_velocity"] - b["angular_velocity"], axis=2) * scene.state.radius
    velocity = np.linalg.norm(a["velocity"] - b["velocity"], axis=2)
    loads = [k for k in ("force", "torque") if k in a and k in b]
    found = {
        "position": np.linalg.norm(shift, axis=2),
        "speed": np.maximum(velocity, spin),
        **{k: np.linalg.norm(a[k] - b[k], axis=2) for k in loads},
    }
    if not (scene.insert or scene.exits):
        return found
    absent = np.isnan(a["position"][..., 0]) & np.isnan(b["position"][..., 0])
    return {k: np.where(absent, 0.0, np.nan_to_num(v, nan=np.inf)) for k, v in found.items()}


def period(scene: Scene) -> np.ndarray:
    """Length (3,) [m] of the domain along periodic axes, 0 along others."""
    lo, hi = np.array(scene.domain.lo), np.array(scene.domain.hi)
    return np.where(scene.domain.periodic, hi - lo, 0.0)


def state_of(scene: Scene, position: np.ndarray, walls: float | Sequence[Surface]) -> contacts.Contacts:
    """All contacts of a state of a scene; `walls`: as `walls_at` has them, or the time [s] for it."""
    here = walls_at(scene, walls) if isinstance(walls, float | int) else walls
    return contacts.find(position, scene.state.radius, period(scene), here, scene.held == FREE)


def find(
    scene: Scene, names: tuple[str, str], a: Trace, b: Trace, allowed: Mapping[str, np.ndarray], until: float
) -> Parting | None:
    """The first significant difference of two traces before a time, and its cause; None if there is none.

    Args:
        scene: The scene of both.
        names: Of the codes, for the text.
        a: Trace of the first code.
        b: Trace of the second one.
        allowed: What rounding allows, (t,) of each of the keys of `differences`.
        until: Time [s] after which nothing is compared.
    """
    found = differences(scene, a, b)
    excess = np.max([found[k].max(axis=1) / allowed[k] for k in ("position", "speed")], axis=0)
    inside = a["time"] <= until
    last = first_beyond(np.where(inside, excess, 0.0), np.ones(len(excess)))
    if last is None:
        return None
    loads = _loads(scene, found, a, b, allowed)
    first = None
    if loads:
        load = np.max([values.max(axis=1) for values in loads.values()], axis=0)
        first = first_beyond(load[: last + 1], np.ones(last + 1))
    step = last if first is None else first
    return _Cause(scene, names, a, b, step, found, loads, first is not None).parting()


def _loads(
    scene: Scene, found: Mapping[str, np.ndarray], a: Trace, b: Trace, allowed: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Differences of forces and torques over what is allowed, each (t, n); none without forces."""
    if "force" not in found:
        return {}
    larger = np.maximum(np.abs(np.nan_to_num(a["force"])), np.abs(np.nan_to_num(b["force"])))
    largest = np.linalg.norm(larger, axis=2).max(axis=1)
    scale = FORCE_FLOOR * np.maximum.accumulate(largest)
    loads = {"force": found["force"] / np.maximum(allowed["force"], scale)[:, None]}
    if "torque" in found:
        limit = np.maximum(allowed["torque"], scale * float(scene.state.radius.max()))
        loads["torque"] = found["torque"] / limit[:, None]
    return loads


class _Cause:
    """The particle, the contact and the kind of a difference at one index of two traces."""

    def __init__(self, scene, names, a, b, k, found, loads, by_load: bool):
        self.scene, self.names, self.a, self.b, self.k = scene, names, a, b, k
        self.found, self.loads, self.by_load = found, loads, by_load
        self.weight = scene.masses[:, None] * scene.gravity_at(a["step"][[k]])
        self.kind = max(loads, key=lambda name: loads[name][k].max()) if by_load else "position"
        rows = loads[self.kind][k] if by_load else found["position"][k] + found["speed"][k]
        self.i = int(np.argmax(rows))
        self.change = scene.masses[:, None] * (a["velocity"][k] - b["velocity"][k])
        if by_load:
            self.change = a["force"][k] - b["force"][k]
        self.radius, self.period = scene.state.radius, period(scene)

    def parting(self) -> Parting:
        """All that is known of it."""
        time, before = self.a["time"][self.k], self.a["time"][max(self.k - 1, 0)]
        partner, normal, pair, single = self.contact()
        what, detail = self.kinds(partner, normal, pair, single)
        return Parting(float(time), float(before), self.i + 1, partner, what, detail)

    def contact(self):
        """(partner in words, normal on i, material pair, whether i has no other contact)."""
        states = [self.a["position"][self.k], self.b["position"][self.k]]
        walls = walls_at(self.scene, self.a["time"][self.k])
        candidates = {}
        for position in states:
            state = state_of(self.scene, position, self.a["time"][self.k])
            for (i, j), normal in zip(state.pairs.tolist(), state.normal, strict=True):
                if self.i in (i, j):
                    other = j if self.i == i else i
                    candidates["particle", other] = normal if self.i == i else -normal
            for i, k in state.wall_pairs.tolist():
                if i == self.i:
                    candidates["wall", k] = normal_of(walls[k])
        if not candidates:
            return "", None, None, False
        change = self.change[self.i]

        def misfit(key) -> float:
            """How badly a contact with this partner explains the change: reaction on it, or none."""
            if key[0] == "particle":
                return float(np.linalg.norm(self.change[key[1]] + change))
            others = [self.change[j] for kind, j in candidates if kind == "particle"]
            return float(max([np.linalg.norm(c) for c in others], default=0.0))

        best = min(candidates, key=misfit)
        names = list(self.scene.materials)
        own = names[self.scene.state.material[self.i]]
        if best[0] == "particle":
            partner, material = f"particle {best[1] + 1}", names[self.scene.state.material[best[1]]]
        else:
            partner, material = f"wall {walls[best[1]].name}", walls[best[1]].material
        return partner, candidates[best], self.scene.pair(own, material), len(candidates) == 1

    def kinds(self, partner: str, normal, pair, single: bool) -> tuple[str, str]:
        """(what differs, its numbers)."""
        change, (one, two) = self.change[self.i], self.names
        mass = self.scene.masses[self.i]
        if not partner:
            if not self.by_load:
                size = self.found["speed"][self.k, self.i]
                return "motion without a contact", f"speeds differ by {size:.2g} m/s; {self.unseen()}"
            gap = np.linalg.norm(change) / mass
            return "force without a contact", f"accelerations differ by {gap:.3g} m/s2: gravity or time step"
        if not self.by_load:
            size = self.found["speed"][self.k, self.i]
            return "motion in a contact", f"speeds differ by {size:.2g} m/s; {self.unseen()}"
        forces = [run["force"][self.k, self.i] - self.weight[self.i] for run in (self.a, self.b)]
        sizes = [float(np.linalg.norm(f)) for f in forces]
        if single and min(sizes) <= 1e-12 * max(sizes):
            without = self.names[int(np.argmin(sizes))]
            return (
                "missing contact (neighbor list or wall list)",
                f"no force in {without}, {max(sizes):.3g} N",
            )
        if self.kind == "torque":
            values = [run["torque"][self.k, self.i] for run in (self.a, self.b)]
            gap = float(np.linalg.norm(values[0] - values[1]))
            return "torque", f"differs by {gap:.3g} N m, the force does not: rolling friction or lever arm"
        if normal is None:
            return "contact force", f"{sizes[0]:.6g} N in {one}, {sizes[1]:.6g} N in {two}"
        share = abs(float(change @ normal)) / float(np.linalg.norm(change))
        if not single:
            part = "normal force" if share > ALONG else "tangential force" if share < 1 - ALONG else "force"
            return part, f"differs by {np.linalg.norm(change):.3g} N; one of several contacts of the particle"
        along = [float(f @ normal) for f in forces]
        across = [float(np.linalg.norm(f - n * normal)) for f, n in zip(forces, along, strict=True)]
        ratio = [t / n if n else float("nan") for t, n in zip(across, along, strict=True)]
        tangential = f"|F_t|/F_n = {ratio[0]:.6g} in {one}, {ratio[1]:.6g} in {two}"
        if share < 1 - ALONG:
            return self.tangential(along, across, pair), tangential + self.age(partner)
        normal_force = f"F_n = {along[0]:.6g} N in {one}, {along[1]:.6g} N in {two}{self.age(partner)}"
        if share > ALONG:
            return "normal force", normal_force
        return "normal force and tangential force", f"{normal_force}; {tangential}"

    def age(self, partner: str) -> str:
        """For how long the contact had lasted without a difference, in words; "" for one that begins."""
        word, _, name = partner.partition(" ")
        count = 0
        for k in range(self.k - 1, -1, -1):
            walls = walls_at(self.scene, self.a["time"][k])
            state = state_of(self.scene, self.a["position"][k], self.a["time"][k])
            if word == "particle":
                there = sorted((self.i, int(name) - 1)) in state.pairs.tolist()
            else:
                there = any(i == self.i and walls[w].name == name for i, w in state.wall_pairs.tolist())
            if not there or count >= MOST_AGE:
                break
            count += 1
        if count == 0:
            return ""
        steps = count * int(self.a["step"][1] - self.a["step"][0])
        return f"; {steps} step{'s' if steps > 1 else ''} of this contact agree"

    def unseen(self) -> str:
        """Why no force is named."""
        return "forces agree at the times of the trace" if "force" in self.found else "forces are not written"

    def tangential(self, along: list[float], across: list[float], pair) -> str:
        """Which part of a tangential force differs, as far as two force vectors show."""
        own = pair.friction if pair is not None else 0.0
        limits = [own, *(p.friction for p in self.scene.contact_pairs if p.friction != own)]
        named = [" / ".join(pair.materials) if pair is not None else ""]
        named += [" / ".join(p.materials) for p in self.scene.contact_pairs if p.friction != own]
        found = []
        for n, t in zip(along, across, strict=True):
            at = [k for k, mu in enumerate(limits) if mu > 0 and abs(t - mu * n) <= AT_LIMIT * abs(mu * n)]
            found.append(at[0] if at else None)
        if found[0] != found[1]:
            foreign = [(who, k) for who, k in zip(self.names, found, strict=True) if k]
            ends = "".join(f", in {who} that of {named[k]}," for who, k in foreign)
            return f"tangential force at the friction limit{ends}"
        previous = self.a["position"][max(self.k - 1, 0)]
        state = state_of(self.scene, previous, self.a["time"][self.k])
        persisted = self.i in state.pairs or self.i in state.wall_pairs[:, 0]
        return "tangential force (spring)" if persisted else "tangential force at the first touch"
