# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false, reportInvalidTypeForm=false, reportOperatorIssue=false, reportOptionalCall=false
"""Cells of particles of several size classes: for each class a grid of its own over the same domain.

The cells of a class are as wide as the reach of its largest particles. A particle searches, class by class,
the cells within its reach to particles of that class: 27 at most in the grids of its own class and of larger
ones, more only for a large particle among small ones. So the cost of a search depends on the number of
neighbors, not on the largest diameter.

Sorted order: slabs of the domain across the slowest axis, the same for all classes; in a slab class after
class; in a class the cells, the fastest axis last. So particles near each other are near each other in
memory, whatever their sizes, and a block of the half list holds most pairs within it.
"""

import functools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from gpudem.contact.types import WIDE
from gpudem.scene import Scene
from gpudem.scene.removal import search_box
from gpudem.scene.size_classes import class_radii
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs

#: Slabs per block of the half list: one in so many is cut by the end of a block, between two classes.
SLABS_PER_BLOCK = 4


@functools.cache
def grid_struct(precision: str) -> Any:
    """The struct `Grid`: the cells of one size class."""
    wide = WIDE[precision]
    wide3 = wp.types.vector(3, wide)

    @wp.struct
    class Grid:
        # vectors: along the fastest axis of the sorted order, the middle one, the slowest
        cells: wp.vec3i
        inv_cell_size: wide3  # cells per length [1/m]
        lo: wide3  # lower corner of the domain [m]
        hi: wide3  # upper corner of the domain [m]
        is_periodic: wp.vec3i
        radius: wide  # the largest of the class [m]
        layers: wp.int32  # layers of cells in a slab
        first: wp.int32  # key of its first cell in the first slab
        slab_keys: wp.int32  # keys of a slab, all classes together

    return Grid


def class_grids(scene: Scene, axes: list[int], block: int, precision: str) -> tuple[np.ndarray, int]:
    """The `Grid` of each size class, ascending, and the number of keys; axes: fastest, middle, slowest.

    At most eight cells a particle of the class (and 4096).
    """
    lo, hi = (corner[axes] for corner in search_box(scene))
    size = hi - lo
    radius = np.sort(scene.state.radius)
    tops = class_radii(radius, scene.skin + scene.contact_range)
    counts = np.diff(np.searchsorted(radius, tops, side="right"), prepend=0)
    blocks = -(-len(radius) // block)
    slabs = 1 if blocks == 1 else min(SLABS_PER_BLOCK * blocks, 4096)
    grids = np.zeros(len(tops), grid_struct(precision).numpy_dtype())
    keys = 0
    for grid, top, count in zip(grids, tops, counts, strict=True):
        edge = 2 * float(top) + scene.skin + scene.contact_range
        while True:
            cells = np.maximum(1, np.floor(size / edge)).astype(int)
            layers = max(1, round(size[2] / edge / slabs))
            cells[2] = slabs * layers
            if math.prod(cells.tolist()) <= 8 * count + 4096:
                break
            edge *= 1.26  # half as many cells
        grid["cells"], grid["inv_cell_size"], grid["radius"] = cells, cells / size, top
        grid["layers"], grid["first"] = layers, keys
        keys += math.prod(cells.tolist()) // slabs
    grids["slab_keys"], grids["lo"], grids["hi"] = keys, lo, hi
    grids["is_periodic"] = np.array(scene.domain.periodic)[axes]
    return grids, keys * slabs


@functools.cache
def grid_functions(spec: Spec) -> SimpleNamespace:
    """Functions of the cells of a class; vectors in the order of the axes in `Grid`.

    sorted_axes(params, p) -> p along the fastest axis, the middle one, the slowest.
    key_of(grids, p, radius) -> key of the cell of a particle at p.
    layer(grid, c) -> key of the first cell of layer c along the slowest axis.
    covered(grid, k, p, reach) -> first and last cell within reach of p along the k-th axis; one of the two
    may lie outside the grid where the axis is periodic, and no cell comes twice.
    """
    t = structs(spec.precision)
    wide, wide3, Grid = t.wide, t.wide3, grid_struct(spec.precision)

    @wp.func
    def component(p: wide3, axis: wp.int32):
        return wp.where(axis == 0, p[0], wp.where(axis == 1, p[1], p[2]))

    @wp.func
    def sorted_axes(params: t.Params, p: wide3):
        axes = params.axes
        return wide3(component(p, axes[0]), component(p, axes[1]), component(p, axes[2]))

    @wp.func
    def above_lower_face(grid: Grid, k: wp.int32, p: wide3):
        """Distance from the lower face; 0 of a lost particle, which was reported."""
        return wp.where(p[k] >= grid.lo[k] and p[k] <= grid.hi[k], p[k] - grid.lo[k], wide(0.0))

    @wp.func
    def layer(grid: Grid, c: wp.int32):
        slab = c // grid.layers
        # mutate: slab_of_layer
        return slab * grid.slab_keys + grid.first + (c - slab * grid.layers) * grid.cells[0] * grid.cells[1]

    @wp.func
    def cell(grid: Grid, k: wp.int32, p: wide3):
        s = above_lower_face(grid, k, p)
        return wp.min(wp.int32(s * grid.inv_cell_size[k]), grid.cells[k] - 1)

    @wp.func
    def key_of(grids: wp.array[Grid], p: wide3, radius: wide):
        g = wp.int32(0)
        while g < grids.shape[0] - 1 and radius > grids[g].radius:  # mutate: class_of_particle
            g += 1
        grid = grids[g]
        return layer(grid, cell(grid, 2, p)) + cell(grid, 1, p) * grid.cells[0] + cell(grid, 0, p)

    @wp.func
    def covered(grid: Grid, k: wp.int32, p: wide3, reach: wide):
        s, n = above_lower_face(grid, k, p), grid.cells[k]
        first = wp.int32(wp.floor((s - reach) * grid.inv_cell_size[k]))
        last = wp.int32(wp.floor((s + reach) * grid.inv_cell_size[k]))
        if grid.is_periodic[k] != 0:
            if last - first + 1 >= n:  # mutate: whole_axis_once
                return wp.int32(0), n - 1
            return first, last
        return wp.max(first, 0), wp.min(last, n - 1)

    return SimpleNamespace(sorted_axes=sorted_axes, key_of=key_of, layer=layer, covered=covered)
