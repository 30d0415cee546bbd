"""Other ways than the shortest, for robots that would meet on it, and ways round robots that failed on theirs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.geometry.buckets import clearance_checker, clearances, keeps_clear
from sva_bench.geometry.distances import point_segment
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.travel.apart import proved_apart
from sva_bench.travel.roadmap import plan_paths
from sva_bench.travel.samples import arc_points, roadmap_samples
from sva_bench.travel.tangents import tangents

_PENALTIES = ((0.6, 2.5), (1.2, 6.0))  # distance to the shortest path [m] within which a metre costs so many
_LONGEST, _LONGER_M = 1.7, 1.5  # a way may be so many times as long as the shortest, and so much more
_SPREAD, _NEAREST = 600, 10  # places between the corners, and neighbours that each vertex is joined to
_PER_CORNER = 6  # points on a quarter circle about a corner
_START_SLACK_M = 1e-9  # a start on the boundary of the free space is free
_APART_M = 0.3  # from which on two ways count as different
_CELL_M = 0.1  # of the grid that marks what is near a path
_GRAZE_M = 1e-6  # a line that leaves a narrow place may come nearer to its walls by so much
_OUT_M = 0.02  # steps in which a free place is looked for about one that is too near to something,
_FARTHEST_M = 0.6  # up to this distance from it
_DIRECTIONS = 32


@dataclass(frozen=True, eq=False, kw_only=True)
class Ways:
    """The free straight lines between some points of a world, the corners that paths bend about, and places between.

    Unlike OMPL's roadmap, which differs by single edges from process to process, it depends on the world alone: the
    shortest way doesn't use these edges, but the second best may.

    Attributes:
        vertices: The ends of the lines, the points first [m], shape (v, 2).
        lines: Numbers of both ends of each line, shape (e, 2).
        checker: From ``clearance_checker``, for lines.
    """

    vertices: FloatArray
    lines: IntArray
    checker: FloatArray


def ways_among(obstacles: Obstacles, points: FloatArray, clearance_m: float) -> Ways:
    """The ways between points.

    Args:
        obstacles: The obstacles.
        points: Ends of ways [m], shape (n, 2); all at least ``clearance_m`` from obstacles.
        clearance_m: Distance that they keep from obstacles [m].
    """
    checker = clearance_checker(obstacles, clearance_m, _START_SLACK_M)
    arcs = arc_points(obstacles, clearance_m, _PER_CORNER, points)
    isolated = np.column_stack([points, np.full((len(points), 2), np.nan), np.zeros(len(points))])
    spread = roadmap_samples(obstacles, clearance_m, _SPREAD, arcs[:0])
    vertices = np.concatenate([points, arcs[:, :2], spread])
    _, nearest = KDTree(vertices).query(vertices, k=min(_NEAREST + 1, len(vertices)))
    beside = np.column_stack([np.repeat(np.arange(len(vertices)), nearest.shape[1]), nearest.ravel()])
    beside = np.unique(np.sort(beside[beside[:, 0] != beside[:, 1]], axis=1), axis=0)
    lines = np.concatenate([tangents(checker, np.concatenate([isolated, arcs])),
                            beside[_free_lines(checker, vertices, beside)]])
    return Ways(vertices=vertices, lines=np.unique(np.sort(lines, axis=1), axis=0), checker=checker)


def alternatives(ways: Ways, path: FloatArray) -> list[FloatArray]:
    """A path, and up to two others between its ends that avoid it as far as that is worth while.

    Args:
        ways: Ways with both ends among their points.
        path: The shortest path [m], shape (k, 2).

    Returns:
        The paths [m], the shortest first, each of shape (k, 2).
    """
    found = [path]
    start, goal = (int(np.argmin(np.hypot(*(ways.vertices - end).T))) for end in (path[0], path[-1]))
    if start == goal:
        return found
    for near_m, factor in _PENALTIES:
        other = _cheapest(ways, start, goal, path, near_m, factor)
        if other is not None and _length(other) <= _LONGEST * _length(path) + _LONGER_M and all(
                _farthest(other, known) > _APART_M for known in found):
            other[0], other[-1] = path[0], path[-1]
            found.append(other)
    return found


def _cheapest(
    ways: Ways, start: int, goal: int, path: FloatArray, near_m: float, factor: float
) -> FloatArray | None:
    """The way between two vertices of least cost, a metre near a path counted so many times; ``None`` if none."""
    low = ways.vertices.min(axis=0) - _CELL_M
    columns, rows = np.ceil((ways.vertices.max(axis=0) - low) / _CELL_M).astype(np.int64) + 2
    near = _marked(path, low, columns, rows, near_m)
    costs = _costs(ways.vertices, ways.lines, near, low, factor)
    count = len(ways.vertices)
    graph = csr_array((costs, (ways.lines[:, 0], ways.lines[:, 1])), shape=(count, count))
    _, before = dijkstra(graph, directed=False, indices=np.array([goal]), return_predecessors=True)
    way = [start]
    while way[-1] != goal:
        if before[0, way[-1]] < 0:
            return None
        way.append(int(before[0, way[-1]]))
    pulled: FloatArray = _pulled(ways.checker, ways.vertices[way], near, low, factor)
    return pulled


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
    checker = clearance_checker(closed, clearance_m, _START_SLACK_M)
    first, last = (_freed(closed, checker, np.asarray(place, dtype=np.float64)) for place in (start, end))
    if first is None or last is None:
        return None
    inner = _joined(closed, checker, np.array([first[-1], last[-1]]), clearance_m)
    if inner is None:
        return None
    path = np.concatenate([first[:-1], inner, last[:-1][::-1]])
    kept: FloatArray = path[np.r_[True, np.hypot(*np.diff(path, axis=0).T) > _GRAZE_M]]
    return kept if len(kept) > 1 else np.array([start, end], dtype=np.float64)


def _joined(obstacles: Obstacles, checker: FloatArray, ends: FloatArray, clearance_m: float) -> FloatArray | None:
    """A path between two places that keep the clearance; ``None`` if there is none."""
    if keeps_clear(checker, *ends[0], *ends[1]):
        return ends
    path = _cheapest(ways_among(obstacles, ends, clearance_m), 0, 1, ends[:1], 0.0, 1.0)
    if path is not None:
        return path
    # The roadmap grows until it finds the narrowest passage.
    if proved_apart(obstacles, ends[0], ends[1], clearance_m):
        return None
    return plan_paths(obstacles, ends, clearance_m)[0][1]


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
def _free_lines(checker: FloatArray, vertices: FloatArray, lines: IntArray) -> BoolArray:
    """Which lines keep the checker's clearance, shape (lines,)."""
    free = np.empty(len(lines), dtype=np.bool_)
    for k in range(len(lines)):
        a, b = lines[k, 0], lines[k, 1]
        free[k] = keeps_clear(checker, vertices[a, 0], vertices[a, 1], vertices[b, 0], vertices[b, 1])
    return free


@njit(cache=True)  # type: ignore[untyped-decorator]
def _costs(vertices: FloatArray, lines: IntArray, near: BoolArray, low: FloatArray, factor: float) -> FloatArray:
    """The cost of each line, shape (lines,)."""
    costs = np.empty(len(lines))
    for k in range(len(lines)):
        a, b = lines[k, 0], lines[k, 1]
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
