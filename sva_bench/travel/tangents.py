"""Tangents of the arcs about corners, and shortcuts of paths; checked exactly, compiled.

A shortest path that keeps a distance bends on arcs about corners only, and its straight parts are tangent to them. So
tangents between points on the arcs make a nearly optimal roadmap.

Source:
    Lozano-Perez & Wesley (1979), "An algorithm for planning collision-free paths among polyhedral obstacles".
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.geometry.buckets import checks_made, keeps_clear

_MOST_PAIRS = 50_000_000  # pairs of evenly spread points within the greatest length of tangents, which it sets
_MOST_WORK = 20_000_000  # solids and buckets that segments are checked against: about half a second
_AT_A_TIME = 5_000_000  # of them, between two checks for Ctrl-C
_EDGE = 100  # cost of a tangent found, in this unit, for its later use as an edge
_SEEN = 8  # points or squares examined in the time of one solid
_FEW = 2000  # points up to which tangents of all lengths are searched in one pass,
_RING = 1.4  # else in rings of length that grow by this factor
_LINES = 1 << 20  # slots of the cache of checked lines


def tangents(checker: FloatArray, arcs: FloatArray) -> IntArray:
    """All free tangents; of very many points on arcs, the shorter ones.

    Short ones come first, in rings of growing length, until ``_MOST_WORK`` is done: along the walls of a ragged map
    every point sees a thousand others. The work is counted, not timed, so the same points have the same tangents on
    every machine.

    Args:
        checker: From ``clearance_checker``.
        arcs: Points on arcs, from ``arc_points``, shape (n, 5); isolated points have centre NaN, and tangents of any
            length.

    Returns:
        Indices of their ends, shape (k, 2).
    """
    x0, y0, x1, y1 = checker[:4]
    farthest = math.hypot(x1 - x0, y1 - y0)
    # The radius at which evenly spread points have _MOST_PAIRS pairs.
    longest = math.sqrt((x1 - x0) * (y1 - y0) * 2 * _MOST_PAIRS / math.pi) / max(len(arcs), 1)
    others = np.flatnonzero(~np.isnan(arcs[:, 2]))
    ends = _ends(arcs[others])
    squares = _squares(ends[:, :2])
    found, left = [tangents_of_isolated(checker, arcs)], _MOST_WORK
    for near, far in _rings(min(longest, farthest), squares.side, len(arcs)):
        at = 0
        while at < len(ends) and left > 0:
            pairs, at, work = _tangents_of_arcs(
                checker, ends, squares.starts, squares.items, squares.low, squares.side, squares.counts, at, near, far,
                min(_AT_A_TIME, left))
            found.append(others[pairs])
            left -= work
    return np.concatenate(found)


def tangents_of_isolated(checker: FloatArray, arcs: FloatArray) -> IntArray:
    """The free tangents with an isolated point at an end, as ``tangents``; at most ``_MOST_WORK`` again."""
    ends, isolated = _ends(arcs), np.flatnonzero(np.isnan(arcs[:, 2]))
    found, left = [np.empty((0, 2), dtype=np.int64)], _MOST_WORK
    x0, y0, x1, y1 = checker[:4]
    farthest = math.hypot(x1 - x0, y1 - y0)
    for near, far in _rings(farthest, 0.01 * farthest, len(arcs)):
        at = 0
        while at < len(isolated) and left > 0:
            pairs, at, work = _tangents_of_isolated(checker, ends, isolated, at, near, far, min(_AT_A_TIME, left))
            found.append(pairs)
            left -= work
    return np.concatenate(found)


def _ends(arcs: FloatArray) -> FloatArray:
    """x, y, the direction from the arc's centre, and the squared tolerance; shape (n, 5)."""
    out = arcs[:, :2] - arcs[:, 2:4]
    out /= np.hypot(out[:, 0], out[:, 1])[:, None]
    out[np.isnan(out[:, 0])] = 0.0  # isolated points: every line counts as tangent
    return np.column_stack([arcs[:, :2], out, arcs[:, 4] ** 2])


@dataclass(frozen=True, eq=False, kw_only=True)
class _Squares:
    """Points by the square of a grid that they lie in, in compressed rows.

    Attributes:
        low: x, y of the grid's lower left corner [m].
        side: Side of a square [m].
        counts: Columns and rows.
        starts: Where each square's points begin in ``items``, row by row, and the end, shape (squares + 1,).
        items: Indices of the points.
    """

    low: FloatArray
    side: float
    counts: IntArray
    starts: IntArray
    items: IntArray


