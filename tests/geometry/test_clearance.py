from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.geometry.buckets import clearance_checker, clearances, keeps_clear, keeps_clearance, longest_view_heading
from sva_bench.geometry.distances import clearance, segment_distance
from sva_bench.geometry.obstacles import Obstacles
from tests.oracles.distances import points_clearance, segment_clearance
from tests.oracles.worlds import random_obstacles

FAR = [-100.0, -100.0, 100.0, 100.0]


def obstacles(*, bounds: list[float] | None = None, boxes: list[list[float]] | None = None,
              cylinders: list[list[float]] | None = None) -> Obstacles:
    return Obstacles(bounds_m=np.array(bounds or FAR), boxes=np.array(boxes or []).reshape(-1, 5),
                     cylinders=np.array(cylinders or []).reshape(-1, 3))


def distance(o: Obstacles, ax: float, ay: float, bx: float, by: float, enough: float = -math.inf) -> float:
    return float(segment_distance(o.bounds_m, o.boxes, o.cylinders, ax, ay, bx, by, enough))


BOX = obstacles(boxes=[[0, 0, 2, 1, 0]])  # 4 m by 2 m about the origin
DIAMOND = obstacles(boxes=[[0, 0, 1, 1, math.pi / 4]])  # corners at distance sqrt(2) on the axes
POST = obstacles(cylinders=[[0, 0, 0.5]])


@pytest.mark.parametrize(("x", "y", "gap"), [
    (3, 0, 1), (0, -4, 3), (5, 5, 5), (2, 1, 0), (1, 0.5, 0), (-2, 3, 2)])  # (5, 5): 3, 4, 5 from the corner (2, 1)
def test_distance_of_a_point_to_a_box(x: float, y: float, gap: float) -> None:
    assert clearance(BOX, x, y) == pytest.approx(gap)


def test_distance_of_a_point_to_a_rotated_box() -> None:
    assert clearance(DIAMOND, 2, 0) == pytest.approx(2 - math.sqrt(2))
    assert clearance(DIAMOND, 2, 2) == pytest.approx(math.sqrt(8) - 1)  # straight out from the middle of a side
    assert clearance(DIAMOND, 0.7, 0.7) == 0  # 0.99 from the centre, along the normal
    assert clearance(DIAMOND, 1.2, 0.4) > 0  # outside, for 1.2 + 0.4 > sqrt(2)


def test_distance_of_a_point_to_a_cylinder() -> None:
    assert clearance(POST, 3, 4) == pytest.approx(4.5)
    assert clearance(POST, 0.2, 0.1) == 0


@pytest.mark.parametrize(("segment", "gap"), [
    ((-5, 2, 5, 2), 1), ((-5, 0, 5, 0), 0), ((3, -5, 3, 5), 1), ((-1, 0, 1, 0.5), 0), ((3, 3, 5, 2), math.sqrt(5)),
    ((0, 3, 0, 5), 2), ((2, -5, 2, 5), 0)])  # the last runs along a side
def test_distance_of_a_segment_to_a_box(segment: tuple[float, float, float, float], gap: float) -> None:
    assert distance(BOX, *segment) == pytest.approx(gap)


def test_a_segment_past_a_corner_is_nearest_at_the_corner() -> None:
    # The line x + y = 5 passes the corner (2, 1) at (5 - 3) / sqrt(2).
    assert distance(BOX, 0, 5, 5, 0) == pytest.approx(math.sqrt(2))


def test_distance_of_a_segment_to_a_cylinder() -> None:
    assert distance(POST, -3, 2, 3, 2) == pytest.approx(1.5)
    assert distance(POST, 3, 4, 6, 8) == pytest.approx(4.5)
    assert distance(POST, -1, 0.4, 1, 0.4) == 0


def test_bounds_count_and_outside_of_them_is_below_zero() -> None:
    room = obstacles(bounds=[0, 0, 10, 5])
    assert clearance(room, 4, 1) == 1
    assert clearance(room, 9.5, 2.5) == 0.5
    assert clearance(room, -2, 2) == -2
    assert distance(room, 1, 2, 12, 2) == -2


def test_the_nearest_of_many_counts() -> None:
    both = obstacles(bounds=[-10, -10, 10, 10], boxes=[[5, 0, 1, 1, 0], [-5, 0, 1, 1, 0]], cylinders=[[0, 3, 1]])
    assert clearance(both, 0, 0) == pytest.approx(2)
    assert clearance(both, 3, 0) == pytest.approx(1)
    assert clearance(both, -9.5, 0) == pytest.approx(0.5)


coordinates = st.floats(-6, 6).map(lambda x: round(x, 4))
places = st.tuples(coordinates, coordinates)
sizes = st.floats(0.02, 2).map(lambda x: round(x, 4))
crowds = st.builds(
    lambda boxes, cylinders: obstacles(bounds=[-6.5, -6.5, 6.5, 6.5], boxes=[list(b) for b in boxes],
                                       cylinders=[list(c) for c in cylinders]),
    st.lists(st.tuples(coordinates, coordinates, sizes, sizes, st.floats(-7, 7)), max_size=3),
    st.lists(st.tuples(coordinates, coordinates, sizes), max_size=3))


