"""Paths against the optimum by visibility graph, and against distances computed another way."""

from __future__ import annotations

import hashlib
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.stats import qmc

from sva_bench.arrays import FloatArray
from sva_bench.choices import PathPlanner
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.travel.roadmap import plan_paths, roadmap_edges
from sva_bench.travel.samples import halton
from tests.oracles.distances import path_clearance
from tests.oracles.visibility import shortest_lengths
from tests.oracles.worlds import free_places, random_obstacles

CLEARANCE_M = 0.297  # radius of a turtlebot2 and the widest margin
PLANNERS: list[Any] = ["prmstar", "rrtconnect", "bfmt", pytest.param("fmt", marks=pytest.mark.long),
                       pytest.param("informedrrtstar", marks=pytest.mark.long)]
MEAN_RATIO, WORST_RATIO = 1.005, 1.10  # of a path's length to the optimum


def length_of(path: FloatArray) -> float:
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def ratios(seed: int, sites: int) -> FloatArray:
    """Length over optimum of the path between each two sites of a random world that are joined at all."""
    obstacles = random_obstacles(seed)
    points = free_places(obstacles, seed, sites, CLEARANCE_M)
    optimum = shortest_lengths(obstacles, points, CLEARANCE_M)
    paths = plan_paths(obstacles, points, CLEARANCE_M)
    found = []
    for i in range(sites):
        for j in range(i + 1, sites):
            path, back = paths[i][j], paths[j][i]
            assert (path is None) == (not np.isfinite(optimum[i, j])), f"world {seed}, pair {i}, {j}"
            if path is None or back is None:
                continue
            assert_array_equal(path[[0, -1]], points[[i, j]])
            assert_array_equal(back[[0, -1]], points[[j, i]])
            # 1 um: the planner frees a start on the very boundary by a nanometre, and so much is lost in rounding.
            assert path_clearance(obstacles, path) >= CLEARANCE_M - 1e-6
            found.append(length_of(path) / optimum[i, j])
    # The oracle cuts arcs off by 0.07 % at most, so no path can be much below 1: else one of the two is wrong.
    assert min(found) >= 1 - 1e-9
    return np.array(found)


@pytest.mark.long
def test_paths_are_near_the_optimum_on_random_worlds() -> None:
    found = np.concatenate([ratios(seed, 10) for seed in (2, 3, 5, 13)])
    assert found.mean() <= MEAN_RATIO
    assert found.max() <= WORST_RATIO


@pytest.mark.long
def test_paths_are_near_the_optimum_on_many_random_worlds() -> None:
    found = np.concatenate([ratios(seed, 25) for seed in range(16)])
    print(f"ratio to optimum over {len(found)} pairs: mean {found.mean():.5f}, worst {found.max():.4f}")  # noqa: T201
    assert found.mean() <= MEAN_RATIO
    assert found.max() <= WORST_RATIO


def test_the_edges_shown_are_those_of_the_roadmap_that_paths_are_planned_on() -> None:
    obstacles = random_obstacles(2)
    points = free_places(obstacles, 2, 6, CLEARANCE_M)
    ends = roadmap_edges(obstacles, points, CLEARANCE_M)
    places, number = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    one, other = number.reshape(-1, 2).T
    graph = csr_array((np.hypot(*(places[one] - places[other]).T), (one, other)), shape=(len(places), len(places)))
    known = {tuple(place): k for k, place in enumerate(places.tolist())}
    paths = plan_paths(obstacles, points, CLEARANCE_M)
    shortest = dijkstra(graph, directed=False, indices=[known[tuple(point)] for point in points.tolist()])
    for i, row in enumerate(paths):
        for j, path in enumerate(row):
            if path is not None:
                assert set(map(tuple, path.tolist())) <= set(known)
                # Pulled taut, a path is a little shorter than its edges.
                on_edges = shortest[i, known[tuple(points[j].tolist())]]
                assert 0.98 * on_edges < length_of(path) <= on_edges + 1e-9


def test_the_oracle_finds_the_shortest_path_round_a_box_by_hand() -> None:
    # Half length 1, clearance 1: from (-2, 0) to (2, 0) round a square of side 2 about the origin. The straight parts
    # touch the rounded corners: from (-2, 0) the corner's circle of radius 1 about (-1, 1) is met at (-2, 1). So
    # 1 up, a quarter circle, 2 along, a quarter circle, 1 down: 4 + pi.
    obstacles = Obstacles(bounds_m=np.array([-9.0, -9, 9, 9]), boxes=np.array([[0.0, 0, 1, 1, 0]]),
                          cylinders=np.empty((0, 3)))
    points = np.array([[-2.0, 0], [2, 0]])
    exact = 4 + np.pi
    lower, upper = (shortest_lengths(obstacles, points, 1.0, bound)[0, 1] for bound in ("lower", "upper"))
    assert exact * (1 - 1e-3) < lower <= exact <= upper < exact * (1 + 1e-3)


