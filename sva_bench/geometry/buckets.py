"""Whether points and segments keep a clearance, exactly and fast among thousands of obstacles.

A uniform grid of buckets lists the solids near each bucket: a segment is checked against those of the buckets that it
crosses. All is packed into one array, since passing an array costs a compiled function more than the check.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.geometry.distances import point_box, point_segment, segment_box
from sva_bench.geometry.obstacles import Obstacles

_BUCKETS = 65_536  # about the greatest number of buckets
_HEAD = 14  # numbers before the arrays: 4 bounds, clearance, side, columns, rows, boxes, cylinders, 3 offsets, 0


def clearance_checker(obstacles: Obstacles, clearance_m: float, slack_m: float = 0.0) -> FloatArray:
    """Obstacles in buckets, packed into one array for ``keeps_clear``.

    Args:
        obstacles: The obstacles.
        clearance_m: Distance to keep from them [m].
        slack_m: Violation that is accepted [m].
    """
    needed = clearance_m - slack_m
    x0, y0, x1, y1 = obstacles.bounds_m.tolist()
    side = max(needed, math.sqrt((x1 - x0) * (y1 - y0) / _BUCKETS), 1e-3)
    columns, rows = math.ceil((x1 - x0) / side), math.ceil((y1 - y0) / side)
    turn = obstacles.boxes[:, 4]
    boxes = np.column_stack([obstacles.boxes[:, :4], np.cos(turn), np.sin(turn)])
    starts, items = _buckets(boxes, obstacles.cylinders, x0, y0, side, columns, rows, max(needed, 0.0))
    at_cylinders = _HEAD + boxes.size
    at_starts = at_cylinders + obstacles.cylinders.size
    head = [x0, y0, x1, y1, needed, side, columns, rows, len(boxes), len(obstacles.cylinders), at_cylinders, at_starts,
            at_starts + len(starts), 0.0]
    return np.concatenate([head, boxes.ravel(), obstacles.cylinders.ravel(), starts, items])


@njit(cache=True)  # type: ignore[untyped-decorator]
def _buckets(
    boxes: FloatArray, cylinders: FloatArray, x0: float, y0: float, side: float, columns: int, rows: int, reach: float
) -> tuple[IntArray, IntArray]:
    """The solids within reach of each bucket, in compressed rows: where each bucket's begin, and their numbers."""
    half = 0.5 * side * math.sqrt(2.0) * (1 + 1e-9)  # of the bucket's circle
    starts = np.zeros(columns * rows + 1, dtype=np.int64)
    items = np.empty(0, dtype=np.int64)
    fill = np.zeros(1, dtype=np.int64)
    for counting in (True, False):
        if not counting:
            for k in range(len(starts) - 1):
                starts[k + 1] += starts[k]
            items = np.empty(starts[-1], dtype=np.int64)
            fill = starts[:-1].copy()
        for k in range(len(boxes) + len(cylinders)):
            if k < len(boxes):
                cx, cy, hx, hy, c, s = boxes[k]
                wide, high = abs(c) * hx + abs(s) * hy, abs(s) * hx + abs(c) * hy
            else:
                cx, cy, radius = cylinders[k - len(boxes)]
                hx, hy, c, s = 0.0, 0.0, 1.0, 0.0
                wide, high = radius, radius
            left = max(math.floor((cx - wide - reach - x0) / side - 1e-6), 0)
            right = min(math.floor((cx + wide + reach - x0) / side + 1e-6), columns - 1)
            low = max(math.floor((cy - high - reach - y0) / side - 1e-6), 0)
            top = min(math.floor((cy + high + reach - y0) / side + 1e-6), rows - 1)
            for row in range(low, top + 1):
                for column in range(left, right + 1):
                    mx, my = x0 + (column + 0.5) * side - cx, y0 + (row + 0.5) * side - cy
                    gap = (point_box(c * mx + s * my, -s * mx + c * my, hx, hy) if k < len(boxes)
                           else math.hypot(mx, my) - radius)
                    if gap > reach + half:
                        continue
                    bucket = row * columns + column
                    if counting:
                        starts[bucket + 1] += 1
                    else:
                        items[fill[bucket]] = k
                        fill[bucket] += 1
    return starts, items