@given(crowds, places, places)
def test_distances_agree_with_an_independent_computation(crowd: Obstacles, a: tuple[float, float],
                                                          b: tuple[float, float]) -> None:
    expected = segment_clearance(crowd, np.array(a), np.array(b))
    # 1e-9 m: where a segment touches a side, rounding decides on which side of it.
    assert distance(crowd, *a, *b) == pytest.approx(expected, abs=1e-9)


@given(crowds, places, places)
def test_no_point_of_a_segment_is_nearer_and_some_are_as_near(crowd: Obstacles, a: tuple[float, float],
                                                              b: tuple[float, float]) -> None:
    samples = np.linspace(a, b, 401)
    gaps = points_clearance(crowd, samples)
    found = distance(crowd, *a, *b)
    assert found <= gaps.min() + 1e-9
    assert gaps.min() - found <= math.hypot(b[0] - a[0], b[1] - a[1]) / 800 + 1e-9  # half the step between samples


@given(crowds, places, places, st.floats(0, 3))
def test_stopping_early_changes_no_answer_to_is_it_enough(crowd: Obstacles, a: tuple[float, float],
                                                          b: tuple[float, float], enough: float) -> None:
    assert (distance(crowd, *a, *b, enough) >= enough) == (distance(crowd, *a, *b) >= enough)


@given(crowds, places, places)
def test_distance_does_not_depend_on_the_direction(crowd: Obstacles, a: tuple[float, float], b: tuple[float, float]
                                                   ) -> None:
    assert distance(crowd, *a, *b) == pytest.approx(distance(crowd, *b, *a), abs=1e-9)


def test_the_open_heading_looks_down_the_longest_free_line() -> None:
    # In a room of 10 by 2 m, a metre from the west wall: the east wall is 9 m away. The corner view at +-5 degrees is
    # longer where it reaches: 9 / cos 5 = 9.03 m, but meets the side wall after 1 / sin 5 = 11.5 m. At 10 degrees it
    # meets it after 5.76 m. So 5 degrees (and -5 = 355) win; the smaller angle is taken.
    room = obstacles(bounds=[0, 0, 10, 2])
    assert longest_view_heading(room, 1, 1) == pytest.approx(math.radians(5))
    # A post on that side blocks 5 degrees, not 355.
    post = obstacles(bounds=[0, 0, 10, 2], cylinders=[[6, 1.45, 0.1]])
    assert longest_view_heading(post, 1, 1) == pytest.approx(math.radians(355))


def test_ties_of_open_headings_go_to_the_smallest_angle() -> None:
    # In the middle of a square all four corners are as far.
    assert longest_view_heading(obstacles(bounds=[-1, -1, 1, 1]), 0, 0) == pytest.approx(math.radians(45))


def test_obstacles_are_read_only_copies_of_the_right_shape() -> None:
    boxes = np.array([[0.0, 0, 1, 1, 0]])
    o = Obstacles(bounds_m=np.array(FAR), boxes=boxes, cylinders=np.empty((0, 3)))
    boxes[0, 0] = 9
    assert o.boxes[0, 0] == 0
    with pytest.raises(ValueError, match="read-only"):
        o.boxes[0, 0] = 1
    with pytest.raises(ValueError, match="shape"):
        Obstacles(bounds_m=np.zeros(3), boxes=boxes, cylinders=np.empty((0, 3)))
    with pytest.raises(ValueError, match="NaN"):
        Obstacles(bounds_m=np.array([0, 0, 1, np.nan]), boxes=boxes, cylinders=np.empty((0, 3)))


@given(st.integers(0, 10_000), st.floats(0.05, 1.5))
def test_buckets_agree_with_a_check_of_every_obstacle(seed: int, needed: float) -> None:
    o = random_obstacles(seed)
    rng = np.random.default_rng(seed)
    ends = rng.uniform(-1, 15, (40, 4))
    ends[::4, 2:] = ends[::4, :2] + rng.normal(0, 1e-4, (10, 2))  # short ones, steep ones, and points
    ends[1::4, 2] = ends[1::4, 0] + rng.choice([0.0, 1e-9, 1e-3], 10)
    ends[2::8, 2:] = ends[2::8, :2]
    checker = clearance_checker(o, needed)
    for ax, ay, bx, by in ends.tolist():
        gap = distance(o, ax, ay, bx, by)
        if abs(gap - needed) > 1e-9:
            assert keeps_clear(checker, ax, ay, bx, by) == (gap >= needed)
    points = np.ascontiguousarray(ends[:, :2])
    exact = np.array([clearance(o, x, y) for x, y in points])
    assert_allclose(np.maximum(clearances(o, points), 0), np.maximum(exact, 0), atol=1e-9)
    sure = abs(exact - needed) > 1e-9
    assert_array_equal(keeps_clearance(o, points, needed)[sure], (exact >= needed)[sure])
