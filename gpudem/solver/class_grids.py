# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportIndexIssue=false, reportInvalidTypeForm=false, reportOperatorIssue=false, reportOptionalCall=false
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
        cells: wp.vec3i  # along x, y, z
        inv_cell_size: wide3  # cells per length [1/m]
        radius: wide  # the largest of the class [m]
        layers: wp.int32  # layers of cells in a slab
        first: wp.int32  # key of its first cell in the first slab
        slab_keys: wp.int32  # keys of a slab, all classes together

    return Grid


def class_grids(scene: Scene, axes: list[int], block: int, precision: str) -> tuple[np.ndarray, int]:
    """The `Grid` of each size class, ascending, and the number of keys; axes: fastest, middle, slowest.

    At most eight cells a particle of the class (and 4096).
    """
    size = np.array(scene.domain.hi) - np.array(scene.domain.lo)
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
            layers = max(1, round(size[axes[2]] / edge / slabs))
            cells[axes[2]] = slabs * layers
            if math.prod(cells.tolist()) <= 8 * count + 4096:
                break
            edge *= 1.26  # half as many cells
        grid["cells"], grid["inv_cell_size"], grid["radius"] = cells, cells / size, top
        grid["layers"], grid["first"] = layers, keys
        keys += math.prod(cells.tolist()) // slabs
    grids["slab_keys"] = keys
    return grids, keys * slabs


@functools.cache
def grid_functions(spec: Spec) -> SimpleNamespace:
    """Functions of the cells of a class.

    key_of(params, grids, p, radius) -> key of the cell of a particle at p.
    layer(params, grid, c) -> key of the first cell of layer c along the slowest axis.
    covered(params, grid, axis, x, reach) -> first and last cell within reach of x along an axis; one of the
    two may lie outside the grid where the axis is periodic, and no cell comes twice.
    """
    t = structs(spec.precision)
    Params, wide, wide3, Grid = t.Params, t.wide, t.wide3, grid_struct(spec.precision)

    @wp.func
    def layer(params: Params, grid: Grid, c: wp.int32):
        slab = c // grid.layers
        cells = grid.cells[params.axes[0]] * grid.cells[params.axes[1]]
        # mutate: slab_of_layer
        return slab * grid.slab_keys + grid.first + (c - slab * grid.layers) * cells

    @wp.func
    def key_of(params: Params, grids: wp.array[Grid], p: wide3, radius: wide):
        g = wp.int32(0)
        while g < grids.shape[0] - 1 and radius > grids[g].radius:  # mutate: class_of_particle
            g += 1
        grid = grids[g]
        cell = wp.vec3i()
        for k in range(3):
            s = p[k] - params.lo[k]
            if not (p[k] >= params.lo[k] and p[k] <= params.hi[k]):
                s = wide(0.0)
            cell[k] = wp.min(wp.int32(s * grid.inv_cell_size[k]), grid.cells[k] - 1)
        row = cell[params.axes[1]] * grid.cells[params.axes[0]]
        return layer(params, grid, cell[params.axes[2]]) + row + cell[params.axes[0]]

    @wp.func
    def covered(params: Params, grid: Grid, axis: wp.int32, x: wide, reach: wide):
        s = x - params.lo[axis]
        if not (x >= params.lo[axis] and x <= params.hi[axis]):
            s = wide(0.0)  # lost: it was reported
        n = grid.cells[axis]
        first = wp.int32(wp.floor((s - reach) * grid.inv_cell_size[axis]))
        last = wp.int32(wp.floor((s + reach) * grid.inv_cell_size[axis]))
        if params.is_periodic[axis] != 0:
            if last - first + 1 >= n:  # mutate: whole_axis_once
                return wp.int32(0), n - 1
            return first, last
        return wp.max(first, 0), wp.min(last, n - 1)

    return SimpleNamespace(key_of=key_of, layer=layer, covered=covered)
