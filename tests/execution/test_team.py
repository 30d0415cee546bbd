"""Teams that react, by hand: when news comes, what a policy sees of it, and whom its orders reach."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sva_bench.choices import NEWS, News, PolicyName
from sva_bench.execution.chance import Drawn
from sva_bench.execution.outcome import Assignment, Driven, RobotFate
from sva_bench.execution.policies.none import none
from sva_bench.execution.policies.policy import Policy
from sva_bench.execution.policies.registry import POLICIES
from sva_bench.execution.rules import LegDriven, settle
from sva_bench.execution.team import Team, play
from sva_bench.execution.team_outcome import TeamOutcome
from tests.execution.shared.teams import ABSENT, SURE, Asked

SITES = ("base", "r1", "p1", "p2", "p3", "p4")
LEG_S = 10.0


def orders(robot: str, *stops: str, fuel: float = 1000.0, limit: float = 1000.0) -> Assignment:
    return Assignment(
        robot=robot, route=("base", *stops, "base") if stops else (), stations=frozenset({"r1"}),
        incentives={"p1": 1.0, "p2": 2.0, "p3": 4.0, "p4": 8.0}, stop_s={site: float(site == "r1") for site in SITES},
        fuel_capacity_s=fuel, mission_limit_s=limit, loss_cost=3.0)


def legs(robot: int, stops: tuple[str, ...]) -> LegDriven:  # noqa: ARG001
    """Every leg takes ten seconds, but robot 1 takes nine."""
    return LegDriven(LEG_S - robot)


def team(own: Sequence[Assignment], news: News, policy: Policy = none) -> Team:
    return Team(orders=tuple(own), base="base", pois=frozenset({"p1", "p2", "p3", "p4"}), policy=policy, news=news,
                scheduled_s=lambda robot, origin, destination: LEG_S)  # noqa: ARG005


def run(own: Sequence[Assignment], fates: Sequence[RobotFate], news: News, policy: Policy = none) -> TeamOutcome:
    return play(team(own, news, policy), Drawn(fates), legs)


def test_every_policy_is_registered() -> None:
    assert set(POLICIES) == set(get_args(PolicyName))


@pytest.mark.parametrize(("news", "when"), [("instant", 0.0), ("report", 10.0)])
def test_news_of_a_robot_that_never_left_comes_at_once_or_when_its_first_report_is_missed(
        news: News, when: float) -> None:
    asked = Asked()
    found = run([orders("a", "p1", "p2"), orders("b", "p3", "p4")], [ABSENT, SURE], news, asked)
    assert [(r.time_s, r.failed, r.learned) for r in found.reactions] == [(when, ("a",), ("b",))]
    (state,) = asked.states
    assert [robot.standing for robot in state.robots] == ["dead", "alive"]


def test_it_is_never_heard_of_without_news() -> None:
    asked = Asked()
    assert run([orders("a", "p1"), orders("b", "p3")], [ABSENT, SURE], "never", asked).reactions == ()
    assert asked.states == []


def test_at_stations_it_is_heard_on_leaving_one_after_the_report_is_missed() -> None:
    # b leaves the station at 9 + 1 = 10 s, when a's report is just missed; then it has p4 to go.
    asked = Asked()
    found = run([orders("a", "p1"), orders("b", "r1", "p4"), orders("c", "p2")], [ABSENT, SURE, SURE], "station", asked)
    assert [(r.time_s, r.learned) for r in found.reactions] == [(10.0, ("b",))]
    assert [robot.reached for robot in asked.states[0].robots] == [False, True, False]


def test_a_failure_after_the_planned_arrival_is_heard_when_it_happens() -> None:
    # Its second leg takes 25 s in place of 10: it fails 18 s into it, at 28 s, and was due at 20.
    def slow(robot: int, stops: tuple[str, ...]) -> LegDriven:
        return LegDriven(25.0 if robot == 0 and len(stops) == 3 else LEG_S)

    found = play(team([orders("a", "p1", "p2"), orders("b", "p3", "p4")], "report"),
                 Drawn([RobotFate(lifetime_s=28.0), SURE]), slow)
    assert [r.time_s for r in found.reactions] == [28.0]


def test_no_report_counts_as_missed_because_a_robot_is_slow() -> None:
    def slow(robot: int, stops: tuple[str, ...]) -> LegDriven:  # noqa: ARG001
        return LegDriven(40.0)

    assert play(team([orders("a", "p1"), orders("b", "p3")], "report"), Drawn([SURE, SURE]), slow).reactions == ()


def test_robots_that_ran_dry_or_got_stuck_are_missed_too() -> None:
    def stuck(robot: int, stops: tuple[str, ...]) -> LegDriven:  # noqa: ARG001
        return LegDriven(12.0, stuck=robot == 0)

    found = play(team([orders("a", "p1"), orders("b", "p3")], "instant"), Drawn([SURE, SURE]), stuck)
    assert [r.time_s for r in found.reactions] == [12.0]
    dry = run([orders("a", "p1", fuel=15.0), orders("b", "p3")], [SURE, SURE], "report")
    assert [(r.time_s, r.failed) for r in dry.reactions] == [(20.0, ("a",))]  # at 15 s, on the way home


def test_a_policy_sees_each_robot_at_its_next_stop_by_the_schedule() -> None:
    asked = Asked()
    run([orders("a", "p1"), orders("b", "p3", "r1", "p4")], [RobotFate(before_poi=1), SURE], "instant", asked)
    run([orders("a", "p1", "p2"), orders("b", "p3", "r1", "p4")], [RobotFate(before_poi=2), SURE], "instant", asked)
    first, second = (state.robots[1] for state in asked.states)
    # At 0 s b is about to leave, or has left for p3; at 10 s it has left p3, where it was at 9 s, for the station.
    assert (first.site, first.ready_s, first.burnt_s, first.remaining) == ("base", 0.0, 0.0, ("p3", "r1", "p4", "base"))
    assert (second.site, second.ready_s, second.burnt_s, second.remaining) == ("r1", 21.0, 0.0, ("p4", "base"))
    assert asked.states[0].open_pois == {"p1", "p2", "p3", "p4"}
    assert asked.states[1].open_pois == {"p2", "p4"}  # a has visited p1, and b p3


def test_a_robot_that_was_late_is_expected_by_its_own_report() -> None:
    def slow(robot: int, stops: tuple[str, ...]) -> LegDriven:
        return LegDriven(30.0 if robot == 1 and len(stops) == 2 else LEG_S)

    asked = Asked()
    play(team([orders("a", "p1", "p2", "p4"), orders("b", "p3", "r1")], "instant", asked),
         Drawn([RobotFate(lifetime_s=35.0), SURE]), slow)
    robot = asked.states[0].robots[1]
    assert (robot.site, robot.ready_s) == ("r1", 41.0)  # at p3 at 30 s, not at 10


def test_orders_reach_a_robot_at_the_end_of_its_leg() -> None:
    takes_over = Asked(lambda state: {"b": ("p1", "base")} if state.robots[0].standing == "dead" else {})
    found = run([orders("a", "p1"), orders("b", "p3", "p4")], [RobotFate(before_poi=1), SURE], "report", takes_over)
    # News at 10 s; b is on its way to p4 since 9 s: it goes there first.
    assert found.stops[1] == ("base", "p3", "p4", "p1", "base")
    (reaction,) = found.reactions
    assert (reaction.before, reaction.after) == ({"b": ("base",)}, {"b": ("p1", "base")})
    assert found.robots[1].incentive == 13.0


def test_a_robot_on_its_way_home_takes_no_orders_and_one_without_a_route_does() -> None:
    everybody = Asked(lambda state: {robot.robot: ("p1", "base") for robot in state.robots if robot.reached})
    found = run([orders("a", "p1"), orders("b", "p3"), orders("c")], [RobotFate(before_poi=1), SURE, SURE], "report",
                everybody)
    # At 10 s b, at p3 since 9 s, has left for home; c has waited at the base.
    assert found.stops == (("base",), ("base", "p3", "base"), ("base", "p1", "base"))
    assert found.robots[2].end_time_s == 26.0


def test_a_robot_may_be_told_to_stay_at_the_base() -> None:
    stays = Asked(lambda state: {"b": ()})  # noqa: ARG005
    found = run([orders("a", "p1"), orders("b", "p3")], [ABSENT, SURE], "instant", stays)
    assert (found.robots[1].end, found.robots[1].end_time_s, found.robots[1].stops_reached) == ("home", 0.0, 0)


def test_a_dead_robot_takes_its_new_orders_along_as_long_as_nobody_knows() -> None:
    # a fails at once, b on leaving p3 at 9 s, unheard of until 20 s. What b is told at 10 s is lost with it.
    told = Asked(lambda state: {"b": ("p1", "base")} if state.robots[1].reached else {})
    found = run([orders("a", "p1"), orders("b", "p3", "p4"), orders("c", "r1", "p2", "r1")],
                [ABSENT, RobotFate(before_poi=2), SURE], "report", told)
    assert [(r.time_s, r.failed) for r in found.reactions] == [(10.0, ("a",)), (20.0, ("b",))]
    assert told.states[1].open_pois == {"p1", "p4"}
    assert found.robots[1].incentive == 4.0


def test_orders_that_do_not_lead_home_are_refused() -> None:
    with pytest.raises(ValueError, match="don't end at the base"):
        run([orders("a", "p1"), orders("b", "p3", "p4")], [ABSENT, SURE], "instant",
            lambda _: {"b": ("p2",)})


fates = st.sampled_from([ABSENT, RobotFate(before_poi=1), RobotFate(before_poi=2), RobotFate(lifetime_s=13.0), SURE])
routes = st.sampled_from([(), ("p1",), ("p1", "r1", "p2"), ("p4", "p3")])


@given(routes, routes, st.sampled_from([5.0, 25.0, 1000.0]), st.sampled_from([25.0, 1000.0]), fates, fates,
       st.sampled_from(NEWS))
def test_a_team_that_keeps_its_plan_fares_as_its_robots_do_alone(
        one: tuple[str, ...], two: tuple[str, ...], fuel: float, limit: float, fate: RobotFate, other: RobotFate,
        news: News) -> None:
    own = [orders("a", *one, fuel=fuel, limit=limit), orders("b", *two, fuel=fuel, limit=limit)]
    found = run(own, [fate, other], news)
    for number, (assignment, one_fate) in enumerate(zip(own, (fate, other), strict=True)):
        alone = settle(assignment, driven(number, assignment.route), one_fate)
        together = found.robots[number]
        assert together.events == alone.events
        assert (together.value, together.end, together.fuel_used_s) == (alone.value, alone.end, alone.fuel_used_s)
        assert math.isclose(together.end_time_s, alone.end_time_s)


def driven(number: int, route: tuple[str, ...]) -> Driven:
    times = [LEG_S - number for _ in pairwise(route)]
    return Driven(leg_s=np.array(times), stuck=False, leg_of=np.empty(0), clock_s=np.empty(0), pose=np.empty((0, 3)))
