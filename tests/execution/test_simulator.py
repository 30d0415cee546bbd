"""Routes driven in physics: against the twin, against themselves, and against obstacles."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sva_bench.arrays import FloatArray
from sva_bench.choices import Fidelity
from sva_bench.execution.driving import DriveTask, drive_route
from sva_bench.execution.following import downsampled
from sva_bench.execution.legs import Leg
from sva_bench.execution.outcome import Driven
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.disturbance import Disturbance
from sva_bench.robot.follower import CONTROL_HZ, stretches
from sva_bench.robot.model import BUILT_IN, RobotModel
from sva_bench.travel.roadmap import plan_paths
from tests.oracles.distances import points_clearance
from tests.oracles.worlds import free_places, random_obstacles

TURTLEBOT = BUILT_IN["turtlebot2"]
CLEARANCE_M = 0.297
NO_BOXES, NO_CYLINDERS = np.empty((0, 5)), np.empty((0, 3))


def random_tour(seed: int, stops: int, model: RobotModel = TURTLEBOT, fidelity: Fidelity = "physics") -> DriveTask:
    """A robot's tour of random places in a random world."""
    obstacles = random_obstacles(seed, size_m=8.0, boxes=4, walls=3, cylinders=3)
    points = free_places(obstacles, seed, stops, CLEARANCE_M)
    headings = np.random.default_rng([seed, 3]).uniform(-np.pi, np.pi, stops)
    paths = plan_paths(obstacles, points, CLEARANCE_M)
    order = [0]
    while True:  # on to the next place that is joined to this one at all
        onward = next((j for j in range(order[-1] + 1, stops) if paths[order[-1]][j] is not None), None)
        if onward is None:
            break
        order.append(onward)
    legs: list[Leg] = []
    for i, j in pairwise(order):
        path = paths[i][j]
        assert path is not None
        legs.append((stretches(path, float(headings[j])),))
    return DriveTask(obstacles=obstacles, model=model, start=(*points[0].tolist(), float(headings[0])),
                     legs=tuple(legs), fidelity=fidelity, traced=True)


def ahead(obstacles: Obstacles, start: tuple[float, float], end: tuple[float, float]) -> Driven:
    """A drive straight ahead, whatever stands there."""
    path = np.array([start, end])
    heading = float(np.arctan2(*(path[1] - path[0])[::-1]))
    return drive_route(DriveTask(obstacles=obstacles, model=TURTLEBOT, start=(*start, heading),
                                 legs=((stretches(path, heading),),), fidelity="physics",
                                 traced=True))


def errors(seeds: range, stops: int, model: RobotModel = TURTLEBOT) -> FloatArray:
    """Relative error of the twin on each leg of 3 s or more of random tours."""
    found = []
    for seed in seeds:
        real, ideal = (drive_route(random_tour(seed, stops, model, level))
                       for level in ("physics", "kinematic"))
        assert not real.stuck
        long = ideal.leg_s >= 3.0
        found.append(real.leg_s[long] / ideal.leg_s[long] - 1)
    return np.concatenate(found)


def test_physics_takes_the_twins_time_within_one_per_cent() -> None:
    # 1 % is the default planning margin: it is what makes a plan that fits on paper fit in physics.
    found = errors(range(3), 6)
    assert len(found) >= 10
    assert np.abs(found).max() < 0.01


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(name for name in BUILT_IN if BUILT_IN[name].radius_m < CLEARANCE_M))
def test_physics_takes_the_twins_time_within_one_per_cent_on_many_courses(name: str) -> None:
    found = errors(range(10, 22), 8, BUILT_IN[name])
    print(f"{name}: {len(found)} legs, error mean {found.mean():+.5f}, sd {found.std():.5f}, "  # noqa: T201
          f"worst {np.abs(found).max():.5f}")
    assert np.abs(found).max() < 0.01


def fingerprint(seed: int) -> tuple[bytes, bytes, bool]:
    driven = drive_route(random_tour(seed, 4))
    return driven.leg_s.tobytes(), driven.pose.tobytes(), driven.stuck


