"""The rules of one mission, each by hand."""

from __future__ import annotations

import pytest

from sva_bench.execution.outcome import Assignment, RobotFate
from sva_bench.execution.rules import LegDriven, RobotMission
from sva_bench.mission.failures import NEVER

ROUTE = ("base", "p1", "r1", "p2", "base")
TIMES = {("base", "p1"): 10.0, ("p1", "r1"): 8.0, ("r1", "p2"): 6.0, ("p2", "base"): 12.0, ("p1", "p2"): 5.0,
         ("base", "p2"): 7.0, ("p1", "base"): 9.0}


def orders(robot: str = "uv1", route: tuple[str, ...] = ROUTE, *, fuel: float = 20.0, limit: float = 50.0
           ) -> Assignment:
    return Assignment(robot=robot, route=route, stations=frozenset({"r1"}), incentives={"p1": 5.0, "p2": 7.0},
                      stop_s={"base": 0.0, "p1": 1.0, "r1": 4.0, "p2": 2.0}, fuel_capacity_s=fuel,
                      mission_limit_s=limit)


def begun(*legs: float, fuel: float = 20.0, limit: float = 50.0, fails: int = NEVER) -> RobotMission:
    """A mission after some legs."""
    mission = RobotMission(orders(fuel=fuel, limit=limit), RobotFate(fails))
    for time_s in legs:
        assert mission.depart() is not None
        mission.drive(LegDriven(time_s))
    return mission


def test_a_robot_departs_for_the_next_stop_of_its_orders() -> None:
    mission = begun()
    assert mission.depart() == "p1"
    assert (mission.site, mission.clock_s, mission.ahead) == ("base", 0.0, ("p1", "r1", "p2", "base"))


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
