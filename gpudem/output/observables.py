"""Observables: the columns of a history, by name. A scene chooses them by `output.history`.

An observable is a function of the state at one step (`gpudem.output.view.View`). Another package adds one by
an entry point of the group `gpudem.observables` that leads to an `Observable`, or at run time by `register`::

    from gpudem.output.observables import observable

    @observable("heat", "J")
    def heat(view):
        '''Kinetic energy of the motion against the centre of mass.'''
        mass, momentum = view.total("mass"), view.sum("velocity", weight="mass")
        return 0.5 * (view.sum("velocity", weight="mass", squared=True) - momentum @ momentum / mass)

    [project.entry-points."gpudem.observables"]
    heat = "my_package.heat:heat"

What it takes by `view.sum` and `view.max` is reduced on the device; `view.numpy` downloads an array.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gpudem.entry_points import load_entry_points
from gpudem.errors import GpudemError

if TYPE_CHECKING:
    import pandas

    from gpudem.output.view import View
    from gpudem.scene import Group, Scene
    from gpudem.scene.sections import FlowPlane

GROUP = "gpudem.observables"

#: Columns of every history beside the observables: of these, no observable may have the name.
ALWAYS = ("step", "time")

#: What a history holds where a scene does not say (and `work`, where walls move).
DEFAULT = (
    "kinetic_energy", "rotational_energy", "potential_energy",
    "contacts", "front_x", "centre_x", "centre_y", "centre_z",
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Observable:
    """One number in time. Calling it evaluates it: `observable(view) -> float`."""

    name: str
    """Column of the history: letters, digits and underscores, a letter first."""
    unit: str
    evaluate: Callable[[View], float]
    """Its value at the step of a view. It must change nothing."""
    description: str = ""
    integer: bool = False
    """It counts: the column is one of whole numbers."""

    def __post_init__(self) -> None:
        if not (self.name.isidentifier() and self.name.isascii()) or self.name in ALWAYS:
            raise GpudemError(f"observable {self.name!r}: not a name, or that of a column of every history")

    def __call__(self, view: View) -> float:
        """Its value at the step of a view."""
        return self.evaluate(view)


_registered: dict[str, Observable] = {}


def observable(
    name: str, unit: str, integer: bool = False
) -> Callable[[Callable[[View], float]], Observable]:
    """Make an observable of a function of a view and register it; its docstring says what it is."""

    def make(evaluate: Callable[[View], float]) -> Observable:
        found = Observable(name, unit, evaluate, (evaluate.__doc__ or "").strip(), integer)
        register(found)
        return found

    return make


def register(found: Observable) -> None:
    """Add an observable for this process. Raises GpudemError: not one, or the name is taken."""
    if not isinstance(found, Observable):
        raise GpudemError(f"{found!r} is not an Observable")
    if _registered.get(found.name, found) != found:
        raise GpudemError(f"observable {found.name!r}: there is another one of this name")
    _registered[found.name] = found


def find(name: str) -> Observable | None:
    """The observable of this name; None for an unknown one."""
    if name not in _registered:
        _load_entry_points()
    return _registered.get(name)


def get(name: str) -> Observable:
    """The observable of this name. Raises GpudemError: unknown; names those known."""
    found = find(name)
    if found is None:
        raise GpudemError(f"no observable {name!r}; known: {', '.join(names())}")
    return found


def names() -> list[str]:
    """Every name that `output.history` takes, built-in observables first."""
    _load_entry_points()
    return list(_registered)


@functools.cache
def _load_entry_points() -> None:
    """Those of installed packages, once."""
    load_entry_points(GROUP, register)


def select(history: pandas.DataFrame, names: Sequence[str] | None, code: str) -> tuple[Any, list[str]]:
    """Of a code that computes DEFAULT: the columns that a scene chooses, and a warning for each other one.

    A code whose history cannot have a column leaves it out: the others can still be compared.
    """
    if names is None:
        return history, []
    lacking = [name for name in names if name not in history]
    warnings = [f"history column {name!r} is left out: {code} does not compute it" for name in lacking]
    return history[[*ALWAYS, *(name for name in names if name in history)]], warnings


#: Quantities of three components that `of_wall` gives, with their unit.
VECTORS_OF_WALL = (("force", "N"), ("torque", "N m"), ("position", "m"))


def of_wall(name: str) -> list[Observable]:
    """Columns of one wall: force_NAME_x [N], ..., torque_NAME_z [N m], position_NAME_z [m], work_NAME [J].

    The torque is about the wall's torque point, and the position is that of this point.
    """

    def component(quantity: str, unit: str, k: int) -> Observable:
        def evaluate(view: View) -> float:
            return float(getattr(view.wall_loads[name], quantity)[k])

        return Observable(f"{quantity}_{name}_{'xyz'[k]}", unit, evaluate)

    vectors = [component(q, unit, k) for q, unit in VECTORS_OF_WALL for k in range(3)]
    return [*vectors, Observable(f"work_{name}", "J", lambda view: view.wall_loads[name].work)]


def of_group(group: Group) -> list[Observable]:
    """Columns of one group: force_NAME_x [N], ..., torque_NAME_z [N m], of its contacts, without its weight;
    of one with a motion work_NAME [J], its work on the particles since the start.

    The torque is about the group's `reference`.
    """
    name = group.name

    def component(quantity: int, unit: str, k: int) -> Observable:
        what = ("force", "torque")[quantity]
        return Observable(f"{what}_{name}_{'xyz'[k]}", unit, lambda view: view.group_load(name)[quantity][k])

    loads = [component(q, unit, k) for q, unit in enumerate(("N", "N m")) for k in range(3)]
    return loads + [Observable(f"work_{name}", "J", lambda view: view.group_works[name])] * bool(group.motion)


def of_exit(name: str) -> list[Observable]:
    """Columns of an exit: removed_NAME [1] and removed_mass_NAME [kg], of what has left since the start."""
    return [
        Observable(f"removed_{name}", "1", lambda view: view.removed[name][0], integer=True),
        Observable(f"removed_mass_{name}", "kg", lambda view: view.removed[name][1]),
    ]


def of_flow(plane: FlowPlane) -> list[Observable]:
    """Columns of a plane or face of `output.flow`: flow_count_NAME [1] and flow_mass_NAME [kg], net since the
    start.
    """
    return [
        Observable(f"flow_count_{plane.name}", "1", lambda view: view.passed(plane)[0], integer=True),
        Observable(f"flow_mass_{plane.name}", "kg", lambda view: view.passed(plane)[1]),
    ]


def rates(scene: Scene) -> dict[str, str]:
    """Columns of exits and planes of flow [kg/s], and that of the mass [kg] whose rate each is."""
    found = {f"removal_rate_{stated.name}": f"removed_mass_{stated.name}" for stated in scene.exits}
    return found | {f"flow_rate_{plane.name}": f"flow_mass_{plane.name}" for plane in scene.output.flow}


def with_rates(history: pandas.DataFrame, scene: Scene) -> pandas.DataFrame:
    """A history with the `rates` of the masses that it has: their change since the row before, by time."""
    for name, mass in rates(scene).items():
        if mass in history:
            history[name] = (history[mass].diff() / history["time"].diff()).fillna(0.0)
    return history


# -- those of gpudem -----------------------------------------------------------------------------------------


@observable("kinetic_energy", "J")
def kinetic_energy(view: View) -> float:
    """Of translation: sum of 1/2 m v^2."""
    return 0.5 * view.sum("velocity", weight="mass", squared=True)


@observable("rotational_energy", "J")
def rotational_energy(view: View) -> float:
    """Of rotation: sum of 1/2 I w^2, I = 2/5 m R^2."""
    return 0.5 * view.sum("angular_velocity", weight="inertia", squared=True)


def _centre(view: View) -> np.ndarray:
    """Centre of mass [m]; it follows particles through periodic sides. NaN without particles."""
    if not len(view):
        return np.full(3, np.nan)
    return view.sum("unwrapped_position", weight="mass") / view.total("mass")


@observable("potential_energy", "J")
def potential_energy(view: View) -> float:
    """Of gravity, counted from the origin: - sum of m g . x; x follows particles through periodic sides.

    At the start of a phase with the gravity before it.
    """
    if not len(view):
        return 0.0
    return -float(view.total("mass") * (_centre(view) @ view.scene.gravity_at(np.array([view.step]))[0]))


@observable("contacts", "1", integer=True)
def contacts(view: View) -> float:
    """Contacts between particles and of particles with walls."""
    return view.contacts


@observable("particles", "1", integer=True)
def particles(view: View) -> float:
    """How many particles there are."""
    return len(view)


@observable("front_x", "m")
def front_x(view: View) -> float:
    """Largest x of a particle's centre; it follows particles through periodic sides."""
    return view.max("unwrapped_position")[0]


