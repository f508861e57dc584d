"""Groups of particles in the words of a deck."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from gpudem.output import observables
from gpudem.scene import Group, Scene
from gpudem.scene.motion import Linear, Oscillate, Rotate
from gpudem.walls.motion import WallPath
from reference.liggghts.step_files import Written, lines
from reference.liggghts.walls import number, vector

#: Most groups of a deck: LIGGGHTS has 32, `all` and three of ours among them.
MOST = 28
#: Motions that `fix move` has.
MOTIONS = (Linear, Oscillate, Rotate)


@dataclasses.dataclass(frozen=True)
class GroupWords:
    """One group; its name in the deck is group_NAME."""

    name: str
    members: tuple[str, ...]
    """The ends of its `group` commands."""
    motion: str
    """The words of its `fix move`; empty: frozen."""


def groups(scene: Scene) -> list[GroupWords]:
    """Every group in order of statement."""
    return [GroupWords(g.name, _members(g.rows(scene) + 1), _motion(g)) for g in scene.groups]


def any_frozen(scene: Scene) -> bool:
    """Whether a group is frozen."""
    return any(group.frozen for group in scene.groups)


def cannot(group: Group) -> str:
    """What of a group LIGGGHTS has no words for; empty: nothing."""
    if len(group.motion) > 1:
        return f"groups.{group.name}.motion: {len(group.motion)} motions; LIGGGHTS' fix move has one"
    if group.motion and not isinstance(group.motion[0], MOTIONS):
        stated = f"groups.{group.name}.motion[0].type = {group.motion[0].type!r}"
        return f"{stated}: LIGGGHTS' fix move has no such motion"
    return ""


def _motion(group: Group) -> str:
    if not group.motion:
        return ""
    motion = group.motion[0]
    if isinstance(motion, Linear):
        return f"linear {vector(motion.velocity)}"
    if isinstance(motion, Oscillate):
        return f"wiggle {vector(motion.amplitude)} {number(motion.period)}"
    assert isinstance(motion, Rotate), f"{motion.type}: refused by limits.check"
    return f"rotate {vector(motion.point)} {vector(motion.axis)} {number(motion.period)}"


@dataclasses.dataclass(frozen=True)
class GroupLoad:
    """Force and torque on one group, as sums over its particles."""

    name: str
    force: tuple[str, ...]
    """Components of the force on one particle, with weight [N]."""
    moments: tuple[str, ...]
    """Components of the torque of one particle about the reference [N m], as formulas."""
    weights: tuple[str, ...] = ()
    """Where members may leave: mass of one particle [kg], and its moments about the reference [kg m]."""

    @property
    def columns(self) -> list[str]:
        """Words of a thermo line: force and torque with weight [N, N m], and the sums of `weights`."""
        loads = [f"c_load_group_{self.name}[{k}]" for k in range(1, 7)]
        return loads + [f"c_weight_group_{self.name}[{k + 1}]" for k in range(len(self.weights))]

    @property
    def words(self) -> str:
        """The columns as the end of a line."""
        return "".join(f" {word}" for word in self.columns)


def loads(scene: Scene) -> list[GroupLoad]:
    """Of the groups whose forces the history has."""
    found = []
    for group in scene.groups:
        lever = [f"({a}-({number(r)}))" for a, r in zip("xyz", group.reference, strict=True)]
        force, torque = ([f"f_frozen_{what}[{k}]" for k in (1, 2, 3)] for what in ("force", "torque"))
        if group.motion:  # nothing has set them to 0
            force, torque = ([f"{what}{a}" for a in "xyz"] for what in ("f", "tq"))
        turns = [(lever[i], force[j], lever[j], force[i], torque[k])
                 for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1)))]  # fmt: skip
        moments = tuple(f"{a}*{b}-{c}*{d}+{own}" for a, b, c, d, own in turns)
        if group.name in scene.output.group_forces:
            leaves = bool(group.motion and scene.exits)
            weights = ("mass", *(f"mass*{along}" for along in lever)) if leaves else ()
            found.append(GroupLoad(group.name, tuple(force), moments, weights))
    return found


def names(scene: Scene) -> list[str]:
    """The history's columns of groups, as gpudem's."""
    columns = [column.name for group in scene.loaded_groups for column in observables.of_group(group)]
    return [name for name in columns if name not in {f"work_{name}" for name in _without_work(scene)}]


def warnings(scene: Scene) -> list[str]:
    """What is left out of the history's columns of groups, a sentence each."""
    return [
        f"history column work_{name} is left out: LIGGGHTS moves particles in through periodic sides at list"
        " rebuilds only, and the torque of a group that turns jumps"
        for name in _without_work(scene)
    ]


