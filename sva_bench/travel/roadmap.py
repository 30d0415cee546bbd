"""Collision-free paths between sites, planned by OMPL. The only importer of ompl.

A deterministic PRM* roadmap serves all pairs: half of its samples lie on the boundary of the inflated obstacles,
where shortest paths bend, half are a Halton sequence; tangents between the boundary's arcs make paths nearly optimal.
Edges are checked exactly, not at a resolution. The other planners search pair by pair.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou
from scipy.ndimage import label
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.choices import PathPlanner
from sva_bench.geometry.buckets import clearance_checker, keeps_clear, keeps_clearance
from sva_bench.geometry.cells import distance_field
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.interrupts import deferring_ctrl_c, pressed
from sva_bench.travel.lattice import lattice_paths, reachable_components
from sva_bench.travel.samples import arc_points, roadmap_samples
from sva_bench.travel.tangents import new_line_cache, shortcut, tangents, tangents_of_isolated

_GROWTH = ((1000, 6), (3000, 12), (6000, 24))
"""Milestones, and points on a quarter circle: the roadmap grows until it connects all sites, or to the last of these.

The tangents between arcs make paths short, the milestones connect the rest: more of them shorten no path.
"""
_CROWD = 10_000
"""Points on arcs from which on the roadmap is not grown, but connected by paths on the lattice of the map's cells.

