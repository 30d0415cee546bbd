"""A team of twins: each drives as it would by itself, but for gates, holds, the brake and its budgets."""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sva_bench.execution.shared.driver import Happening, Hold, Member
from sva_bench.execution.shared.lanes import Cut, Itinerary, cut
from sva_bench.execution.shared.space_time import plan_order
from sva_bench.execution.shared.team_twin import TeamTwin
from sva_bench.robot.disturbance import UNDISTURBED, Disturbance, ErrorField
from sva_bench.robot.follower import CONTROL_HZ, stretches
from sva_bench.robot.twin import drive
from tests.execution.shared.teams import (
    CORRIDOR,
    CROSSING,
    DOOR,
    MODEL,
    Mission,
    Place,
    Tour,
    begun,
    cuts_of,
    geared,
    lane_of,
    members_of,
    planned,
)

NOISY = Disturbance(wheel_gains=(1.01, 0.99), track_gain=1.02, delay_s=0.08,
                    field=ErrorField(sd_m=0.05, sd_rad=0.035, length_m=0.5, seed=(1, 2)))
AHEAD: Tour = [[(0.0, 0.0), (4.0, 0.0)]]
TOURS = {"corridor": CORRIDOR, "door": DOOR, "crossing": CROSSING}
TICK_S = 1.0 / CONTROL_HZ

corners = st.lists(st.tuples(st.floats(-4, 4), st.floats(-4, 4)), min_size=1, max_size=4)


# One robot


@settings(max_examples=30, deadline=None)
@given(st.lists(corners, min_size=1, max_size=3), st.sampled_from([UNDISTURBED, NOISY]), st.floats(0.0, 7.0))
def test_a_robot_without_gates_takes_the_twins_times_and_way_to_the_bit(
        places: list[list[tuple[float, float]]], disturbance: Disturbance, ready_s: float) -> None:
    tour: list[list[Place]] = []
    for path in places:
        tour.append([tour[-1][-1] if tour else (0.5, 0.5), *path])
    cuts = cuts_of(tour)
    pose = disturbance.start((0.5, 0.5, 0.0))
    driver = TeamTwin(members_of([tour], [disturbance]), traced=True)
    driver.assign(0, lane_of(cuts), None)
    for each in cuts:
        driver.start_leg(0, ready_s, math.inf, ())
        assert driver.run().kind == "arrived"
        time_s, trace = drive(MODEL, each.leg[0], pose, disturbance, traced=True)
        leg = driver.leg(0)
        assert leg.driving_s == time_s
        assert driver.pose(0) == tuple(pose.tolist())
        assert not leg.waits
        assert leg.clock_s == ready_s + time_s
        steps = np.round(leg.since_s * CONTROL_HZ).astype(int)
        assert not len(trace) or np.array_equal(leg.pose, trace[steps - 1])
        ready_s = leg.clock_s + 1.3
    assert driver.run().kind == "idle"


def test_a_leg_of_several_hops_takes_the_sum_of_their_times() -> None:
    hops = (stretches(np.array([[0.0, 0.0], [2.0, 0.0]]), 1.0), stretches(np.array([[2.0, 0.0], [2.0, 2.0]]), 0.0))
    pose, alone = np.zeros(3), 0.0
    for hop in hops:
        alone += drive(MODEL, hop, pose, NOISY)[0]
    lane = lane_of([Cut(leg=hops, place_m=np.zeros((40, 2)), enter_s=np.arange(40.0), lasts_s=alone)])
    driver = TeamTwin([Member(model=MODEL, start=(0.0, 0.0, 0.0), disturbance=NOISY)])
    driver.assign(0, lane, None)
    driver.start_leg(0, 0.0, math.inf, ())
    driver.run()
    assert driver.leg(0).driving_s == alone
    assert driver.pose(0) == tuple(pose.tolist())
    assert driver.cell(0) == 39


