"""Paths on the lattice of a map's half cells, which connect a roadmap where a map has too many corners.

The saddle points of the distance to a map's obstacles lie on that lattice, so hardly a passage is missed, whatever the
number of corners; the paths are not shortest, but free.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import label

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.geometry.buckets import keeps_clear
from sva_bench.geometry.cells import DistanceField, distance_field
from sva_bench.geometry.obstacles import Obstacles

_SURELY = 1 + 1e-6  # factor on the clearance that covers the rounding of single precision
_AT_A_TIME = 1_000_000  # nodes between two checks for Ctrl-C


def lattice_paths(
    obstacles: Obstacles, checker: FloatArray, clearance_m: float, points: FloatArray, goals: Sequence[int],
) -> list[FloatArray | None]:
    """A free path from the first point to each of some others, straightened greedily.

    Args:
        obstacles: The obstacles: an occupancy grid, and cylinders that stand on it.
        checker: From ``clearance_checker``, for that clearance.
        clearance_m: Distance to keep [m].
        points: The points, all of them free [m], shape (n, 2).
        goals: Indices of the goals.

    Returns:
        For each goal the path's vertices [m], shape (k, 2); ``None`` where none is found.
    """
    assert obstacles.cells is not None
    field = distance_field(obstacles.cells)
    roomy = field.distance_m >= clearance_m * _SURELY
    _close_about(field, roomy, obstacles.cylinders, clearance_m)
    parts, count = label(roomy)
    # World coordinates of a node: those of the first, and a step along a row and along a column.
    first, right, up = field.places(np.array([[0, 0], [0, 1], [1, 0]]))
    frame = np.concatenate([first, right - first, up - first])
    parent = np.arange(count + 1)
    bridges = [np.empty((0, 2), dtype=np.int64)]
    at = 0
    while at < parts.size:
        found = _bridges(parts, parent, frame, checker, at, min(at + _AT_A_TIME, parts.size))
        bridges += [found, found[:, ::-1]]
        at += _AT_A_TIME
    links = np.concatenate(bridges)
    links = links[np.argsort(links[:, 0], kind="stable")]
    start = _nearest_free_place(field, checker, roomy, points[0])
    ends = [_nearest_free_place(field, checker, roomy, points[goal]) for goal in goals]
    if start is None:
        return [None] * len(goals)
    predecessor = np.full(parts.size, -1, dtype=np.int32)
    queue = np.empty(parts.size, dtype=np.int32)
    predecessor[start], queue[0] = start, start
    state = np.array([0, 1])  # head and tail of the queue
    while state[0] < state[1]:
        _breadth_first(parts, links, predecessor, queue, state, _AT_A_TIME)
    paths: list[FloatArray | None] = []
    for goal, end in zip(goals, ends, strict=True):
        if end is None or predecessor[end] < 0:
            paths.append(None)
            continue
        index = np.column_stack(np.divmod(_path_back(predecessor, end)[::-1], parts.shape[1]))
        path = np.concatenate([points[:1], field.places(index), points[goal:goal + 1]])
        paths.append(_straightened(checker, np.ascontiguousarray(path)))
    return paths


def _close_about(
    field: DistanceField, roomy: NDArray[np.bool_], cylinders: FloatArray, clearance_m: float,
) -> None:
    """Close the nodes from which a line to a neighbour may be too near to a cylinder, in place."""
    step = field.cells.cell_m / 2
    for x, y, radius in cylinders.tolist():
        reach = radius + clearance_m + step / 2
        row, column = field.index_of(np.array([[x, y]]))[0].tolist()
        wide = math.ceil(reach / step) + 1
        rows = np.arange(max(row - wide, 0), min(row + wide + 1, roomy.shape[0]))
        columns = np.arange(max(column - wide, 0), min(column + wide + 1, roomy.shape[1]))
        index = np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1).reshape(-1, 2)
        near = np.hypot(*(field.places(index) - (x, y)).T) < reach
        roomy[index[near, 0], index[near, 1]] = False


def _nearest_free_place(
    field: DistanceField, checker: FloatArray, roomy: NDArray[np.bool_], point: FloatArray,
) -> int | None:
    """The number of the nearest node with enough clearance that a free line joins to a point; ``None`` if none."""
    row, column = field.index_of(point[None])[0].tolist()
    rows, columns = roomy.shape
    around = np.array([(r, c) for r in range(max(row - 2, 0), min(row + 3, rows)) for c in range(
        max(column - 2, 0), min(column + 3, columns)) if roomy[r, c]]).reshape(-1, 2)
    places = field.places(around)
    for k in np.argsort(np.hypot(*(places - point).T), kind="stable").tolist():
        if keeps_clear(checker, point[0], point[1], places[k, 0], places[k, 1]):
            return int(around[k, 0] * columns + around[k, 1])
    return None


@njit(cache=True)  # type: ignore[untyped-decorator]
def _root(parent: IntArray, part: int) -> int:
    while parent[part] != part:
        parent[part] = parent[parent[part]]
        part = parent[part]
    return part


@njit(cache=True)  # type: ignore[untyped-decorator]
def _bridges(
    parts: NDArray[np.int32], parent: IntArray, frame: FloatArray, checker: FloatArray, begin: int, end: int
) -> IntArray:
    """Free lines between nodes, at most two steps apart, that join components not yet joined.

    Args:
        parts: Component of each node, 0 = none, shape (rows, columns).
        parent: Union-find forest of the components joined so far; changed in place.
        frame: x, y of the first node, and steps along rows and columns [m], shape (6,).
        checker: From ``clearance_checker``.
        begin, end: Numbers of the nodes to begin from.

    Returns:
        Numbers of both nodes, shape (k, 2).
    """
    found = np.empty((len(parent), 2), dtype=np.int64)  # each joins two trees of the forest
    count = 0
    rows, columns = parts.shape
    for number in range(begin, end):
        row, column = number // columns, number % columns
        mine = parts[row, column]
        if mine == 0:
            continue
        for r in range(row, min(row + 3, rows)):
            for c in range(max(column - 2, 0), min(column + 3, columns)):
                other = parts[r, c]
                if other == 0 or other == mine or _root(parent, mine) == _root(parent, other):
                    continue
                ax, ay = frame[0] + column * frame[2] + row * frame[4], frame[1] + column * frame[3] + row * frame[5]
                bx, by = frame[0] + c * frame[2] + r * frame[4], frame[1] + c * frame[3] + r * frame[5]
                if keeps_clear(checker, ax, ay, bx, by):
                    parent[_root(parent, mine)] = _root(parent, other)
                    found[count, 0], found[count, 1] = number, r * columns + c
                    count += 1
    return found[:count].copy()


@njit(cache=True)  # type: ignore[untyped-decorator]
def _breadth_first(
    parts: NDArray[np.int32], links: IntArray, predecessor: NDArray[np.int32], queue: NDArray[np.int32],
    state: IntArray, most: int,
) -> None:
    """Continue a breadth-first search over nodes and bridges for ``most`` nodes, in place."""
    rows, columns = parts.shape
    head, tail = state
    until = head + most
    while head < tail and head < until:
        here = queue[head]
        head += 1
        row, column = here // columns, here % columns
        for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            r, c = row + dr, column + dc
            if 0 <= r < rows and 0 <= c < columns and parts[r, c] > 0 and predecessor[r * columns + c] < 0:
                predecessor[r * columns + c] = here
                queue[tail] = r * columns + c
                tail += 1
        link = np.searchsorted(links[:, 0], here) if len(links) else 0
        while link < len(links) and links[link, 0] == here:
            there = links[link, 1]
            if predecessor[there] < 0:
                predecessor[there] = here
                queue[tail] = there
                tail += 1
            link += 1
    state[0], state[1] = head, tail


@njit(cache=True)  # type: ignore[untyped-decorator]
def _path_back(predecessor: NDArray[np.int32], end: int) -> IntArray:
    """Nodes from ``end`` back to the root of the search, which is its own predecessor."""
    count, place = 1, end
    while predecessor[place] != place:
        place = predecessor[place]
        count += 1
    chain = np.empty(count, dtype=np.int64)
    chain[0] = end
    for k in range(1, count):
        chain[k] = predecessor[chain[k - 1]]
    return chain


@njit(cache=True)  # type: ignore[untyped-decorator]
def _straightened(checker: FloatArray, path: FloatArray) -> FloatArray:
    """A path with fewer vertices: from each a free line as far along as bisection finds."""
    kept = [0]
    while kept[-1] < len(path) - 1:
        here = kept[-1]
        good, step = here + 1, 2  # one step is free by construction
        while here + step < len(path) and keeps_clear(
                checker, path[here, 0], path[here, 1], path[here + step, 0], path[here + step, 1]):
            good, step = here + step, 2 * step
        bad = min(here + step, len(path))
        while bad - good > 1:
            middle = (good + bad) // 2
            if keeps_clear(checker, path[here, 0], path[here, 1], path[middle, 0], path[middle, 1]):
                good = middle
            else:
                bad = middle
        kept.append(good)
    pulled: FloatArray = path[np.array(kept)]
    return pulled


def reachable_components(
    field: DistanceField, clearance_m: float, points: FloatArray,
) -> tuple[NDArray[np.int32], IntArray]:
    """Components of the lattice that no path leaves: of the nodes, and of some points.

    Each point of a path is within half a diagonal of a node. Nodes nearer to an obstacle than the clearance less that
    are closed; so a path stays within half a diagonal of open ones, from neighbour to neighbour.

    Returns:
        Component of each node, 0 = closed, shape (rows, columns); component of each point, shape (n,).
    """
    open_places = field.distance_m >= clearance_m - field.cells.cell_m / 2 * math.sqrt(0.5) - 1e-5
    at = field.index_of(points)
    found, _ = label(open_places, structure=np.ones((3, 3)))
    parts: NDArray[np.int32] = found.astype(np.int32, copy=False)
    return parts, parts[at[:, 0], at[:, 1]].astype(np.int64)
