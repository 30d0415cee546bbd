"""Missions of teams that react over time: what was driven, and how orders changed on the way."""

from __future__ import annotations

import numpy as np
import pytest

from sva_bench.execution.case import Case
from sva_bench.execution.outcome import Outcome, RobotFate
from sva_bench.execution.reacted import Reacted
from sva_bench.execution.team_outcome import Reaction, TeamOutcome
from sva_bench.execution.team_trace import Played, typical
from sva_bench.mission.plan import Plan
from sva_bench.study.options import Options
from sva_bench.study.run import measure
from sva_bench.world.model import World
from tests.worlds_for_tests import SMALL, world_of

# uv1 is sure but poor, so the deterministic plan leaves the best to uv2, and may leave uv1 at the base.
TEXT = SMALL.replace("limit_s: 120", "limit_s: 30").replace("name: small\n", "name: small\nfailure: per_leg\n")


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    return world_of(tmp_path_factory.mktemp("world"), TEXT)


@pytest.fixture(scope="module")
def reacted(world: World) -> tuple[Reacted, ...]:
    options = Options(trials=8, rollouts=2, fidelity="kinematic", policies=("resolve",), news=("report", "instant"))
    return measure(world, options, None, lambda *_: None).reacted


def test_a_typical_mission_is_shown_as_it_was_driven(world: World, reacted: tuple[Reacted, ...]) -> None:
    shown = 0
    for run in reacted:
        assert (run.shown is None) == (not run.reacted.any())
        if run.shown is None:
            continue
        shown += 1
        row = run.trial.tolist().index(run.shown.trial)
        mission = run.played[row]
        assert run.reacted[row]
        assert run.weight[row] <= max(run.weight[run.reacted])
        assert [heard.time_s for heard in run.shown.news] == [reaction.time_s for reaction in mission.reactions]
        for number, (trace, stops) in enumerate(zip(run.shown.traces, mission.stops, strict=True)):
            assert trace.time_s[-1] == pytest.approx(run.end_time_s[row, number])
            assert np.all(np.diff(trace.time_s) >= 0)
            if len(stops) > 1:
                assert trace.orders.route == stops
            # Each stop that was reached was passed at the time told, within what a twin with noisy wheels is off.
            for event in (e for e in trace.outcome.events if e.kind == "arrived"):
                site = next(site for site in world.sites if site.name == event.site)
                at = int(np.argmin(np.abs(trace.time_s - event.time_s)))
                assert np.hypot(*(trace.pose[at, :2] - [site.x_m, site.y_m])) < 0.1
            fuel = trace.orders.fuel_capacity_s
            assert np.all((trace.fuel_s >= -1e-9) & (trace.fuel_s <= fuel))
    assert shown


def test_new_orders_go_on_from_where_the_robot_stands_or_is_going(world: World, reacted: tuple[Reacted, ...]) -> None:
    at = {site.name: (site.x_m, site.y_m) for site in world.sites}
    changes = 0
    for run in reacted:
        for mission in run.played:
            assert all(set(told.since) == set(told.after) == set(told.before) for told in mission.reactions)
        if run.shown is None:
            continue
        reactions = run.played[run.trial.tolist().index(run.shown.trial)].reactions
        for heard, reaction in zip(run.shown.news, reactions, strict=True):
            for robot in heard.rerouted:
                changes += 1
                before, after = reaction.before[robot.robot], reaction.after[robot.robot]
                assert robot.new[0] == pytest.approx(at[reaction.since[robot.robot]], abs=0.05)
                assert robot.new[-1] == pytest.approx(at["base"], abs=0.05)
                assert set(robot.taken) == set(after) - set(before) - {"base", "r1"}
                assert set(robot.dropped) == set(before) - set(after) - {"base", "r1"}
    assert changes


def mission(course: str, weight: float, trial: int, *, reacts: bool = True) -> Played:
    outcome = Outcome(available=True, incentive=0, lost=False, value=0, pois_reached=0, stops_reached=1, end="home",
                      end_time_s=1, fuel_used_s=1, driven_s=1, waited_s=0, contacts=0, events=())
    reaction = Reaction(time_s=0, failed=("uv2",), learned=("uv1",), before={"uv1": ()} if reacts else {},
                        after={"uv1": ("base",)} if reacts else {}, lived=("uv1",) if reacts else ())
    return Played(case=Case(scenario=None, planner="p", plan=Plan(routes={})),  # type: ignore[arg-type]
                  trial=trial, rollout=0, weight=weight,
                  outcome=TeamOutcome(robots=(outcome,), stops=(("base", course),), reactions=(reaction,),
                                      fates=(RobotFate(),), left_over=((),), doubled=0))


def test_the_typical_mission_is_the_first_of_the_most_probable_course_with_changed_orders() -> None:
    # By hand: nothing changes in 0.5 of the missions; b weighs 0.1 + 0.15 under two noise draws, a 0.2.
    missions = [mission("c", 0.5, 0, reacts=False), mission("a", 0.2, 1), mission("b", 0.1, 2), mission("b", 0.15, 3)]
    found = typical(missions)
    assert found is not None
    assert found.trial == 2
    assert typical(missions[:1]) is None
    # Sums that differ by rounding alone are equal: 0.1 + 0.2 > 0.3.
    tied = typical([mission("a", 0.3, 0), mission("b", 0.1, 1), mission("b", 0.2, 2)])
    assert tied is not None
    assert tied.trial == 0


def test_a_row_alone_is_that_of_all_rows(reacted: tuple[Reacted, ...]) -> None:
    for run in reacted:
        assert run.legs
        alone = run.row(len(run.trial) - 1)
        assert (alone.legs, alone.shown, len(alone.played)) == ((), None, 1)
        assert alone.value.tolist() == run.value[-1:].tolist()
        with pytest.raises(IndexError):
            run.row(len(run.trial))
