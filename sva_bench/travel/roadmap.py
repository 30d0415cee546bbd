"""Collision-free paths between sites, planned by OMPL. The only importer of ompl.

A deterministic PRM* roadmap serves all pairs: half of its samples lie on the boundary of the inflated obstacles,
where shortest paths bend, half are a Halton sequence. Edges are checked exactly, without a resolution.
RRTConnect, pair by pair, is the noisy alternative.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numba import njit
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou
from scipy.ndimage import label
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.stats import qmc

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.world.clearance import segment_distance
from sva_bench.world.model import Obstacles

PlannerName = Literal["prmstar", "rrtconnect"]

_MILESTONES = (4000, 16000)  # a second, denser roadmap where the first leaves sites apart
_CELL_M, _CELLS = 0.02, 200_000  # finest cell, and most cells, of the grid that says which sites no path joins
_RRT_ITERATIONS = 20_000  # states that RRTConnect may try for one pair before the pair counts as unreachable
_GRAZE_M = 1e-4  # boundary samples keep this far outside, so that edges along the boundary are free
_ROUNDS = 3  # passes of the simplifier; a fourth no longer shortens anything by 0.1 %

ou.setLogLevel(ou.LogLevel.LOG_NONE)  # it warns that seeding is late; it is not, and the result is the same bit for bit


def plan_paths(
    obstacles: Obstacles, points: FloatArray, clearance_m: float, *, planner: PlannerName = "prmstar", seed: int = 0,
) -> list[list[FloatArray | None]]:
    """A path from every point to every other.

    Args:
        obstacles: What stands in the way.
        points: Where the paths begin and end [m], shape (n, 2); all at least ``clearance_m`` from obstacles.
        clearance_m: Distance that every path keeps from obstacles.
        planner: ``prmstar``, one roadmap for all; or ``rrtconnect``, each directed pair by itself, noisy.
        seed: Seed of OMPL's random numbers.

    Returns:
        ``paths[i][j]``: vertices [m], shape (k, 2); ``None`` if there is no way, or i = j.
    """
    ou.RNG.setSeed(seed + 1)  # 0 means "by the clock" to OMPL
    if planner == "rrtconnect":
        return _rrtconnect(obstacles, points, clearance_m)
    paths: list[list[FloatArray | None]] = []
    for milestones in _MILESTONES:
        paths = _prmstar(obstacles, points, clearance_m, milestones)
        missing = [(i, j) for i, row in enumerate(paths) for j, path in enumerate(row) if i != j and path is None]
        if not missing or surely_apart(obstacles, points, clearance_m)[tuple(zip(*missing, strict=True))].all():
            break  # a denser roadmap would find no more
    return paths


class _ExactValidator(ob.MotionValidator):  # type: ignore[misc]
    """Checks a whole edge at once, exactly."""

    def __init__(self, si: Any, free: Callable[[float, float, float, float], bool]) -> None:
        super().__init__(si)
        self._free = free

    def checkMotion(self, a: Any, b: Any) -> bool:
        return bool(self._free(a[0], a[1], b[0], b[1]))


class _SampleQueue(ob.ValidStateSampler):  # type: ignore[misc]
    """Hands out prepared samples, one after the other; none ever depends on chance."""

    def __init__(self, si: Any, samples: FloatArray) -> None:
        super().__init__(si)
        self._samples, self._next = samples, 0

    def sample(self, state: Any) -> bool:
        state[0], state[1] = (float(x) for x in self._samples[self._next % len(self._samples)])
        self._next += 1
        return True

    def sampleNear(self, state: Any, near: Any, distance: float) -> bool:  # noqa: ARG002 - OMPL's signature
        return self.sample(state)


def surely_apart(obstacles: Obstacles, points: FloatArray, clearance_m: float) -> BoolArray:
    """Which points no path can join, however fine the roadmap, shape (n, n).

    Each point of a path lies in a cell of a grid, whose centre is at most half a diagonal away from it. Cells whose
    centre is nearer to an obstacle than the clearance less that are closed; a path runs through open ones, from
    neighbour to neighbour. So points in different parts of the open cells are apart.
    """
    low, high = obstacles.bounds_m[:2], obstacles.bounds_m[2:]
    cell = max(_CELL_M, math.sqrt(float(np.prod(high - low)) / _CELLS))
    counts = np.ceil((high - low) / cell).astype(np.int64)
    x, y = (low[axis] + (np.arange(counts[axis]) + 0.5) * cell for axis in (0, 1))
    centres = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    needed = clearance_m - cell * math.sqrt(0.5) - 1e-6
    open_cells = _free_mask(obstacles.bounds_m, obstacles.boxes, obstacles.cylinders, centres, needed) > 0
    parts, _ = label(open_cells.reshape(tuple(counts)), structure=np.ones((3, 3)))
    at = np.clip(((points - low) / cell).astype(np.int64), 0, counts - 1)
    mine = parts[at[:, 0], at[:, 1]]
    apart: BoolArray = mine[:, None] != mine[None, :]
    return apart


def _space(obstacles: Obstacles, clearance_m: float) -> tuple[Any, Callable[[float, float, float, float], bool]]:
    space = ob.RealVectorStateSpace(2)
    bounds = ob.RealVectorBounds(2)
    for axis in (0, 1):
        bounds.setLow(axis, float(obstacles.bounds_m[axis]))
        bounds.setHigh(axis, float(obstacles.bounds_m[axis + 2]))
    space.setBounds(bounds)
    si = ob.SpaceInformation(space)
    o, needed = obstacles, clearance_m - 1e-9  # a start on the very boundary is free

    def free(ax: float, ay: float, bx: float, by: float) -> bool:
        return bool(segment_distance(o.bounds_m, o.boxes, o.cylinders, ax, ay, bx, by, needed) >= needed)

    si.setStateValidityChecker(lambda s: free(s[0], s[1], s[0], s[1]))
    si.setMotionValidator(_ExactValidator(si, free))
    si.setup()
    return si, free


def _state(si: Any, point: Sequence[float] | FloatArray) -> Any:
    state = si.allocState()
    state[0], state[1] = float(point[0]), float(point[1])
    return state


def _prmstar(
    obstacles: Obstacles, points: FloatArray, clearance_m: float, milestones: int
) -> list[list[FloatArray | None]]:
    if len(points) < 2:
        return [[None] for _ in points]
    si, vertices, graph = _grown(obstacles, points, clearance_m, milestones)
    at = _nearest(vertices, points)
    lengths, before = dijkstra(graph, directed=False, indices=at, return_predecessors=True)
    n = len(points)
    paths: list[list[FloatArray | None]] = [[None] * n for _ in range(n)]
    simplifier = og.PathSimplifier(si)
    for i in range(n):
        for j in range(i + 1, n):
            if not math.isfinite(lengths[i, at[j]]):
                continue
            chain = [at[j]]
            while chain[-1] != at[i]:
                chain.append(int(before[i, chain[-1]]))
            path = _simplified(si, simplifier, vertices[chain[::-1]])
            path[0], path[-1] = points[i], points[j]
            paths[i][j], paths[j][i] = path, path[::-1].copy()
    return paths


def roadmap_edges(obstacles: Obstacles, points: FloatArray, clearance_m: float) -> FloatArray:
    """The edges of the roadmap that ``plan_paths`` plans on, for looking at: both ends of each [m], shape (e, 2, 2)."""
    if len(points) < 2:
        return np.empty((0, 2, 2))
    for milestones in _MILESTONES:
        _, vertices, graph = _grown(obstacles, points, clearance_m, milestones)
        _, part = connected_components(graph, directed=False)
        if len(set(part[_nearest(vertices, points)].tolist())) == 1:
            break
    one, other = graph.nonzero()
    ends: FloatArray = np.stack([vertices[one], vertices[other]], axis=1)
    return ends[one < other]


def _nearest(vertices: FloatArray, points: FloatArray) -> list[int]:
    return [int(np.argmin(np.hypot(*(vertices - point).T))) for point in points]


def _grown(
    obstacles: Obstacles, points: FloatArray, clearance_m: float, milestones: int
) -> tuple[Any, FloatArray, csr_array]:
    """OMPL's space, and the vertices and edges of a roadmap of so many milestones."""
    si, _ = _space(obstacles, clearance_m)
    samples = roadmap_samples(obstacles, clearance_m, milestones)
    si.setValidStateSamplerAllocator(lambda inner: _SampleQueue(inner, samples))
    problem = ob.ProblemDefinition(si)
    # Each site once: of two vertices in one place, chance decides which gets an edge.
    for point in points[1:]:
        problem.addStartState(_state(si, point))
    problem.setGoalState(_state(si, points[0]))
    planner = og.PRMstar(si)
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(ob.plannerAlwaysTerminatingCondition())  # inserts the sites; a Python condition would deadlock here
    total = len(points) + len(samples)
    planner.growRoadmapPtc(ob.PlannerTerminationCondition(lambda: planner.milestoneCount() >= total))
    return si, *_read_roadmap(si, planner)


