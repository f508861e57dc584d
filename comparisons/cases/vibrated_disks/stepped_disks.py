# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false
"""Hard disks by time steps: move, find overlapping pairs, apply the collision rule, repeat.

Two rules. The tested one separates overlapping disks and reverses those that approach, each pair once per
step. The source's reverses every overlapping pair, also one that separates, and every disk beyond a wall.
That alone would change little, for separated disks no longer overlap: but its search finds the pairs of a
cell from both sides in the same step, and after the first time the distance is one diameter up to rounding.
Where it is a last digit short, the pair is reversed again and loses energy each time, whatever the step: a
defect of this rule, not of time steps. Which pairs are found twice depends on the cells, so those of the
source are used: 12 by 8 on 2 m by 1 m, the highest open.

One Warp kernel, one thread. Takes the problem of the event-driven engine, and shares nothing else with it.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from gpudem.event_driven.problem import HardSphereProblem
from gpudem.solver.device import compile_kernels, find_device

COLUMNS, ROWS, TOP = wp.constant(12), wp.constant(8), 1.0
_SIDES = (0, 1, 4)  # xlo, xhi, zlo in the order of the problem

real = wp.float64


@wp.struct
class _Box:
    radius: real
    diameter: real
    restitution: real
    gravity: real
    lo: real
    hi: real
    floor: real
    speed: real
    wall_restitution: wp.vec3d
    cell_rate: wp.vec2d


@wp.func
def _against_wall(x: real, v: real, at: real, inward: real, speed: real, e: real, radius: real, tested: bool):
    """(coordinate, velocity) of a disk along the normal of a wall."""
    w = v * inward
    if (x - at) * inward < radius and (w < real(0.0) or not tested):
        x = at + inward * radius
        v = inward * ((real(1.0) + e) * speed - e * w)
    return x, v


@wp.func
def _move(
    box: _Box, dt: real, tested: bool, i: wp.int32,
    x: wp.array[real], z: wp.array[real], u: wp.array[real], w: wp.array[real],
):  # fmt: skip
    """Disk i one step on, then against the walls."""
    px = x[i] + u[i] * dt
    vx = u[i]
    vz = w[i] - box.gravity * dt
    # the source's rule moves with the new velocity
    pz = z[i] + w[i] * dt - wp.where(tested, real(0.5), real(1.0)) * box.gravity * dt * dt
    e = box.wall_restitution
    pz, vz = _against_wall(pz, vz, box.floor, real(1.0), box.speed, e[2], box.radius, tested)
    px, vx = _against_wall(px, vx, box.lo, real(1.0), real(0.0), e[0], box.radius, tested)
    px, vx = _against_wall(px, vx, box.hi, real(-1.0), real(0.0), e[1], box.radius, tested)
    x[i] = px
    z[i] = pz
    u[i] = vx
    w[i] = vz


@wp.func
def _collide(
    box: _Box, tested: bool, i: wp.int32, j: wp.int32,
    x: wp.array[real], z: wp.array[real], u: wp.array[real], w: wp.array[real],
):  # fmt: skip
    """The collision rule for a pair of disks, if they overlap."""
    half = real(0.5)
    rx = x[i] - x[j]
    rz = z[i] - z[j]
    distance = wp.sqrt(rx * rx + rz * rz)
    # two disks in one corner may be set to the same place, without a normal
    if distance < box.diameter and distance > real(0.0):
        nx = rx / distance
        nz = rz / distance
        speed = nx * (u[i] - u[j]) + nz * (w[i] - w[j])
        if tested:
            if speed < real(0.0):
                gap = half * (box.diameter - distance)
                x[i] = x[i] + gap * nx
                z[i] = z[i] + gap * nz
                x[j] = x[j] - gap * nx
                z[j] = z[j] - gap * nz
        else:
            x[j] = x[i] - box.diameter * nx
            z[j] = z[i] - box.diameter * nz
        if speed < real(0.0) or not tested:
            turn = half * (real(1.0) + box.restitution) * speed
            u[i] = u[i] - turn * nx
            w[i] = w[i] - turn * nz
            u[j] = u[j] + turn * nx
            w[j] = w[j] + turn * nz


@wp.kernel(enable_backward=False)
def _run(
    # params
    box: _Box, dt: real, steps: wp.int32, stride: wp.int32, tested: bool,
    # in and out
    x: wp.array[real], z: wp.array[real], u: wp.array[real], w: wp.array[real],
    cell: wp.array[wp.int32], head: wp.array[wp.int32], next: wp.array[wp.int32],
    # out
    heights: wp.array[real],
):  # fmt: skip
    n = x.shape[0]
    for k in range(1, steps + 1):
        for c in range(COLUMNS * ROWS):
            head[c] = -1
        for back in range(n):
            i = n - 1 - back
            _move(box, dt, tested, i, x, z, u, w)
            column = wp.clamp(wp.int32((x[i] - box.lo) * box.cell_rate[0]), 0, COLUMNS - 1)
            row = wp.clamp(wp.int32((z[i] - box.floor) * box.cell_rate[1]), 0, ROWS - 1)
            cell[i] = row * COLUMNS + column
            next[i] = head[cell[i]]
            head[cell[i]] = i
        for i in range(n):
            column = cell[i] % COLUMNS
            row = cell[i] // COLUMNS
            for side in range(5):  # the own cell, and half of the cells around
                there_column = column + wp.where(side == 0 or side == 4, 0, 1)
                there_row = row + wp.where(side == 0, 0, side - 2)
                if side == 4:
                    there_row = row + 1
                if there_column < COLUMNS and there_row >= 0 and there_row < ROWS:
                    j = head[there_row * COLUMNS + there_column]
                    while j >= 0:
                        if j != i and not (tested and side == 0 and j < i):
                            _collide(box, tested, i, j, x, z, u, w)
                        j = next[j]
        if k % stride == 0:
            total = real(0.0)
            for i in range(n):
                total += z[i]
            heights[k // stride] = total / real(n)


def mean_heights(
    problem: HardSphereProblem, step: float, duration: float, every: float, tested: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """(times, mean heights [m]) of disks between walls over a fast floor.

    Args:
        problem: Equal hard disks in a layer across y, gravity along -z, walls xlo, xhi, zlo.
        step: Time step [s].
        duration: Length of the run [s].
        every: Time between rows [s].
        tested: Whether only approaching disks are reversed, each pair once: else the source's rule.
    """
    compile_kernels(find_device("cpu"), [_run])
    walls, material = problem.segments[0][2], int(problem.material[0])
    box = _Box()
    box.radius = float(problem.radius[0])
    box.diameter = 2 * box.radius
    box.restitution = float(problem.restitution[material, material])
    box.gravity = -float(problem.gravity[2])
    box.lo, box.hi, box.floor = (float(walls.position[side]) for side in _SIDES)
    box.speed = float(walls.speed[_SIDES[2]])
    box.wall_restitution = wp.vec3d(*(float(walls.restitution[side, material]) for side in _SIDES))
    box.cell_rate = wp.vec2d(12 / (box.hi - box.lo), 8 / TOP)
    stride, steps, n = round(every / step), round(duration / step), len(problem.position)
    columns = [problem.position[:, 0], problem.position[:, 2]]
    columns += [problem.velocity[:, 0], problem.velocity[:, 2]]
    moving = [wp.array(c.copy(), dtype=real, device="cpu") for c in columns]
    lists = [wp.zeros(size, dtype=wp.int32, device="cpu") for size in (n, 12 * 8, n)]
    heights = wp.zeros(steps // stride + 1, dtype=real, device="cpu")
    inputs = [box, step, steps, stride, tested, *moving, *lists]
    wp.launch(_run, 1, inputs=inputs, outputs=[heights], device="cpu")
    found = heights.numpy().copy()
    found[0] = columns[1].mean()
    return np.arange(len(found)) * stride * step, found
