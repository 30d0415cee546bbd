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

_MOST_PAIRS = 50_000_000  # of points that are looked at: a second or two


def tangents(checker: FloatArray, arcs: FloatArray) -> IntArray:
    """All free tangents; of very many points on arcs, those to points that are not too far away.

    Args:
        checker: As ``clearance_checker`` makes it.
        arcs: Points on arcs, as ``arc_points`` gives them; points of their own have centre NaN, and their tangents any
            length.

    Returns:
        Indices of their ends, shape (k, 2).
    """
    order = np.argsort(arcs[:, 0], kind="stable")
    x0, y0, x1, y1 = checker[:4]
    # Of points spread evenly, so many partners lie within the circle that there are _MOST_PAIRS.
    longest = math.sqrt((x1 - x0) * (y1 - y0) * 2 * _MOST_PAIRS / math.pi) / max(len(arcs), 1)
    out = arcs[order, :2] - arcs[order, 2:4]
    out /= np.hypot(out[:, 0], out[:, 1])[:, None]
    alone = np.isnan(out[:, 0])
    out[alone] = 0.0  # at right angles to every line: tangent to all
    ends = np.column_stack([arcs[order, :2], out, arcs[order, 4] ** 2])
    found: IntArray = order[_tangents(checker, ends, np.flatnonzero(alone), longest)]
    return found


@njit(cache=True)  # type: ignore[untyped-decorator]
def _tangents(checker: FloatArray, ends: FloatArray, own: IntArray, longest: float) -> IntArray:
    """The same.

    Args:
        checker: As ``clearance_checker`` makes it.
        ends: x, y, the direction from the arc's centre, and the squared tolerance; in order of x, shape (n, 5).
        own: Indices of points of their own.
        longest: Length of tangents between arcs [m].
    """
    found = np.empty((1024, 2), dtype=np.int64)
    count = 0
    for i in range(len(ends)):
        x, y, nx, ny, slack = ends[i]
        alone = nx == 0.0 and ny == 0.0
        j = i - 1
        before = len(own) - 1  # once the others are too far away, only points of their own are left
        while True:
            if j >= 0 and x - ends[j, 0] > longest and not alone:
                while before >= 0 and own[before] > j:
                    before -= 1
                if before < 0:
                    break
                j = own[before]
            if j < 0:
                break
            dx, dy = ends[j, 0] - x, ends[j, 1] - y
            squared = dx * dx + dy * dy
            mx, my = ends[j, 2], ends[j, 3]
            # Within so much of a right angle to the radius a line touches the arc.
            if ((nx * dx + ny * dy) ** 2 <= slack * squared and (mx * dx + my * dy) ** 2 <= ends[j, 4] * squared
                    and (squared <= longest * longest or alone or (mx == 0.0 and my == 0.0))
                    and keeps_clear(checker, x, y, ends[j, 0], ends[j, 1])):
                if count == len(found):
                    grown = np.empty((2 * count, 2), dtype=np.int64)
                    grown[:count] = found
                    found = grown
                found[count, 0], found[count, 1] = i, j
                count += 1
            j -= 1
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
