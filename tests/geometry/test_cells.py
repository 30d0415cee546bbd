"""Occupancy grids: covered exactly, measured exactly, and the same for planner, physics and drawing."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.execution.engines.bodies import obstacles_urdf
from sva_bench.geometry.buckets import clearances, keeps_clearance
from sva_bench.geometry.cells import (
    Cells,
    TooManyBoxes,
    bounds_of,
    boxes_of,
    connected_region,
    convex_corners,
    cover,
    distance_field,
)
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.recording.story import story_of
from tests.recording.missions import WORLD as LINE
from tests.recording.missions import trace
from tests.world.maps_for_tests import write_ros_map
from tests.worlds_for_tests import SMALL, world_of

grids = arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=9))


def cells_of(occupied: BoolArray, cell_m: float = 1.0, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Cells:
    return Cells(occupied=occupied, cell_m=cell_m, origin=np.array(origin))


def obstacles_of(cells: Cells) -> Obstacles:
    return Obstacles(bounds_m=bounds_of(cells), boxes=boxes_of(cells), cylinders=np.empty((0, 3)), cells=cells)


def distances_by_hand(occupied: BoolArray, points: FloatArray) -> FloatArray:
    """Distance from points to the nearest occupied unit square, or to the grid's rim."""
    rows, columns = occupied.shape
    x, y = points.T
    nearest: FloatArray = np.min([x, y, columns - x, rows - y], axis=0)
    for row, column in np.argwhere(occupied):
        dx = np.maximum(np.abs(x - column - 0.5) - 0.5, 0)
        dy = np.maximum(np.abs(y - row - 0.5) - 0.5, 0)
        nearest = np.minimum(nearest, np.hypot(dx, dy))
    return nearest


def test_runs_of_rows_become_few_boxes() -> None:
    # A room of 6 x 4 cells with a door in the lower wall: two long walls, of which one is cut, and two sides.
    room = np.ones((4, 6), dtype=np.bool_)
    room[1:3, 1:5] = False
    room[0, 2] = False
    assert len(cover(room)) == 5  # across: two below, two sides, one above
    assert len(cover(np.ones((7, 9), dtype=np.bool_))) == 1
    assert cover(np.zeros((2, 2), dtype=np.bool_)).shape == (0, 4)


@settings(deadline=None)  # the first call compiles
@given(grids)
def test_the_cover_is_exact_and_disjoint(occupied: BoolArray) -> None:
    times = np.zeros(occupied.shape, dtype=int)
    for x0, y0, x1, y1 in cover(occupied).astype(int):
        times[y0:y1, x0:x1] += 1
    assert_array_equal(times, occupied)


def test_a_checkerboard_is_refused_before_it_fills_the_memory() -> None:
    with pytest.raises(TooManyBoxes):
        cover(np.indices((2000, 2000)).sum(axis=0) % 2 == 0)


@settings(deadline=None)  # the first call compiles
@given(grids)
def test_the_distance_field_is_exact_on_every_half_cell(occupied: BoolArray) -> None:
    field = distance_field(cells_of(occupied))
    rows, columns = field.distance_m.shape
    index = np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), axis=-1).reshape(-1, 2)
    expected = distances_by_hand(occupied, field.places(index))
    assert_allclose(field.distance_m.ravel(), expected, atol=1e-6)  # single precision


@settings(deadline=None)  # the first call compiles
@given(grids)
def test_corners_stick_out_where_one_cell_of_four_is_occupied(occupied: BoolArray) -> None:
    solid = np.pad(occupied, 1, constant_values=True)
    expected = {(c, r) for r in range(occupied.shape[0] + 1) for c in range(occupied.shape[1] + 1)
                if (block := solid[r:r + 2, c:c + 2]).sum() == 1 or (block.sum() == 2 and block[0, 0] == block[1, 1])}
    assert {(int(x), int(y)) for x, y, _, _ in convex_corners(cells_of(occupied))} == expected


@given(grids, st.floats(-4, 4), st.integers(0, 1000))
def test_boxes_and_grid_agree_on_what_is_near_whatever_the_yaw(occupied: BoolArray, yaw: float, seed: int) -> None:
    cells = cells_of(occupied, 0.5, (3.0, -2.0, yaw))
    own = np.random.default_rng(seed).uniform(-1, 11, (60, 2))
    expected = np.maximum(distances_by_hand(occupied, own) * 0.5, 0)
    found = clearances(obstacles_of(cells), cells.to_world(own * 0.5))
    assert_allclose(np.maximum(found, 0), expected, atol=1e-9)
    assert_array_equal(keeps_clearance(obstacles_of(cells), cells.to_world(own * 0.5), 0.3)[abs(expected - 0.3) > 1e-9],
                       (expected >= 0.3)[abs(expected - 0.3) > 1e-9])


