"""Other ways than the shortest, for robots that would meet on it, and ways round robots that failed on theirs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numba import njit
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.geometry.buckets import clearance_checker, clearances, keeps_clear
from sva_bench.geometry.distances import point_segment
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.travel.roadmap import Roadmap, plan_paths, surely_disconnected

_PENALTIES = ((0.6, 2.5), (1.2, 6.0))  # distance to the shortest path [m] within which a metre costs so many
_LONGEST, _LONGER_M = 1.7, 1.5  # a way may be so many times as long as the shortest, and so much more
_APART_M = 0.3  # from which on two ways count as different
_CELL_M = 0.1  # of the grid that marks what is near a path
_GRAZE_M = 1e-6  # a line that leaves a narrow place may come nearer to its walls by so much
_OUT_M = 0.02  # steps in which a free place is looked for about one that is too near to something,
_FARTHEST_M = 0.6  # up to this distance from it
_DIRECTIONS = 32


def alternatives(roadmap: Roadmap, path: FloatArray) -> list[FloatArray]:
    """A path, and up to two others between its ends that avoid it as far as that is worth while.

    Args:
        roadmap: A roadmap with both ends among its points, from ``connecting_roadmap``.
        path: The shortest path [m], shape (k, 2).

    Returns:
        The paths [m], the shortest first, each of shape (k, 2).
    """
    found = [path]
    start, goal = (int(np.argmin(np.hypot(*(roadmap.vertices - end).T))) for end in (path[0], path[-1]))
    if start == goal:
        return found
    edges = roadmap.graph.tocoo()
    low = roadmap.vertices.min(axis=0) - 2 * _PENALTIES[-1][0]
    counts = np.ceil((roadmap.vertices.max(axis=0) + 2 * _PENALTIES[-1][0] - low) / _CELL_M).astype(np.int64)
    for near_m, factor in _PENALTIES:
        near = _marked(path, low, counts[0], counts[1], near_m)
        costs = _costs(roadmap.vertices, edges.row.astype(np.int64), edges.col.astype(np.int64), near, low, factor)
        graph = csr_array((costs, (edges.row, edges.col)), shape=roadmap.graph.shape)
        _, before = dijkstra(graph, directed=False, indices=np.array([goal]), return_predecessors=True)
        way = [start]
        while way[-1] != goal and before[0, way[-1]] >= 0:
            way.append(int(before[0, way[-1]]))
        if way[-1] != goal:
            return found
        other = _pulled(roadmap.checker, roadmap.vertices[way], near, low, factor)
        other[0], other[-1] = path[0], path[-1]
        if _length(other) <= _LONGEST * _length(path) + _LONGER_M and all(
                _farthest(other, known) > _APART_M for known in found):
            found.append(other)
    return found


def way_round(
    obstacles: Obstacles, start: FloatArray, end: FloatArray, clearance_m: float, discs: FloatArray
) -> FloatArray | None:
    """A path from any free place to another among obstacles and robots that stand for good.

    A robot may stand nearer to something than paths are planned: then it first leaves it, coming no nearer.

    Args:
        obstacles: The obstacles.
        start, end: Its ends [m], shape (2,). An end may be nearer to obstacles than the clearance, to discs it may not.
        clearance_m: Distance that the path keeps from obstacles and discs [m].
        discs: Centre x, y, and radius of each disc [m], shape (n, 3).

    Returns:
        Vertices [m], shape (k, 2), k >= 2; ``None`` if there is no path.
    """
    discs = np.asarray(discs, dtype=np.float64).reshape(-1, 3)
    if len(discs) and (np.hypot(*(discs[:, :2] - end).T) - discs[:, 2]).min() < clearance_m - _GRAZE_M:
        return None
    closed = replace(obstacles, cylinders=np.concatenate([obstacles.cylinders, discs])) if len(discs) else obstacles
    checker = clearance_checker(closed, clearance_m, 1e-9)
    first, last = (_freed(closed, checker, np.asarray(place, dtype=np.float64)) for place in (start, end))
    if first is None or last is None:
        return None
    if keeps_clear(checker, *first[-1], *last[-1]):
        inner = np.array([first[-1], last[-1]])
    else:
        points = np.array([first[-1], last[-1]])
        found = None if surely_disconnected(closed, points, clearance_m)[0, 1] else plan_paths(
            closed, points, clearance_m)[0][1]
        if found is None:
            return None
        inner = found
    path = np.concatenate([first[:-1], inner, last[:-1][::-1]])
    moves = np.hypot(*np.diff(path, axis=0).T) > 1e-9
    kept: FloatArray = path[np.r_[True, moves]]
    return kept if len(kept) > 1 else np.array([start, end], dtype=np.float64)


def _freed(obstacles: Obstacles, checker: FloatArray, place: FloatArray) -> FloatArray | None:
    """A straight line from a place to the nearest that keeps the clearance, shape (1 or 2, 2); ``None`` if none is."""
    if keeps_clear(checker, place[0], place[1], place[0], place[1]):
        return place[None]
    room = float(clearances(obstacles, place[None])[0])
    if room <= 0:
        return None
    leaving = clearance_checker(obstacles, room, _GRAZE_M)
    angles = np.arange(_DIRECTIONS) * (2 * math.pi / _DIRECTIONS)
    for away in np.arange(_OUT_M, _FARTHEST_M, _OUT_M).tolist():
        for x, y in (place + away * np.column_stack([np.cos(angles), np.sin(angles)])).tolist():
            if keeps_clear(checker, x, y, x, y) and keeps_clear(leaving, place[0], place[1], x, y):
                return np.array([place, (x, y)])
    return None


def _length(path: FloatArray) -> float:
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


@njit(cache=True)  # type: ignore[untyped-decorator]
def _farthest(one: FloatArray, other: FloatArray) -> float:
    """The greatest distance from a path, in steps along it, to another path [m]."""
    most = 0.0
    for k in range(len(one) - 1):
        ax, ay, bx, by = one[k, 0], one[k, 1], one[k + 1, 0], one[k + 1, 1]
        steps = int(math.hypot(bx - ax, by - ay) / _CELL_M) + 1
        for step in range(steps + 1):
            x, y = ax + step / steps * (bx - ax), ay + step / steps * (by - ay)
            least = math.inf
            for j in range(len(other) - 1):
                least = min(least, point_segment(x, y, other[j, 0], other[j, 1], other[j + 1, 0], other[j + 1, 1]))
            most = max(most, least)
    return most


@njit(cache=True)  # type: ignore[untyped-decorator]
def _marked(path: FloatArray, low: FloatArray, columns: int, rows: int, reach: float) -> BoolArray:
    """Squares of a grid whose middles are within reach of a path, shape (columns, rows)."""
    marks = np.zeros((columns, rows), dtype=np.bool_)
    for k in range(len(path) - 1):
        ax, ay, bx, by = path[k, 0], path[k, 1], path[k + 1, 0], path[k + 1, 1]
        for column in range(max(int((min(ax, bx) - reach - low[0]) / _CELL_M), 0),
                            min(int((max(ax, bx) + reach - low[0]) / _CELL_M) + 1, columns)):
            for row in range(max(int((min(ay, by) - reach - low[1]) / _CELL_M), 0),
                             min(int((max(ay, by) + reach - low[1]) / _CELL_M) + 1, rows)):
                x, y = low[0] + (column + 0.5) * _CELL_M, low[1] + (row + 0.5) * _CELL_M
                if not marks[column, row] and point_segment(x, y, ax, ay, bx, by) <= reach:
                    marks[column, row] = True
    return marks


@njit(cache=True)  # type: ignore[untyped-decorator]
def _cost(ax: float, ay: float, bx: float, by: float, near: BoolArray, low: FloatArray, factor: float) -> float:
    """Length of a line, its parts on marked squares counted so many times."""
    length = math.hypot(bx - ax, by - ay)
    steps = int(length / _CELL_M) + 1
    marked = 0
    for step in range(steps):
        share = (step + 0.5) / steps
        column, row = int((ax + share * (bx - ax) - low[0]) / _CELL_M), int((ay + share * (by - ay) - low[1]) / _CELL_M)
        marked += near[column, row]
    return length * (1.0 + (factor - 1.0) * marked / steps)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _costs(
    vertices: FloatArray, heads: IntArray, tails: IntArray, near: BoolArray, low: FloatArray, factor: float
) -> FloatArray:
    """The cost of each edge, shape (edges,)."""
    costs = np.empty(len(heads))
    for k in range(len(heads)):
        a, b = heads[k], tails[k]
        costs[k] = max(_cost(vertices[a, 0], vertices[a, 1], vertices[b, 0], vertices[b, 1], near, low, factor), 1e-12)
    return costs


@njit(cache=True)  # type: ignore[untyped-decorator]
def _pulled(checker: FloatArray, path: FloatArray, near: BoolArray, low: FloatArray, factor: float) -> FloatArray:
    """The path of least cost by way of a subsequence of a path's vertices."""
    cost, before = np.full(len(path), np.inf), np.zeros(len(path), dtype=np.int64)
    cost[0] = 0.0
    for b in range(1, len(path)):
        for a in range(b):
            ax, ay, bx, by = path[a, 0], path[a, 1], path[b, 0], path[b, 1]
            if cost[a] + math.hypot(bx - ax, by - ay) >= cost[b]:
                continue
            reach = cost[a] + _cost(ax, ay, bx, by, near, low, factor)
            if reach < cost[b] and (a == b - 1 or keeps_clear(checker, ax, ay, bx, by)):
                cost[b], before[b] = reach, a
    kept = [len(path) - 1]
    while kept[-1] > 0:
        kept.append(before[kept[-1]])
    pulled: FloatArray = path[np.array(kept[::-1])]
    return pulled
