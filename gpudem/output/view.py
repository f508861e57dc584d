"""The state of a run at one step, as observables and output see it; a column is made when asked for."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from gpudem.errors import SimulationError
from gpudem.output.vtu import Frame
from gpudem.scene import Scene, flow
from gpudem.scene.groups import contact_force
from gpudem.scene.sections import FlowPlane

#: Columns of three components, in order of id.
VECTORS = ("position", "unwrapped_position", "velocity", "angular_velocity", "force", "torque")
#: Columns of one number, which do not change in a run.
SCALARS = ("mass", "radius", "inertia")
#: Rows and last positions [m] where no particle has left.
NONE_LEFT = (np.empty(0, np.int64), np.empty((0, 3)))


@dataclasses.dataclass(frozen=True)
class WallLoad:
    """What the particles do to a wall in one step."""

    force: np.ndarray
    """On the wall [N], shape (3,)."""
    torque: np.ndarray
    """About the wall's torque point [N m], shape (3,)."""
    position: np.ndarray
    """Of the torque point [m], shape (3,)."""
    work: float
    """Of the wall on the particles since the start [J]."""


class View:
    """All particles at one step, at full-step velocities, in order of id; to be read only.

    Columns (SI units), each an attribute: `position`, `velocity`, `angular_velocity`, `force`, `torque`, and
    `unwrapped_position`, which follows particles through periodic sides, shape (n, 3); `mass`, `radius`,
    `inertia` (2/5 m R^2), shape (n,). On the CPU they are NumPy arrays, on a CUDA device Warp arrays
    (`DeviceView`); `numpy(name)` gives a NumPy array in every case.

    `sum`, `total`, `max`, `min` and `largest` are computed where the particles are.
    """

    def __init__(
        self,
        scene: Scene,
        step: int,
        column: Callable[[str], np.ndarray],
        contacts: Callable[[], int] = lambda: 0,
        wall_work: Callable[[], float | None] = lambda: None,
        wall_loads: Callable[[], dict[str, WallLoad]] = dict,
        servo_ways: Callable[[], dict[str, np.ndarray]] = dict,
        triangle_forces: Callable[[], dict[str, np.ndarray]] = dict,
        rows: Callable[[], np.ndarray] | None = None,
        removed: Callable[[], dict[str, tuple[int, float]]] = dict,
        departed: Callable[[], tuple[np.ndarray, np.ndarray]] = lambda: NONE_LEFT,
        group_works: Callable[[], dict[str, float]] = dict,
        crossings: Callable[[], dict[str, np.ndarray]] = dict,
    ):
        """`column(name)` gives one of VECTORS; the other functions the properties of their names."""
        self.scene, self.step = scene, step
        self._column, self._contacts, self._wall_work = column, contacts, wall_work
        self._wall_loads, self._servo_ways = wall_loads, servo_ways
        self._triangle_forces = triangle_forces
        self._rows, self._removed, self._departed = rows, removed, departed
        self._group_works, self._crossings = group_works, crossings
        self._known: dict[Any, Any] = {}

    @classmethod
    def of_frame(
        cls, scene: Scene, step: int, frame: Frame, contacts: int = 0, unwrapped: np.ndarray | None = None
    ) -> View:
        """The view of a frame; `unwrapped` positions [m], by default those of the frame."""
        columns = {**frame, "unwrapped_position": frame["position"] if unwrapped is None else unwrapped}
        return cls(scene, step, columns.__getitem__, lambda: contacts, rows=lambda: frame["id"] - 1)

    @property
    def time(self) -> float:
        """Physical time [s]."""
        return self.step * self.scene.time.step

    def __len__(self) -> int:
        return len(self.rows) if self.scene.exits else self.scene.count_at(self.step)

    @property
    def rows(self) -> np.ndarray:
        """The rows of the scene that are there, ascending: id - 1, shape (n,)."""
        return self._once("rows", self._rows or (lambda: np.arange(self.scene.count_at(self.step))))

    def passed(self, plane: FlowPlane) -> tuple[int, float]:
        """Net number and mass [kg] of particles that have passed a plane or face of `output.flow` since the
        start.
        """

        def compute() -> tuple[int, float]:
            if plane.face is not None:
                crossed = self._once("crossings", self._crossings)[plane.name]
                return int(crossed.sum()), float(self.scene.masses @ crossed)
            left, where = self._departed()
            position = np.concatenate([self.numpy("position"), where])
            return flow.passed(self.scene, plane, np.concatenate([self.rows, left]), position)

        return self._once(("passed", plane.name), compute)

    @property
    def removed(self) -> dict[str, tuple[int, float]]:
        """Number and mass [kg] of the particles that have left since the start, by name of the exit."""
        return self._once("removed", self._removed)

    def __getattr__(self, name: str) -> Any:
        if name in VECTORS or name in SCALARS:
            return self.column(name)
        raise AttributeError(f"a view has no column {name!r}; known: {', '.join((*VECTORS, *SCALARS))}")

    def column(self, name: str) -> Any:
        """A column where it is: a NumPy array, or a Warp array on the device."""
        return self.numpy(name)

    def numpy(self, name: str) -> np.ndarray:
        """A column as a NumPy array, float64."""
        name = self._same(name)
        return self._once(name, lambda: self._scalar(name) if name in SCALARS else self._column(name))

    def _same(self, name: str) -> str:
        """Without periodic sides there is nothing to unwrap."""
        plain = name == "unwrapped_position" and not any(self.scene.domain.periodic)
        return "position" if plain else name

    def _scalar(self, name: str) -> np.ndarray:
        rows = self.rows if self.scene.exits else slice(len(self))
        mass, radius = self.scene.masses[rows], self.scene.state.radius[rows]
        if name != "inertia":
            return mass if name == "mass" else radius
        return 0.4 * mass * radius**2  # mutate: moments_of_inertia

    def _once(self, key: Any, make: Callable[[], Any]) -> Any:
        if key not in self._known:
            self._known[key] = make()
        return self._known[key]

    @property
    def contacts(self) -> int:
        """Contacts between particles and of particles with walls."""
        return self._once("contacts", self._contacts)

    @property
    def wall_work(self) -> float | None:
        """Work of moving walls since the start [J]; None where none moves."""
        return self._once("wall_work", self._wall_work)

    @property
    def servo_ways(self) -> dict[str, np.ndarray]:
        """How far servos have moved their walls beyond the motions of the scene [m], (3,), by name."""
        return self._once("servo_ways", self._servo_ways)

    @property
    def triangle_forces(self) -> dict[str, np.ndarray]:
        """Force of the particles on each triangle [N], shape (k, 3), of the meshes that `output.wall_stress`
        names, by name.
        """
        return self._once("triangle_forces", self._triangle_forces)

    @property
    def wall_loads(self) -> dict[str, WallLoad]:
        """Force, torque and work of the walls that `output.wall_forces` names, by name of the wall."""
        return self._once("wall_loads", self._wall_loads)

    @property
    def group_works(self) -> dict[str, float]:
        """Work of the groups with a motion on the particles since the start [J], by name of the group."""
        return self._once("group_works", self._group_works)

    def group_load(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Force [N] of the contacts on a group, and their torque [N m] about its reference, each (3,)."""

        def found() -> tuple[np.ndarray, np.ndarray]:
            group = next(group for group in self.scene.groups if group.name == name)
            members = np.intersect1d(group.rows(self.scene), self.rows)  # one that moves may have left
            at = np.searchsorted(self.rows, members)
            force = contact_force(self.scene, self.step, members, self.numpy("force")[at])
            lever = self.numpy("position")[at] - np.array(group.reference)
            torque = np.cross(lever, force) + self.numpy("torque")[at]
            return force.sum(axis=0), torque.sum(axis=0)

        return self._once(("group", name), found)

    def frame(self) -> Frame:
        """All columns of a frame, as NumPy arrays."""
        state, rows = self.scene.state, self.rows
        return {
            "id": (rows + 1).astype(np.int64),
            "material": state.material[rows].astype(np.int32),
            **{name: self.numpy(name) for name in ("position", "velocity", "angular_velocity")},
            "radius": state.radius[rows],
            **{name: self.numpy(name) for name in ("force", "torque")},
        }

    def require_finite(self) -> None:
        """Raises SimulationError for a position or velocity that is not a number; names particle and time."""
        for name in ("position", "velocity"):
            bad = ~np.isfinite(self.numpy(name)).all(axis=1)
            if bad.any():
                at = f"t = {self.time:.9g} s (step {self.step})"
                particle = int(self.rows[np.argmax(bad)]) + 1
                raise SimulationError(f"particle {particle} has a {name} that is not a number (NaN) at {at}")

    # -- reductions ----------------------------------------------------------------------------------------

    def total(self, name: str) -> float:
        """Sum of one of SCALARS."""
        return self._once(("total", name), lambda: self.numpy(name).sum())

    def sum(self, name: str, weight: str, squared: bool = False) -> Any:
        """Sum of w_i a_i, three components, or of w_i a_i . a_i; w is one of SCALARS, a one of VECTORS."""
        if not len(self):
            return 0.0 if squared else np.zeros(3)
        return self._once(("sum", name, weight, squared), lambda: self._sum(name, weight, squared))

    def max(self, name: str) -> tuple[float, float, float]:
        """Largest value of each component of one of VECTORS; NaN without particles."""
        if not len(self):
            return np.nan, np.nan, np.nan
        x, y, z = self._once(("max", name), lambda: self._extreme(name, 1))
        return float(x), float(y), float(z)

    def min(self, name: str) -> tuple[float, float, float]:
        """Smallest value of each component of one of VECTORS; NaN without particles."""
        if not len(self):
            return np.nan, np.nan, np.nan
        x, y, z = self._once(("min", name), lambda: self._extreme(name, -1))
        return float(x), float(y), float(z)

    def largest(self, name: str) -> float:
        """Largest magnitude of one of VECTORS; NaN without particles."""
        if not len(self):
            return np.nan
        return self._once(("largest", name), lambda: self._largest(name))

    def _sum(self, name: str, weight: str, squared: bool) -> Any:
        values, weights = self.numpy(name), self.numpy(weight)
        if squared:
            return float(weights @ (values**2).sum(axis=1))  # mutate: weighted_squares
        return weights @ values  # mutate: weighted_sum

    def _extreme(self, name: str, sign: int) -> Any:
        values = self.numpy(name)
        return values.max(axis=0) if sign > 0 else values.min(axis=0)

    def _largest(self, name: str) -> float:
        return float(np.sqrt((self.numpy(name) ** 2).sum(axis=1).max()))


class DeviceView(View):
    """A view whose columns are Warp arrays on a device; reductions run there and give three numbers each.

    Sums are in float64, each in a fixed order: repeated runs agree to the last bit, and with a sum on the
    host to rounding.
    """

    def __init__(
        self,
        scene: Scene,
        step: int,
        read: Callable[[str], Any],
        scalars: dict[str, Any],
        contacts: Callable[[], int] = lambda: 0,
        wall_work: Callable[[], float | None] = lambda: None,
        wall_loads: Callable[[], dict[str, WallLoad]] = dict,
        servo_ways: Callable[[], dict[str, np.ndarray]] = dict,
        triangle_forces: Callable[[], dict[str, np.ndarray]] = dict,
        rows: Callable[[], np.ndarray] | None = None,
        removed: Callable[[], dict[str, tuple[int, float]]] = dict,
        departed: Callable[[], tuple[np.ndarray, np.ndarray]] = lambda: NONE_LEFT,
        group_works: Callable[[], dict[str, float]] = dict,
        crossings: Callable[[], dict[str, np.ndarray]] = dict,
    ):
        """`read(name)` gives a Warp array of three-component vectors; `scalars` lasts from view to view."""
        super().__init__(scene, step, lambda name: self.column(name).numpy().astype(np.float64, copy=False),
                         contacts, wall_work, wall_loads, servo_ways, triangle_forces, rows,
                         removed, departed, group_works, crossings)  # fmt: skip
        self._read, self._scalars = read, scalars

    def column(self, name: str) -> Any:
        """A Warp array on the device."""
        name = self._same(name)
        if name in VECTORS:
            return self._once(("device", name), lambda: self._read(name))
        if self.scene.exits and not np.array_equal(self._scalars.get("rows", ()), self.rows):
            self._scalars.clear()
            self._scalars["rows"] = self.rows
        if name not in self._scalars or len(self._scalars[name]) != len(self):
            import warp as wp

            device = self.column("velocity").device
            self._scalars[name] = wp.array(self._scalar(name), dtype=wp.float64, device=device)
        return self._scalars[name]

    def _sum(self, name: str, weight: str, squared: bool) -> Any:
        from gpudem.output import reductions

        return reductions.weighted_sum(self.column(name), self.column(weight), squared)

    def _extreme(self, name: str, sign: int) -> Any:
        from gpudem.output import reductions

        return reductions.extreme(self.column(name), sign)

    def _largest(self, name: str) -> float:
        from gpudem.output import reductions

        return reductions.largest(self.column(name))