@pytest.mark.parametrize("disturbance", [UNDISTURBED, NOISY], ids=["ideal", "noisy"])
def test_a_hold_stops_a_robot_where_it_is_for_as_long_as_it_lasts(disturbance: Disturbance) -> None:
    alone = TeamTwin(members_of([AHEAD], [disturbance]), traced=True)
    held = TeamTwin(members_of([AHEAD], [disturbance]), traced=True)
    door = Hold(along_m=2.0, lasts_s=5.0, cause="door")
    for driver, holds in ((alone, []), (held, [door])):
        driver.assign(0, lane_of(cuts_of(AHEAD)), None)
        driver.start_leg(0, 0.0, math.inf, holds)
        assert driver.run().kind == "arrived"
    leg = held.leg(0)
    (wait,) = leg.waits
    assert wait.hold == "door"
    assert wait.robot is None
    assert wait.lasts_s == pytest.approx(5.0 + 0.5, abs=0.5)  # braking from 0.65 m/s at 0.68 m/s2 takes 0.96 s
    assert wait.lasts_s > 5.0
    stood = leg.pose[np.argmax(np.diff(leg.since_s)), 0]
    assert stood == pytest.approx(2.0, abs=0.12 if disturbance is NOISY else 0.01)
    assert leg.driving_s == pytest.approx(alone.leg(0).driving_s, abs=1.0)
    assert leg.clock_s == pytest.approx(leg.driving_s + wait.lasts_s)


def test_a_long_leg_with_many_holds_keeps_every_pose_and_every_wait() -> None:
    # More of each than there is room for to begin with.
    tour: Tour = [[(0.0, 0.0), (60.0, 0.0)]]
    driver = TeamTwin(members_of([tour]), traced=True)
    driver.assign(0, lane_of(cuts_of(tour)), None)
    driver.start_leg(0, 0.0, math.inf, [Hold(along_m=1.0 + k, lasts_s=0.5, cause=f"door {k}") for k in range(50)])
    assert driver.run().kind == "arrived"
    leg = driver.leg(0)
    assert [wait.hold for wait in leg.waits] == [f"door {k}" for k in range(50)]
    assert [wait.x_m for wait in leg.waits] == pytest.approx([1.0 + k for k in range(50)], abs=0.4)  # from braking on
    assert len(leg.pose) > 1500
    assert (np.diff(leg.since_s) > 0).all()
    assert np.diff(leg.pose[:, 0]).max() < 0.65 / 20 + 1e-6


@pytest.mark.parametrize("along_m", [0.0, 4.0, 99.0])
def test_a_hold_at_either_end_of_a_leg_is_served_too(along_m: float) -> None:
    driver = TeamTwin(members_of([AHEAD]))
    driver.assign(0, lane_of(cuts_of(AHEAD)), None)
    driver.start_leg(0, 0.0, math.inf, [Hold(along_m=along_m, lasts_s=2.0, cause="people")] * 2)
    assert driver.run().kind == "arrived"
    assert 4.0 <= sum(wait.lasts_s for wait in driver.leg(0).waits) < 5.0  # braking for it counts


def test_a_robot_ends_when_its_driving_time_is_over_and_stands_there() -> None:
    driver = TeamTwin(members_of([AHEAD]))
    driver.assign(0, lane_of(cuts_of(AHEAD)), None)
    driver.start_leg(0, 1.0, 3.3333, ())
    happening = driver.run()
    assert (happening.kind, happening.robot, happening.clock_s) == ("ended", 0, 1.0 + 3.3333)
    assert driver.leg(0).driving_s == 3.3333
    # 3.33 s at up to 0.65 m/s, of which 0.81 s to come up to speed: 1.90 m.
    assert driver.arc_m(0) == pytest.approx(1.90, abs=0.05)
    assert driver.run().kind == "idle"


def test_a_robot_whose_driving_time_is_just_enough_arrives() -> None:
    cuts = cuts_of(AHEAD)
    for driving_s, kind in ((cuts[0].lasts_s, "arrived"), (np.nextafter(cuts[0].lasts_s, 0.0), "ended")):
        driver = TeamTwin(members_of([AHEAD]))
        driver.assign(0, lane_of(cuts), None)
        driver.start_leg(0, 0.0, float(driving_s), ())
        assert driver.run().kind == kind