@given(grids, st.floats(-4, 4))
def test_places_go_to_the_grid_and_back(occupied: BoolArray, yaw: float) -> None:
    cells = cells_of(occupied, 0.05, (100.0, -20.0, yaw))
    points = np.random.default_rng(0).uniform(-5, 5, (9, 2))
    assert_allclose(cells.from_world(cells.to_world(points)), points, atol=1e-12)


def test_a_region_ends_where_the_robot_no_longer_fits() -> None:
    # Two rooms of 5 x 5 cells of 0.1 m, joined by a door of three cells: a robot of 0.15 m fits through, 0.16 not.
    occupied = np.zeros((5, 11), dtype=np.bool_)
    occupied[:, 5] = True
    occupied[1:4, 5] = False
    field = distance_field(cells_of(occupied, 0.1))
    here, there = np.array([0.25, 0.25]), field.index_of(np.array([[0.85, 0.25]]))[0]
    assert connected_region(field, here, 0.15)[tuple(there)]
    assert not connected_region(field, here, 0.16)[tuple(there)]
    assert not connected_region(field, np.array([0.55, 0.0]), 0.05).any()  # a place where no robot is


ROOM = """\
##########
#..#....??
#..#....??
#.......##
#..#.....#
##########"""
MAP_WORLD = SMALL.replace(SMALL[SMALL.index("  shapes:"):SMALL.index("sites:")], "  ros: {file: map.yaml}\n")


@pytest.mark.parametrize("origin", ["[0, 0, 0]", "[-1, 2, 0.7]"])
def test_planner_physics_and_drawing_agree_on_what_is_free(tmp_path: Path, origin: str) -> None:
    write_ros_map(tmp_path, ROOM, resolution=1.0, origin=origin)
    x, y, yaw = (float(word) for word in origin.strip("[]").split(","))
    at = [(math.cos(yaw) * a - math.sin(yaw) * b + x, math.sin(yaw) * a + math.cos(yaw) * b + y)
          for a, b in [(2, 1.5), (5.5, 2.5), (1.5, 4), (5, 4.5), (7.5, 1.5), (4, 2.5)]]
    text = MAP_WORLD[:MAP_WORLD.index("sites:")] + (
        f"sites:\n  base: {{at_m: {list(at[0])}}}\n  stations: {{r1: {{at_m: {list(at[1])}}}}}\n  pois:\n"
        + "".join(f"    p{k}: {{at_m: {list(at[k + 1])}}}\n" for k in range(1, 5)))
    world = world_of(tmp_path, text + MAP_WORLD[MAP_WORLD.index("robots:"):])
    cells = world.obstacles.cells
    assert cells is not None
    x0, y0, x1, y1 = world.obstacles.bounds_m
    points = np.random.default_rng(5).uniform((x0, y0), (x1, y1), (3000, 2))
    column, row = np.floor(cells.from_world(points)).astype(int).T
    inside = (column >= 0) & (column < 10) & (row >= 0) & (row < 6)
    free = inside & ~cells.occupied[np.clip(row, 0, 5), np.clip(column, 0, 9)]
    assert 0.2 < free.mean() < 0.8

    assert_array_equal(clearances(world.obstacles, points) > 0, free)
    drawn = story_of(replace(LINE, obstacles=world.obstacles), [trace("uv1")], "title").solids.boxes
    turned = np.cos(drawn[:, 4]), np.sin(drawn[:, 4])
    dx, dy = points[:, None, 0] - drawn[:, 0], points[:, None, 1] - drawn[:, 1]
    in_box = ((abs(turned[0] * dx + turned[1] * dy) < drawn[:, 2])
              & (abs(-turned[1] * dx + turned[0] * dy) < drawn[:, 3]))
    assert_array_equal(~in_box.any(axis=1), free)

    client = pybullet.connect(pybullet.DIRECT)
    try:
        (tmp_path / "obstacles.urdf").write_text(obstacles_urdf(world.obstacles))
        pybullet.loadURDF(str(tmp_path / "obstacles.urdf"), useFixedBase=True, physicsClientId=client)
        # From above down to the floor.
        hits = [pybullet.rayTest([px, py, 2], [px, py, 0.01], physicsClientId=client)[0][0] for px, py in points]
    finally:
        pybullet.disconnect(physicsClientId=client)
    assert_array_equal(np.array(hits) < 0, free)
