"""Exact distances between points, segments and obstacles, compiled."""

from __future__ import annotations

import math

from numba import njit

from sva_bench.arrays import FloatArray
from sva_bench.geometry.obstacles import Obstacles


@njit(cache=True)  # type: ignore[untyped-decorator]
def point_segment(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Distance from the point p to the segment ab [m]."""
    dx, dy = bx - ax, by - ay
    squared = dx * dx + dy * dy
    t = 0.0 if squared == 0.0 else min(max(((px - ax) * dx + (py - ay) * dy) / squared, 0.0), 1.0)
    return math.hypot(ax + t * dx - px, ay + t * dy - py)


@njit(cache=True)  # type: ignore[untyped-decorator]
def point_box(px: float, py: float, hx: float, hy: float) -> float:
    """Distance from the point p to an axis-aligned box about the origin with half sides hx, hy [m]; 0 inside."""
    return math.hypot(max(abs(px) - hx, 0.0), max(abs(py) - hy, 0.0))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _meets_box(ax: float, ay: float, bx: float, by: float, hx: float, hy: float) -> bool:
    """Whether the segment ab meets an axis-aligned box about the origin (slab test)."""
    low, high = 0.0, 1.0
    for start, move, half in ((ax, bx - ax, hx), (ay, by - ay, hy)):
        if move == 0.0:
            if abs(start) > half:
                return False
            continue
        first, second = (-half - start) / move, (half - start) / move
        low, high = max(low, min(first, second)), min(high, max(first, second))
    return low <= high


@njit(cache=True)  # type: ignore[untyped-decorator]
def segment_box(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, hx: float, hy: float, c: float, s: float,
    far: float,
) -> float:
    """Distance from a segment to a box [m]; ``inf`` if a bound shows that it exceeds ``far``.

    Args:
        ax, ay, bx, by: Ends of the segment [m].
        cx, cy, hx, hy, c, s: Centre, half length, half width [m], cosine and sine of the yaw.
        far: Distance beyond which the exact one is not needed [m].
    """
    # Bounding circles reject most boxes quickly.
    mx, my, half = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * math.hypot(bx - ax, by - ay)
    if math.hypot(mx - cx, my - cy) - half - math.hypot(hx, hy) > far:
        return math.inf
    px, py = c * (ax - cx) + s * (ay - cy), -s * (ax - cx) + c * (ay - cy)
    qx, qy = c * (bx - cx) + s * (by - cy), -s * (bx - cx) + c * (by - cy)
    if _meets_box(px, py, qx, qy, hx, hy):
        return 0.0
    gap = min(point_box(px, py, hx, hy), point_box(qx, qy, hx, hy))
    if ax != bx or ay != by:
        for sx in (-hx, hx):
            for sy in (-hy, hy):
                gap = min(gap, point_segment(sx, sy, px, py, qx, qy))
    return float(gap)


@njit(cache=True)  # type: ignore[untyped-decorator]
def segment_distance(
    bounds: FloatArray, boxes: FloatArray, cylinders: FloatArray, ax: float, ay: float, bx: float, by: float,
    enough: float,
) -> float:
    """Distance from a segment to the nearest obstacle or outer wall [m]; below 0 outside the bounds.

    Args:
        bounds, boxes, cylinders: As in ``Obstacles``.
        ax, ay, bx, by: Ends of the segment [m]; equal ends make it a point.
        enough: The search stops once the distance is below this [m]; ``-inf`` for the exact distance.
    """
    nearest = min(min(ax, bx) - bounds[0], min(ay, by) - bounds[1], bounds[2] - max(ax, bx), bounds[3] - max(ay, by))
    for k in range(len(cylinders)):
        if nearest < enough:
            return float(nearest)
        gap = point_segment(cylinders[k, 0], cylinders[k, 1], ax, ay, bx, by) - cylinders[k, 2]
        nearest = min(nearest, max(gap, 0.0))
    for k in range(len(boxes)):
        if nearest < enough:
            return float(nearest)
        gap = segment_box(ax, ay, bx, by, boxes[k, 0], boxes[k, 1], boxes[k, 2], boxes[k, 3], math.cos(boxes[k, 4]),
                          math.sin(boxes[k, 4]), max(nearest, 0.0))
        nearest = min(nearest, gap)
    return float(nearest)


def clearance(obstacles: Obstacles, x: float, y: float) -> float:
    """Distance from a point to the nearest obstacle or outer wall [m]; 0 or less inside one."""
    return float(segment_distance(obstacles.bounds_m, obstacles.boxes, obstacles.cylinders, x, y, x, y, -math.inf))
