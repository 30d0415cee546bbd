"""Which obstacles a drive can meet: those near its course. A world of 50 000 boxes takes seconds to build, a leg's a
hundredth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numba import njit

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.geometry.distances import point_segment
from sva_bench.geometry.obstacles import Obstacles

CORRIDOR_M = 1.0
"""Solids that come so near to the hull of a robot on its course are built."""
_STRAYED_M = 0.8  # a robot further off its course is about to leave what was built; it moves 0.1 m between two poses


@njit(cache=True)  # type: ignore[untyped-decorator]
def _near(points: FloatArray, reach: FloatArray, course: FloatArray) -> BoolArray:
    """Whether each point comes within its reach of a polyline."""
    near = np.zeros(len(points), dtype=np.bool_)
    for i in range(len(points)):
        for k in range(len(course) - 1):
            if point_segment(points[i, 0], points[i, 1], course[k, 0], course[k, 1], course[k + 1, 0],
                             course[k + 1, 1]) <= reach[i]:
                near[i] = True
                break
    return near


def solids_near(obstacles: Obstacles, course: FloatArray, radius_m: float) -> Obstacles:
    """The obstacles that a robot can touch within ``CORRIDOR_M`` of its course, in their order; the bounds stay.

    Args:
        obstacles: All of them.
        course: Vertices of the path that it is to drive [m], shape (n, 2).
        radius_m: Radius of its hull.
    """
    boxes, cylinders = obstacles.boxes, obstacles.cylinders
    far = radius_m + CORRIDOR_M
    return replace(
        obstacles, cells=None,
        boxes=boxes[_near(boxes[:, :2].copy(), far + np.hypot(boxes[:, 2], boxes[:, 3]), course)],
        cylinders=cylinders[_near(cylinders[:, :2].copy(), far + cylinders[:, 2], course)])


def strayed(poses: Sequence[tuple[float, float, float]], course: FloatArray) -> bool:
    """Whether a robot came so far from its course that it might have met what was not built."""
    places = np.array(poses, dtype=np.float64).reshape(-1, 3)[:, :2].copy()
    return not bool(_near(places, np.full(len(places), _STRAYED_M), course).all())
