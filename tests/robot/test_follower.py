from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.arrays import FloatArray
from sva_bench.geometry.clearance import CLEARANCE_MARGINS_M
from sva_bench.robot.disturbance import Disturbance
from sva_bench.robot.follower import ARRIVED, CONTROL_HZ, NO_LINE, arc_lengths, control, new_state, stretches, wrap
from sva_bench.robot.model import BUILT_IN, RobotModel
from sva_bench.robot.twin import drive
from sva_bench.travel.roadmap import plan_paths
from tests.oracles.distances import points_to_segment
from tests.oracles.worlds import free_places, random_obstacles

TURTLEBOT = BUILT_IN["turtlebot2"]
MODELS = list(BUILT_IN.values())
STEP_S = 1 / CONTROL_HZ


def by_model(model: RobotModel) -> str:
    return model.name


def course_time(model: RobotModel, path: Sequence[Sequence[float]], heading: float, start: float,
                gains: tuple[float, float] = (1.0, 1.0)) -> tuple[float, FloatArray]:
    """Time of a path from a heading to a heading, and the pose at its end."""
    pose = np.array([*path[0], start])
    time_s, _ = drive(model, stretches(np.array(path), heading), pose, Disturbance(wheel_gains=gains))
    return time_s, pose


def trapezoid_s(length: float, fastest: float, acceleration: float) -> float:
    """Time from rest to rest: v / a to speed up, as much to brake, the rest at v; a triangle where it is too short."""
    if length * acceleration < fastest**2:
        return 2 * math.sqrt(length / acceleration)
    return length / fastest + fastest / acceleration


# Stretches


def test_a_sharp_corner_is_stopped_at_and_turned_in_place() -> None:
    # East 2 m, north 1 m: a bend of 90 degrees cuts the path in two; the first part ends looking north.
    parts = stretches(np.array([[0.0, 0], [2, 0], [2, 1]]), -1.0)
    assert len(parts) == 2
    assert_array_equal(parts[0].path, [[0, 0], [2, 0]])
    assert_array_equal(parts[1].path, [[2, 0], [2, 1]])
    assert parts[0].heading_rad == pytest.approx(math.pi / 2)
    assert parts[1].heading_rad == -1.0
    assert_array_equal(parts[0].arc, [0, 2])


def test_a_gentle_bend_is_driven_round() -> None:
    # 30 degrees = 0.52 rad is below 0.6 rad, 40 degrees = 0.70 rad above.
    for degrees, parts in ((30, 1), (40, 2)):
        bend = math.radians(degrees)
        path = np.array([[0.0, 0], [1, 0], [1 + math.cos(bend), math.sin(bend)]])
        assert len(stretches(path, 0.0)) == parts


def test_a_bend_across_west_is_no_corner() -> None:
    # Bearings of 175 and -175 degrees differ by 10 degrees, not by 350.
    a, b = math.radians(175), math.radians(185)
    path = np.cumsum([[0.0, 0], [math.cos(a), math.sin(a)], [math.cos(b), math.sin(b)]], axis=0)
    assert len(stretches(path, 0.0)) == 1


def test_doubled_vertices_and_a_path_of_no_length_do_no_harm() -> None:
    assert len(stretches(np.array([[0.0, 0], [0, 0], [1, 0], [1, 0], [2, 0]]), 0.0)) == 1
    (still,) = stretches(np.array([[1.0, 1], [1, 1]]), 2.0)
    assert_array_equal(still.path, [[1, 1], [1, 1]])
    assert still.arc[-1] == 0


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=2, max_size=8, unique=True),
       st.floats(-3.1, 3.1))
def test_stretches_join_into_the_path(points: list[tuple[float, float]], heading: float) -> None:
    path = np.array(points)
    parts = stretches(path, heading)
    for part, following in pairwise(parts):
        assert_array_equal(part.path[-1], following.path[0])
        move = following.path[1] - following.path[0]
        assert part.heading_rad == pytest.approx(math.atan2(move[1], move[0]))
    assert parts[-1].heading_rad == heading
    # Vertices closer than 1e-9 m are one.
    assert sum(part.arc[-1] for part in parts) == pytest.approx(float(np.hypot(*np.diff(path, axis=0).T).sum()),
                                                                abs=1e-8)


def test_arc_lengths_and_angles_by_hand() -> None:
    assert_allclose(arc_lengths(np.array([[0.0, 0], [3, 4], [3, 5]])), [0, 5, 6])
    assert wrap(1.5 * math.pi) == pytest.approx(-0.5 * math.pi)
    assert wrap(-math.pi) == -math.pi
    assert wrap(math.pi) == -math.pi


# Control


@pytest.mark.parametrize("model", MODELS, ids=by_model)
@given(x=st.floats(-0.3, 3), y=st.floats(-0.5, 0.5), yaw=st.floats(-3.2, 3.2), speed=st.floats(0, 0.2),
       rate=st.floats(-1, 1))