def _read_roadmap(si: Any, planner: Any) -> tuple[FloatArray, csr_array]:
    data = ob.PlannerData(si)
    planner.getPlannerData(data)
    count = data.numVertices()
    vertices = np.array([(s[0], s[1]) for s in (data.getVertex(k).getState() for k in range(count))])
    rows, columns = [], []
    for k in range(count):
        neighbours = data.getEdges(k)
        rows += [k] * len(neighbours)
        columns += neighbours
    # OMPL numbers vertices by where they lie in memory, and ties between equally short paths go by number:
    # by their coordinates instead, the same roadmap always gives the same paths.
    order = np.lexsort(vertices.T)
    number = np.empty(count, dtype=np.int64)
    number[order] = np.arange(count)
    vertices = vertices[order]
    heads, tails = number[np.array(rows, dtype=np.int64)], number[np.array(columns, dtype=np.int64)]
    length = np.maximum(np.hypot(*(vertices[heads] - vertices[tails]).T), 1e-12)  # a stored 0 would be no edge
    return vertices, csr_array((length, (heads, tails)), shape=(count, count))


def _simplified(si: Any, simplifier: Any, vertices: FloatArray) -> FloatArray:
    path = og.PathGeometric(si)
    for vertex in vertices:
        path.append(_state(si, vertex))
    for _ in range(_ROUNDS):
        simplifier.reduceVertices(path)
        simplifier.partialShortcutPath(path)
        simplifier.collapseCloseVertices(path)
    return np.array([(s[0], s[1]) for s in path.getStates()])


