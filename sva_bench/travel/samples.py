"""The roadmap's milestones: on the arcs about corners, where shortest paths bend, and all over the free space."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.geometry.buckets import keeps_clearance
from sva_bench.geometry.cells import Cells, convex_corners, distance_field
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.travel.lattice import reachable_components

_GRAZE_M = 1e-4  # distance of boundary samples from the boundary, so that edges along it are free
_MOST_ARC_POINTS = 40_000  # reached by maps of 2000 x 2000 cells full of corners


def arc_points(
    obstacles: Obstacles, clearance_m: float, per_corner: int, sites: FloatArray | None = None
) -> FloatArray:
    """Free points on the arcs about corners and cylinders, on which shortest paths bend.

    They are the vertices of polygons circumscribed about the arcs: edges of inscribed ones would come too near.

    Args:
        obstacles: The obstacles.
        clearance_m: Distance to keep [m].
        per_corner: Vertices on a quarter circle.
        sites: Ends of the paths [m], shape (n, 2): on a map with too many points, those that no path
            between them can reach are left out.

    Returns:
        x, y, the arc's centre x, y [m], and the sine of half the angle between vertices: within that of a right
        angle to the radius, a line counts as tangent; shape (k, 5), at most ``_MOST_ARC_POINTS``.
    """
    ring, half = clearance_m + _GRAZE_M, math.pi / (4 * per_corner)
    angles = (np.arange(per_corner) + 0.5) / per_corner * (math.pi / 2)
    quarter = np.column_stack([np.cos(angles), np.sin(angles)])
    corners = _corners_of_boxes(obstacles) if obstacles.cells is None else _corners_of_cells(obstacles.cells)
    centres = np.repeat(corners[:, :2], per_corner, axis=0)
    # Each corner comes with the outward directions of its two sides.
    aside = quarter @ corners[:, 2:].reshape(-1, 2, 2)
    points = centres + ring / math.cos(half) * aside.reshape(-1, 2)
    if len(obstacles.cylinders):
        around = np.arange(4 * per_corner) * 2 * half
        circle = np.column_stack([np.cos(around), np.sin(around)])
        reach = (obstacles.cylinders[:, 2] + ring) / math.cos(half)
        posts = obstacles.cylinders[:, None, :2] + reach[:, None, None] * circle
        points = np.concatenate([points, posts.reshape(-1, 2)])
        centres = np.concatenate([centres, np.repeat(obstacles.cylinders[:, :2], len(around), axis=0)])
    arcs = np.column_stack([points, centres, np.full(len(points), math.sin(1.05 * half))])
    arcs = arcs[keeps_clearance(obstacles, points, clearance_m)]
    if sites is not None and obstacles.cells is not None and len(arcs) > _MOST_ARC_POINTS:
        field = distance_field(obstacles.cells)
        parts, mine = reachable_components(field, clearance_m, sites)
        row, column = field.index_of(arcs[:, :2]).T
        arcs = arcs[np.isin(parts[row, column], np.unique(mine[mine > 0]))]
    return arcs[_thin_out(np.ascontiguousarray(arcs[:, :2]), _MOST_ARC_POINTS)]


def roadmap_samples(obstacles: Obstacles, clearance_m: float, count: int, arcs: FloatArray) -> FloatArray:
    """Free samples: half on the inflated obstacles' boundary, where shortest paths bend, half a Halton sequence.

    Args:
        obstacles: The obstacles.
        clearance_m: Distance to keep [m].
        count: Number of samples.
        arcs: Points on arcs, from ``arc_points``.

    Returns:
        Shape (about ``count``, 2) [m]; fewer where too few free ones are found.
    """
    boundary = np.ascontiguousarray(arcs[:, :2])
    boundary = boundary[_thin_out(boundary, count // 2)]
    if obstacles.cells is None:
        along = _along_edges(obstacles, clearance_m + _GRAZE_M, count // 2 - len(boundary))
        boundary = np.concatenate([boundary, _free(obstacles, along, clearance_m)])
    low, high = obstacles.bounds_m[:2], obstacles.bounds_m[2:]
    spread = np.empty((0, 2))
    wanted = count - len(boundary)
    for part in range(8):  # enough where an eighth of the area is free
        drawn = low + halton(part * count, count) * (high - low)
        spread = np.concatenate([spread, _free(obstacles, drawn, clearance_m)])
        if len(spread) >= wanted:
            break
    return np.concatenate([boundary, spread[:wanted]])


@njit(cache=True)  # type: ignore[untyped-decorator]
def halton(first: int, count: int) -> FloatArray:
    """Points of the Halton sequence in the unit square, from number ``first`` on, shape (count, 2).

    Equal to SciPy's to the bit, whose package takes half a second to import.

    Source:
        Halton (1960), with bases 2 and 3.
    """
    points = np.zeros((count, 2))
    for axis, base in enumerate((2, 3)):
        for k in range(count):
            share, left = 1.0 / base, first + k
            while left > 0:
                points[k, axis] += left % base * share
                share /= base
                left //= base
    return points


def _corners_of_boxes(obstacles: Obstacles) -> FloatArray:
    """Corner x, y and the outward directions of its two sides; shape (4 k, 6)."""
    x, y, hx, hy, yaw = obstacles.boxes.T
    ahead, left = np.column_stack([np.cos(yaw), np.sin(yaw)]), np.column_stack([-np.sin(yaw), np.cos(yaw)])
    return np.concatenate([np.column_stack([
        np.column_stack([x, y]) + sx * hx[:, None] * ahead + sy * hy[:, None] * left, sx * ahead, sy * left])
        for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))])


def _corners_of_cells(cells: Cells) -> FloatArray:
    """The same for the convex corners of the occupied cells, shape (k, 6)."""
    corners = convex_corners(cells)
    yaw = float(cells.origin[2])
    ahead, left = np.array([[math.cos(yaw), math.sin(yaw)]]), np.array([[-math.sin(yaw), math.cos(yaw)]])
    return np.column_stack([cells.to_world(corners[:, :2]), corners[:, 2:3] * ahead, corners[:, 3:4] * left])


def _along_edges(obstacles: Obstacles, ring: float, count: int) -> FloatArray:
    """About ``count`` points along the edges of single boxes, at distance ``ring``."""
    edges = []
    for cx, cy, hx, hy, yaw in obstacles.boxes:
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        for axis, reach in ((0, hx), (1, hy)):
            for side in (-1.0, 1.0):
                ends = np.zeros((2, 2))
                ends[:, axis] = (-reach, reach)
                ends[:, 1 - axis] = side * ((hy, hx)[axis] + ring)
                edges.append(ends @ turn.T + (cx, cy))
    if not edges or count <= 0:
        return np.empty((0, 2))
    lengths = np.array([np.hypot(*(b - a)) for a, b in edges])
    step = lengths.sum() / count
    return np.concatenate([a + (np.arange(k) + 0.5)[:, None] / k * (b - a) for (a, b), k in zip(
        edges, np.maximum(lengths / step, 1).astype(np.int64), strict=True)])


def _thin_out(points: FloatArray, count: int) -> IntArray:
    """Indices of at most ``count`` points, spread by a least distance as small as that allows."""
    if len(points) <= count:
        return np.arange(len(points))
    # The smallest of these gaps that leaves at most ``count``: exponential search, then bisection.
    gaps = 0.01 * 1.3 ** np.arange(100)
    low, high, step = -1, 0, 1
    kept: IntArray
    while len(kept := _spaced(points, gaps[high])) > count:
        low, high, step = high, high + step, 2 * step
    while high - low > 1:
        middle = (low + high) // 2
        fewer = _spaced(points, gaps[middle])
        low, high, kept = (low, middle, fewer) if len(fewer) <= count else (middle, high, kept)
    return kept


@njit(cache=True)  # type: ignore[untyped-decorator]
def _spaced(points: FloatArray, gap: float) -> IntArray:
    """Indices of points of which no two are nearer than ``gap`` [m], chosen greedily in order."""
    low_x, low_y = points[:, 0].min(), points[:, 1].min()
    wide, high = points[:, 0].max() - low_x, points[:, 1].max() - low_y
    side, squared = max(gap, max(wide, high) / 1000), gap * gap  # at most 1000 squares along each side
    columns, rows = math.floor(wide / side) + 1, math.floor(high / side) + 1
    newest = np.full(columns * rows, -1, dtype=np.int32)  # last kept point of each square
    before = np.full(len(points), -1, dtype=np.int32)  # the point kept before it in the same square
    kept = np.empty(len(points), dtype=np.int64)
    count = 0
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        column, row = math.floor((x - low_x) / side), math.floor((y - low_y) / side)
        far = True
        # Its own square first, which most likely has a near one.
        for r in (row, row - 1, row + 1):
            for c in (column, column - 1, column + 1):
                if not far or r < 0 or r >= rows or c < 0 or c >= columns:
                    continue
                other = newest[r * columns + c]
                while other >= 0 and far:
                    dx, dy = points[other, 0] - x, points[other, 1] - y
                    far = dx * dx + dy * dy >= squared
                    other = before[other]
        if far:
            before[k] = newest[row * columns + column]
            newest[row * columns + column] = k
            kept[count] = k
            count += 1
    return kept[:count]


def _free(obstacles: Obstacles, points: FloatArray, clearance_m: float) -> FloatArray:
    free: FloatArray = points[keeps_clearance(obstacles, points, clearance_m)]
    return free
