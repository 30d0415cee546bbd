"""Paths on occupancy grids: never too near, near the optimum, and as long as other programs say."""

from __future__ import annotations

import math
from itertools import chain, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.geometry.cells import Cells, distance_field
from sva_bench.geometry.passages import widest_passage
from sva_bench.travel.roadmap import plan_paths
from sva_bench.world.maps.movingai import read_movingai_map
from sva_bench.world.maps.ros import read_ros_map
from tests.geometry.test_cells import cells_of, obstacles_of
from tests.oracles.grids import shortest_lengths
from tests.oracles.octile import octile_length, read_scen
from tests.travel.test_roadmap import MEAN_RATIO, WORST_RATIO, length_of
from tests.world.maps_for_tests import shared_map

CLEARANCE_M = 0.297
MOVINGAI = ["room-32-32-4", "maze-32-32-2", "random-32-32-20", "empty-32-32"]
ROS = ["turtlebot_stage/maze", "turtlebot_stdr/simple_rooms", "turtlebot3/map", "aws_small_house/map",
       "turtlebot_stdr/sparse_obstacles"]


def places_on(cells: Cells, count: int, seed: int, clearance_m: float = CLEARANCE_M) -> FloatArray:
    """Random places with room about them."""
    field = distance_field(cells)
    roomy = np.flatnonzero(field.distance_m > clearance_m + 1e-6)
    chosen = np.random.default_rng(seed).choice(roomy, min(count, len(roomy)), replace=False)
    return field.places(np.column_stack(np.unravel_index(chosen, field.distance_m.shape)))


def distance_to_cells(occupied: BoolArray, a: FloatArray, b: FloatArray) -> float:
    """Least distance from a segment to the occupied unit squares and the rim, at 200 places of it."""
    t = np.linspace(0, 1, 200)[:, None]
    points = a + t * (b - a)
    row, column = np.nonzero(np.pad(occupied, 1, constant_values=True))
    dx = np.maximum(abs(points[:, None, 0] - (column - 0.5)) - 0.5, 0)
    dy = np.maximum(abs(points[:, None, 1] - (row - 0.5)) - 0.5, 0)
    return float(np.hypot(dx, dy).min())


@settings(max_examples=8)
@given(arrays(np.bool_, (6, 7), elements=st.sampled_from([False, False, True])), st.floats(0.1, 0.6),
       st.sampled_from([0.0, 0.9]))
def test_every_path_keeps_the_clearance_from_occupied_cells(occupied: BoolArray, radius: float, yaw: float) -> None:
    cells = cells_of(occupied, 1.0, (0.0, 0.0, yaw))
    points = places_on(cells, 6, 0, radius)
    for row in plan_paths(obstacles_of(cells), points, radius):
        for path in row:
            for a, b in pairwise([] if path is None else cells.from_world(path)):
                # The planner frees a start on the very boundary by a nanometre, and so much is lost in rounding.
                assert distance_to_cells(occupied, a, b) >= radius - 1e-6


def check_ratios(cells: Cells, count: int) -> FloatArray:
    """Length over optimum between places of a map; a way is found exactly where there is one."""
    points = places_on(cells, count, 1)
    paths = plan_paths(obstacles_of(cells), points, CLEARANCE_M)
    optimum = shortest_lengths(cells.occupied, cells.cell_m, cells.from_world(points), CLEARANCE_M)
    found = []
    for i in range(len(points)):
        for j in range(i + 1, len(points)):
            path = paths[i][j]
            assert (path is None) == (not np.isfinite(optimum[i, j])), f"{points[i]} to {points[j]}"
            if path is not None:
                found.append(length_of(path) / optimum[i, j])
    assert min(found) >= 1 - 1e-9
    assert np.mean(found) <= MEAN_RATIO
    assert max(found) <= WORST_RATIO
    return np.array(found)


@pytest.mark.parametrize("name", ["room-32-32-4", "random-32-32-20"])
def test_paths_are_near_the_optimum_on_benchmark_maps(name: str) -> None:
    path = shared_map(f"movingai/{name}.map")
    check_ratios(read_movingai_map(path.parent, path.name, 1.0)[0], 10)


