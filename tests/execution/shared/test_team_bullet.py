"""Teams in one PyBullet world: one robot is as ever, several agree with their twins, and what they touch is told."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sva_bench.execution.engines.bullet import Bullet
from sva_bench.execution.engines.engine import Pose
from sva_bench.execution.following import follow
from sva_bench.execution.shared.driver import LegSoFar, Member
from sva_bench.execution.shared.team_bullet import TeamBullet
from sva_bench.execution.shared.team_twin import TeamTwin
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.disturbance import UNDISTURBED, Disturbance
from sva_bench.robot.model import BUILT_IN
from tests.execution.shared.teams import (
    CROSSING,
    DOOR,
    MODEL,
    Mission,
    Place,
    Tour,
    begun,
    cuts_of,
    lane_of,
    members_of,
    planned,
    there_and_back,
)

ROOM = Obstacles(bounds_m=np.array([-6.0, -6, 10, 6]), boxes=np.empty((0, 5)), cylinders=np.empty((0, 3)))
WALL_WITH_A_DOOR = np.array([[3.5, -2.3, 0.1, 3.4, 0.0], [3.5, 4.3, 0.1, 1.7, 0.0]])
TOUR: Tour = [[(0.0, 0.0), (3.0, 0.4), (3.0, 2.0)], [(3.0, 2.0), (0.0, 2.0)]]
NOISY = Disturbance(wheel_gains=(1.01, 0.99), track_gain=1.02, delay_s=0.08, payload_kg=0.5, hull_friction=0.4)


def driven_alone(obstacles: Obstacles, path: list[Place], disturbance: Disturbance = UNDISTURBED,
                 standing: list[Place] | None = None) -> tuple[str, LegSoFar]:
    """What came of one leg, and what it ended with; others may stand about."""
    tour: Tour = [path]
    members = [*members_of([tour], [disturbance]),
               *(Member(model=MODEL, start=(x, y, 0.0)) for x, y in standing or [])]
    with TeamBullet(obstacles, members) as driver:
        driver.assign(0, lane_of(cuts_of(tour)), None)
        driver.start_leg(0, 0.0, math.inf, ())
        happening = driver.run()
        return happening.kind, driver.leg(0)


@pytest.mark.parametrize("disturbance", [UNDISTURBED, NOISY], ids=["ideal", "noisy"])
def test_a_robot_alone_is_driven_as_in_a_world_of_its_own_to_the_bit(disturbance: Disturbance) -> None:
    cuts = cuts_of(TOUR)
    x, y, yaw = disturbance.start((0.0, 0.0, 0.0)).tolist()
    alone: list[tuple[float, Pose]] = []
    with Bullet(ROOM, MODEL, (x, y, yaw), disturbance) as engine:
        for each in cuts:
            time_s, arrived = follow(engine, MODEL, each.leg[0], None, disturbance)
            assert arrived
            alone.append((time_s, engine.pose()))
    found = []
    with TeamBullet(ROOM, members_of([TOUR], [disturbance])) as driver:
        driver.assign(0, lane_of(cuts), None)
        for _ in cuts:
            driver.start_leg(0, driver.clock_s + 2.5, math.inf, ())
            assert driver.run().kind == "arrived"
            found.append((driver.leg(0).driving_s, driver.pose(0)))
    assert found == alone


@pytest.mark.parametrize(("tours", "boxes"), [(CROSSING, np.empty((0, 5))), (DOOR, WALL_WITH_A_DOOR)],
                         ids=["crossing", "door"])
def test_physics_and_twin_agree_on_sites_ends_and_times(tours: tuple[Tour, ...], boxes: np.ndarray) -> None:
    order = planned(tours, 2.0)
    members = members_of(tours)
    twin = begun(TeamTwin(members), order, 2.0)
    assert twin.go_on().kind == "idle"
    with TeamBullet(replace(ROOM, boxes=boxes), members) as driver:
        physics = begun(driver, order, 2.0)
        assert physics.go_on().kind == "idle"
        assert not any(leg.touches for legs in physics.legs.values() for leg in legs)
    assert {robot: len(legs) for robot, legs in physics.legs.items()} == {
        robot: len(legs) for robot, legs in twin.legs.items()}
    for robot, legs in twin.legs.items():
        for ours, theirs in zip(legs, physics.legs[robot], strict=True):
            assert theirs.clock_s == pytest.approx(ours.clock_s, rel=0.01)


def test_a_team_in_physics_repeats_to_the_bit() -> None:
    order, seen = planned(CROSSING, 1.0), []
    for _ in range(2):
        with TeamBullet(ROOM, members_of(CROSSING, [NOISY] * 2)) as driver:
            mission = begun(driver, order, 1.0)
            mission.go_on()
            seen.append((mission.happened, [driver.pose(robot) for robot in range(2)]))
    assert seen[0] == seen[1]


def test_coming_back_at_some_time_changes_nothing_in_physics() -> None:
    order, seen = planned(CROSSING, 1.0), []
    for stops in ((), (0.0, 1.003, 4.5, 4.51)):
        with TeamBullet(ROOM, members_of(CROSSING, [NOISY] * 2)) as driver:
            mission = begun(driver, order, 1.0)
            for until_s in stops:
                assert driver.run(until_s).kind == "time"
            mission.go_on()
            seen.append((mission.happened, [driver.pose(robot) for robot in range(2)]))
    assert seen[0] == seen[1]


def test_robots_that_meet_without_gates_touch_and_both_know_whom() -> None:
    with TeamBullet(ROOM, members_of(CROSSING)) as driver:
        mission = Mission(driver, planned(CROSSING, 1.0).lanes)
        mission.begin(None)
        happening = mission.go_on()
        assert (happening.kind, happening.robot, happening.other) == ("touch", 0, 1)
        for robot in (0, 1):
            (touch,) = driver.leg(robot).touches
            assert touch.robot == 1 - robot
            assert touch.solid == ""
            assert touch.since_s == pytest.approx(happening.clock_s, abs=0.1)
        apart = math.dist(driver.pose(0)[:2], driver.pose(1)[:2])
        assert apart == pytest.approx(2 * MODEL.radius_m, abs=0.03)


def test_what_a_hull_scrapes_along_is_named_as_ever() -> None:
    # A post 2 cm within the hull's way, at its left: it slides past.
    kind, leg = driven_alone(replace(ROOM, cylinders=np.array([[2.0, MODEL.radius_m + 0.08, 0.1]])),
                             [(0.0, 0.0), (4.0, 0.0)])
    assert kind == "arrived"
    assert {touch.solid for touch in leg.touches} == {"cylinder 1"}
    assert leg.touches[0].since_s == pytest.approx(3.3, abs=0.4)  # 2 m at up to 0.65 m/s


def test_a_robot_before_a_wall_is_stuck_and_one_that_waits_for_another_is_not() -> None:
    kind, leg = driven_alone(replace(ROOM, boxes=np.array([[2.0, 0.0, 0.1, 2.0, 0.0]])), [(0.0, 0.0), (4.0, 0.0)])
    assert kind == "stuck"
    assert leg.driving_s < 40.0
    # The first goes into a dead end and stays there for five minutes; the other waits at its mouth.
    tours = [there_and_back([(0.0, 0.0), (4.0, 0.0)]), there_and_back([(0.0, 1.5), (2.0, 0.0), (4.5, 0.0)])]
    order = planned(tours, 300.0)
    with TeamBullet(ROOM, members_of(tours)) as driver:
        mission = begun(driver, order, 300.0)
        assert mission.go_on().kind == "idle"
        waited = max(wait.lasts_s for legs in mission.legs.values() for leg in legs for wait in leg.waits)
        assert waited > 200.0


def test_a_robot_that_drives_into_one_that_stands_is_told_once() -> None:
    kind, leg = driven_alone(ROOM, [(0.0, 0.0), (4.0, 0.0)], standing=[(2.0, 0.0)])
    assert kind == "touch"
    assert [touch.robot for touch in leg.touches] == [1]


def test_robots_of_different_models_share_a_world_that_is_fine_enough_for_both() -> None:
    burger = BUILT_IN["turtlebot3_burger"]
    members = [Member(model=MODEL, start=(0.0, 0.0, 0.0)), Member(model=burger, start=(0.0, 2.0, 0.0))]
    tours: list[Tour] = [[[(0.0, 0.0), (3.0, 0.0)]], [[(0.0, 2.0), (1.0, 2.0)]]]
    cuts = [cuts_of(tours[0])[0], cuts_of(tours[1], burger)[0]]
    with TeamBullet(ROOM, members) as driver:
        for robot, each in enumerate(cuts):
            driver.assign(robot, lane_of([each]), None)
            driver.start_leg(robot, 0.0, math.inf, ())
        assert [driver.run().kind for _ in range(3)] == ["arrived", "arrived", "idle"]
        for robot, each in enumerate(cuts):
            assert driver.leg(robot).driving_s == pytest.approx(each.lasts_s, rel=0.01)


def test_a_driver_that_was_closed_leaves_its_client_to_the_next() -> None:
    with TeamBullet(ROOM, members_of(CROSSING)) as driver:
        first = driver._world._client.number
    with TeamBullet(ROOM, members_of(CROSSING)) as driver:
        assert driver._world._client.number == first