def test_waiting_burns_the_idle_share_of_fuel_and_no_driving_time() -> None:
    # 10 s of fuel, of which a hold of 60 s takes a tenth of its time: after 6 s of fuel burnt there 4 are left at most.
    driver = TeamTwin(members_of([AHEAD]))
    driver.assign(0, lane_of(cuts_of(AHEAD)), None)
    driver.start_leg(0, 0.0, math.inf, [Hold(along_m=2.0, lasts_s=60.0, cause="door")], fuel_s=10.0, idle_share=0.1)
    assert driver.run().kind == "ended"
    leg = driver.leg(0)
    assert leg.driving_s + 0.1 * leg.waits[0].lasts_s == pytest.approx(10.0, abs=0.02)
    # Dry while it stands: nothing is passed over beyond that.
    driver = TeamTwin(members_of([AHEAD]))
    driver.assign(0, lane_of(cuts_of(AHEAD)), None)
    driver.start_leg(0, 0.0, math.inf, [Hold(along_m=1.0, lasts_s=600.0, cause="door")], fuel_s=10.0, idle_share=0.1)
    assert driver.run().kind == "ended"
    leg = driver.leg(0)
    assert leg.driving_s + 0.1 * leg.waits[0].lasts_s == pytest.approx(10.0, abs=0.02)
    assert driver.arc_m(0) == pytest.approx(1.0, abs=0.03)


# Teams


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(sorted(TOURS)), st.lists(st.floats(0.5, 1.2), min_size=4, max_size=4), st.floats(0.0, 0.15))
def test_whatever_their_speeds_robots_on_a_planned_order_never_touch_and_always_end(
        name: str, factors: list[float], delay_s: float) -> None:
    tours = TOURS[name]
    order = ORDERS[name]
    disturbances = [Disturbance(wheel_gains=(factor, factor), delay_s=delay_s) for factor in factors[:len(tours)]]
    mission = begun(TeamTwin(members_of(tours, disturbances)), order, 3.0)
    assert mission.go_on().kind == "idle"
    assert {happening.kind for happening in mission.happened} == {"arrived", "idle"}
    assert [len(legs) for legs in mission.legs.values()] == [len(lane.cuts) for lane in order.lanes]


ORDERS = {name: planned(tours, 3.0) for name, tours in TOURS.items()}


@pytest.mark.parametrize("name", TOURS)
def test_robots_that_drive_as_planned_end_when_planned(name: str) -> None:
    order = ORDERS[name]
    mission = begun(TeamTwin(members_of(TOURS[name])), order, 3.0)
    mission.go_on()
    # A gate lets a robot in when the other is out, the plan keeps 0.3 s between them.
    assert mission.ends_s == pytest.approx(order.ends_s - 3.0, abs=3.0)


def test_without_gates_the_same_robots_touch() -> None:
    mission = Mission(TeamTwin(members_of(CROSSING)), ORDERS["crossing"].lanes)
    mission.begin(None)
    happening = mission.go_on()
    assert (happening.kind, happening.robot, happening.other) == ("touch", 0, 1)
    # Told once for the encounter: they stay within each other for a while.
    rest = mission.go_on()
    assert rest.kind in ("touch", "idle")
    assert rest.clock_s > happening.clock_s + 1.0


def test_a_wait_names_the_robot_that_is_waited_for_and_takes_no_driving_time() -> None:
    order = ORDERS["crossing"]
    free, gated = (Mission(TeamTwin(members_of(CROSSING)), order.lanes) for _ in range(2))
    free.begin(None)
    while free.go_on().kind != "idle":
        pass
    gated.begin(order)
    gated.go_on()
    waits = [(robot, wait) for robot, legs in gated.legs.items() for leg in legs for wait in leg.waits]
    assert waits
    assert all(wait.robot == 1 - robot and not wait.hold for robot, wait in waits)
    for robot in (0, 1):
        ready_s = 0.0
        for one, other in zip(free.legs[robot], gated.legs[robot], strict=True):
            assert other.driving_s <= one.driving_s + 1.2 * len(other.waits)  # it comes up to speed again
            assert other.clock_s == pytest.approx(
                ready_s + other.driving_s + sum(wait.lasts_s for wait in other.waits))
            ready_s = other.clock_s


def test_two_teams_drive_alike_to_the_bit() -> None:
    ends = []
    for _ in range(2):
        mission = begun(TeamTwin(members_of(DOOR, [NOISY] * 4)), ORDERS["door"], 1.0)
        mission.go_on()
        ends.append((mission.happened, [mission.driver.pose(robot) for robot in range(4)]))
    assert ends[0] == ends[1]


