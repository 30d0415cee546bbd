"""Other ways than the shortest, and ways round robots that stand for good."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.arrays import FloatArray
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.travel.alternatives import alternatives, way_round, ways_among
from sva_bench.travel.apart import proved_apart
from sva_bench.travel.roadmap import plan_paths
from tests.idle_seconds import idle_seconds
from tests.oracles.distances import path_clearance
from tests.oracles.worlds import free_places, random_obstacles

CLEARANCE_M = 0.297
NO_DISCS = np.empty((0, 3))


def room(*boxes: tuple[float, float, float, float]) -> Obstacles:
    """A room of 10 x 6 m with boxes: x, y, half length, half width."""
    return Obstacles(bounds_m=np.array([0.0, 0, 10, 6]), cylinders=np.empty((0, 3)),
                     boxes=np.array([(*box, 0.0) for box in boxes], dtype=np.float64).reshape(-1, 5))


def length_of(path: FloatArray) -> float:
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def distance(path: FloatArray, point: tuple[float, float]) -> float:
    """From a point to a path [m]."""
    return path_clearance(Obstacles(bounds_m=np.array([-99.0, -99, 99, 99]), boxes=np.empty((0, 5)),
                                    cylinders=np.array([(*point, 0.0)])), path)


def test_other_ways_lead_round_the_other_side() -> None:
    # The block in the middle reaches from 2.2 to 4.2 m: from a height of 3 m it is shorter to pass below it.
    obstacles = room((5.0, 3.2, 1.0, 1.0))
    ends = np.array([(1.0, 3.0), (9.0, 3.0)])
    shortest = plan_paths(obstacles, ends, CLEARANCE_M)[0][1]
    assert shortest is not None
    assert shortest[:, 1].min() < 2.2
    found = alternatives(ways_among(obstacles, ends, CLEARANCE_M), shortest)
    assert len(found) >= 2
    assert_array_equal(found[0], shortest)
    assert any(path[:, 1].max() > 4.4 for path in found[1:])


@pytest.mark.long
def test_other_ways_keep_the_clearance_join_the_same_ends_and_differ() -> None:
    count = 0
    for seed in (2, 3, 5):
        obstacles = random_obstacles(seed)
        points = free_places(obstacles, seed, 5, CLEARANCE_M)
        ways = ways_among(obstacles, points, CLEARANCE_M)
        paths = plan_paths(obstacles, points, CLEARANCE_M)
        for i in range(5):
            for j in range(5):
                path = paths[i][j]
                if path is None:
                    continue
                found = alternatives(ways, path)
                assert 1 <= len(found) <= 3
                for other in found[1:]:
                    count += 1
                    assert_array_equal(other[[0, -1]], path[[0, -1]])
                    assert path_clearance(obstacles, other) >= CLEARANCE_M - 1e-6
                    assert length_of(other) <= 1.7 * length_of(path) + 1.5
                    middle = max(distance(path, tuple(point)) for point in other[1:-1].tolist())
                    assert middle > 0.2
    assert count > 10


def test_a_corridor_has_no_other_way() -> None:
    obstacles = room((5.0, 4.0, 5.0, 0.6), (5.0, 2.0, 5.0, 0.6))  # 0.8 m wide
    path = np.array([(1.0, 3.0), (9.0, 3.0)])
    assert len(alternatives(ways_among(obstacles, path, CLEARANCE_M), path)) == 1


@pytest.mark.long
def test_other_ways_are_the_same_in_every_process() -> None:
    # OMPL's own roadmap differs by single edges.
    code = ("import hashlib, numpy as np\n"
            "from sva_bench.travel.alternatives import ways_among\n"
            "from tests.oracles.worlds import free_places, random_obstacles\n"
            "o = random_obstacles(3)\n"
            "w = ways_among(o, free_places(o, 3, 5, 0.297), 0.297)\n"
            "print(hashlib.sha256(w.vertices.tobytes() + w.lines.tobytes()).hexdigest())")
    said = {subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
            for _ in range(2)}
    assert len(said) == 1


@pytest.mark.parametrize("seed", [2, 3, 5, 13])
def test_a_way_round_is_found_where_the_roadmap_finds_one_and_keeps_its_distance(seed: int) -> None:
    obstacles = random_obstacles(seed)
    points = free_places(obstacles, seed, 6, CLEARANCE_M)
    paths = plan_paths(obstacles, points, CLEARANCE_M)
    for j in range(1, 6):
        path, found = paths[0][j], way_round(obstacles, points[0], points[j], CLEARANCE_M, NO_DISCS)
        assert (found is None) == (path is None)
        if path is None or found is None:
            continue
        assert length_of(found) <= 1.1 * length_of(path)
        middle = 0.5 * (path[0] + path[1])
        disc = np.array([[*middle, 0.3]])
        if np.hypot(*(points[[0, j]] - middle).T).min() < 0.3 + CLEARANCE_M:
            continue
        round_it = way_round(obstacles, points[0], points[j], CLEARANCE_M, disc)
        if round_it is not None:
            assert_array_equal(round_it[[0, -1]], points[[0, j]])
            assert path_clearance(obstacles, round_it) >= CLEARANCE_M - 1e-6
            assert distance(round_it, tuple(middle.tolist())) >= 0.3 + CLEARANCE_M - 1e-6


def test_a_robot_in_a_doorway_shuts_it() -> None:
    obstacles = room((5.0, 4.7, 0.1, 1.3), (5.0, 1.3, 0.1, 1.3))  # a door of 0.8 m
    start, end = np.array([1.0, 3.0]), np.array([9.0, 3.0])
    assert way_round(obstacles, start, end, CLEARANCE_M, NO_DISCS) is not None
    assert way_round(obstacles, start, end, CLEARANCE_M, np.array([[5.0, 3.0, 0.177]])) is None


def test_a_robot_that_stands_near_something_first_leaves_it_coming_no_nearer() -> None:
    obstacles = room((5.0, 3.0, 1.0, 1.0))
    start, end = np.array([3.8, 3.0]), np.array([9.0, 3.0])  # 0.2 m from the block
    disc = np.array([[3.3, 3.1, 0.177]])
    path = way_round(obstacles, start, end, CLEARANCE_M, disc)
    assert path is not None
    assert_array_equal(path[[0, -1]], [start, end])
    assert path_clearance(obstacles, path) == pytest.approx(0.2, abs=1e-5)
    assert path_clearance(obstacles, path[1:]) >= CLEARANCE_M - 1e-6
    assert distance(path[1:], (3.3, 3.1)) >= 0.177 + CLEARANCE_M - 1e-6


def test_nobody_is_led_to_a_place_beside_a_robot_that_stands_there_for_good() -> None:
    assert way_round(room(), np.array([1.0, 3.0]), np.array([9.0, 3.0]), CLEARANCE_M,
                     np.array([[9.0, 3.3, 0.177]])) is None


def test_a_way_from_a_place_to_itself_stays_there() -> None:
    path = way_round(room(), np.array([1.0, 3.0]), np.array([1.0, 3.0]), CLEARANCE_M, NO_DISCS)
    assert path is not None
    assert_allclose(path, [[1.0, 3.0], [1.0, 3.0]])


def test_a_way_round_takes_a_tenth_of_a_second_at_most() -> None:
    obstacles = random_obstacles(3)
    points = free_places(obstacles, 3, 2, CLEARANCE_M)
    discs = np.array([[*points.mean(axis=0), 0.177]])
    way_round(obstacles, points[0], points[1], CLEARANCE_M, discs)  # compiled
    assert idle_seconds(lambda: way_round(obstacles, points[0], points[1], CLEARANCE_M, discs)) < 0.1


def beside_a_post(free_m: float) -> FloatArray:
    """A robot that leaves a gap to the lower side of a door, wider by so much than a path needs."""
    return np.array([[5.0, 2.0 + 2 * CLEARANCE_M + free_m + 0.177, 0.177]])


DOOR = room((5.0, 4.7, 0.1, 1.3), (5.0, 1.0, 0.1, 1.0))  # of 1.4 m


@pytest.mark.parametrize("free_m", [-0.05, -0.02, -0.005, -0.001])
def test_that_a_robot_nearly_shuts_a_door_is_found_out_soon(free_m: float) -> None:
    start, end = np.array([1.0, 3.0]), np.array([9.0, 3.0])
    assert way_round(DOOR, start, end, CLEARANCE_M, beside_a_post(free_m)) is None
    assert idle_seconds(lambda: way_round(DOOR, start, end, CLEARANCE_M, beside_a_post(free_m))) < 0.2


@pytest.mark.parametrize("free_m", [1e-4, 0.001, 0.005, 0.02])
def test_a_gap_that_is_just_wide_enough_is_driven_through(free_m: float) -> None:
    path = way_round(DOOR, np.array([1.0, 3.0]), np.array([9.0, 3.0]), CLEARANCE_M, beside_a_post(free_m))
    assert path is not None
    assert distance(path, (5.0, beside_a_post(free_m)[0, 1])) >= 0.177 + CLEARANCE_M - 1e-6


@pytest.mark.spread(1)
@pytest.mark.parametrize("clearance_m", [0.1, 0.297, 0.6])
def test_places_that_a_path_joins_are_never_proved_apart(clearance_m: float) -> None:
    joined = apart = 0
    for seed in range(8):
        obstacles = random_obstacles(seed)
        points = free_places(obstacles, seed, 4, clearance_m)
        paths = plan_paths(obstacles, points, clearance_m)
        for j in range(1, len(points)):
            proved = proved_apart(obstacles, points[0], points[j], clearance_m)
            assert not (proved and paths[0][j] is not None)
            joined, apart = joined + (paths[0][j] is not None), apart + proved
    assert joined > 3
    assert apart or clearance_m < 0.5
