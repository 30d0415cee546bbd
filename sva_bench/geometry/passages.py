"""The widest clearance at which points are connected."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import label

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.geometry.buckets import clearances
from sva_bench.geometry.cells import distance_field
from sva_bench.geometry.obstacles import Obstacles

_FINEST_M, _PLACES = 0.02, 1_000_000  # finest lattice step among shapes, and most nodes
_STEPS = 16  # bisections of the range of clearances


def widest_passage(obstacles: Obstacles, points: FloatArray) -> float:
    """The greatest clearance at which all points are connected [m], to half a lattice step below; 0 if there is none.

    Args:
        obstacles: The obstacles.
        points: The points [m], shape (n, 2).
    """
    distance, at = _lattice(obstacles, points)
    # The lattice nodes about a point may have another clearance than the point itself.
    low, high = 0.0, float(min(clearances(obstacles, points).min(), distance[at[..., 0], at[..., 1]].max(axis=1).min()))
    if high > 0 and _connects(distance, at, high):
        return high
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if middle > 0 and _connects(distance, at, middle) else (low, middle)
    return max(low, 0.0)


def _lattice(obstacles: Obstacles, points: FloatArray) -> tuple[FloatArray, IntArray]:
    """Distances [m] at the nodes of a lattice, lower bounds on the lines between neighbours; the nodes about points.

    Returns:
        Shapes (rows, columns) and (n, 4, 2): row and column of the four nodes about each point.
    """
    if obstacles.cells is not None:
        field = distance_field(obstacles.cells)
        distance = field.distance_m.astype(np.float64)
        steps = field.cells.from_world(points)[:, ::-1] / (field.cells.cell_m / 2)
    else:
        low, size = obstacles.bounds_m[:2], obstacles.bounds_m[2:] - obstacles.bounds_m[:2]
        step = max(_FINEST_M, math.sqrt(float(np.prod(size)) / _PLACES))
        x, y = (low[axis] + np.arange(math.floor(size[axis] / step) + 1) * step for axis in (0, 1))
        places = np.stack(np.meshgrid(x, y), axis=-1)
        # Halfway to a neighbour an obstacle may be nearer by half a step.
        distance = clearances(obstacles, places.reshape(-1, 2)).reshape(places.shape[:2]) - step / 2
        steps = (points - low)[:, ::-1] / step
    corner = np.floor(steps).astype(np.int64)
    around = corner[:, None] + np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    return distance, np.clip(around, 0, np.array(distance.shape) - 1)


def _connects(distance: FloatArray, at: IntArray, clearance_m: float) -> bool:
    """Whether one connected component with this clearance has a node about every point."""
    components, count = label(distance >= clearance_m)
    near = np.zeros((len(at), count + 1), dtype=np.bool_)
    near[np.arange(len(at))[:, None], components[at[..., 0], at[..., 1]]] = True
    return bool(near[:, 1:].all(axis=0).any())