@pytest.mark.long
@pytest.mark.parametrize("name", MOVINGAI + ROS)
def test_paths_are_near_the_optimum_on_every_shared_map(name: str) -> None:
    if name in MOVINGAI:
        path = shared_map(f"movingai/{name}.map")
        cells, _ = read_movingai_map(path.parent, path.name, 1.0)
    else:
        path = shared_map(f"ros/{name}.yaml")
        cells, _ = read_ros_map(path.parent, path.name)
    ratios = check_ratios(cells, 25)
    print(f"{name}: {len(ratios)} pairs, mean {ratios.mean():.5f}, worst {ratios.max():.4f}")  # noqa: T201


@pytest.mark.parametrize("name", ["room-32-32-4", pytest.param("maze-32-32-2", marks=pytest.mark.long),
                                  pytest.param("random-32-32-20", marks=pytest.mark.long)])
def test_lengths_are_those_of_the_benchmarks_queries_within_what_the_robots_size_explains(name: str) -> None:
    path = shared_map(f"movingai/{name}.map")
    cells, _ = read_movingai_map(path.parent, path.name, 1.0)
    queries = read_scen(path.with_name(f"{name}-random-1.scen"))[:12]
    north = cells.occupied[::-1]  # .scen files count rows from the upper left
    for query in queries[:4]:
        assert octile_length(north, query.start, query.goal) == pytest.approx(query.length, abs=1e-6)
    ends = [end for query in queries for end in (query.start, query.goal)]
    points = np.array([(x + 0.5, len(north) - y - 0.5) for x, y in ends])
    paths = plan_paths(obstacles_of(cells), points, CLEARANCE_M)
    for k, query in enumerate(queries):
        found = paths[2 * k][2 * k + 1]
        assert found is not None
        # A path over the centres of cells that cuts no corner keeps half a cell, more than the robot needs: it may be
        # driven, so ours is no longer. One in any direction saves at most 1 - cos(22.5 degrees) = 7.6 %; and where the
        # grid's path passes a corner by the centre of a cell, ours passes it 0.71 - 0.30 m nearer, there and back.
        assert length_of(found) <= query.length * MEAN_RATIO
        straights = (np.hypot(*np.diff(found, axis=0).T) > 0.2).sum()
        saved = 2 * (math.sqrt(0.5) - CLEARANCE_M) * (straights - 1)
        assert length_of(found) >= query.length * math.cos(math.pi / 8) - saved


def test_the_widest_passage_of_a_map_by_hand() -> None:
    # Two rooms with a door of three cells of 0.1 m.
    occupied = np.zeros((9, 11), dtype=np.bool_)
    occupied[:, 5] = True
    occupied[1:4, 5] = False
    points = np.array([[0.25, 0.45], [0.85, 0.45]])
    obstacles = obstacles_of(cells_of(occupied, 0.1))
    assert widest_passage(obstacles, points) == pytest.approx(0.15, abs=1e-4)
    assert plan_paths(obstacles, points, 0.149)[0][1] is not None
    assert plan_paths(obstacles, points, 0.2)[0][1] is None
    occupied[1:4, 5] = True
    assert widest_passage(obstacles_of(cells_of(occupied, 0.1)), points) == 0


def test_a_map_and_its_turned_twin_have_paths_of_the_same_lengths() -> None:
    occupied = np.random.default_rng(3).random((12, 12)) < 0.2
    straight, turned = cells_of(occupied), cells_of(occupied, 1.0, (50.0, -7.0, 2.5))
    points = places_on(straight, 8, 2)
    there = turned.to_world(straight.from_world(points))
    first, second = plan_paths(obstacles_of(straight), points, 0.3), plan_paths(obstacles_of(turned), there, 0.3)
    for a, b in zip(chain(*first), chain(*second), strict=True):
        assert (a is None) == (b is None)
        if a is not None and b is not None:
            assert length_of(a) == pytest.approx(length_of(b), rel=1e-3)