def test_commands_stay_within_the_limits(model: RobotModel, x: float, y: float, yaw: float, speed: float, rate: float
                                         ) -> None:
    path = np.array([[0.0, 0], [1.5, 0.2], [3, 0]])
    state = new_state()
    state[2], state[3] = speed, rate
    for _ in range(3):
        before = state.copy()
        new_speed, new_rate = control(path, arc_lengths(path), 1.0, model.limits, state, x, y, yaw, STEP_S,
                                      NO_LINE)
        assert -1e-12 <= new_speed <= max(model.max_speed_m_s, speed) + 1e-12
        assert abs(new_speed - before[2]) <= model.acceleration_m_s2 * STEP_S + 1e-12
        if state[0] != ARRIVED:
            # In a curve the rate may change twice as fast as in place: it follows the speed as well as the bend.
            assert abs(new_rate - before[3]) <= 2 * model.turn_acceleration_rad_s2 * STEP_S + 1e-12


def test_control_is_a_pure_function_of_pose_and_state() -> None:
    path = np.array([[0.0, 0], [2, 0]])
    answers = []
    for _ in range(2):
        state = new_state()
        answers.append([control(path, arc_lengths(path), 0.0, TURTLEBOT.limits, state, 0.1 * k, 0.01, 0.0, STEP_S,
                                NO_LINE)
                        for k in range(10)])
    assert answers[0] == answers[1]


# The stop line


def to_the_line(model: RobotModel, line_m: float, steps: int = 1200) -> tuple[FloatArray, FloatArray]:
    """Arc and speed, and whether the line held the robot, at each step of an ideal robot that drives ahead."""
    path, state, x, speed = np.array([[0.0, 0], [9, 0]]), new_state(), 0.0, 0.0
    seen = []
    for _ in range(steps):
        speed, _ = control(path, arc_lengths(path), 0.0, model.limits, state, x, 0.0, 0.0, STEP_S, line_m)
        x += speed * STEP_S
        seen.append((x, speed, state[4]))
    found = np.array(seen)
    return found[:, :2], found[:, 2]


@pytest.mark.parametrize("model", MODELS, ids=by_model)
@pytest.mark.parametrize("line_m", [0.05, 0.4, 2.0])
def test_a_robot_stops_two_centimetres_before_its_stop_line_and_stands(model: RobotModel, line_m: float) -> None:
    moved, held = to_the_line(model, line_m)
    assert moved[:, 0].max() == pytest.approx(line_m - 0.02, abs=2e-3)
    assert moved[-60:, 1].max() == 0.0  # it stands; it doesn't creep
    assert np.abs(np.diff(moved[:, 1])).max() <= model.acceleration_m_s2 * STEP_S + 1e-12
    assert held[-60:].all()
    assert not held[0]  # coming up to speed it would have been as fast without


@pytest.mark.parametrize("model", MODELS, ids=by_model)
def test_a_robot_at_or_beyond_its_stop_line_does_not_set_off(model: RobotModel) -> None:
    for line_m in (0.02, 0.0, -1.0, -math.inf):
        moved, held = to_the_line(model, line_m, 30)
        assert moved.max() == 0.0
        assert held[1:].all()  # the first step turns towards the path


@pytest.mark.parametrize("model", MODELS, ids=by_model)
def test_a_line_far_ahead_holds_nobody(model: RobotModel) -> None:
    free, held = to_the_line(model, NO_LINE, 120)
    far, _ = to_the_line(model, 60.0, 120)
    assert np.array_equal(free, far)
    assert not held.any()


# The twin


@pytest.mark.parametrize("model", MODELS, ids=by_model)
@pytest.mark.parametrize("angle", [0.5, math.pi / 2, -2.5])
def test_turning_in_place_takes_the_time_of_the_trapezoid(model: RobotModel, angle: float) -> None:
    time_s, pose = course_time(model, [[1, 1], [1, 1]], angle, 0.0)
    assert_allclose(pose[:2], [1, 1], atol=1e-12)
    assert abs(wrap(angle - pose[2])) < 0.02
    # The last 0.02 rad are not turned: at 0.9 of the acceleration they would take sqrt(2 0.02 / 2.7) = 0.122 s.
    # Braking at 0.9 of the acceleration adds 11 % to the braking half at most; the rest is a control step or two.
    ideal = trapezoid_s(abs(angle), model.max_turn_rad_s, model.turn_acceleration_rad_s2)
    assert ideal - 0.122 <= time_s <= 1.06 * ideal + 2 * STEP_S


@pytest.mark.parametrize("model", MODELS, ids=by_model)
@pytest.mark.parametrize("length", [0.3, 1.0, 4.0])
def test_a_straight_line_takes_the_time_of_the_trapezoid(model: RobotModel, length: float) -> None:
    time_s, pose = course_time(model, [[0, 0], [length, 0]], 0.0, 0.0)
    ideal = trapezoid_s(length, model.max_speed_m_s, model.acceleration_m_s2)
    # Braking at 0.9 of the acceleration makes the braking part 11 % longer: half of v / a / 0.9. The approach ends at
    # a creep over the last centimetres, below half a second at 0.03 m/s; the last centimetre is not driven.
    braking = min(model.max_speed_m_s / model.acceleration_m_s2, ideal / 2)
    assert ideal - 0.01 / model.max_speed_m_s <= time_s <= ideal + braking / 9 + 0.5
    assert_allclose(pose, [length, 0, 0], atol=0.0101)


