"""Teams that react in a world they share: when news comes, who takes over what, and that nobody touches on the way."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sva_bench.choices import NEWS, News
from sva_bench.execution.case import Settings
from sva_bench.execution.outcome import RobotFate
from sva_bench.execution.policies.none import none
from sva_bench.execution.policies.registry import POLICIES, Means
from sva_bench.execution.react import react
from sva_bench.execution.reacted import Reacted
from sva_bench.execution.shared.execute import execute_team
from sva_bench.execution.team_outcome import TeamOutcome
from sva_bench.solver.rest import plan_rest
from sva_bench.study.costs import instance_of
from tests.execution.shared.random_missions import Ready, random_mission
from tests.execution.shared.teams import ABSENT, SURE, Asked, Stage
from tests.worlds_for_tests import SMALL, world_of

SHARED = SMALL.replace("stop_s: 4}", "stop_s: 4, slots: 2}") + "interaction: shared\n"
UNCOORDINATED = SHARED.replace("shared", "uncoordinated")
FIGURES = ("incentive", "value", "end", "end_time_s", "fuel_used_s", "waited_s", "pois_reached", "stops_reached",
           "contacts", "lost")


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    return Stage(world_of(tmp_path_factory.mktemp("shared"), SHARED))


@pytest.fixture(scope="module")
def loose(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    return Stage(world_of(tmp_path_factory.mktemp("uncoordinated"), UNCOORDINATED))


BOTH = {"uv1": ("base", "p1", "r1", "p4", "base"), "uv2": ("base", "p2", "p3", "base")}
TAKES_OVER = {"uv1": ("p3", "base")}


def arrivals(told: TeamOutcome, robot: int) -> dict[str, float]:
    """When a robot arrived where."""
    return {event.site: event.time_s for event in told.robots[robot].events if event.kind == "arrived"}


# News


@pytest.mark.parametrize("news", ["instant", "report"])
def test_a_robot_takes_over_what_one_that_failed_has_left(shared: Stage, news: News) -> None:
    asked = Asked(lambda state: TAKES_OVER)  # noqa: ARG005
    told = shared.told(BOTH, (SURE, RobotFate(before_poi=2)), news, asked)
    (reaction,) = told.reactions
    left_s = arrivals(told, 1)["p2"] + 2  # it stops there for so long, and fails on leaving
    assert told.robots[1].end == "failed"
    assert told.robots[1].end_time_s == pytest.approx(left_s)
    # By its schedule or own report it left p2 when it did, or later, and is missed when it is due at p3.
    scheduled_s = shared.costs["uv2"].cost_s
    sites = shared.costs["uv2"].times.sites
    due_s = max(left_s, scheduled_s[0, sites.index("p2")] + 2) + scheduled_s[sites.index("p2"), sites.index("p3")]
    assert reaction.time_s == pytest.approx(left_s if news == "instant" else due_s)
    assert (reaction.failed, reaction.learned, reaction.after) == (("uv2",), ("uv1",), TAKES_OVER)
    assert reaction.lived == ("uv1",)
    assert told.robots[0].end == "home"
    # A leg is driven to its end: new orders begin at the stop that it stands at or is going to.
    stops = told.stops[0]
    assert stops[-2:] == ("p3", "base")
    since = stops.index("p3") - 1
    assert stops[since] == reaction.since["uv1"]
    assert arrivals(told, 0)[stops[since - 1]] < reaction.time_s <= arrivals(told, 0)[stops[since]] + 4
    assert told.robots[0].incentive == 10 + 30 + (40 if "p4" in stops else 0)
    assert told.doubled == 0


def test_the_team_sees_its_schedule_or_a_robots_own_later_report(shared: Stage) -> None:
    asked = Asked()
    told = shared.told(BOTH, (SURE, RobotFate(before_poi=2)), "instant", asked)
    ((first, second),) = (state.robots for state in asked.states)
    assert (second.standing, second.remaining) == ("dead", ("base",))
    cost, sites = shared.costs["uv1"].cost_s, shared.costs["uv1"].times.sites
    to_p1 = float(cost[0, sites.index("p1")])
    at_p1 = arrivals(told, 0)["p1"]
    assert at_p1 < asked.states[0].time_s < arrivals(told, 0)["r1"]
    ready_s = max(to_p1, at_p1) + float(cost[sites.index("p1"), sites.index("r1")]) + 4
    assert first.site == "r1"
    assert first.ready_s == pytest.approx(ready_s)
    assert asked.states[0].open_pois == {"p3", "p4"}


def test_at_a_station_it_is_heard_on_leaving(shared: Stage) -> None:
    asked = Asked(lambda state: {"uv1": ("p3", "p4", "base")} if state.robots[0].reached else {})
    routes = {"uv1": ("base", "p1", "r1", "p4", "base"), "uv2": ("base", "p2", "p3", "base")}
    told = shared.told(routes, (SURE, ABSENT), "station", asked)
    (reaction,) = told.reactions
    assert reaction.time_s == pytest.approx(arrivals(told, 0)["r1"] + 4)
    assert told.stops[0] == ("base", "p1", "r1", "p3", "p4", "base")


def test_it_is_never_heard_of_without_news(shared: Stage) -> None:
    asked = Asked()
    assert shared.told(BOTH, (SURE, ABSENT), "never", asked).reactions == ()
    assert asked.states == []


# Orders


def test_what_is_known_before_anybody_leaves_is_planned_without_a_wait(shared: Stage) -> None:
    driven = shared.play(BOTH, (SURE, ABSENT), "instant", Asked(lambda state: {  # noqa: ARG005
        "uv1": ("p2", "p3", "p4", "p1", "base")}))
    assert driven.stops[0] == ("base", "p2", "p3", "p4", "p1", "base")
    assert driven.waited_s == 0
    assert not driven.replanned
    assert driven.told is not None
    assert driven.told.reactions[0].lived == ("uv1",)


def test_a_robot_that_waits_at_its_berth_is_sent_out(shared: Stage) -> None:
    routes: dict[str, tuple[str, ...]] = {"uv1": ("base", "p1", "p4", "base"), "uv2": ()}
    told = shared.told(routes, (RobotFate(before_poi=2), SURE), "report", Asked(lambda state: {  # noqa: ARG005
        "uv2": ("p4", "base")}))
    assert told.stops == (("base", "p1"), ("base", "p4", "base"))
    assert told.robots[1].events[0].time_s == told.reactions[0].time_s
    assert told.robots[1].incentive == 10


def test_one_that_is_sent_out_and_drawn_to_fail_never_leaves(shared: Stage) -> None:
    routes: dict[str, tuple[str, ...]] = {"uv1": ("base", "p1", "p4", "base"), "uv2": ()}
    told = shared.told(routes, (RobotFate(before_poi=2), ABSENT), "report", Asked(lambda state: {  # noqa: ARG005
        "uv2": ("p4", "base")}))
    assert told.stops == (("base", "p1"), ("base",))
    assert (told.robots[1].end, told.reactions[0].lived) == ("failed", ())
    assert told.reactions[1].failed == ("uv2",)


def test_a_robot_may_be_told_to_stay_at_its_berth(shared: Stage) -> None:
    told = shared.told(BOTH, (SURE, ABSENT), "instant", Asked(lambda state: {"uv1": ()}))  # noqa: ARG005
    assert (told.robots[0].end, told.robots[0].end_time_s, told.robots[0].stops_reached) == ("home", 0.0, 0)


def test_a_dead_robot_takes_its_new_orders_along_as_long_as_nobody_knows(shared: Stage) -> None:
    # uv2 never left, and uv1 ends on its first leg: what it is told, before it is missed itself, is told in vain.
    told = shared.told({"uv1": ("base", "p3", "p4", "base"), "uv2": ("base", "p1", "base")},
                       (RobotFate(lifetime_s=1.0), ABSENT), "report",
                       Asked(lambda state: {"uv1": ("p1", "base")} if state.robots[0].reached else {}))
    first = told.reactions[0]
    assert (first.failed, first.after, first.lived) == (("uv2",), {"uv1": ("p1", "base")}, ())
    assert told.fates == (RobotFate(lifetime_s=1.0), ABSENT)
    assert not told.orders_change
    assert told.left_over[0] == ("p3", "p4")  # its mission is over, whatever it is told


def test_orders_that_do_not_lead_home_are_refused(shared: Stage) -> None:
    with pytest.raises(ValueError, match="orders of uv1 don't end at the base"):
        shared.told(BOTH, (SURE, ABSENT), "instant", lambda _: {"uv1": ("p1",)})


@pytest.mark.parametrize("news", ["instant", "report"])
def test_robots_that_nobody_coordinates_take_new_orders_at_their_next_stop_without_a_brake(
        loose: Stage, news: News) -> None:
    driven = loose.play(BOTH, (SURE, RobotFate(before_poi=2)), news, Asked(lambda state: TAKES_OVER))  # noqa: ARG005
    assert driven.told is not None
    assert driven.stops[0][-2:] == ("p3", "base")
    assert driven.told.robots[0].end == "home"
    assert driven.waited_s == 0
    way = driven.told.robots[0].driven_s
    alone = loose.play({"uv1": driven.stops[0], "uv2": ()}, (SURE, SURE), "never", none)
    assert way == alone.robots[0].driven_s


# Missions drawn


def random(seed: int, interaction: str = "shared") -> Ready:
    ready = random_mission(seed, interaction=interaction, robots=3)
    assert ready is not None, "its robots fit"
    return ready


def settings_of(seed: int) -> Settings:
    return Settings(seed=seed, trials=6, rollouts=3, fidelity="kinematic", recorded=True)


@pytest.mark.spread(2)
@pytest.mark.parametrize("interaction", ["shared", "uncoordinated"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_team_that_keeps_its_orders_fares_as_one_that_does_not_react(seed: int, interaction: str) -> None:
    ready = random(seed, interaction)
    (alone,) = execute_team(ready.world, ready.costs, [ready.case], settings_of(seed), None, None, {})
    cases = [ready.case, *(replace(ready.case, policy="resolve", news=news) for news in NEWS
                           if news != "station" or ready.world.stations)]
    for kept in react(ready.world, ready.costs, cases, [none] * len(cases), settings_of(seed)):
        for name in FIGURES:
            assert_array_equal(getattr(kept, name), getattr(alone, name), err_msg=name)
        assert alone.meetings is not None
        assert kept.meetings is not None
        for name in ("contacts", "detours", "waited_s"):
            assert_array_equal(getattr(kept.meetings, name), getattr(alone.meetings, name))
        assert kept.shown is None
        assert not kept.reacted.any()


def resolved(ready: Ready, news: News, settings: Settings) -> Reacted:
    """Missions of a team that plans the rest anew."""
    instance = replace(instance_of(ready.world, ready.costs, ready.case.scenario), failure=ready.world.execute_failure)
    policy = POLICIES["resolve"](Means(instance=instance, plans_rest=plan_rest))
    (run,) = react(ready.world, ready.costs, [replace(ready.case, policy="resolve", news=news)], [policy], settings)
    return run


@pytest.mark.spread(2)
@pytest.mark.parametrize("news", ["instant", "report"])
@pytest.mark.parametrize("seed", [1, 7])
def test_whatever_happens_nobody_touches_and_nobody_waits_for_ever(seed: int, news: News) -> None:
    run = resolved(random(seed), news, settings_of(seed))
    assert run.meetings is not None
    assert run.meetings.contacts.sum() == 0
    assert not any(event.what == "deadlock" for mission in run.played for robot in mission.robots
                   for event in robot.events)
    assert run.reacted.any()
    assert run.doubled.sum() == 0
    assert (run.enumerated, run.history.max(), run.whole) == (False, -1, None)
    assert run.weight.sum() == pytest.approx(1.0)
    assert run.nominal.shape == run.trial.shape
    for mission in run.played:
        for stops, outcome in zip(mission.stops, mission.robots, strict=True):
            reached = [event.site for event in outcome.events if event.kind == "arrived"]
            assert tuple(reached) == stops[1:len(reached) + 1]
            assert len(stops) - 1 - len(reached) in (0, 1) or not stops


def test_a_typical_mission_is_shown_as_it_was_played() -> None:
    run = resolved(random(1), "report", settings_of(1))
    assert run.shown is not None
    row = int(np.flatnonzero(run.trial == run.shown.trial)[0])
    mission = run.played[row]
    assert mission.orders_change
    assert [heard.time_s for heard in run.shown.news] == [reaction.time_s for reaction in mission.reactions]
    driven = [leg for leg in run.legs if leg.trial == run.shown.trial]
    for trace, outcome, stops in zip(run.shown.traces, mission.robots, mission.stops, strict=True):
        assert trace.outcome.end_time_s == outcome.end_time_s
        assert trace.outcome.incentive == outcome.incentive
        mine = [(leg.origin, leg.destination) for leg in driven if leg.robot == trace.orders.robot]
        assert mine == list(pairwise(stops))[:len(mine)]
        steps = np.hypot(*np.diff(trace.pose[:, :2], axis=0).T) / np.diff(trace.time_s)
        # Nobody jumps, but from where it believes to stand at first to where it stands.
        assert np.max(steps[1:], initial=0.0) < 1.0
        assert math.isclose(trace.time_s[-1], outcome.end_time_s)