def begun_with_a_timer(name: str, at_s: float, disturbance: Disturbance) -> Mission:
    """A mission of a test's tours, and a robot far away that ends after a time, at which the team is stopped for it."""
    tours, order = TOURS[name], ORDERS[name]
    far: Tour = [[(100.0, 0.0), (100.0 + at_s, 0.0)]]
    mission = Mission(TeamTwin(members_of([*tours, far], [disturbance] * len(tours) + [UNDISTURBED])), order.lanes,
                      stop_s=1.0)
    driver = mission.driver
    for robot, lane in enumerate(order.lanes):
        driver.assign(robot, lane, [*order.needs[robot], np.zeros(len(lane.enter_s), dtype=np.int64)])
        mission.legs[robot] = []
        driver.start_leg(robot, 0.0, math.inf, ())
    driver.assign(len(tours), lane_of(cuts_of(far)), None)
    driver.start_leg(len(tours), 0.0, at_s, ())
    assert mission.go_on().kind == "ended"
    assert driver.clock_s == pytest.approx(at_s, abs=TICK_S)
    return mission


def at_rest(mission: Mission) -> list[int]:
    """Brake the team until it rests; who arrived meanwhile."""
    arrived = []
    mission.driver.brake(on=True)
    while (happening := mission.driver.run()).kind == "arrived":
        arrived.append(happening.robot)
        mission.legs[happening.robot].append(mission.driver.leg(happening.robot))
    assert happening.kind == "rest"
    return arrived


@pytest.mark.parametrize("at_s", [0.5, 2.0, 4.0, 7.0, 9.5, 13.0])
@pytest.mark.parametrize("name", TOURS)
def test_the_brake_brings_all_to_rest_within_their_gates_and_then_they_go_on(name: str, at_s: float) -> None:
    mission, order = begun_with_a_timer(name, at_s, NOISY), ORDERS[name]
    driver, robots = mission.driver, range(len(order.lanes))
    braked_s, before = driver.clock_s, [driver.arc_m(robot) for robot in robots]
    arrived = at_rest(mission)
    assert driver.clock_s - braked_s < 1.2  # from 0.65 m/s at 0.8 m/s2, and a delay
    stood = [driver.pose(robot) for robot in robots]
    assert all(driver.arc_m(robot) - before[robot] < 0.4 for robot in robots)
    assert driver.run().kind == "rest"
    assert [driver.pose(robot) for robot in robots] == stood
    for robot in robots:
        for other in robots:
            assert other == robot or driver.cell(other) >= order.needs[robot][other][driver.cell(robot)]
    driver.brake(on=False)
    for robot in arrived:
        if len(mission.legs[robot]) < len(order.lanes[robot].cuts):
            driver.start_leg(robot, driver.clock_s, math.inf, ())
    assert mission.go_on().kind == "idle"
    assert [len(mission.legs[robot]) for robot in robots] == [len(lane.cuts) for lane in order.lanes]


@pytest.mark.parametrize("at_s", [2.0, 4.0, 7.0])
def test_from_rest_robots_take_other_lanes_in_another_order(at_s: float) -> None:
    mission = begun_with_a_timer("crossing", at_s, UNDISTURBED)
    driver = mission.driver
    at_rest(mission)
    new = [(cut(MODEL, (stretches(np.array([driver.pose(robot)[:2], place]), 0.0),), driver.pose(robot)),)
           for robot, place in enumerate([(-4.0, -1.0), (-4.0, 1.0)])]
    order = plan_order([Itinerary(radius_m=MODEL.radius_m, legs=(legs,), stop_s=(0.0,), ready_s=driver.clock_s,
                                  place_m=driver.pose(robot)[:2]) for robot, legs in enumerate(new)], 0.2)
    assert order is not None
    again = Mission(driver, order.lanes)
    driver.brake(on=False)
    for robot, lane in enumerate(order.lanes):
        driver.assign(robot, lane, [*order.needs[robot], np.zeros(len(lane.enter_s), dtype=np.int64)])
        again.legs[robot] = []
        assert (driver.cell(robot), driver.arc_m(robot), driver.leg(robot).driving_s) == (0, 0.0, 0.0)
    for robot in (0, 1):
        driver.start_leg(robot, driver.clock_s, math.inf, ())
    assert again.go_on().kind == "idle"
    assert again.ends_s == pytest.approx(order.ends_s, abs=2.0)
    assert math.dist(driver.pose(0)[:2], (-4.0, -1.0)) < 0.05