@njit(cache=True)  # type: ignore[untyped-decorator]
def keeps_clear(checker: FloatArray, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether a segment keeps the checker's clearance from all obstacles and the bounds; equal ends make it a point."""
    return bool(checks_made(checker, ax, ay, bx, by) > 0)


@njit(cache=True)  # type: ignore[untyped-decorator]
def checks_made(checker: FloatArray, ax: float, ay: float, bx: float, by: float) -> int:
    """The same with the work done: 1 + the number of solids and buckets checked; negative if too near."""
    passed = 1
    x0, y0, x1, y1, needed, side = checker[:6]
    if min(min(ax, bx) - x0, min(ay, by) - y0, x1 - max(ax, bx), y1 - max(ay, by)) < needed:
        return -passed
    columns, rows, boxes = int(checker[6]), int(checker[7]), int(checker[8])
    at_cylinders, at_starts, at_items = int(checker[10]), int(checker[11]), int(checker[12])
    if ax > bx:
        ax, ay, bx, by = bx, by, ax, ay
    along_x, along_y, mx, my = bx - ax, by - ay, 0.5 * (ax + bx), 0.5 * (ay + by)
    long = math.sqrt(along_x * along_x + along_y * along_y)
    # A steep segment is checked against all rows between its ends: few columns, and no rounding amplified by the slope.
    slope = (by - ay) / (bx - ax) if bx - ax > 1e-3 * abs(by - ay) else 0.0
    first = min(max(math.floor((ax - x0) / side - 1e-6), 0), columns - 1)
    last = min(max(math.floor((bx - x0) / side + 1e-6), 0), columns - 1)
    for column in range(first, last + 1):
        # The part of the segment within this column, and the rows that it crosses.
        ya, yb = ay, by
        if slope != 0.0:
            if column > first:
                ya = ay + slope * (x0 + column * side - ax)
            if column < last:
                yb = ay + slope * (x0 + (column + 1) * side - ax)
        low = min(max(math.floor((min(ya, yb) - y0) / side - 1e-6), 0), rows - 1)
        top = min(max(math.floor((max(ya, yb) - y0) / side + 1e-6), 0), rows - 1)
        for row in range(low, top + 1):
            bucket = at_starts + row * columns + column
            passed += 1
            for at in range(at_items + int(checker[bucket]), at_items + int(checker[bucket + 1])):
                k = int(checker[at])
                passed += 1
                if k < boxes:
                    b = _HEAD + 6 * k
                    cx, cy, hx, hy = checker[b], checker[b + 1], checker[b + 2], checker[b + 3]
                    # Quick rejection, without square roots: most boxes are far from the segment's line, or from the
                    # circle about it, by more than rounding.
                    far = (hx + hy + needed) * (1 + 1e-9) + 1e-9
                    if abs(along_x * (cy - ay) - along_y * (cx - ax)) > far * long:
                        continue
                    if (cx - mx) ** 2 + (cy - my) ** 2 > (0.5 * long + far) ** 2:
                        continue
                    if segment_box(ax, ay, bx, by, cx, cy, hx, hy, checker[b + 4], checker[b + 5], needed) < needed:
                        return -passed
                else:
                    c = checker[at_cylinders + 3 * (k - boxes):at_cylinders + 3 * (k - boxes) + 3]
                    if max(point_segment(c[0], c[1], ax, ay, bx, by) - c[2], 0.0) < needed:
                        return -passed
    return passed


@njit(cache=True)  # type: ignore[untyped-decorator]
def clear_points(checker: FloatArray, points: FloatArray) -> BoolArray:
    """Which points keep the checker's clearance, shape (n,)."""
    found = np.empty(len(points), dtype=np.bool_)
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        found[k] = keeps_clear(checker, x, y, x, y)
    return found


def keeps_clearance(obstacles: Obstacles, points: FloatArray, clearance_m: float) -> BoolArray:
    """Which points keep a distance from every obstacle and the bounds, shape (n,).

    Args:
        obstacles: The obstacles.
        points: The points [m], shape (n, 2).
        clearance_m: The distance [m].
    """
    found: BoolArray = clear_points(clearance_checker(obstacles, clearance_m),
                                    np.ascontiguousarray(points, dtype=np.float64))
    return found


@njit(cache=True)  # type: ignore[untyped-decorator]
def _distances(checker: FloatArray, points: FloatArray) -> FloatArray:
    """Exact distances from points to the nearest solid or bound [m], searching buckets outwards; 0 inside a solid."""
    x0, y0, x1, y1, _, side = checker[:6]
    columns, rows, boxes = int(checker[6]), int(checker[7]), int(checker[8])
    at_cylinders, at_starts, at_items = int(checker[10]), int(checker[11]), int(checker[12])
    found = np.empty(len(points))
    for p in range(len(points)):
        x, y = points[p, 0], points[p, 1]
        nearest = min(x - x0, y - y0, x1 - x, y1 - y)
        column = min(max(math.floor((x - x0) / side), 0), columns - 1)
        row = min(max(math.floor((y - y0) / side), 0), rows - 1)
        ring = 0
        while nearest > (ring - 1 - 1e-6) * side and nearest > 0:
            for r in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
                # All of the ring's lowest and highest row; of the rows between, the two ends.
                step = 1 if abs(r - row) == ring else max(2 * ring, 1)
                for c in range(column - ring, column + ring + 1, step):
                    if c < 0 or c >= columns:
                        continue
                    bucket = at_starts + r * columns + c
                    for at in range(at_items + int(checker[bucket]), at_items + int(checker[bucket + 1])):
                        k = int(checker[at])
                        if k < boxes:
                            b = checker[_HEAD + 6 * k:_HEAD + 6 * k + 6]
                            gap = segment_box(x, y, x, y, b[0], b[1], b[2], b[3], b[4], b[5], nearest)
                        else:
                            d = checker[at_cylinders + 3 * (k - boxes):at_cylinders + 3 * (k - boxes) + 3]
                            gap = max(math.hypot(d[0] - x, d[1] - y) - d[2], 0.0)
                        nearest = min(nearest, gap)
            ring += 1
        found[p] = nearest
    return found


def clearances(obstacles: Obstacles, points: FloatArray) -> FloatArray:
    """Distance from each point to the nearest obstacle or outer wall [m], shape (n,); 0 or less inside one."""
    found: FloatArray = _distances(clearance_checker(obstacles, 0.0), np.ascontiguousarray(points, dtype=np.float64))
    return found


def longest_view_heading(obstacles: Obstacles, x: float, y: float, checker: FloatArray | None = None) -> float:
    """The heading of the longest free line of sight from a point [rad], in steps of 5 degrees.

    A robot that stops in it need not turn away from a wall to leave. Ties go to the smallest angle.

    Args:
        obstacles: The obstacles.
        x, y: The point [m].
        checker: From ``sight_checker``, to be reused for many points; ``None`` = made here.
    """
    views = np.deg2rad(np.arange(0.0, 360.0, 5.0))
    x0, y0, x1, y1 = obstacles.bounds_m
    checker = sight_checker(obstacles) if checker is None else checker
    lengths = _views(checker, x, y, views, math.hypot(x1 - x0, y1 - y0))
    return float(views[int(np.argmax(np.round(lengths, 6)))])


def sight_checker(obstacles: Obstacles) -> FloatArray:
    """The checker of ``longest_view_heading``: a line of sight keeps any positive distance."""
    return clearance_checker(obstacles, 1e-300)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _views(checker: FloatArray, x: float, y: float, angles: FloatArray, far: float) -> FloatArray:
    """Lengths of the free lines of sight from a point [m], to a millimetre, shape (angles,)."""
    lengths = np.empty(len(angles))
    for k in range(len(angles)):
        low, high = 0.0, far
        while high - low > 1e-3:
            middle = 0.5 * (low + high)
            if keeps_clear(checker, x, y, x + middle * math.cos(angles[k]), y + middle * math.sin(angles[k])):
                low = middle
            else:
                high = middle
        lengths[k] = low
    return lengths
