"""Ways on the lattice of a map's half cells: what a roadmap is joined by where crowds of corners leave it in parts.

The saddles of the distance to a map's corners and walls lie on that lattice, so hardly a passage is left out, however
many corners there are; the paths are not the shortest, but are free.
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
from sva_bench.geometry.cells import Cells, DistanceField, distance_field

_SURELY = 1 + 1e-6  # times the clearance, in single precision, is the clearance at least
_AT_A_TIME = 1_000_000  # places that are looked at before Ctrl-C is listened to


def lattice_paths(
    cells: Cells, checker: FloatArray, clearance_m: float, points: FloatArray, goals: Sequence[int],
) -> list[FloatArray | None]:
    """A free path from the first point to each of some others, pulled straight where it goes easily.

    Args:
        cells: The map.
        checker: As ``clearance_checker`` makes it, for that clearance.
        clearance_m: Distance to keep.
        points: The points, all of them free [m], shape (n, 2).
        goals: Indices of those to go to.

    Returns:
        For each goal the path's vertices [m], shape (k, 2); ``None`` where none is found.
    """
    field = distance_field(cells)
    roomy = field.distance_m >= clearance_m * _SURELY
    parts, count = label(roomy)
    # World coordinates of a place: those of the first, and a step along a row and along a column.
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
    start = _place_by(field, checker, roomy, points[0])
    ends = [_place_by(field, checker, roomy, points[goal]) for goal in goals]
    if start is None:
        return [None] * len(goals)
    came = np.full(parts.size, -1, dtype=np.int32)
    queue = np.empty(parts.size, dtype=np.int32)
    came[start], queue[0] = start, start
    state = np.array([0, 1])  # places of the queue that are done, and all of them
    while state[0] < state[1]:
        _go_on(parts, links, came, queue, state, _AT_A_TIME)
    paths: list[FloatArray | None] = []
    for goal, end in zip(goals, ends, strict=True):
        if end is None or came[end] < 0:
            paths.append(None)
            continue
        index = np.column_stack(np.divmod(_chain(came, end)[::-1], parts.shape[1]))
        path = np.concatenate([points[:1], field.places(index), points[goal:goal + 1]])
        paths.append(_pulled(checker, np.ascontiguousarray(path)))
    return paths


def _place_by(field: DistanceField, checker: FloatArray, roomy: NDArray[np.bool_], point: FloatArray) -> int | None:
    """The number of the nearest place with room that a straight free line joins to a point."""
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
    """Free lines from place to place, two steps away at most, that join parts which nothing joined before.

    Args:
        parts: Which part each place is of, 0 = of none.
        parent: Parts that are joined already, as a forest; brought up to date.
        frame: x, y of the first place, and steps along rows and columns [m], shape (6,).
        checker: As ``clearance_checker`` makes it.
        begin, end: Numbers of the places to begin from.

    Returns:
        Numbers of both places, shape (k, 2).
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
def _go_on(
    parts: NDArray[np.int32], links: IntArray, came: NDArray[np.int32], queue: NDArray[np.int32], state: IntArray,
    most: int,
) -> None:
    """Breadth-first search over places and bridges, for so many places."""
    rows, columns = parts.shape
    head, tail = state
    until = head + most
    while head < tail and head < until:
        here = queue[head]
        head += 1
        row, column = here // columns, here % columns
        for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            r, c = row + dr, column + dc
            if 0 <= r < rows and 0 <= c < columns and parts[r, c] > 0 and came[r * columns + c] < 0:
                came[r * columns + c] = here
                queue[tail] = r * columns + c
                tail += 1
        link = np.searchsorted(links[:, 0], here) if len(links) else 0
        while link < len(links) and links[link, 0] == here:
            there = links[link, 1]
            if came[there] < 0:
                came[there] = here
                queue[tail] = there
                tail += 1
            link += 1
    state[0], state[1] = head, tail


@njit(cache=True)  # type: ignore[untyped-decorator]
def _chain(came: NDArray[np.int32], end: int) -> IntArray:
    """Places on the way back from one to where the search began, which came from itself."""
    count, place = 1, end
    while came[place] != place:
        place = came[place]
        count += 1
    chain = np.empty(count, dtype=np.int64)
    chain[0] = end
    for k in range(1, count):
        chain[k] = came[chain[k - 1]]
    return chain


@njit(cache=True)  # type: ignore[untyped-decorator]
def _pulled(checker: FloatArray, path: FloatArray) -> FloatArray:
    """A path with fewer vertices: from each a line about as far along as it is free."""
    kept = [0]
    while kept[-1] < len(path) - 1:
        here = kept[-1]
        good, step = here + 1, 2  # one step is free: the lattice says so
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


def open_parts(field: DistanceField, clearance_m: float, points: FloatArray) -> tuple[NDArray[np.int32], IntArray]:
    """Parts of the lattice that no path leaves: those of the places, and those of some points.

    Each point of a path is near a place of the lattice, at most half a diagonal away. Places that are nearer to an
    obstacle than the clearance less that are closed; a path runs by open ones, from neighbour to neighbour.
    """
    open_places = field.distance_m >= clearance_m - field.cells.cell_m / 2 * math.sqrt(0.5) - 1e-5
    at = field.index_of(points)
    found, _ = label(open_places, structure=np.ones((3, 3)))
    parts: NDArray[np.int32] = found.astype(np.int32, copy=False)
    return parts, parts[at[:, 0], at[:, 1]].astype(np.int64)
