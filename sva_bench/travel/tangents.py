"""Lines that touch the arcs about corners, and paths pulled taut: exact checks, compiled.

A shortest path that keeps a distance bends on arcs about corners only, and its straight parts touch them. So tangents
between points on the arcs make a roadmap near the optimum.

Source:
    Lozano-Perez & Wesley (1979).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.world.near import keeps_clear


@njit(cache=True)  # type: ignore[untyped-decorator]
def _touches(arc: FloatArray, dx: float, dy: float, length: float) -> bool:
    """Whether a line from a point on an arc leaves the arc's circle on one side; it does from a point of its own."""
    if math.isnan(arc[2]):
        return True
    rx, ry = arc[0] - arc[2], arc[1] - arc[3]
    return bool(abs(rx * dx + ry * dy) <= arc[4] * math.hypot(rx, ry) * length)


@njit(cache=True)  # type: ignore[untyped-decorator]
def tangents(checker: FloatArray, arcs: FloatArray) -> IntArray:
    """All free tangents.

    Args:
        checker: As ``clearance_checker`` makes it.
        arcs: Points on arcs, as ``arc_points`` gives them; points of their own have centre NaN.

    Returns:
        Indices of their ends, shape (k, 2).
    """
    found = np.empty((1024, 2), dtype=np.int64)
    count = 0
    for i in range(len(arcs)):
        for j in range(i):
            dx, dy = arcs[j, 0] - arcs[i, 0], arcs[j, 1] - arcs[i, 1]
            length = math.hypot(dx, dy)
            if (_touches(arcs[i], dx, dy, length) and _touches(arcs[j], dx, dy, length)
                    and keeps_clear(checker, arcs[i, 0], arcs[i, 1], arcs[j, 0], arcs[j, 1])):
                if count == len(found):
                    grown = np.empty((2 * count, 2), dtype=np.int64)
                    grown[:count] = found
                    found = grown
                found[count, 0], found[count, 1] = i, j
                count += 1
    return found[:count].copy()


@njit(cache=True)  # type: ignore[untyped-decorator]
def taut(checker: FloatArray, path: FloatArray, window: int) -> FloatArray:
    """The shortest path by way of some of a path's vertices, in their order.

    Args:
        checker: As ``clearance_checker`` makes it.
        path: Vertices [m], shape (n, 2); it keeps the clearance.
        window: How many vertices at most are cut off at a time.
    """
    n = len(path)
    length = np.full(n, np.inf)
    before = np.zeros(n, dtype=np.int64)
    length[0] = 0.0
    for j in range(1, n):
        for i in range(max(j - window, 0), j):
            way = length[i] + math.hypot(path[j, 0] - path[i, 0], path[j, 1] - path[i, 1])
            if way < length[j] and (i == j - 1 or keeps_clear(checker, path[i, 0], path[i, 1], path[j, 0], path[j, 1])):
                length[j], before[j] = way, i
    kept = [n - 1]
    while kept[-1] > 0:
        kept.append(before[kept[-1]])
    shorter: FloatArray = path[np.array(kept[::-1])]
    return shorter