def _rrtconnect(obstacles: Obstacles, points: FloatArray, clearance_m: float) -> list[list[FloatArray | None]]:
    si, _ = _space(obstacles, clearance_m)
    n = len(points)
    paths: list[list[FloatArray | None]] = [[None] * n for _ in range(n)]
    simplifier = og.PathSimplifier(si)
    for i in range(n):
        for j in range(n):
            if i == j:
                continue
            problem = ob.ProblemDefinition(si)
            problem.setStartAndGoalStates(_state(si, points[i]), _state(si, points[j]))
            planner = og.RRTConnect(si)
            planner.setProblemDefinition(problem)
            planner.setup()
            planner.solve(_after(_RRT_ITERATIONS))
            if problem.hasExactSolution():  # solve() is true for an approximate one too, which ends short
                path = problem.getSolutionPath()
                simplifier.simplifyMax(path)
                vertices = np.array([(s[0], s[1]) for s in path.getStates()])
                vertices[0], vertices[-1] = points[i], points[j]
                paths[i][j] = vertices
    return paths


def _after(calls: int) -> Any:
    """A termination condition that counts how often it is asked: never the clock."""
    asked = iter(range(calls))
    return ob.PlannerTerminationCondition(lambda: next(asked, None) is None)


def roadmap_samples(obstacles: Obstacles, clearance_m: float, count: int) -> FloatArray:
    """Free samples: half on the inflated obstacles' boundary, where shortest paths bend, half a Halton sequence.

    Returns:
        Shape (about ``count``, 2); fewer where no more free ones are found.
    """
    ring = clearance_m + _GRAZE_M
    boundary = _free(obstacles, _boundary(obstacles, ring, count // 2), clearance_m)
    low, high = obstacles.bounds_m[:2], obstacles.bounds_m[2:]
    halton = qmc.Halton(2, scramble=False)
    spread = np.empty((0, 2))
    wanted = count - len(boundary)
    for _ in range(8):  # an eighth of the area free is the least that fills the count
        spread = np.concatenate([spread, _free(obstacles, low + halton.random(count) * (high - low), clearance_m)])
        if len(spread) >= wanted:
            break
    return np.concatenate([boundary, spread[:wanted]])


def _boundary(obstacles: Obstacles, ring: float, count: int) -> FloatArray:
    """Points at distance ``ring`` from single obstacles: round each corner, and along each edge."""
    corners = 4 * len(obstacles.boxes)
    shares = max(corners + 2 * len(obstacles.cylinders), 1)
    per_corner = min(max(count // (2 * shares), 3), 12)
    angles = (np.arange(per_corner) + 0.5) / per_corner * (np.pi / 2)
    # An inscribed polygon would leave the ring between its corners, and so be blocked; this one circumscribes it.
    around_corner = ring / math.cos(np.pi / (4 * per_corner))
    points = []
    edges = []
    for cx, cy, hx, hy, yaw in obstacles.boxes:
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        for quadrant, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
            a = angles + quadrant * np.pi / 2
            arc = np.array([sx * hx, sy * hy]) + around_corner * np.column_stack([np.cos(a), np.sin(a)])
            points.append(arc @ turn.T + (cx, cy))
        for axis, reach in ((0, hx), (1, hy)):
            for side in (-1.0, 1.0):
                ends = np.zeros((2, 2))
                ends[:, axis] = (-reach, reach)
                ends[:, 1 - axis] = side * ((hy, hx)[axis] + ring)
                edges.append(ends @ turn.T + (cx, cy))
    around = np.arange(2 * per_corner) / (2 * per_corner) * 2 * np.pi
    for cx, cy, radius in obstacles.cylinders:
        reach = (radius + ring) / math.cos(np.pi / len(around))
        points.append(np.array([cx, cy]) + reach * np.column_stack([np.cos(around), np.sin(around)]))
    left = count - sum(map(len, points))
    if edges and left > 0:
        lengths = np.array([np.hypot(*(b - a)) for a, b in edges])
        step = lengths.sum() / left
        for (a, b), length in zip(edges, lengths, strict=True):
            k = max(int(length / step), 1)
            points.append(a + (np.arange(k) + 0.5)[:, None] / k * (b - a))
    return np.concatenate(points) if points else np.empty((0, 2))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _free_mask(
    bounds: FloatArray, boxes: FloatArray, cylinders: FloatArray, points: FloatArray, needed: float
) -> FloatArray:
    mask = np.zeros(len(points))
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        mask[k] = segment_distance(bounds, boxes, cylinders, x, y, x, y, needed) >= needed
    return mask


def _free(obstacles: Obstacles, points: FloatArray, clearance_m: float) -> FloatArray:
    mask = _free_mask(obstacles.bounds_m, obstacles.boxes, obstacles.cylinders, points, clearance_m)
    free: FloatArray = points[mask > 0]
    return free