def _without_work(scene: Scene) -> list[str]:
    """Groups that turn, across periodic sides."""
    turning = [g.name for g in scene.loaded_groups if any(motion.turns for motion in g.motion)]
    return turning if any(scene.domain.periodic) else []


def written(scene: Scene) -> list[Written]:
    """The groups of which each step's load is written, for their work."""
    left_out = _without_work(scene)
    moving = [group.name for group in scene.loaded_groups if group.motion and group.name not in left_out]
    return [Written(load.name, (), tuple(load.columns)) for load in loads(scene) if load.name in moving]


def history(scene: Scene, raw: Path, thermo: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The columns of groups by name, as gpudem's; thermo: columns by the words of the deck, and `step`.

    Raises LiggghtsOutputError.
    """
    found: dict[str, np.ndarray] = {}
    worked = {one.name for one in written(scene)}
    for load, group in zip(loads(scene), _in_order(scene), strict=True):
        steps = thermo["step"]
        table = np.stack([thermo[word] for word in load.columns], axis=1)
        values = [*_of_contacts(scene, group, steps, table).T]
        if group.motion:
            values.append(_work(scene, group, raw)[steps] if load.name in worked else np.zeros(len(steps)))
        columns = observables.of_group(group)
        found |= {column.name: v for column, v in zip(columns, values, strict=True)}
    return {name: found[name] for name in names(scene)}


def _in_order(scene: Scene) -> list[Group]:
    """The groups of `loads`."""
    return [group for group in scene.groups if group.name in scene.output.group_forces]


def _of_contacts(scene: Scene, group: Group, steps: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Force and torque about the reference, (k, 6), of the contacts alone, in these steps [N, N m].

    table: (k, 6), or (k, 10) with the mass of the members that are there and its moments.
    """
    if table.shape[1] > 6:
        gravity = scene.gravity_at(steps)
        weight = table[:, 6:7] * gravity  # mutate: weight_of_members_there
        return table[:, :6] - np.concatenate([weight, np.cross(table[:, 7:], gravity)], axis=1)
    rows, gravity = group.rows(scene), scene.gravity_at(steps)
    mass, place = scene.masses[rows].sum(), scene.masses[rows] @ scene.state.position[rows]
    moment = np.tile(place, (len(gravity), 1))
    if group.motion:
        poses = WallPath(group.motion, scene.time.step).at(0, scene.n_steps + 1)
        moment = poses.rotation[steps] @ place + mass * poses.shift[steps]
    moment = moment - mass * np.array(group.reference)
    return table - np.concatenate([mass * gravity, np.cross(moment, gravity)], axis=1)


def _work(scene: Scene, group: Group, raw: Path) -> np.ndarray:
    """Work of a group on the particles since the start in every step [J], shape (steps + 1,)."""
    steps = np.arange(scene.n_steps + 1)
    load = _of_contacts(scene, group, steps, lines(scene, raw, group.name))
    poses = WallPath(group.motion, scene.time.step).at(0, len(steps))
    at = poses.velocity_at(np.tile(group.reference, (len(steps), 1)))
    power = np.sum(load[:, :3] * at, axis=1) + np.sum(load[:, 3:] * poses.spin, axis=1)
    power[0] = 0.0  # the set-up takes no time
    return -np.cumsum(power) * scene.time.step  # mutate: work_of_group_load


def _members(ids: np.ndarray) -> tuple[str, ...]:
    """Ascending ids as spans of consecutive ones."""
    spans = np.split(ids, np.flatnonzero(np.diff(ids) != 1) + 1)  # mutate: spans_of_ids
    return tuple(f"id <> {span[0]} {span[-1]}" for span in spans)