def test_a_dropped_robot_is_waited_for_by_nobody_and_stays_where_it_was() -> None:
    # The first into the corridor stops for good on its way in: the others wait for it until it is dropped.
    order = ORDERS["corridor"]
    first = min(range(3), key=lambda robot: order.lanes[robot].enter_s[30])
    for dropped in (False, True):
        mission = Mission(TeamTwin(members_of(CORRIDOR)), order.lanes)
        for robot, lane in enumerate(order.lanes):
            mission.driver.assign(robot, lane, order.needs[robot])
            mission.legs[robot] = []
        for robot in range(3):
            mission.driver.start_leg(robot, 0.0, 2.0 if robot == first else math.inf, ())
        assert mission.go_on().kind == "ended"
        place = mission.driver.pose(first)
        if not dropped:
            assert mission.go_on().kind == "deadlock"
            continue
        mission.driver.drop(first)
        while (kind := mission.go_on().kind) == "touch":  # they drive through it
            pass
        assert kind == "idle"
        assert mission.driver.pose(first) == place
        assert [len(mission.legs[robot]) for robot in range(3)].count(2) == 2


def test_who_waits_goes_on_when_the_robot_that_it_waits_for_is_dropped_while_all_stand() -> None:
    # The first into the corridor stands at a door until it is dry; by then all others stand before the corridor.
    order = ORDERS["corridor"]
    first = min(range(3), key=lambda robot: order.lanes[robot].enter_s[30])
    mission = Mission(TeamTwin(members_of(CORRIDOR)), order.lanes)
    for robot, lane in enumerate(order.lanes):
        mission.driver.assign(robot, lane, order.needs[robot])
        mission.legs[robot] = []
    for robot in range(3):
        holds, fuel_s = ([Hold(along_m=3.0, lasts_s=900.0, cause="door")], 60.0) if robot == first else ([], math.inf)
        mission.driver.start_leg(robot, 0.0, math.inf, holds, fuel_s=fuel_s, idle_share=0.5)
    assert mission.go_on().kind == "ended"
    ended_s = mission.driver.clock_s
    mission.driver.drop(first)
    while (happening := mission.go_on()).kind == "touch":  # they drive through it
        pass
    assert happening.kind == "idle"
    assert ended_s > 90
    assert [len(mission.legs[robot]) for robot in range(3)].count(2) == 2


def test_a_robot_that_stays_where_it_is_has_a_lane_without_legs_and_is_in_the_way() -> None:
    # It stands beside the way of another, within reach of its hull: no order, for it never leaves.
    beside, clear = (2.0, 0.2), (2.0, 2.0)
    moving = Itinerary(radius_m=MODEL.radius_m, legs=tuple((each,) for each in cuts_of(AHEAD)), stop_s=(0.0,),
                       ready_s=0.0, place_m=(0.0, 0.0))
    for place, kinds in ((clear, ["arrived", "idle"]), (beside, ["touch", "arrived", "idle"])):
        order = plan_order([moving, Itinerary(radius_m=MODEL.radius_m, legs=(), stop_s=(), ready_s=0.0,
                                              place_m=place)], 0.2)
        assert (order is None) == (place == beside)
        driver = TeamTwin([*members_of([AHEAD]), Member(model=MODEL, start=(*place, 0.0))])
        driver.assign(0, lane_of(cuts_of(AHEAD)) if order is None else order.lanes[0],
                      None if order is None else order.needs[0])
        driver.assign(1, None if order is None else order.lanes[1], None if order is None else order.needs[1])
        driver.start_leg(0, 0.0, math.inf, ())
        assert [driver.run().kind for _ in kinds] == kinds
        with pytest.raises(ValueError, match="no leg left"):
            driver.start_leg(1, 0.0, math.inf, ())


@pytest.mark.parametrize("numbers", list(permutations(range(3))))
def test_whoever_waits_for_a_dropped_robot_goes_on_at_once_whatever_their_numbers(numbers: tuple[int, ...]) -> None:
    # The others stand at their gates when the first stops for good; robots of lower numbers have their command of that
    # control step already.
    tours = [CORRIDOR[k] for k in numbers]
    order = planned(tours, 0.0)
    first = min(range(3), key=lambda robot: order.lanes[robot].enter_s[30])
    mission = Mission(TeamTwin(members_of(tours)), order.lanes)
    for robot, lane in enumerate(order.lanes):
        mission.driver.assign(robot, lane, order.needs[robot])
        mission.legs[robot] = []
        mission.driver.start_leg(robot, 0.0, 9.0 if robot == first else math.inf, ())
    happening = mission.go_on()
    assert happening.kind == "ended"
    mission.driver.drop(first)
    while (kind := mission.go_on().kind) == "touch":
        pass
    assert kind == "idle"
    for robot in {0, 1, 2} - {first}:
        for wait in mission.legs[robot][0].waits:
            if wait.robot == first:
                assert wait.since_s + wait.lasts_s <= happening.clock_s + 2 * TICK_S


