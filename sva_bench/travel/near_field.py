"""Distances to obstacles as far as they matter: the lattice on which robots find room beside each other."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray
from sva_bench.geometry.cells import Cells, DistanceField, distance_field
from sva_bench.geometry.distances import point_box
from sva_bench.geometry.obstacles import Obstacles

_FINEST_M, _NODES = 0.05, 1_000_000  # finest lattice step over shapes, and about the greatest number of nodes


def near_field(obstacles: Obstacles, reach_m: float) -> DistanceField:
    """Distances to obstacles at the nodes of a lattice: lower bounds on the lines between neighbouring nodes.

    Args:
        obstacles: The obstacles: shapes, or an occupancy grid alone.
        reach_m: Greatest distance of interest [m]: greater ones may be given as this one.
    """
    if obstacles.cells is not None:
        return distance_field(obstacles.cells)
    x0, y0, x1, y1 = obstacles.bounds_m.tolist()
    step = max(_FINEST_M, math.sqrt((x1 - x0) * (y1 - y0) / _NODES))
    rows, columns = (max(math.ceil(length / (2 * step)), 1) for length in (y1 - y0, x1 - x0))
    frame = Cells(occupied=np.zeros((rows, columns), dtype=np.bool_), cell_m=2 * step, origin=np.array([x0, y0, 0.0]))
    distance = np.full((2 * rows + 1, 2 * columns + 1), reach_m + step)
    _lower(distance, obstacles.bounds_m, obstacles.boxes, obstacles.cylinders, step)
    # Halfway to a neighbour an obstacle may be nearer by half a step.
    return DistanceField(cells=frame, distance_m=np.maximum(distance - step / 2, 0.0).astype(np.float32))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _lower(distance: FloatArray, bounds: FloatArray, boxes: FloatArray, cylinders: FloatArray, step: float) -> None:
    """Lower distances to those to the bounds, and of nodes near each solid to that to it, in place."""
    rows, columns = distance.shape
    reach = distance[0, 0]
    for row in range(rows):
        for column in range(columns):
            x, y = bounds[0] + column * step, bounds[1] + row * step
            distance[row, column] = min(reach, x - bounds[0], y - bounds[1], bounds[2] - x, bounds[3] - y)
    for k in range(len(boxes) + len(cylinders)):
        if k < len(boxes):
            cx, cy, hx, hy, yaw = boxes[k]
            c, s = math.cos(yaw), math.sin(yaw)
            wide, high = abs(c) * hx + abs(s) * hy, abs(s) * hx + abs(c) * hy
        else:
            cx, cy, radius = cylinders[k - len(boxes)]
            c, s, hx, hy = 1.0, 0.0, 0.0, 0.0
            wide, high = radius, radius
        left = max(math.floor((cx - wide - reach - bounds[0]) / step), 0)
        right = min(math.ceil((cx + wide + reach - bounds[0]) / step), columns - 1)
        low = max(math.floor((cy - high - reach - bounds[1]) / step), 0)
        top = min(math.ceil((cy + high + reach - bounds[1]) / step), rows - 1)
        for row in range(low, top + 1):
            for column in range(left, right + 1):
                x, y = bounds[0] + column * step - cx, bounds[1] + row * step - cy
                gap = (point_box(c * x + s * y, -s * x + c * y, hx, hy) if k < len(boxes)
                       else math.hypot(x, y) - radius)
                distance[row, column] = min(distance[row, column], gap)