def _squares(points: FloatArray) -> _Squares:
    """A grid with two points a square on average."""
    low = points.min(axis=0) if len(points) else np.zeros(2)
    wide, high = (points.max(axis=0) - low).tolist() if len(points) else (0.0, 0.0)
    side = max(math.sqrt(2 * wide * high / max(len(points), 1)), max(wide, high) / 1000, 1e-3)
    columns, rows = math.floor(wide / side) + 1, math.floor(high / side) + 1
    at = np.floor((points - low) / side).astype(np.int64)
    square = at[:, 1] * columns + at[:, 0]
    starts = np.concatenate([[0], np.cumsum(np.bincount(square, minlength=columns * rows))])
    return _Squares(low=low, side=side, counts=np.array([columns, rows]), starts=starts,
                    items=np.argsort(square, kind="stable"))


def _rings(reach_m: float, side_m: float, points: int) -> Iterator[tuple[float, float]]:
    """Rings of length (from, to) [m] up to the reach; one ring where points are few."""
    near, far = 0.0, 4 * side_m
    while far < reach_m and points > _FEW:
        yield near, far
        near, far = far, far * _RING
    yield near, reach_m


@njit(cache=True)  # type: ignore[untyped-decorator]
def _tangents_of_isolated(
    checker: FloatArray, ends: FloatArray, isolated: IntArray, first: int, near: float, far: float, most: int
) -> tuple[IntArray, int, int]:
    """Free lines between isolated points, and free tangents from them to arcs.

    Args:
        checker: From ``clearance_checker``.
        ends: x, y, the direction from the arc's centre, and the squared tolerance, shape (n, 5).
        isolated: Indices of isolated points, ascending.
        first: Position of the first of them to treat.
        near, far: Length of the tangents: above the one, at most the other [m].
        most: Work after which it returns.

    Returns:
        Indices of the ends, shape (k, 2); position of the next point to treat; and the work done.
    """
    found = np.empty((256, 2), dtype=np.int64)
    count, work, seen = 0, 0, 0
    while first < len(isolated) and work < most:
        i = isolated[first]
        x, y = ends[i, 0], ends[i, 1]
        for j in range(len(ends)):
            dx, dy = ends[j, 0] - x, ends[j, 1] - y
            squared = dx * dx + dy * dy
            if squared > far * far or (squared <= near * near and near > 0):
                continue
            mx, my = ends[j, 2], ends[j, 3]
            if (mx * dx + my * dy) ** 2 > ends[j, 4] * squared or (mx == 0.0 and my == 0.0 and j >= i):
                continue
            passed = checks_made(checker, x, y, ends[j, 0], ends[j, 1])
            work += abs(passed)
            if passed > 0:
                found, count = _appended(found, count, i, j)
                work += _EDGE
        seen += len(ends)
        work += len(ends) // _SEEN
        first += 1
    return found[:count].copy(), first, work


@njit(cache=True)  # type: ignore[untyped-decorator]
def _tangents_of_arcs(
    checker: FloatArray, ends: FloatArray, starts: IntArray, items: IntArray, low: FloatArray, side: float,
    counts: IntArray, first: int, near: float, far: float, most: int,
) -> tuple[IntArray, int, int]:
    """Free tangents between arcs.

    Those from a point lie in two narrow cones; only the squares that a cone crosses are searched. One loop, because
    compiled code called for each point would pass a dozen arrays each time.

    Args:
        checker, near, far, most: As above.
        ends: As above, of points on arcs only.
        starts, items, low, side, counts: As in ``_Squares``.
        first: Which point to begin with.

    Returns:
        As above.
    """
    found = np.empty((256, 2), dtype=np.int64)
    count, work, seen = 0, 0, 0
    quad = np.empty((4, 2))
    columns, rows = counts
    while first < len(ends) and work < most:
        i = first
        x, y, nx, ny, slack = ends[i]
        sine, cosine = math.sqrt(slack) + 1e-9, math.sqrt(1 - slack) - 1e-9
        for sign in (-1.0, 1.0):
            tx, ty = -sign * ny, sign * nx
            # A quadrangle about the part of the cone between the two lengths.
            for corner in range(4):
                turn = sine if corner in (1, 2) else -sine
                away = near if corner < 2 else far / cosine
                quad[corner, 0] = x + away * (cosine * tx - turn * ty)
                quad[corner, 1] = y + away * (cosine * ty + turn * tx)
            bottom = max(math.floor((quad[:, 1].min() - low[1]) / side - 1e-6), 0)
            top = min(math.floor((quad[:, 1].max() - low[1]) / side + 1e-6), rows - 1)
            for row in range(bottom, top + 1):
                left, right = _span(quad, low[1] + row * side - 1e-6 * side, low[1] + (row + 1) * side + 1e-6 * side)
                begin = max(math.floor((left - low[0]) / side - 1e-6), 0)
                end = min(math.floor((right - low[0]) / side + 1e-6), columns - 1)
                seen += 1
                if begin > end:
                    continue
                for at in range(starts[row * columns + begin], starts[row * columns + end + 1]):
                    j = items[at]
                    seen += 1
                    if j >= i:
                        continue
                    dx, dy = ends[j, 0] - x, ends[j, 1] - y
                    squared = dx * dx + dy * dy
                    # Tangent: within the tolerance of a right angle to the radius.
                    if (squared > far * far or (squared <= near * near and near > 0)
                            or tx * dx + ty * dy < 0.0 or (nx * dx + ny * dy) ** 2 > slack * squared
                            or (ends[j, 2] * dx + ends[j, 3] * dy) ** 2 > ends[j, 4] * squared):
                        continue
                    passed = checks_made(checker, x, y, ends[j, 0], ends[j, 1])
                    work += abs(passed)
                    if passed > 0:
                        found, count = _appended(found, count, i, j)
                        work += _EDGE
        work += seen // _SEEN
        seen %= _SEEN
        first += 1
    return found[:count].copy(), first, work