class InSlices(TeamTwin):
    """Comes back at many times, and is told to go on each time."""

    def run(self, until_s: float = math.inf) -> Happening:
        while (happening := super().run(min(until_s, self.clock_s + 0.37))).kind == "time" and self.clock_s < until_s:
            if not self._robots["doing"].any():
                return super().run()
        return happening


@pytest.mark.parametrize("name", TOURS)
def test_coming_back_at_some_time_changes_nothing(name: str) -> None:
    # Holds and stops too, in which time is passed over.
    tours, order, seen = TOURS[name], ORDERS[name], []
    for driver in (TeamTwin(members_of(tours, [NOISY] * len(tours)), traced=True),
                   InSlices(members_of(tours, [NOISY] * len(tours)), traced=True)):
        mission = Mission(driver, order.lanes, stop_s=1.1)
        mission.begin(order, {0: [Hold(along_m=1.0, lasts_s=5.0, cause="door")]})
        assert mission.go_on().kind == "idle"
        seen.append([(leg.driving_s, leg.clock_s, leg.waits, leg.since_s.tolist(), leg.pose.tolist())
                     for legs in mission.legs.values() for leg in legs])
        assert len(mission.happened) == sum(len(lane.cuts) for lane in order.lanes) + 1
    assert seen[0] == seen[1]


@pytest.mark.parametrize("until_s", [0.0, 1.0, 1.001, 100.0])
def test_it_comes_back_at_the_first_control_step_from_a_time_on(until_s: float) -> None:
    driver = TeamTwin(members_of([AHEAD]))
    driver.assign(0, lane_of(cuts_of(AHEAD)), None)
    driver.start_leg(0, 0.5, math.inf, ())
    happening = driver.run(until_s)
    if until_s == 100.0:  # beyond its arrival; nobody has anything to do after that, and time goes on
        assert happening.kind == "arrived"
        happening = driver.run(until_s)
    assert happening.kind == "time"
    assert until_s <= driver.clock_s < until_s + TICK_S
    assert driver.run(until_s).kind == "time"  # it is late enough
    assert driver.run().kind == ("idle" if until_s == 100.0 else "arrived")


def test_time_in_which_all_stand_is_passed_over() -> None:
    # An hour at a stop and an hour at a hold are not driven through: ten million control steps would take a second.
    driver = TeamTwin(members_of([AHEAD]))
    driver.assign(0, lane_of(cuts_of(AHEAD)), None)
    driver.start_leg(0, 3.6e6, math.inf, [Hold(along_m=2.0, lasts_s=3.6e6, cause="door")])
    happening = driver.run()
    assert happening.kind == "arrived"
    assert happening.clock_s == pytest.approx(7.2e6 + cuts_of(AHEAD)[0].lasts_s, abs=2.0)


def test_a_leg_is_not_started_twice_nor_beyond_the_last() -> None:
    driver = TeamTwin(members_of([AHEAD]))
    with pytest.raises(ValueError, match="no leg left"):
        driver.start_leg(0, 0.0, math.inf, ())
    driver.assign(0, lane_of(cuts_of(AHEAD)), None)
    driver.start_leg(0, 0.0, math.inf, ())
    with pytest.raises(ValueError, match="drives one yet"):
        driver.start_leg(0, 0.0, math.inf, ())
    driver.run()
    with pytest.raises(ValueError, match="no leg left"):
        driver.start_leg(0, 0.0, math.inf, ())


def test_a_robot_of_another_speed_keeps_its_own_figures() -> None:
    mission = begun(TeamTwin(members_of(CROSSING, [geared(0.5), geared(1.0)])), ORDERS["crossing"])
    assert mission.go_on().kind == "idle"
    assert mission.legs[0][0].driving_s > 1.6 * mission.legs[1][0].driving_s
