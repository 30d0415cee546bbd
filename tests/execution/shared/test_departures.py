"""Staggered departures: who is planned to wait on its first leg leaves later, and is nowhere later for it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sva_bench.execution.outcome import RobotFate
from sva_bench.execution.rules import settle
from sva_bench.execution.shared.crossings import foresee
from sva_bench.execution.shared.departures import EARLY_S, staggered
from sva_bench.execution.shared.earliest import SPARE_S
from sva_bench.execution.shared.lanes import Order
from sva_bench.execution.shared.planning import first_order
from sva_bench.execution.shared.truncation import cut_off
from sva_bench.world.model import World
from tests.execution.shared.invariants import broken, fates_of, played, ways_of
from tests.execution.shared.random_missions import Ready, mission_in, random_mission
from tests.execution.shared.teams import CORRIDOR, CROSSING, DOOR, SURE, Asked, Stage, planned
from tests.execution.shared.test_random_missions import same_missions

FEW = (0, 8, 18, 22, 29, 54, 87, 105, 133, 193)  # worlds in which somebody leaves later, of all kinds
TOURS = (("corridor", CORRIDOR), ("door", DOOR), ("crossing", CROSSING))
TICK_S = 1 / 60


def leaving_later(ready: Ready) -> Ready:
    return replace(ready, world=replace(ready.world, departures="staggered"))


@cache
def drawn(seed: int) -> Ready:
    ready = random_mission(seed)
    assert ready is not None
    return ready


@cache
def orders_planned() -> list[tuple[str, Order]]:
    found = [(name, planned(tours, 3.0)) for name, tours in TOURS]
    for seed in FEW:
        ready = drawn(seed)
        order = first_order(ways_of(ready), ready.orders, [bool(own.route) for own in ready.orders])
        assert order is not None
        found.append((f"seed {seed}", order))
    return found


def entered(order: Order, departs: tuple[float, ...]) -> np.ndarray:
    """When cells are entered, everybody as early as the gates allow."""
    crossings, robots = order.crossings, len(order.lanes)
    enter_s = np.full(len(crossings.stay_s), -math.inf)
    foresee(crossings.first, crossings.stay_s, crossings.needs(crossings.second), np.zeros(robots, dtype=np.int64),
            crossings.stay_s[crossings.first[:-1]] + departs, np.zeros(robots, dtype=np.bool_), SPARE_S, enter_s)
    return enter_s


@pytest.mark.long
def test_nobody_is_planned_to_be_later_at_a_stop_and_no_other_robot_anywhere() -> None:
    later = 0
    for name, order in orders_planned():
        departs, first = staggered(order), order.crossings.first
        at_once, then = entered(order, (0.0,) * len(departs)), entered(order, departs)
        for robot, (lane, depart) in enumerate(zip(order.lanes, departs, strict=True)):
            later += depart > 0
            stops = first[robot] + lane.first_cell[1:] - 1
            assert (then[stops] <= at_once[stops] + 1e-6).all(), name
            # One leaves later at a time, too: nobody counts on another's delay.
            alone = entered(order, tuple(depart if k == robot else 0.0 for k in range(len(departs))))
            for other in range(len(departs)):
                if other != robot:
                    cells = slice(first[other], first[other + 1])
                    assert (alone[cells] <= at_once[cells] + 1e-6).all(), name
    assert later >= 6


def test_who_waits_for_nobody_leaves_at_once() -> None:
    assert staggered(planned([CROSSING[0]], 1.0)) == (0.0,)
    apart = [CROSSING[0], [[(20.0, 20.0), (24.0, 20.0)]]]
    assert staggered(planned(apart, 1.0)) == (0.0, 0.0)


@pytest.mark.long
def test_a_wait_shorter_than_what_is_kept_in_hand_delays_nobody() -> None:
    for _, order in orders_planned():
        for robot, depart in enumerate(staggered(order)):
            lane = order.lanes[robot]
            waits = lane.enter_s[lane.first_cell[1] - 1] if lane.cuts else 0.0
            assert depart <= max(waits - EARLY_S, 0.0)


@pytest.mark.spread(2)
@pytest.mark.parametrize("seed", FEW)
def test_no_mission_that_is_staggered_breaks_a_rule(seed: int) -> None:
    ready = drawn(seed)
    for fate, rollout in [(tuple(RobotFate() for _ in ready.orders), 0), *fates_of(ready, seed, 2, rollouts=2)]:
        mission = played(leaving_later(ready), seed, fate, rollout)
        assert not broken(leaving_later(ready), mission)
        for own, driven, outcome in zip(ready.orders, mission.driven, mission.robots, strict=True):
            assert outcome.end == "failed" or not own.route or outcome.events[0].time_s == driven.start_s
        if mission.replanned:
            continue
        for own, driven, outcome, each in zip(ready.orders, mission.driven, mission.robots, fate, strict=True):
            if own.route and each == RobotFate():  # what its legs say without the others
                assert settle(own, driven).end_time_s == pytest.approx(outcome.end_time_s, abs=1e-9)


@pytest.mark.long
def test_a_mission_cut_off_at_a_failure_is_the_mission_played_with_it() -> None:
    cut = 0
    for seed in FEW:
        ready, ways = leaving_later(drawn(seed)), ways_of(drawn(seed))
        sure = tuple(RobotFate() for _ in ready.orders)
        whole = played(ready, seed, sure, 0)
        for number, own in enumerate(ready.orders):
            last = sum(own.is_poi(site) for site in own.route)  # each fails on leaving for its last POI
            fates = tuple(RobotFate(before_poi=last) if k == number and last else each for k, each in enumerate(sure))
            shorter = None if fates == sure else cut_off(ways, ready.orders, whole, fates)
            if shorter is not None:
                cut += shorter.driven[number].start_s > 0
                assert same_missions(shorter, played(ready, seed, fates, 0)), f"seed {seed}"
    assert cut


def doorway() -> Ready:
    """Two robots go one after the other into a chamber behind a door, in which there is room for one; without noise."""
    walls = [{"box": [9, 1.6], "size_m": [6, 3.8]}, {"box": [9, 6.4], "size_m": [6, 3.8]}]
    robot = {"model": "turtlebot2", "availability": 0.9, "fuel_capacity_s": 500, "mission_limit_s": 500,
             "idle_share": 0.2, "incentives": {f"p{k}": 10 for k in (1, 2)}}
    return mission_in({
        "map": {"shapes": {"bounds_m": [0, 0, 12, 8], "obstacles": walls}},
        "sites": {"base": {"at_m": [2, 4]}, "pois": {
            "p1": {"at_m": [11.2, 4], "stop_s": 10}, "p2": {"at_m": [10.8, 4], "stop_s": 10}}},
        "robots": {"uv1": robot, "uv2": robot}}, {"uv1": ("base", "p1", "base"), "uv2": ("base", "p2", "base")})


def test_who_would_wait_at_a_door_stands_at_its_berth_instead_and_comes_home_no_later() -> None:
    ready = doorway()
    fates = (RobotFate(), RobotFate())
    together, later = (played(each, 0, fates, 0) for each in (ready, leaving_later(ready)))
    assert max(driven.start_s for driven in later.driven) > 1.0
    assert later.waited_s < together.waited_s - 1.0
    for number, (before, after) in enumerate(zip(together.robots, later.robots, strict=True)):
        assert after.end_time_s <= before.end_time_s + TICK_S
        # From its departure on it takes less, and burns no idle share before.
        assert after.end_time_s - later.driven[number].start_s <= before.end_time_s + TICK_S
        assert after.fuel_used_s <= before.fuel_used_s + TICK_S
    assert sum(o.fuel_used_s for o in later.robots) < sum(o.fuel_used_s for o in together.robots)
    assert not broken(leaving_later(ready), later)


def test_robots_that_nobody_coordinates_all_leave_at_once() -> None:
    world: World = leaving_later(doorway()).world
    assert world.unfit_departures is False
    assert replace(world, interaction="uncoordinated").unfit_departures is True


CHAMBER = {"uv1": ("base", "p1", "base"), "uv2": ("base", "p2", "base")}
ON_LEAVING = RobotFate(before_poi=1)


def test_a_robot_that_is_told_of_a_failure_before_anybody_has_left_waits_for_the_dead_no_more() -> None:
    stage = Stage(leaving_later(doorway()).world)
    asked = Asked(lambda state: {"uv1": ("p1", "p2", "base")} if state.time_s == 0 else {})
    later = stage.told(CHAMBER, (SURE, SURE), "instant", asked)
    assert later.robots[0].events[0].time_s > 5.0
    assert not asked.states
    told = stage.told(CHAMBER, (SURE, ON_LEAVING), "instant", asked)
    assert [reaction.time_s for reaction in told.reactions] == [0.0]
    assert (told.robots[0].events[0].kind, told.robots[0].events[0].time_s) == ("departed", 0.0)
    assert told.stops[0] == ("base", "p1", "p2", "base")
    assert told.robots[0].end == "home"


def test_a_robot_that_has_not_left_yet_takes_new_orders_at_its_berth() -> None:
    stage = Stage(leaving_later(doorway()).world)
    asked = Asked(lambda state: {"uv1": ("p1", "p2", "base")} if state.robots else {})
    told = stage.told(CHAMBER, (SURE, RobotFate(lifetime_s=3.0)), "instant", asked)
    (reaction,) = told.reactions
    left_s = told.robots[0].events[0].time_s
    assert reaction.time_s == pytest.approx(3.0, abs=0.1)
    assert left_s > 5.0
    assert reaction.since == {"uv1": "base"}
    assert told.stops[0] == ("base", "p1", "p2", "base")
    assert told.robots[0].end == "home"
