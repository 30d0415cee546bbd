"""The rules of one mission, each by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sva_bench.execution.outcome import Assignment, Driven, RobotFate
from sva_bench.execution.rules import LegDriven, RobotMission, settle
from sva_bench.mission.failures import NEVER

ROUTE = ("base", "p1", "r1", "p2", "base")
TIMES = {("base", "p1"): 10.0, ("p1", "r1"): 8.0, ("r1", "p2"): 6.0, ("p2", "base"): 12.0, ("p1", "p2"): 5.0,
         ("base", "p2"): 7.0, ("p1", "base"): 9.0}


def orders(robot: str = "uv1", route: tuple[str, ...] = ROUTE, *, fuel: float = 20.0, limit: float = 50.0
           ) -> Assignment:
    return Assignment(robot=robot, route=route, stations=frozenset({"r1"}), incentives={"p1": 5.0, "p2": 7.0},
                      stop_s={"base": 0.0, "p1": 1.0, "r1": 4.0, "p2": 2.0}, fuel_capacity_s=fuel,
                      mission_limit_s=limit)


def begun(*legs: float, fuel: float = 20.0, limit: float = 50.0, fails: int = NEVER, lifetime: float = math.inf
          ) -> RobotMission:
    """A mission after some legs."""
    mission = RobotMission(orders(fuel=fuel, limit=limit), RobotFate(fails, lifetime))
    for time_s in legs:
        assert mission.depart() is not None
        mission.drive(LegDriven(time_s))
    return mission


def test_a_robot_departs_for_the_next_stop_of_its_orders() -> None:
    mission = begun()
    assert mission.depart() == "p1"
    assert (mission.site, mission.clock_s, mission.ahead) == ("base", 0.0, ("p1", "r1", "p2", "base"))


def test_it_fails_where_its_driven_time_reaches_its_lifetime_on_any_leg() -> None:
    # Driven to p1 at 10 s, r1 at 18, p2 at 24, home at 36; stops of 1 s, 4 s and 2 s age nobody.
    for lifetime, stops, incentive, clock in ((3.0, 0, 0.0, 3.0), (12.0, 1, 5.0, 13.0), (20.0, 2, 5.0, 25.0),
                                              (30.0, 3, 12.0, 37.0)):
        outcome = begun(*(10.0, 8.0, 6.0, 12.0)[: stops + 1], lifetime=lifetime).outcome()
        assert (outcome.end, outcome.lost, outcome.available) == ("failed", True, False)
        assert (outcome.stops_reached, outcome.incentive) == (stops, incentive)
        assert (outcome.end_time_s, outcome.fuel_used_s) == (clock, lifetime)
    assert begun(10.0, 8.0, 6.0, 12.0, lifetime=36.5).outcome().end == "home"


def test_without_any_lifetime_it_fails_at_once_on_its_first_leg_and_is_lost() -> None:
    outcome = begun(10.0, lifetime=0.0).outcome()
    assert (outcome.end, outcome.lost, outcome.end_time_s, outcome.fuel_used_s) == ("failed", True, 0.0, 0.0)


def test_it_collects_where_its_lifetime_ends_on_arrival_and_fails_on_setting_off() -> None:
    outcome = begun(10.0, 8.0, lifetime=10.0).outcome()
    assert (outcome.end, outcome.incentive, outcome.end_time_s, outcome.fuel_used_s) == ("failed", 5.0, 11.0, 10.0)


def test_what_comes_first_on_a_leg_ends_it() -> None:
    # The tank of 15 s is empty 5 s after p1.
    assert begun(10.0, 8.0, fuel=15.0, lifetime=14.0).outcome().end == "failed"
    assert begun(10.0, 8.0, fuel=15.0, lifetime=16.0).outcome().end == "out_of_fuel"
    for lifetime, end in ((12.0, "failed"), (14.0, "stuck")):
        mission = begun(10.0, lifetime=lifetime)
        mission.drive(LegDriven(3.0, stuck=True))
        assert mission.outcome().end == end


def test_a_lost_robot_costs_and_one_that_never_left_does_not() -> None:
    def value(fate: RobotFate, fuel: float = 20.0, limit: float = 50.0) -> float:
        priced = replace(orders(fuel=fuel, limit=limit), loss_cost=100.0)
        return settle(priced, driven(0, ROUTE), fate).value

    assert value(RobotFate()) == 12.0
    assert value(RobotFate(), limit=30.0) == 5.0  # late: it comes home
    assert value(RobotFate(before_poi=0)) == 0.0
    assert value(RobotFate(before_poi=1)) == -100.0
    assert value(RobotFate(before_poi=2)) == -95.0
    assert value(RobotFate(lifetime_s=30.0)) == -88.0
    assert value(RobotFate(), fuel=15.0) == -95.0  # out of fuel


def test_it_arrives_and_its_stop_takes_time_but_no_fuel() -> None:
    mission = begun(10.0)
    assert (mission.site, mission.clock_s, mission.fuel_s, mission.tank_s) == ("p1", 11.0, 10.0, 10.0)


def test_it_collects_when_its_stop_is_over_within_the_limit() -> None:
    assert begun(10.0, limit=11.0).incentive == 5.0
    assert begun(10.0, limit=10.9).incentive == 0.0


def test_it_refuels_at_a_station() -> None:
    assert begun(10.0, 8.0).tank_s == 20.0


def test_it_fails_on_leaving_for_the_poi_in_question_and_is_lost() -> None:
    mission = begun(10.0, 8.0, fails=2)  # uv1 leaves p1 for the station, which is no POI
    assert mission.depart() is None
    outcome = mission.outcome()
    assert (outcome.end, outcome.lost, outcome.available, outcome.incentive) == ("failed", True, False, 5.0)


def test_a_robot_that_fails_at_the_base_never_left_and_is_not_lost() -> None:
    outcome = begun(fails=0).outcome()
    assert (outcome.end, outcome.lost) == ("failed", False)


def test_it_runs_dry_on_the_way_and_is_lost() -> None:
    outcome = begun(10.0, 8.0, fuel=15.0).outcome()
    assert (outcome.end, outcome.lost, outcome.end_time_s, outcome.fuel_used_s) == ("out_of_fuel", True, 16.0, 15.0)


def test_it_gets_stuck_and_is_lost() -> None:
    mission = begun(10.0)
    mission.drive(LegDriven(4.0, stuck=True, contacts=3))
    outcome = mission.outcome()
    assert (outcome.end, outcome.lost, outcome.end_time_s, outcome.contacts) == ("stuck", True, 15.0, 3)


def test_it_comes_home_late_or_in_time_and_is_not_lost() -> None:
    for limit, end in ((43.0, "home"), (42.0, "late")):
        outcome = begun(10.0, 8.0, 6.0, 12.0, limit=limit).outcome()
        assert (outcome.end, outcome.lost, outcome.end_time_s) == (end, False, 43.0)


def test_a_mission_that_goes_on_has_no_outcome() -> None:
    with pytest.raises(ValueError, match="not over"):
        begun(10.0).outcome()


def driven(number: int, route: tuple[str, ...]) -> Driven:
    times = [TIMES[leg] + number for leg in pairwise(route)]
    return Driven(leg_s=np.array(times), stuck=False, leg_of=np.empty(0), clock_s=np.empty(0), pose=np.empty((0, 3)))
