"""Places where robots that share a world block one another: what is reported of fleets, and what is hard by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import pytest

from sva_bench.execution.outcome import RobotFate
from sva_bench.execution.shared import mission as mission_module
from sva_bench.execution.shared import planning
from sva_bench.execution.shared.planning import Onward
from sva_bench.execution.shared.players import TeamDriven
from sva_bench.execution.shared.switching import Switching
from sva_bench.mission.plan import Route
from sva_bench.travel.berths import NoRoomForBerths
from tests.execution.shared.invariants import broken, played
from tests.execution.shared.random_missions import Ready, mission_in

Box = tuple[float, float, float, float]
"""Middle and size [m]."""
CORRIDOR: Sequence[Box] = ((6, 1.3, 4, 2.6), (6, 4.7, 4, 2.6))  # 0.8 m wide, from x = 4 to 8, at y = 3
DOOR: Sequence[Box] = ((6, 1.3, 0.2, 2.6), (6, 4.7, 0.2, 2.6))  # as wide
BLIND: Sequence[Box] = (*CORRIDOR, (10, 3, 4, 6))  # the corridor ends at x = 8
ROOMS: Sequence[Box] = (*DOOR, (9, 1.3, 0.2, 2.6), (9, 4.7, 0.2, 2.6))


def world(boxes: Sequence[Box], robots: int, pois: Mapping[str, tuple[float, float]], *,
          base: tuple[float, float] = (2, 3), station: tuple[float, float] | None = None, noise: Any = None,
          **robot: Any) -> dict[str, Any]:
    """A world of 12 by 6 m."""
    return {
        "noise": noise or {}, "map": {"shapes": {"bounds_m": [0, 0, 12, 6], "obstacles": [
            {"box": [x, y], "size_m": [wide, deep]} for x, y, wide, deep in boxes]}},
        "sites": {"base": {"at_m": list(base)},
                  "stations": {} if station is None else {"r1": {"at_m": list(station), "stop_s": 5, "charge_rate": 5}},
                  "pois": {name: {"at_m": list(place), "stop_s": 2} for name, place in pois.items()}},
        "robots": {f"uv{k + 1}": {"model": "turtlebot2", "availability": 0.9, "mission_limit_s": 900,
                                  "fuel_capacity_s": 500, "incentives": dict.fromkeys(pois, 10), **robot}
                   for k in range(robots)}}


def routes(*tours: Sequence[str]) -> dict[str, Route]:
    return {f"uv{k + 1}": ("base", *tour, "base") for k, tour in enumerate(tours)}


FAR = {f"p{k + 1}": (8.8 + 1.2 * (k // 3), 0.9 + 2.1 * (k % 3)) for k in range(6)}
NEAR = {"q1": (0.8, 5.2), "q2": (3.2, 0.8), "q3": (3.2, 5.2)}


@cache
def place(name: str) -> Ready:
    """The missions by name: no robot fails in them unless it is told to."""
    match name:
        case "head on in a corridor":  # each turns round at once on the other side, and meets the next
            return mission_in(world(CORRIDOR, 3, FAR | NEAR), routes(
                ("p1", "q1", "p4"), ("p2", "q2", "p5"), ("q3", "p3", "p6")))
        case "one door for all":
            return mission_in(world(DOOR, 5, FAR), routes(("p1",), ("p2", "p6"), ("p3",), ("p4",), ("p5",)))
        case "two fleets at one door":  # three cross it to and fro, three are at home on this side for a while
            return mission_in(world(DOOR, 6, FAR | NEAR), routes(
                ("p1", "q1"), ("p2", "q2"), ("p3", "q3"), ("q1", "p4"), ("q2", "p5"), ("q3", "p6")))
        case "a station in a dead end":
            return mission_in(world(BLIND, 3, NEAR, station=(7.3, 3)), routes(
                ("q1", "r1", "q2"), ("r1", "q3"), ("q2", "r1", "q1")))
        case "sites in a corridor":
            return mission_in(world(CORRIDOR, 3, {"c1": (5, 3), "c2": (6, 3), "c3": (7, 3)} | FAR), routes(
                ("c1", "p1", "c3"), ("c2", "p2"), ("c3", "c2", "c1")))
        case "two doors":
            return mission_in(world(ROOMS, 4, {"m1": (7.5, 1.5), "m2": (7.5, 4.5)} | {
                "e1": (10.5, 1), "e2": (10.5, 3), "e3": (10.5, 5)}, station=(7.5, 3)), routes(
                ("m1", "e1"), ("e2", "r1", "m2"), ("e3", "r1"), ("r1", "m1", "e1")))
        case "drifted localisation at a crossing":
            return mission_in(world((), 4, {"a": (11, 1), "b": (11, 5), "c": (6, 5.3), "d": (6, 0.7)}, noise={
                "localisation": {"sd_m": 0.12, "length_m": 1.5}, "speed_gain_sd": 0.03}), routes(
                    ("a", "c"), ("b", "d"), ("c", "a"), ("d", "b")))
        case "a base in a doorway":
            return mission_in(world(DOOR, 3, FAR | NEAR, base=(6, 3)), routes(("p1", "q1"), ("q2", "p2"), ("p3", "q3")))
    raise ValueError(name)


PLACES = ("head on in a corridor", "one door for all", "two fleets at one door", "a station in a dead end",
          "sites in a corridor", "two doors", "drifted localisation at a crossing", "a base in a doorway")


def sound(name: str, fates: Mapping[int, RobotFate] | None = None, rollout: int = 0) -> TeamDriven:
    """A mission, in which all holds that must."""
    ready = place(name)
    mission = played(ready, 0, [(fates or {}).get(k, RobotFate()) for k in range(len(ready.orders))], rollout)
    assert not broken(ready, mission)
    return mission


@pytest.mark.spread(3)
@pytest.mark.parametrize("name", PLACES)
def test_all_come_home_when_nobody_fails(name: str) -> None:
    for rollout in range(2):
        mission = sound(name, rollout=rollout)
        assert {outcome.end for outcome in mission.robots} == {"home"}
        assert not mission.replanned


@pytest.mark.spread(3)
@pytest.mark.parametrize("name", PLACES)
def test_coordinated_robots_are_home_sooner_than_one_after_the_other(name: str) -> None:
    mission = sound(name)
    ends = [outcome.end_time_s for outcome in mission.robots]
    assert max(ends) < sum(outcome.end_time_s - outcome.waited_s for outcome in mission.robots)


@pytest.mark.spread(3)
@pytest.mark.parametrize("name", PLACES)
def test_wherever_a_robot_stops_for_good_the_others_end_with_a_reason(name: str) -> None:
    """In a corridor, in each doorway, on the station, at each stop and on the way from it."""
    whole = sound(name)
    drives_s = whole.robots[0].driven_s
    for k in range(12):
        mission = sound(name, {0: RobotFate(lifetime_s=drives_s * (k + 0.5) / 12)})
        assert mission.robots[0].end == "failed"
        for outcome in mission.robots[1:]:
            assert outcome.end in ("home", "stuck")


@pytest.mark.spread(3)
@pytest.mark.parametrize("name", PLACES)
def test_several_may_fail_at_once_and_while_others_brake(name: str) -> None:
    whole = sound(name)
    for share in (0.2, 0.45, 0.7):
        at_s = share * whole.robots[0].driven_s
        for later_s in (0.0, 0.1, 0.4):
            sound(name, {0: RobotFate(lifetime_s=at_s), 1: RobotFate(lifetime_s=at_s + later_s)})


def test_a_robot_that_failed_on_its_stop_is_served_beside_or_left_out() -> None:
    # uv1 fails on leaving p1, where nobody else goes; in the next mission on the station, which two others want.
    mission = sound("two doors", {1: RobotFate(before_poi=2)})
    assert [outcome.end for outcome in mission.robots] == ["home", "failed", "home", "home"]
    assert mission.robots[1].events[-1].site == "r1"
    assert mission.detours
    assert all("refuelled" in [event.kind for event in mission.robots[k].events] for k in (2, 3))


def test_who_is_shut_in_behind_a_failed_robot_is_stuck_by_it() -> None:
    mission = sound("sites in a corridor", {0: RobotFate(before_poi=2)})  # it has been at c1, in the corridor
    assert mission.robots[0].events[-1].site == "c1"
    stuck = [outcome for outcome in mission.robots[1:] if outcome.end == "stuck"]
    assert stuck
    assert {outcome.events[-1].what for outcome in stuck} <= {"uv1", "no way on"}


def test_more_robots_than_fit_are_refused() -> None:
    with pytest.raises(NoRoomForBerths):
        mission_in(world(((6, 3, 7.6, 6), (1.1, 3.9, 2.2, 4.2)), 8, {"p1": (0.5, 0.5)}, base=(1.2, 0.9)),
                   routes(*[("p1",)] * 8))


def held_s(mission: TeamDriven, robot: int, leg: int) -> float:
    """How long people held a robot on a leg [s]."""
    return sum(wait.lasts_s for wait in mission.driven[robot].waits if wait.leg == leg and wait.cause == "people")


def test_who_goes_on_after_all_braked_meets_the_same_people_as_without(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[list[Onward]] = []

    def heard(*arguments: Any) -> tuple[list[Onward], Switching]:
        onward, switching = planning.plan_onward(*arguments)
        told.append(onward)
        return onward, switching

    monkeypatch.setattr(mission_module, "plan_onward", heard)
    ready = mission_in(world((), 4, {"a": (11, 1), "b": (11, 5), "c": (6, 5.3), "d": (6, 0.7)}, noise={
        "people": {"per_m": 0.6, "stop_s": 1.5}}), routes(("a", "c"), ("b", "d"), ("c", "a"), ("d", "b")))
    whole = played(ready, 0, [RobotFate()] * 4, 0)
    compared = 0
    for k in range(16):
        told.clear()
        fates = [RobotFate(lifetime_s=whole.robots[0].driven_s * (k + 0.5) / 16), *[RobotFate()] * 3]
        mission = played(ready, 0, fates, 0)
        assert not broken(ready, mission)
        for robot in range(1, 4):
            for leg, parts in enumerate(mission.trails[robot]):
                if len(parts) > 1 and len(told) == 1 and told[0][robot].on_its_way:
                    # A hold or two of 1.5 s more or less would show; braking may count for who is met first.
                    assert held_s(mission, robot, leg) == pytest.approx(held_s(whole, robot, leg), abs=0.5)
                    compared += held_s(whole, robot, leg) > 2
    assert compared >= 6