@njit(cache=True)  # type: ignore[untyped-decorator]
def _span(quad: FloatArray, low: float, high: float) -> tuple[float, float]:
    """Least and greatest x of a convex quadrangle between two heights; (``inf``, ``-inf``) if it has no part there."""
    left, right = math.inf, -math.inf
    for k in range(4):
        ax, ay, bx, by = quad[k, 0], quad[k, 1], quad[(k + 1) % 4, 0], quad[(k + 1) % 4, 1]
        if max(ay, by) < low or min(ay, by) > high:
            continue
        for height, y, x in ((low, ay, ax), (high, by, bx)):
            if low <= y <= high:
                left, right = min(left, x), max(right, x)
            if ay != by and min(ay, by) <= height <= max(ay, by):
                cut = ax + (bx - ax) * (height - ay) / (by - ay)
                left, right = min(left, cut), max(right, cut)
    return left, right


@njit(cache=True)  # type: ignore[untyped-decorator]
def _appended(found: IntArray, count: int, i: int, j: int) -> tuple[IntArray, int]:
    """A list of pairs with one more."""
    if count == len(found):
        grown = np.empty((2 * count, 2), dtype=np.int64)
        grown[:count] = found
        found = grown
    found[count, 0], found[count, 1] = i, j
    return found, count + 1


@njit(cache=True)  # type: ignore[untyped-decorator]
def shortcut(
    checker: FloatArray, vertices: FloatArray, before: NDArray[np.int32], start: int, goal: int, window: int,
    known: IntArray, length: FloatArray, via: IntArray,
) -> FloatArray:
    """The shortest path by way of a subsequence of a path's vertices.

    Paths from one start form a tree, so what is computed for one path serves the others.

    Args:
        checker: From ``clearance_checker``.
        vertices: Vertices of the roadmap [m], shape (v, 2).
        before: Predecessor of each vertex on its path from the start, which keeps the clearance, shape (v,).
        start, goal: Vertices at the ends of the path.
        window: Most vertices that one shortcut skips.
        known: Cache of lines checked for other paths, from ``new_line_cache``; changed in place.
        length: Length of the shortest path from this start to each vertex [m], as far as computed for other paths,
            else ``inf``; 0 at the start; changed in place, shape (v,).
        via: Predecessor on that path; changed in place, shape (v,).
    """
    new, vertex = [goal], before[goal]
    while length[new[-1]] == np.inf:
        new.append(vertex)
        vertex = before[vertex]
    back = np.empty(window, dtype=np.int64)
    for k in range(len(new) - 2, -1, -1):
        here, count = new[k], 0
        vertex = before[here]
        while count < window and vertex >= 0:
            back[count] = vertex
            vertex = before[vertex]
            count += 1
        for step in range(count - 1, -1, -1):
            there = back[step]
            ax, ay, bx, by = vertices[there, 0], vertices[there, 1], vertices[here, 0], vertices[here, 1]
            reach = length[there] + math.hypot(bx - ax, by - ay)
            if reach < length[here]:
                number = there * len(vertices) + here
                if step == 0 or _is_free(checker, known, number, ax, ay, bx, by):
                    length[here], via[here] = reach, there
    kept = [goal]
    while kept[-1] != start:
        kept.append(via[kept[-1]])
    shorter: FloatArray = vertices[np.array(kept[::-1])]
    return shorter


@njit(cache=True)  # type: ignore[untyped-decorator]
def _is_free(checker: FloatArray, known: IntArray, number: int, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether a line keeps the clearance, cached by its number."""
    line = 2 * number
    slot = (line * 0x9E3779B1 >> 12) % len(known)
    if known[slot] != line and known[slot] != line + 1:
        known[slot] = line + keeps_clear(checker, ax, ay, bx, by)
    return bool(known[slot] == line + 1)


def new_line_cache() -> IntArray:
    """An empty cache of checked lines: each slot holds twice a line's number, plus 1 if it is free, or -1."""
    return np.full(_LINES, -1, dtype=np.int64)