More points and milestones would take seconds, and connect hardly more; the lattice finds nearly every passage.
"""
_CELL_M, _CELLS = 0.02, 200_000  # finest cell, and most cells, of the grid that proves sites disconnected
_EFFORTS = (1, 4, 16)  # factors on a planner's samples and steps for one pair, tried until a path is found
_START_SLACK_M = 1e-9  # a start on the boundary of the free space is free
_WINDOW = 40  # most vertices that one shortcut skips: more than an arc has between two tangents



@dataclass(frozen=True, kw_only=True)
class PairPlanner:
    """A planner that searches pair by pair.

    Attributes:
        search: OMPL's class.
        calls: Evaluations of its termination condition for one pair, at effort 1.
        samples: States that it samples beforehand, at effort 1; 0 = it samples while it searches.
    """

    search: Callable[[Any], Any]
    calls: int
    samples: int = 0


PAIR_PLANNERS: Mapping[PathPlanner, PairPlanner] = {
    "rrtconnect": PairPlanner(search=og.RRTConnect, calls=20_000),
    "fmt": PairPlanner(search=og.FMT, calls=20_000, samples=1000),
    "bfmt": PairPlanner(search=og.BFMT, calls=20_000, samples=1000),
    "informedrrtstar": PairPlanner(search=og.InformedRRTstar, calls=1500),
}
"""The planners but for ``prmstar``, whose one roadmap serves all pairs."""

ou.setLogLevel(ou.LogLevel.LOG_NONE)  # it warns that seeding is late, wrongly: results are equal to the bit


def plan_paths(
    obstacles: Obstacles, points: FloatArray, clearance_m: float, *, planner: PathPlanner = "prmstar", seed: int = 0,
) -> list[list[FloatArray | None]]:
    """A path from every point to every other.

    Args:
        obstacles: The obstacles.
        points: Ends of the paths [m], shape (n, 2); all at least ``clearance_m`` from obstacles.
        clearance_m: Distance that every path keeps from obstacles [m].
        planner: ``prmstar``: one roadmap for all pairs; the others plan each directed pair by itself.
        seed: Seed of OMPL's random numbers.

    Returns:
        ``paths[i][j]``: vertices [m], shape (k, 2); ``None`` if there is no path, or i = j.

    Source:
        Karaman & Frazzoli (2011), "Sampling-based algorithms for optimal motion planning" (PRM*).
    """
    ou.RNG.setSeed(seed + 1)  # 0 means "by the clock" to OMPL
    if planner in PAIR_PLANNERS:
        return _pair_by_pair(obstacles, points, clearance_m, planner)
    if len(points) < 2:
        return [[None] for _ in points]
    return _shortest(_connecting_roadmap(obstacles, points, clearance_m), points)


def roadmap_edges(obstacles: Obstacles, points: FloatArray, clearance_m: float) -> FloatArray:
    """The edges of the roadmap of ``plan_paths``, for display: both ends of each [m], shape (e, 2, 2)."""
    if len(points) < 2:
        return np.empty((0, 2, 2))
    ou.RNG.setSeed(1)
    roadmap = _connecting_roadmap(obstacles, points, clearance_m)
    one, other = roadmap.graph.nonzero()
    ends: FloatArray = np.stack([roadmap.vertices[one], roadmap.vertices[other]], axis=1)
    return ends


@dataclass(frozen=True, eq=False, kw_only=True)
class _Roadmap:
    """A roadmap.

    Attributes:
        vertices: Its vertices [m], shape (v, 2).
        graph: Length of each edge [m], from the lower number to the higher, shape (v, v).
        at: Index of the vertex of each end of paths, shape (n,).
        checker: From ``clearance_checker``, for edges.
        arcs: Points on arcs among its vertices, from ``arc_points``.
    """

    vertices: FloatArray
    graph: csr_array
    at: IntArray
    checker: FloatArray
    arcs: FloatArray


class _ExactValidator(ob.MotionValidator):  # type: ignore[misc]
    """Checks edges exactly."""

    def __init__(self, si: Any, free: Callable[[float, float, float, float], bool]) -> None:
        super().__init__(si)
        self._free = free

    def checkMotion(self, a: Any, b: Any) -> bool:
        return bool(self._free(a[0], a[1], b[0], b[1]))


class _SampleQueue(ob.ValidStateSampler):  # type: ignore[misc]
    """Returns prepared samples in order, so that nothing is random."""

    def __init__(self, si: Any, samples: FloatArray) -> None:
        super().__init__(si)
        self._samples, self._next = samples, 0

    def sample(self, state: Any) -> bool:
        state[0], state[1] = (float(x) for x in self._samples[self._next % len(self._samples)])
        self._next += 1
        return True

    def sampleNear(self, state: Any, near: Any, distance: float) -> bool:  # noqa: ARG002 - OMPL's signature
        return self.sample(state)


def surely_disconnected(obstacles: Obstacles, points: FloatArray, clearance_m: float) -> BoolArray:
    """Which pairs of points are proved to have no path, shape (n, n).

    By a lattice: each point of a path has a node nearby that is hardly nearer to an obstacle than the path.
    """
    if obstacles.cells is not None:
        _, mine = reachable_components(distance_field(obstacles.cells), clearance_m, points)
    else:
        low, high = obstacles.bounds_m[:2], obstacles.bounds_m[2:]
        cell = max(_CELL_M, math.sqrt(float(np.prod(high - low)) / _CELLS))
        counts = np.ceil((high - low) / cell).astype(np.int64)
        x, y = (low[axis] + (np.arange(counts[axis]) + 0.5) * cell for axis in (0, 1))
        centres = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        needed = clearance_m - cell * math.sqrt(0.5) - 1e-6
        open_places = keeps_clearance(obstacles, centres, needed).reshape(tuple(counts))
        at = np.clip(((points - low) / cell).astype(np.int64), 0, counts - 1)
        parts, _ = label(open_places, structure=np.ones((3, 3)))
        mine = parts[at[:, 0], at[:, 1]].astype(np.int64)
    disconnected: BoolArray = mine[:, None] != mine[None, :]
    return disconnected


def _space(obstacles: Obstacles, clearance_m: float) -> tuple[Any, Callable[[float, float, float, float], bool]]:
    space = ob.RealVectorStateSpace(2)
    bounds = ob.RealVectorBounds(2)
    for axis in (0, 1):
        bounds.setLow(axis, float(obstacles.bounds_m[axis]))
        bounds.setHigh(axis, float(obstacles.bounds_m[axis + 2]))
    space.setBounds(bounds)
    si = ob.SpaceInformation(space)
    checker = clearance_checker(obstacles, clearance_m, _START_SLACK_M)

    def free(ax: float, ay: float, bx: float, by: float) -> bool:
        return bool(keeps_clear(checker, ax, ay, bx, by))

    free(*obstacles.bounds_m[:2].tolist() * 2)  # compile it here, where Ctrl-C may be raised, not within OMPL
    si.setStateValidityChecker(lambda s: free(s[0], s[1], s[0], s[1]))
    si.setMotionValidator(_ExactValidator(si, free))
    si.setup()
    return si, free


def _state(si: Any, point: Sequence[float] | FloatArray) -> Any:
    state = si.allocState()
    state[0], state[1] = float(point[0]), float(point[1])
    return state


def _connecting_roadmap(obstacles: Obstacles, points: FloatArray, clearance_m: float) -> _Roadmap:
    """A roadmap grown until it connects all points, or to the last of ``_GROWTH``."""
    disconnected: BoolArray | None = None
    for milestones, per_corner in _GROWTH:
        roadmap = _build_roadmap(obstacles, points, clearance_m, milestones, per_corner)
        _, part = connected_components(roadmap.graph, directed=False)
        mine = part[roadmap.at]
        missing = mine[:, None] != mine[None, :]
        if not missing.any():
            break
        if obstacles.cells is not None and len(roadmap.arcs) > _CROWD:
            return _with_lattice_paths(roadmap, obstacles, points, clearance_m, np.flatnonzero(missing[0]))
        if disconnected is None:
            disconnected = surely_disconnected(obstacles, points, clearance_m)
        if disconnected[missing].all():
            break  # a denser roadmap would connect no more
    return roadmap


def _with_lattice_paths(
    roadmap: _Roadmap, obstacles: Obstacles, points: FloatArray, clearance_m: float, goals: IntArray
) -> _Roadmap:
    """A roadmap with lattice paths from the first point to some others added, and tangents from their vertices."""
    found = lattice_paths(obstacles, roadmap.checker, clearance_m, points, goals.tolist())
    paths = [path for path in found if path is not None]
    if not paths:
        return roadmap
    along = np.concatenate(paths)
    last = np.cumsum([len(path) for path in paths]) - 1
    first = np.delete(np.arange(len(along)), last)  # of each edge
    vertices, graph = _with_edges(roadmap.vertices, roadmap.graph, along, np.column_stack([first, first + 1]))
    inner = np.unique(np.concatenate([path[1:-1] for path in paths]), axis=0)
    ends = np.concatenate([_isolated(inner), roadmap.arcs])
    vertices, graph = _with_edges(vertices, graph, ends[:, :2], tangents_of_isolated(roadmap.checker, ends))
    return replace(roadmap, vertices=vertices, graph=graph)


def _build_roadmap(
    obstacles: Obstacles, points: FloatArray, clearance_m: float, milestones: int, per_corner: int,
) -> _Roadmap:
    si, _ = _space(obstacles, clearance_m)
    arcs = arc_points(obstacles, clearance_m, per_corner, points)
    samples = roadmap_samples(obstacles, clearance_m, milestones, arcs)
    si.setValidStateSamplerAllocator(lambda inner: _SampleQueue(inner, samples))
    problem = ob.ProblemDefinition(si)
    # Each site once: of two vertices at one point, chance decides which gets an edge.
    for point in points[1:]:
        problem.addStartState(_state(si, point))
    problem.setGoalState(_state(si, points[0]))
    planner = og.PRMstar(si)
    planner.setProblemDefinition(problem)
    planner.setup()
    total = len(points) + len(samples)
    with deferring_ctrl_c():  # exceptions must not pass through OMPL's callbacks
        planner.solve(ob.plannerAlwaysTerminatingCondition())  # inserts the sites; a Python condition would deadlock
        planner.growRoadmapPtc(ob.PlannerTerminationCondition(lambda: pressed() or planner.milestoneCount() >= total))
    checker = clearance_checker(obstacles, clearance_m, _START_SLACK_M)
    ends = np.concatenate([_isolated(points), arcs])
    vertices, graph = _with_edges(*_read_roadmap(si, planner), ends[:, :2], tangents(checker, ends))
    at = np.array([int(np.argmin(np.hypot(*(vertices - point).T))) for point in points], dtype=np.int64)
    return _Roadmap(vertices=vertices, graph=graph, at=at, checker=checker, arcs=arcs)


def _shortest(roadmap: _Roadmap, points: FloatArray) -> list[list[FloatArray | None]]:
    """Shortest paths on a roadmap, shortened by shortcuts, as ``plan_paths`` returns them."""
    at = roadmap.at.tolist()
    lengths, before = dijkstra(roadmap.graph, directed=False, indices=at, return_predecessors=True)
    n = len(points)
    paths: list[list[FloatArray | None]] = [[None] * n for _ in range(n)]
    known = new_line_cache()
    for i in range(n):
        length = np.full(len(roadmap.vertices), np.inf)
        length[at[i]] = 0.0
        via = np.full(len(length), -1, dtype=np.int64)
        for j in range(i + 1, n):
            if not math.isfinite(lengths[i, at[j]]):
                continue
            path = shortcut(roadmap.checker, roadmap.vertices, before[i], at[i], at[j], _WINDOW, known, length, via)
            path[0], path[-1] = points[i], points[j]
            paths[i][j], paths[j][i] = path, path[::-1].copy()
    return paths


def _isolated(points: FloatArray) -> FloatArray:
    """Isolated points, on no arc, as ``tangents`` takes them, shape (n, 5)."""
    return np.column_stack([points, np.full((len(points), 2), np.nan), np.zeros(len(points))])


def _with_edges(
    vertices: FloatArray, graph: csr_array, ends: FloatArray, pairs: IntArray
) -> tuple[FloatArray, csr_array]:
    """A roadmap with more edges.

    Args:
        vertices, graph: The roadmap.
        ends: Ends of the edges [m], shape (n, 2); those that are no vertices yet are added.
        pairs: Indices of the two ends of each edge, shape (e, 2).
    """
    # Lookup by x, then y, the order of complex numbers; of vertices at one point the last.
    places = np.ascontiguousarray(vertices).view(np.complex128)[:, 0]
    order = np.argsort(places, kind="stable")
    wanted = np.ascontiguousarray(ends).view(np.complex128)[:, 0]
    at = order[np.searchsorted(places[order], wanted, side="right") - 1]
    known = np.where(places[at] == wanted, at, -1)
    new = np.flatnonzero(known < 0)
    known[new] = len(vertices) + np.arange(len(new))
    vertices = np.concatenate([vertices, ends[new]])
    heads, tails = known[pairs].T
    old = graph.tocoo()
    rows, columns = np.concatenate([old.row, heads]), np.concatenate([old.col, tails])
    # Each edge once: a sparse matrix sums duplicates.
    low, high = np.minimum(rows, columns).astype(np.int64), np.maximum(rows, columns).astype(np.int64)
    numbers = np.sort(low * len(vertices) + high)
    low, high = np.divmod(numbers[np.diff(numbers, prepend=-1) > 0], len(vertices))
    length = np.maximum(np.hypot(*(vertices[low] - vertices[high]).T), 1e-12)  # a stored 0 would be no edge
    return vertices, csr_array((length, (low, high)), shape=(len(vertices), len(vertices)))


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
    # OMPL numbers vertices by memory address, and ties between equally short paths go by number:
    # sorted by coordinates, equal roadmaps give equal paths.
    order = np.lexsort(vertices.T)
    number = np.empty(count, dtype=np.int64)
    number[order] = np.arange(count)
    vertices = vertices[order]
    heads, tails = number[np.array(rows, dtype=np.int64)], number[np.array(columns, dtype=np.int64)]
    length = np.maximum(np.hypot(*(vertices[heads] - vertices[tails]).T), 1e-12)  # a stored 0 would be no edge
    return vertices, csr_array((length, (heads, tails)), shape=(count, count))


def _pair_by_pair(
    obstacles: Obstacles, points: FloatArray, clearance_m: float, planner: PathPlanner
) -> list[list[FloatArray | None]]:
    si, _ = _space(obstacles, clearance_m)
    n = len(points)
    paths: list[list[FloatArray | None]] = [[None] * n for _ in range(n)]
    simplifier = og.PathSimplifier(si)
    disconnected: BoolArray | None = None
    for i in range(n):
        for j in range(n):
            if i == j:
                continue
            for effort in _EFFORTS:
                paths[i][j] = _query(si, simplifier, planner, effort, points[i], points[j])
                if paths[i][j] is not None:
                    break
                if disconnected is None:
                    disconnected = surely_disconnected(obstacles, points, clearance_m)
                if disconnected[i, j]:
                    break
    return paths


def _query(
    si: Any, simplifier: Any, planner: PathPlanner, effort: int, start: FloatArray, goal: FloatArray
) -> FloatArray | None:
    problem = ob.ProblemDefinition(si)
    problem.setStartAndGoalStates(_state(si, start), _state(si, goal))
    kind = PAIR_PLANNERS[planner]
    search = kind.search(si)
    if kind.samples:
        search.setNumSamples(kind.samples * effort)
    search.setProblemDefinition(problem)
    search.setup()
    with deferring_ctrl_c():
        search.solve(_after(kind.calls * effort))
    if not problem.hasExactSolution():  # solve() is true for an approximate one too, which ends before the goal
        return None
    path = problem.getSolutionPath()
    with deferring_ctrl_c():
        simplifier.simplifyMax(path)
    vertices = np.array([(s[0], s[1]) for s in path.getStates()])
    vertices[0], vertices[-1] = start, goal
    return vertices


def _after(calls: int) -> Any:
    """A termination condition by number of evaluations, not by time; Ctrl-C ends it too."""
    evaluations = iter(range(calls))
    return ob.PlannerTerminationCondition(lambda: next(evaluations, None) is None or pressed())