def test_a_drive_repeats_bit_for_bit_here_and_in_a_fresh_process() -> None:
    first = fingerprint(4)
    fingerprint(5)  # another world in between leaves nothing behind
    assert fingerprint(4) == first
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as fresh:
        assert fresh.submit(fingerprint, 4).result() == first


def test_tracing_does_not_change_the_drive() -> None:
    task = random_tour(1, 4)
    bare = DriveTask(**{**vars(task), "traced": False})
    assert_array_equal(drive_route(bare).leg_s, drive_route(task).leg_s)
    assert len(drive_route(bare).pose) == 0


@pytest.mark.parametrize("seed", [0, 2, 6])
def test_on_planned_paths_a_robot_touches_nothing(seed: int) -> None:
    task = random_tour(seed, 6)
    driven = drive_route(task)
    assert not driven.stuck
    assert points_clearance(task.obstacles, driven.pose[:, :2]).min() > TURTLEBOT.radius_m


def test_unequal_wheels_keep_clear_too() -> None:
    task = random_tour(2, 6)
    apart = Disturbance(wheel_gains=(0.97, 1.03))  # three standard deviations of 1 %
    driven = drive_route(replace(task, disturbance=apart))
    assert not driven.stuck
    assert points_clearance(task.obstacles, driven.pose[:, :2]).min() > TURTLEBOT.radius_m


def test_a_wall_in_the_way_stops_it() -> None:
    # The wall's face stands at x = 1.95; the hull reaches it with the centre at 1.95 - 0.177 = 1.773.
    wall = Obstacles(bounds_m=np.array([0.0, 0, 4, 2]), boxes=np.array([[2.0, 1, 0.05, 1.0, 0]]),
                     cylinders=NO_CYLINDERS)
    driven = ahead(wall, (0.6, 1.0), (3.4, 1.0))
    assert driven.stuck
    assert driven.pose[-1, 0] == pytest.approx(1.773, abs=0.01)  # solid bodies sink in by a few millimetres
    kinematic = drive_route(DriveTask(obstacles=wall, model=TURTLEBOT, start=(0.6, 1.0, 0.0),
                                      legs=((stretches(np.array([[0.6, 1.0], [3.4, 1.0]]), 0.0),),),
                                      fidelity="kinematic", traced=False))
    assert not kinematic.stuck  # the twin knows no obstacles


def test_a_robot_that_gets_no_further_gives_up_soon() -> None:
    wall = Obstacles(bounds_m=np.array([0.0, 0, 4, 2]), boxes=np.array([[2.0, 1, 0.05, 1.0, 0]]),
                     cylinders=NO_CYLINDERS)
    driven = ahead(wall, (0.6, 1.0), (3.4, 1.0))
    assert driven.stuck
    # 2.5 s on the way, then 10 s to 20 s until a check finds it where it was at the check before.
    assert 10 < driven.leg_s[0] < 25


def test_the_bounds_are_walls() -> None:
    empty = Obstacles(bounds_m=np.array([0.0, 0, 3, 3]), boxes=NO_BOXES, cylinders=NO_CYLINDERS)
    for end in ((3.4, 1.5), (-0.4, 1.5), (1.5, 3.4), (1.5, -0.4)):
        driven = ahead(empty, (1.5, 1.5), end)
        assert driven.stuck
        # At full speed it is 11 mm further after a step of physics, and only then feels a wall; a step later it is out.
        assert points_clearance(empty, driven.pose[:, :2]).min() > TURTLEBOT.radius_m - 0.013
        assert points_clearance(empty, driven.pose[-1:, :2])[0] > TURTLEBOT.radius_m - 0.001
        assert driven.contacts[0] >= 1


