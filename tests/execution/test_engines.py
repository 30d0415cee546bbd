"""What every engine must do, and the follower's loop over engines: the ideal one is the twin to the bit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sva_bench.choices import EngineName, Fidelity
from sva_bench.execution import driving
from sva_bench.execution.corridor import solids_near, strayed
from sva_bench.execution.driving import DriveTask, drive_route, drive_tasks
from sva_bench.execution.engines import bullet
from sva_bench.execution.engines.engine import ENGINE_OF, ENGINES, Engine, Pose
from sva_bench.execution.following import follow, is_stuck
from sva_bench.execution.touch import Touch
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.disturbance import UNDISTURBED, Disturbance
from sva_bench.robot.follower import CONTROL_HZ, stretches
from sva_bench.robot.model import BUILT_IN
from sva_bench.robot.twin import drive as drive_twin

MODEL = BUILT_IN["turtlebot2"]
ROOM = Obstacles(bounds_m=np.array([-9.0, -9, 9, 9]), boxes=np.empty((0, 5)), cylinders=np.empty((0, 3)))
START: Pose = (1.0, 2.0, 0.5)
STEPS = 240

engines = pytest.mark.parametrize("name", sorted(ENGINES))


@contextmanager
def opened(name: EngineName, disturbance: Disturbance = UNDISTURBED) -> Iterator[Engine]:
    with ENGINES[name](ROOM, MODEL, START, disturbance) as engine:
        yield engine


def driven(name: EngineName, left_m_s: float, right_m_s: float, disturbance: Disturbance = UNDISTURBED) -> list[Pose]:
    """Poses after a second to come up to speed and after ``STEPS`` more."""
    with opened(name, disturbance) as engine:
        for _ in range(round(CONTROL_HZ)):
            engine.step(left_m_s, right_m_s)
        poses = [engine.pose()]
        for _ in range(STEPS):
            engine.step(left_m_s, right_m_s)
            poses.append(engine.pose())
        return poses


def test_every_engine_and_every_fidelity_is_registered() -> None:
    assert set(ENGINES) == set(get_args(EngineName))
    assert set(ENGINE_OF) == set(get_args(Fidelity))


@engines
def test_an_engine_begins_in_the_pose_it_was_given_and_stands_there_until_told_otherwise(name: EngineName) -> None:
    with opened(name) as engine:
        assert engine.pose() == pytest.approx(START, abs=1e-6)
        for _ in range(60):
            engine.step(0.0, 0.0)
        assert engine.pose() == pytest.approx(START, abs=1e-3)
        assert not engine.touches
        assert engine.fault is None


@engines
def test_equal_wheels_drive_straight_at_the_speed_commanded_within_one_per_cent(name: EngineName) -> None:
    begun, *_, ended = driven(name, 0.3, 0.3)
    way = math.hypot(ended[0] - begun[0], ended[1] - begun[1])
    assert way == pytest.approx(0.3 * STEPS / CONTROL_HZ, rel=0.01)
    assert math.atan2(ended[1] - begun[1], ended[0] - begun[0]) == pytest.approx(START[2], abs=0.01)


@engines
def test_opposite_wheels_turn_on_the_spot_at_the_rate_commanded_within_one_per_cent(name: EngineName) -> None:
    poses = driven(name, -0.1, 0.1)
    turned = np.unwrap([yaw for _, _, yaw in poses])
    assert turned[-1] - turned[0] == pytest.approx(0.2 / MODEL.track_m * STEPS / CONTROL_HZ, rel=0.01)
    assert math.hypot(poses[-1][0] - START[0], poses[-1][1] - START[1]) < 0.01


@engines
def test_a_wheel_gain_acts_on_its_own_wheel(name: EngineName) -> None:
    # Commanded alike, but the right wheel 2 % faster: it turns left at 0.02 x 0.3 / track.
    poses = driven(name, 0.3, 0.3, Disturbance(wheel_gains=(1.0, 1.02)))
    assert poses[-1][2] - poses[0][2] == pytest.approx(0.006 / MODEL.track_m * STEPS / CONTROL_HZ, rel=0.05)


@engines
def test_two_fresh_engines_move_alike_to_the_bit_whatever_was_driven_between(name: EngineName) -> None:
    first = driven(name, 0.2, 0.4)
    driven(name, 0.4, 0.1)
    assert driven(name, 0.2, 0.4) == first


@engines
def test_an_engine_may_be_open_beside_another(name: EngineName) -> None:
    alone = driven(name, 0.2, 0.4)
    with opened(name) as other:
        other.step(0.3, 0.3)
        assert driven(name, 0.2, 0.4) == alone


def test_a_client_is_used_again_unless_something_went_wrong() -> None:
    driven("bullet", 0.1, 0.1)
    before = list(bullet._free)
    with opened("bullet"):
        assert len(bullet._free) == len(before) - 1
    assert sorted(bullet._free) == sorted(before)
    with pytest.raises(RuntimeError), opened("bullet"):
        raise RuntimeError
    assert len(bullet._free) == len(before) - 1


# The follower's loop

corners = st.lists(st.tuples(st.floats(-4, 4), st.floats(-4, 4)), min_size=1, max_size=5)


@settings(max_examples=40, deadline=None)
@given(corners, st.floats(-3.1, 3.1), st.tuples(st.floats(0.97, 1.03), st.floats(0.97, 1.03)))
def test_following_in_the_ideal_engine_is_the_twin_to_the_bit(
        places: list[tuple[float, float]], heading: float, gains: tuple[float, float]) -> None:
    hop = stretches(np.array([START[:2], *places]), heading)
    pose = np.array(START)
    time_s, trace = drive_twin(MODEL, hop, pose, Disturbance(wheel_gains=gains), traced=True)
    poses: list[Pose] = []
    with opened("ideal", Disturbance(wheel_gains=gains)) as engine:
        found, arrived = follow(engine, MODEL, hop, poses)
    assert (found, arrived) == (time_s, True)
    assert np.array_equal(np.array(poses).reshape(-1, 3), trace)


class Blocked:
    """An engine that never moves."""

    touches: tuple[Touch, ...] = ()
    fault = None

    def pose(self) -> Pose:
        return 0.0, 0.0, 0.0

    def step(self, left_m_s: float, right_m_s: float) -> None:
        pass

    def __enter__(self) -> Blocked:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def test_a_robot_that_does_not_move_is_stuck_at_the_first_check() -> None:
    time_s, arrived = follow(Blocked(), MODEL, stretches(np.array([[0.0, 0.0], [3.0, 0.0]]), 0.0))
    assert (time_s, arrived) == (10.0, False)


@pytest.mark.parametrize(("progress_m", "turned_rad", "on_the_way", "stuck"), [
    (0.03, 0.0, True, False), (0.01, 0.0, True, True),  # on the way only progress counts
    (0.01, 1.0, True, True),  # it pushes a wall and sways
    (0.0, 1.0, False, False), (0.0, -1.0, False, False),  # it turns on the spot, either way round
    (0.0, 0.01, False, True)])
def test_the_stuck_rule_by_cases(progress_m: float, turned_rad: float, on_the_way: bool, stuck: bool) -> None:
    assert is_stuck(progress_m, turned_rad, on_the_way) == stuck


# Obstacles far from the course


def test_a_drive_that_touches_nothing_does_not_depend_on_what_stands_far_away() -> None:
    # A grid of posts 3 m and more off the way, and none at all.
    posts = np.array([(x, y, 0.2) for x in np.arange(-8, 9, 1.0) for y in (-8.0, -6.0, 6.0, 8.0)])
    hop = stretches(np.array([[0.0, 0.0], [2.0, 0.5], [4.0, 0.0]]), 1.0)
    bare = DriveTask(obstacles=ROOM, model=MODEL, start=(0.0, 0.0, 0.0), legs=((hop,),), fidelity="physics",
                     traced=True)
    for obstacles in (replace(ROOM, cylinders=posts), replace(ROOM, cylinders=posts[::-1].copy())):
        result = drive_route(replace(bare, obstacles=obstacles))
        assert np.array_equal(result.leg_s, drive_route(bare).leg_s)
        assert np.array_equal(result.pose, drive_route(bare).pose)


def test_only_what_a_robot_can_touch_within_a_metre_of_its_course_is_built() -> None:
    # A course along y = 0 from 0 to 4, a hull of 0.177: a post of 0.2 counts up to 1.377 off, a box of half diagonal
    # 0.5 up to 1.677.
    posts = np.array([(2.0, 1.37, 0.2), (2.0, 1.38, 0.2), (-1.37, 0.0, 0.2), (5.38, 0.0, 0.2)])
    boxes = np.array([(1.0, -1.67, 0.3, 0.4, 0.7), (1.0, -1.68, 0.3, 0.4, 0.7)])
    near = solids_near(replace(ROOM, cylinders=posts, boxes=boxes), np.array([[0.0, 0.0], [4.0, 0.0]]), 0.177)
    assert np.array_equal(near.cylinders, posts[[0, 2]])
    assert np.array_equal(near.boxes, boxes[:1])
    assert np.array_equal(near.bounds_m, ROOM.bounds_m)


def test_a_robot_strays_when_it_is_more_than_80_cm_off_its_course() -> None:
    course = np.array([[0.0, 0.0], [4.0, 0.0]])
    assert not strayed([(1.0, 0.79, 0.0), (4.79, 0.0, 2.0)], course)
    assert strayed([(1.0, 0.79, 0.0), (1.0, 0.81, 0.0)], course)
    assert not strayed([], course)


def test_a_robot_that_strays_is_driven_again_among_all_obstacles(monkeypatch: pytest.MonkeyPatch) -> None:
    wall = replace(ROOM, boxes=np.array([[3.0, 0.0, 0.1, 4.0, 0.0]]))
    hop = stretches(np.array([[0.0, 0.0], [6.0, 0.0]]), 0.0)
    task = DriveTask(obstacles=wall, model=MODEL, start=(0.0, 0.0, 0.0), legs=((hop,),), fidelity="physics",
                     traced=True)
    stopped = drive_route(task)
    assert stopped.stuck
    monkeypatch.setattr(driving, "solids_near", lambda *_: ROOM)
    assert not drive_route(task).stuck
    monkeypatch.setattr(driving, "strayed", lambda *_: True)
    assert np.array_equal(drive_route(task).pose, stopped.pose)


def test_drives_of_one_course_are_those_of_each_by_itself() -> None:
    hop = stretches(np.array([[0.0, 0.0], [2.0, 0.0]]), 0.0)
    tasks = [DriveTask(obstacles=ROOM, model=MODEL, start=(0.0, 0.0, 0.0), legs=((hop,),), fidelity="physics",
                       traced=False, disturbance=Disturbance(wheel_gains=gains))
             for gains in ((1.0, 1.0), (0.98, 1.01), (1.02, 1.0))]
    for task, result in zip(tasks, drive_tasks(tasks), strict=True):
        assert np.array_equal(result.leg_s, drive_route(task).leg_s)