@pytest.mark.parametrize("heading", [0.0, 1.0, math.pi, -2.0, 7.0])
@pytest.mark.parametrize("start", [0.0, 3.0, -1.5])
def test_it_stops_at_the_end_in_the_given_heading(start: float, heading: float) -> None:
    time_s, pose = course_time(TURTLEBOT, [[0, 0], [1, 0.2], [2, 0], [2, 1]], heading, start)
    assert math.isfinite(time_s)
    assert abs(wrap(heading - pose[2])) < 0.02
    assert np.hypot(pose[0] - 2, pose[1] - 1) < 0.015  # stops within 0.01 m, and off the path by a few mm


def test_the_twin_is_deterministic() -> None:
    path = [(0.0, 0.0), (1.0, 0.3), (2.0, 0.0), (2.0, 2.0)]
    (first, pose), (second, again) = (course_time(TURTLEBOT, path, 1.0, 0.5) for _ in range(2))
    assert first == second
    assert_array_equal(pose, again)


def test_a_trace_shows_the_drive_and_costs_it_nothing() -> None:
    course = stretches(np.array([[0.0, 0], [1, 0], [1, 1]]), 0.0)
    pose, other = np.array([0.0, 0, 0]), np.array([0.0, 0, 0])
    time_s, trace = drive(TURTLEBOT, course, pose, traced=True)
    assert drive(TURTLEBOT, course, other)[0] == time_s
    assert len(trace) == round(time_s * CONTROL_HZ)
    assert_array_equal(trace[-1], pose)
    steps = np.hypot(*np.diff(trace[:, :2], axis=0).T)
    assert steps.max() <= TURTLEBOT.max_speed_m_s * STEP_S + 1e-12


def test_slow_wheels_take_longer_and_unequal_ones_still_arrive() -> None:
    path = [(0.0, 0.0), (4.0, 0.0)]
    ideal, _ = course_time(TURTLEBOT, path, 0.0, 0.0)
    slow, _ = course_time(TURTLEBOT, path, 0.0, 0.0, (0.9, 0.9))
    slower, _ = course_time(TURTLEBOT, path, 0.0, 0.0, (0.8, 0.8))
    assert ideal < slow < slower
    # Of 6.97 s some 5.3 s pass at full speed, which takes 1 / 0.9 as long.
    assert slow == pytest.approx(ideal / 0.9, rel=0.03)
    unequal, pose = course_time(TURTLEBOT, path, 0.0, 0.0, (0.97, 1.03))
    # 3 % of difference over the track's 0.23 m is steered against all the way, and turned back at the end: 0.2 s.
    assert unequal == pytest.approx(ideal, abs=0.3)
    assert np.hypot(pose[0] - 4, pose[1]) < 0.02


def test_wheels_that_hardly_turn_never_arrive() -> None:
    time_s, _ = course_time(TURTLEBOT, [[0, 0], [5, 0]], 0.0, 0.0, (0.001, 0.001))
    assert time_s == math.inf


def test_on_planned_paths_it_strays_less_than_the_narrowest_margin_in_use() -> None:
    obstacles = random_obstacles(3)
    points = free_places(obstacles, 3, 8, 0.297)
    strays = []
    for row in plan_paths(obstacles, points, 0.297):
        for path in row:
            if path is None:
                continue
            pose = np.array([*path[0], 0.3])
            _, trace = drive(TURTLEBOT, stretches(path, 0.0), pose, traced=True)
            gaps = np.min([points_to_segment(trace[:, :2], a, b)
                           for a, b in pairwise(path)], axis=0)
            strays.append(gaps.max())
    # Corners below 0.6 rad are cut, by some 5 cm as the planner's margins assume.
    assert max(strays) < min(0.06, CLEARANCE_MARGINS_M[0])


# Figures


@pytest.mark.parametrize(("figure", "value", "says"), [
    ("radius_m", 0.0, "must be positive"), ("mass_kg", -1.0, "must be positive"),
    ("max_speed_m_s", math.inf, "finite"), ("track_m", math.nan, "must be positive"),
    ("track_m", 0.5, "outside a hull"), ("wheel_radius_m", 0.1, "too large for a hull")])
def test_figures_of_no_robot_are_refused(figure: str, value: float, says: str) -> None:
    figures = {k: v for k, v in TURTLEBOT.figures().items() if k != "name"}
    with pytest.raises(ValueError, match=says):
        RobotModel(name="odd", **(figures | {figure: value}))  # type: ignore[arg-type]


def test_limits_are_in_the_order_that_compiled_code_reads() -> None:
    assert_array_equal(TURTLEBOT.limits, [0.65, 1.9, 0.8, 3.0])
