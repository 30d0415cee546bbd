"""Shortest paths among obstacles that are kept at a distance, by visibility graph: the optimum planners are held to.

A box inflated by a clearance is a rectangle with rounded corners, a cylinder a circle; the bounds shrink. Arcs become
polygons with a vertex every 7.5 degrees: on the arc, so that the obstacles are a little too small and lengths a lower
bound of the optimum; or with the edges touching the arc, so that the obstacles are a little too large and lengths an
upper bound. A chord of 7.5 degrees is shorter than its arc by t^2 / 24 = 0.07 %, and only the bends of a path are arcs.

Source:
    Lozano-Perez & Wesley (1979): a shortest path among convex polygons bends at their vertices only, where it is
    tangent to them.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.geometry.obstacles import Obstacles
from tests.oracles.distances import corners_of

_QUADRANT = 12  # edges for each quarter of a circle
_GRAZE_M = 1e-9  # a segment may run along an edge, or through a vertex

Bound = Literal["lower", "upper"]


def shortest_lengths(obstacles: Obstacles, points: FloatArray, clearance_m: float, bound: Bound = "lower"
                     ) -> FloatArray:
    """Length of the shortest path between each pair of points, shape (n, n); ``inf`` where there is none.

    Args:
        obstacles: What stands in the way.
        points: Where paths begin and end [m], shape (n, 2); free.
        clearance_m: Distance to keep.
        bound: Whether arcs are cut inside or outside: lengths bound the optimum from below or from above.
    """
    polygons = [_inflated(corners_of(box), clearance_m, bound) for box in obstacles.boxes]
    polygons += [_circle(c[:2], c[2] + clearance_m, bound) for c in obstacles.cylinders]
    n = len(points)
    nodes, neighbours = [points], [np.full((n, 2, 2), np.nan)]
    owner = [np.full(n, -1)]
    for number, polygon in enumerate(polygons):
        nodes.append(polygon)
        neighbours.append(np.stack([np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0)], axis=1))
        owner.append(np.full(len(polygon), number))
    node, beside, own = np.concatenate(nodes), np.concatenate(neighbours), np.concatenate(owner)
    usable = _usable(node, own, polygons, obstacles, clearance_m)
    node, beside = node[usable], beside[usable]
    tangent = _tangent(node, beside)
    tails, heads = (index.astype(np.int64) for index in np.nonzero(np.triu(tangent & tangent.T, k=1)))
    free = _unblocked(node[tails], node[heads], polygons)
    tails, heads = tails[free], heads[free]
    length = np.maximum(np.hypot(*(node[tails] - node[heads]).T), 1e-15)  # a stored 0 would be no edge
    graph = csr_array((length, (tails, heads)), shape=(len(node), len(node)))
    result: FloatArray = dijkstra(graph, directed=False, indices=np.arange(n))[:, :n]
    return result


def _inflated(corners: FloatArray, reach: float, bound: Bound) -> FloatArray:
    """A convex counter-clockwise polygon whose corners are rounded by ``reach``."""
    arcs = []
    for k, corner in enumerate(corners):
        edge = corner - corners[k - 1]
        begin = math.atan2(-edge[0], edge[1])  # normal of the edge that ends here; the next lies a quarter further on
        arcs.append(corner + _arc(begin, math.pi / 2, _QUADRANT, reach, bound))
    return np.concatenate(arcs)


def _circle(centre: FloatArray, radius: float, bound: Bound) -> FloatArray:
    around = _arc(0.0, 2 * math.pi, 4 * _QUADRANT, radius, bound)
    result: FloatArray = centre + (around[:-1] if bound == "lower" else around[1:-1])
    return result


def _arc(begin: float, sweep: float, edges: int, radius: float, bound: Bound) -> FloatArray:
    """Vertices of an arc: on it, or of the tangents that touch it at those places and at both ends."""
    step = sweep / edges
    if bound == "lower":
        angles = begin + step * np.arange(edges + 1)
        return radius * np.column_stack([np.cos(angles), np.sin(angles)])
    angles = begin + step * (np.arange(edges) + 0.5)
    reach = radius / math.cos(step / 2)
    ends = np.array([[begin], [begin + sweep]])
    first, last = radius * np.hstack([np.cos(ends), np.sin(ends)])
    return np.vstack([first, reach * np.column_stack([np.cos(angles), np.sin(angles)]), last])


def _outward(polygon: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals of the edges and their distances from the origin."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.hypot(*edges.T)[:, None]
    return normals, np.einsum("ij,ij->i", normals, polygon)


def _usable(node: FloatArray, own: IntArray, polygons: list[FloatArray], obstacles: Obstacles, clearance_m: float
            ) -> BoolArray:
    """Which nodes lie within the shrunken bounds and in no polygon; the points themselves always do."""
    low, high = obstacles.bounds_m[:2] + clearance_m, obstacles.bounds_m[2:] - clearance_m
    usable: BoolArray = np.all((node >= low - _GRAZE_M) & (node <= high + _GRAZE_M), axis=1)
    for number, polygon in enumerate(polygons):
        normals, offsets = _outward(polygon)
        inside = np.all(node @ normals.T < offsets - _GRAZE_M, axis=1)
        usable &= ~(inside & (own != number))
    usable[own < 0] = True
    return usable


def _tangent(node: FloatArray, beside: FloatArray) -> BoolArray:
    """Whether a straight line from node i towards node j leaves both polygon neighbours of i on one side of it."""
    way = node[None, :, :] - node[:, None, :]
    sides = [way[..., 0] * (beside[:, None, k, 1] - node[:, None, 1])
             - way[..., 1] * (beside[:, None, k, 0] - node[:, None, 0]) for k in (0, 1)]
    slack = 1e-12
    one_side: BoolArray = ((sides[0] >= -slack) & (sides[1] >= -slack)) | ((sides[0] <= slack) & (sides[1] <= slack))
    one_side[np.isnan(beside[:, 0, 0])] = True  # points where paths begin have no neighbours
    return one_side


def _unblocked(starts: FloatArray, ends: FloatArray, polygons: list[FloatArray]) -> BoolArray:
    """Which segments run through the inside of no polygon, by clipping them (Cyrus & Beck, 1978)."""
    free = np.ones(len(starts), dtype=bool)
    for polygon in polygons:
        normals, offsets = _outward(polygon)
        at_start = starts @ normals.T - (offsets - _GRAZE_M)
        change = (ends - starts) @ normals.T
        with np.errstate(divide="ignore", invalid="ignore"):
            meets = -at_start / change
        low = np.where(change < 0, meets, 0.0).max(axis=1, initial=0.0)
        high = np.where(change > 0, meets, 1.0).min(axis=1, initial=1.0)
        outside = ((change == 0) & (at_start >= 0)).any(axis=1)
        free &= outside | (low >= high)
    return free
