"""Shortest paths on occupancy grids that keep a distance: the optimum planners are held to.

A visibility graph over points on the quarter circles about all corners that stick out. Segments are held against every
cell's box, by formulas of this file's own.

Source:
    Lozano-Perez & Wesley (1979), as in ``visibility.py``.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from sva_bench.arrays import BoolArray, FloatArray

_QUADRANT = 9  # steps of 10 degrees on each quarter circle: chords are shorter than their arcs by 0.13 %


def shortest_lengths(occupied: BoolArray, cell_m: float, points: FloatArray, clearance_m: float) -> FloatArray:
    """A lower bound, good to 0.13 % of the bends, of the shortest path between each pair of points; shape (n, n).

    Args:
        occupied: Row 0 lowest; what lies outside is occupied.
        cell_m: Side of a cell.
        points: Where paths begin and end, in the grid's own frame [m], shape (n, 2); free.
        clearance_m: Distance to keep.
    """
    solid = np.pad(occupied, 1, constant_values=True)
    spans = _spans(solid) * cell_m - cell_m  # x0, y0, x1, y1 of runs of occupied cells, the rim included
    node, owner = _nodes(solid, cell_m, clearance_m)
    needed = clearance_m * math.cos(math.pi / 4 / _QUADRANT) - 1e-9  # so near do chords come
    on_rim = _clear(spans, node, node, np.zeros(len(node), dtype=np.bool_), needed)
    node, owner = node[on_rim], owner[on_rim]
    node = np.concatenate([points, node])
    owner = np.concatenate([np.full((len(points), 4), np.nan), owner])
    tails, heads = _seeing(spans, node, owner, needed)
    length = np.maximum(np.hypot(*(node[tails] - node[heads]).T), 1e-15)
    graph = csr_array((length, (tails, heads)), shape=(len(node), len(node)))
    found: FloatArray = dijkstra(graph, directed=False, indices=np.arange(len(points)))[:, : len(points)]
    return found


def _spans(solid: BoolArray) -> FloatArray:
    """Runs of occupied cells along rows, one cell high; those that only continue the row below are joined to it."""
    found: list[list[int]] = []
    open_runs: dict[tuple[int, int], int] = {}
    for y, row in enumerate(solid):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(np.int8), [0]])))
        runs = {(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)}
        open_runs = {run: at for run, at in open_runs.items() if run in runs}
        for run in sorted(runs):
            if run in open_runs:
                found[open_runs[run]][3] = y + 1
            else:
                open_runs[run] = len(found)
                found.append([run[0], y, run[1], y + 1])
    return np.array(found, dtype=np.float64)


def _nodes(solid: BoolArray, cell_m: float, radius: float) -> tuple[FloatArray, FloatArray]:
    """Points on quarter circles, and corner x, y and signs of the quarter that each belongs to."""
    nodes, owners = [], []
    angle = np.linspace(0, math.pi / 2, _QUADRANT + 1)
    arc = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    rows, columns = solid.shape
    for r in range(1, rows):
        for c in range(1, columns):
            block = solid[r - 1:r + 1, c - 1:c + 1]
            for sx in (-1, 1):
                for sy in (-1, 1):
                    mine, beside, above = block[(1 - sy) // 2, (1 - sx) // 2], block[(1 - sy) // 2, (1 + sx) // 2], \
                        block[(1 + sy) // 2, (1 - sx) // 2]
                    if mine and not beside and not above:
                        corner = np.array([(c - 1) * cell_m, (r - 1) * cell_m])
                        nodes.append(corner + arc * (sx, sy))
                        owners.append(np.tile([*corner, sx, sy], (len(arc), 1)))
    if not nodes:
        return np.empty((0, 2)), np.empty((0, 4))
    return np.concatenate(nodes), np.concatenate(owners)


@njit
def _gap(x0: float, y0: float, x1: float, y1: float, ax: float, ay: float, bx: float, by: float, far: float) -> float:
    """Distance between an upright rectangle and a segment; something above ``far`` if it is more."""
    if min(ax, bx) - x1 > far or x0 - max(ax, bx) > far or min(ay, by) - y1 > far or y0 - max(ay, by) > far:
        return math.inf
    # The distance to a convex set is convex along the segment: golden section finds where it is least.
    low, high = 0.0, 1.0
    golden = (math.sqrt(5.0) - 1) / 2
    least = math.inf
    for _ in range(48):
        t, u = high - golden * (high - low), low + golden * (high - low)
        px, py, qx, qy = ax + t * (bx - ax), ay + t * (by - ay), ax + u * (bx - ax), ay + u * (by - ay)
        p = math.hypot(max(x0 - px, px - x1, 0.0), max(y0 - py, py - y1, 0.0))
        q = math.hypot(max(x0 - qx, qx - x1, 0.0), max(y0 - qy, qy - y1, 0.0))
        least = min(least, p, q)
        if least < far:
            return least
        if p <= q:
            high = u
        else:
            low = t
    return least


@njit
def _sees(spans: FloatArray, a: FloatArray, b: FloatArray, needed: float) -> bool:
    for k in range(len(spans)):
        s = spans[k]
        if _gap(s[0], s[1], s[2], s[3], a[0], a[1], b[0], b[1], needed) < needed:
            return False
    return True


@njit
def _clear(spans: FloatArray, starts: FloatArray, ends: FloatArray, found: BoolArray, needed: float) -> BoolArray:
    for k in range(len(starts)):
        found[k] = _sees(spans, starts[k], ends[k], needed)
    return found


@njit
def _tangent(node: FloatArray, owner: FloatArray, towards: FloatArray) -> bool:
    """Whether a line from a node leaves its circle on one side, but for the width of the arc's steps."""
    if math.isnan(owner[0]):
        return True
    rx, ry = node[0] - owner[0], node[1] - owner[1]
    wx, wy = towards[0] - node[0], towards[1] - node[1]
    return bool(abs(rx * wx + ry * wy) <= 0.09 * math.hypot(rx, ry) * math.hypot(wx, wy))  # sin 5 degrees


@njit
def _seeing(spans: FloatArray, node: FloatArray, owner: FloatArray, needed: float) -> tuple[FloatArray, FloatArray]:
    tails = [0]
    heads = [0]
    for i in range(len(node)):
        for j in range(i):
            if (_tangent(node[i], owner[i], node[j]) and _tangent(node[j], owner[j], node[i])
                    and _sees(spans, node[i], node[j], needed)):
                tails.append(i)
                heads.append(j)
    return np.array(tails[1:]), np.array(heads[1:])