def test_the_oracle_finds_the_shortest_path_round_a_cylinder_by_hand() -> None:
    # Radius 0.5 + 0.5, points at distance 2 on either side: two tangents of length sqrt(4 - 1), each leaving the axis
    # by 30 degrees, so the arc between them spans 180 - 2 x 60 = 60 degrees: 2 sqrt(3) + pi / 3.
    obstacles = Obstacles(bounds_m=np.array([-9.0, -9, 9, 9]), boxes=np.empty((0, 5)),
                          cylinders=np.array([[0.0, 0, 0.5]]))
    exact = 2 * np.sqrt(3) + np.pi / 3
    points = np.array([[-2.0, 0], [2, 0]])
    lower, upper = (shortest_lengths(obstacles, points, 0.5, bound)[0, 1] for bound in ("lower", "upper"))
    assert exact * (1 - 1e-3) < lower <= exact <= upper < exact * (1 + 1e-3)


@pytest.mark.parametrize("seed", [0, 1, 7])
def test_the_two_bounds_of_the_oracle_enclose_the_optimum_to_a_thousandth(seed: int) -> None:
    obstacles = random_obstacles(seed)
    points = free_places(obstacles, seed, 20, CLEARANCE_M)
    lower, upper = (shortest_lengths(obstacles, points, CLEARANCE_M, bound) for bound in ("lower", "upper"))
    both = np.isfinite(lower) & (lower > 0)
    assert np.all(upper[both] >= lower[both])
    assert np.all(upper[both] <= lower[both] * 1.001)


def digest(planner: PathPlanner) -> str:
    """Every bit of all paths of a random world."""
    obstacles = random_obstacles(3)
    paths = plan_paths(obstacles, free_places(obstacles, 3, 6, CLEARANCE_M), CLEARANCE_M, planner=planner)
    parts = [b"none" if path is None else path.tobytes() for row in paths for path in row]
    return hashlib.sha256(b"|".join(parts)).hexdigest()


@pytest.mark.spread(1)
@pytest.mark.parametrize("planner", PLANNERS)
def test_planning_again_gives_equal_paths_to_the_bit(planner: PathPlanner) -> None:
    first = digest(planner)
    assert digest(planner) == first
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as fresh:
        assert fresh.submit(digest, planner).result() == first


@pytest.mark.parametrize("planner", PLANNERS)
def test_paths_of_every_planner_are_free_and_end_at_their_sites(planner: PathPlanner) -> None:
    obstacles = random_obstacles(5)
    points = free_places(obstacles, 5, 6, CLEARANCE_M)
    optimum = shortest_lengths(obstacles, points, CLEARANCE_M)
    paths = plan_paths(obstacles, points, CLEARANCE_M, planner=planner)
    for i in range(6):
        assert paths[i][i] is None
        for j in range(6):
            path = paths[i][j]
            if i == j:
                continue
            assert (path is None) == (not np.isfinite(optimum[i, j]))
            if path is None:
                continue
            assert_array_equal(path[[0, -1]], points[[i, j]])
            assert path_clearance(obstacles, path) >= CLEARANCE_M - 1e-6
            assert length_of(path) >= optimum[i, j] * (1 - 1e-9)


def test_in_an_empty_world_paths_are_straight() -> None:
    nothing = Obstacles(bounds_m=np.array([0.0, 0, 5, 5]), boxes=np.empty((0, 5)), cylinders=np.empty((0, 3)))
    points = np.array([[1.0, 1], [4, 1], [2, 4]])
    paths = plan_paths(nothing, points, CLEARANCE_M)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        path = paths[i][j]
        assert path is not None
        assert length_of(path) == pytest.approx(np.hypot(*(points[i] - points[j])), rel=1e-9)


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_closed_wall_leaves_no_path(planner: PathPlanner) -> None:
    closed = Obstacles(bounds_m=np.array([0.0, 0, 3, 2]), boxes=np.array([[1.5, 1, 0.05, 1.0, 0]]),
                       cylinders=np.empty((0, 3)))
    paths = plan_paths(closed, np.array([[0.6, 1.0], [2.4, 1.0], [0.6, 1.5]]), CLEARANCE_M, planner=planner)
    assert paths[0][1] is None
    assert paths[1][2] is None
    assert paths[0][2] is not None


def test_the_halton_sequence_is_that_of_scipy_bit_by_bit_wherever_it_begins() -> None:
    usual = qmc.Halton(2, scramble=False)
    for first in (0, 3000, 6000):
        np.testing.assert_array_equal(halton(first, 3000), usual.random(3000))
