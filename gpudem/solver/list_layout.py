# pyright: reportInvalidTypeForm=false, reportIndexIssue=false, reportArgumentType=false, reportCallIssue=false, reportOperatorIssue=false
"""Where the entries of a particle lie in the list, and in every array with a value for each entry.

Half list: entry m of particle i is at start[i] + m, so the entries of a particle lie one after the other.

Full list, as on a GPU, where neighboring threads read at the same time: in slices of 32 particles (sliced
ELLPACK, Kreutzer et al., SIAM J. Sci. Comput. 36 (2014) C401). Entry m of particle i is at

    start[i / 32] + 32 m + i % 32

so entry m of the 32 particles of a slice lies side by side. A slice is as long as the longest of its lists;
what lies behind the entries of a shorter one is padding, which nothing reads. `Spec.list_slice` is the
distance between two entries of a particle, 1 or 32. The order of the entries is the same in both layouts.
"""

import functools
from collections.abc import Iterable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from gpudem.solver.arrays import access
from gpudem.solver.spec import Spec
from gpudem.solver.state import State, structs


@functools.cache
def place_in_slices(slice_size: int) -> SimpleNamespace:
    """Functions for arrays laid out in slices of so many particles, a power of two.

    first(start, i) -> place of entry 0 of particle i, where slice s begins at start[s].
    first_of_equal(i, length) -> the same where there is room for `length` entries of each particle.
    """
    get_int, bits = access(wp.int32).get, slice_size.bit_length() - 1

    @wp.func
    def lane(i: wp.int32):
        return i & wp.static(slice_size - 1)

    @wp.func
    def first(start: wp.array[wp.int32], i: wp.int32):
        if wp.static(slice_size == 1):
            return get_int(start, i)
        return get_int(start, i >> wp.static(bits)) + lane(i)  # mutate: slice_of_particle

    @wp.func
    def first_of_equal(i: wp.int32, length: wp.int32):
        return (i - lane(i)) * length + lane(i)  # mutate: place_in_cache

    return SimpleNamespace(first=first, first_of_equal=first_of_equal)


@functools.cache
def list_places(spec: Spec) -> SimpleNamespace:
    """Functions of (particles, i) for the list of particle i: its entries are at

    range(first(particles, i), end(particles, i), spec.list_slice)

    length(particles, i) -> how many there are; first_wall(particles, i) -> place of the first wall, or end.
    """
    t = structs(spec.precision)
    Particles, size, get_int = t.Particles, spec.list_slice, access(wp.int32).get
    first_in = place_in_slices(size).first

    @wp.func
    def first(particles: Particles, i: wp.int32):
        return first_in(particles.start, i)

    @wp.func
    def length(particles: Particles, i: wp.int32):
        if wp.static(spec.half_list):
            return get_int(particles.start, i + 1) - get_int(particles.start, i)
        return get_int(particles.count, i)

    @wp.func
    def end(particles: Particles, i: wp.int32):
        if wp.static(spec.half_list):
            return get_int(particles.start, i + 1)
        # mutate: end_of_list
        return first_in(particles.start, i) + wp.static(size) * get_int(particles.count, i)

    @wp.func
    def first_wall(particles: Particles, i: wp.int32):
        if wp.static(spec.has_walls):
            return get_int(particles.wall_start, i)
        return end(particles, i)

    return SimpleNamespace(first=first, length=length, end=end, first_wall=first_wall)


@functools.cache
def slice_widths(slice_size: int) -> Any:
    """A kernel: the room that each slice takes, for so many particles as its longest list has entries."""

    @wp.kernel(module="unique", enable_backward=False)
    def widths(
        # in
        n: wp.int32,
        count: wp.array[wp.int32],
        # out
        width: wp.array[wp.int32],
    ):
        s = wp.tid()
        longest = wp.int32(0)
        for i in range(s * wp.static(slice_size), wp.min((s + 1) * wp.static(slice_size), n)):
            longest = wp.max(longest, count[i])  # mutate: longest_of_slice
        width[s] = wp.static(slice_size) * longest

    return widths


# -- on the host ---------------------------------------------------------------------------------------------


def places(first: np.ndarray, length: np.ndarray, distance: int) -> np.ndarray:
    """Places of `length[i]` entries from `first[i]` on, `distance` apart, particle after particle."""
    before = np.cumsum(length) - length
    return np.repeat(first - distance * before, length) + distance * np.arange(length.sum())


def first_places(spec: Spec, start: np.ndarray, n: int) -> np.ndarray:
    """Place of the first entry of each of n particles, shape (n,)."""
    i = np.arange(n)
    return start[i // spec.list_slice] + i % spec.list_slice


def packed(state: State, names: Iterable[str] = ("neighbor",)) -> dict[str, np.ndarray]:
    """The list of a state one particle after the other, whatever its layout.

    start: first entry of each particle, (n + 1,); with walls, wall_start: first of them that is a wall, (n,);
    and these arrays of `state.particles`, one value for each entry. That is how restart files hold it.
    """
    spec, p, n = state.spec, state.particles, state.n
    first = first_places(spec, p.start.numpy(), n)
    length = np.diff(p.start.numpy()) if spec.half_list else p.count.numpy()
    start = np.concatenate([[0], np.cumsum(length)]).astype(np.int32)
    found = {"start": start}
    if spec.has_walls:
        found["wall_start"] = start[:-1] + (p.wall_start.numpy() - first) // spec.list_slice
        found["wall_start"] = found["wall_start"].astype(np.int32)
    at = places(first, length, spec.list_slice)
    return found | {name: getattr(p, name).numpy()[at] for name in names}


def spread(spec: Spec, given: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What `packed` gave in the layout of a Spec: arrays of `State.particles`, padding zero."""
    found, length = dict(given), np.diff(given["start"])
    if spec.half_list:
        return found
    n, size = len(length), spec.list_slice
    padded = np.zeros(-(-n // size) * size, np.int64)
    padded[:n] = length
    start = np.concatenate([[0], size * np.cumsum(padded.reshape(-1, size).max(axis=1, initial=0))])
    found["start"], found["count"] = start.astype(np.int32), length.astype(np.int32)
    first = first_places(spec, start, n)
    if "wall_start" in given:
        ahead = given["wall_start"] - given["start"][:-1]
        found["wall_start"] = (first + size * ahead).astype(np.int32)
    at = places(first, length, size)
    for name in given.keys() - {"start", "wall_start"}:
        found[name] = np.zeros((start[-1], *given[name].shape[1:]), given[name].dtype)
        found[name][at] = given[name]
    return found
