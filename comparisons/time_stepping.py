"""Hard disks by time steps: move, find overlapping pairs, apply the rule of collision, repeat. NumPy.

Partners that overlap are set apart; only those that approach are turned back. Takes the statement of the
event-driven engine, and shares nothing else with it.
"""

from __future__ import annotations

import numpy as np
from scipy import spatial

from gpudem.event_driven.statement import Statement


def mean_heights(
    statement: Statement, step: float, duration: float, every: float
) -> tuple[np.ndarray, np.ndarray]:
    """(times, mean heights [m]) of disks between walls over a fast floor.

    Args:
        statement: Hard disks in a layer across y, gravity along z.
        step: Time step [s].
        duration: Length of the run [s].
        every: Time between rows [s].
    """
    x, v = statement.position.copy(), statement.velocity.copy()
    walls = statement.segments[0][2]
    diameter, e = 2 * float(statement.radius[0]), float(statement.restitution[0, 0])
    stride, steps = round(every / step), round(duration / step)
    times, heights = [0.0], [float(x[:, 2].mean())]
    for k in range(1, steps + 1):
        x += v * step + 0.5 * step * step * statement.gravity
        v += step * statement.gravity
        for side in np.flatnonzero(walls.present).tolist():
            _turn_at_wall(statement, x, v, side)
        for i, j in spatial.KDTree(x).query_pairs(diameter, output_type="ndarray"):
            r = x[i] - x[j]
            distance = float(np.sqrt(r @ r))
            n = r / distance
            w = float(n @ (v[i] - v[j]))
            if w >= 0:
                continue
            x[i] += 0.5 * (diameter - distance) * n
            x[j] -= 0.5 * (diameter - distance) * n
            v[i] -= 0.5 * (1 + e) * w * n
            v[j] += 0.5 * (1 + e) * w * n
        if k % stride == 0:
            times.append(k * step)
            heights.append(float(x[:, 2].mean()))
    return np.array(times), np.array(heights)


def _turn_at_wall(statement: Statement, x: np.ndarray, v: np.ndarray, side: int) -> None:
    walls, axis, sign = statement.segments[0][2], side // 2, 1 - 2 * (side % 2)
    depth = statement.radius - (x[:, axis] - walls.at[side]) * sign
    w = v[:, axis] * sign
    hit = (depth > 0) & (w < 0)
    e = walls.restitution[side, statement.material[hit]]
    x[hit, axis] += sign * depth[hit]
    v[hit, axis] = sign * ((1 + e) * walls.speed[side] - e * w[hit])