@observable("centre_x", "m")
def centre_x(view: View) -> float:
    """Centre of mass along x; it follows particles through periodic sides."""
    return float(_centre(view)[0])


@observable("centre_y", "m")
def centre_y(view: View) -> float:
    """Centre of mass along y."""
    return float(_centre(view)[1])


@observable("centre_z", "m")
def centre_z(view: View) -> float:
    """Centre of mass along z."""
    return float(_centre(view)[2])


@observable("work", "J")
def work(view: View) -> float:
    """Work of moving walls on the particles since the start; 0 where none moves."""
    return view.wall_work or 0.0


@observable("largest_speed", "m/s")
def largest_speed(view: View) -> float:
    """Largest speed of a particle."""
    return view.largest("velocity")


@observable("momentum_x", "kg m/s")
def momentum_x(view: View) -> float:
    """Momentum along x: sum of m v_x."""
    return float(view.sum("velocity", weight="mass")[0])


@observable("momentum_y", "kg m/s")
def momentum_y(view: View) -> float:
    """Momentum along y: sum of m v_y."""
    return float(view.sum("velocity", weight="mass")[1])


@observable("momentum_z", "kg m/s")
def momentum_z(view: View) -> float:
    """Momentum along z: sum of m v_z."""
    return float(view.sum("velocity", weight="mass")[2])