@pytest.mark.parametrize("count", [20, 100])
@pytest.mark.parametrize("kind", ["box", "cylinder"])
def test_however_many_obstacles_there_are_the_last_one_is_solid(kind: str, count: int) -> None:
    # A collision shape made of an array keeps 16 shapes and drops the others without a word.
    posts = [(0.3 + 0.25 * (k % 40), 3.0 + 0.5 * (k // 40)) for k in range(count - 1)]
    centres = np.array([*posts, (2.0, 1.0)])
    ones = np.full(count, 0.1)
    boxes = np.column_stack([centres, ones, ones, 0 * ones]) if kind == "box" else NO_BOXES
    cylinders = np.column_stack([centres, ones]) if kind == "cylinder" else NO_CYLINDERS
    driven = ahead(Obstacles(bounds_m=np.array([0.0, 0, 11, 6]), boxes=boxes, cylinders=cylinders), (0.6, 1.0),
                   (3.4, 1.0))
    cleared = np.hypot(driven.pose[:, 0] - 2.0, driven.pose[:, 1] - 1.0).min()
    assert cleared > 0.1 + TURTLEBOT.radius_m - 0.01


def test_a_rotated_box_stands_where_the_file_says() -> None:
    # A box of 2 by 0.1 turned by 45 degrees about (2, 1): on y = 1 its face is at x = 2 - 0.05 sqrt(2), and the hull
    # meets it with its centre 0.05 + 0.177 from its axis: at x = 2 - 0.227 sqrt(2) = 1.679. Then it slides along.
    box = Obstacles(bounds_m=np.array([0.0, -2, 4, 4]), boxes=np.array([[2.0, 1, 1.0, 0.05, np.pi / 4]]),
                    cylinders=NO_CYLINDERS)
    driven = ahead(box, (0.6, 1.0), (3.4, 1.0))
    assert points_clearance(box, driven.pose[:, :2]).min() == pytest.approx(TURTLEBOT.radius_m, abs=0.01)


def test_a_leg_may_be_a_chain_of_hops_with_a_stop_at_each() -> None:
    nothing = Obstacles(bounds_m=np.array([0.0, 0, 6, 6]), boxes=NO_BOXES, cylinders=NO_CYLINDERS)
    hops = tuple(stretches(np.array([[x, 1.0], [x + 1.0, 1.0]]), 0.0) for x in (1.0, 2.0, 3.0))
    task = DriveTask(obstacles=nothing, model=TURTLEBOT, start=(1.0, 1.0, 0.0), legs=(hops,),
                     fidelity="physics", traced=True)
    apart = DriveTask(**{**vars(task), "legs": tuple((hop,) for hop in hops)})
    one, three = drive_route(task), drive_route(apart)
    assert len(one.leg_s) == 1
    assert one.leg_s[0] == pytest.approx(three.leg_s.sum(), abs=1e-9)
    assert_array_equal(one.pose[-1], three.pose[-1])
    assert set(three.leg_of) == {0.0, 1.0, 2.0}


def test_a_robot_drives_in_the_direction_that_it_starts_in() -> None:
    nothing = Obstacles(bounds_m=np.array([0.0, 0, 6, 6]), boxes=NO_BOXES, cylinders=NO_CYLINDERS)
    driven = ahead(nothing, (3.0, 5.0), (3.0, 2.0))
    assert np.ptp(driven.pose[:, 0]) < 0.005  # a straight line, to a few millimetres
    assert driven.pose[-1, 1] == pytest.approx(2.0, abs=0.02)
    assert np.all(np.abs(driven.pose[:, 2] + np.pi / 2) < 0.02)


def test_fewer_poses_are_kept_but_always_the_last() -> None:
    poses = [(float(k), 0.0, 0.0) for k in range(1, 11)]
    every = round(CONTROL_HZ / 20)
    times, kept = downsampled(poses, 20.0)
    assert_array_equal(kept[:, 0], [3, 6, 9, 10])
    assert_array_equal(times * CONTROL_HZ, kept[:, 0])
    assert every == 3
    assert downsampled([], 20.0)[1].shape == (0, 3)


def test_nothing_is_written_to_standard_output(capfd: pytest.CaptureFixture[str]) -> None:
    drive_route(random_tour(1, 3))
    assert capfd.readouterr().out == ""
