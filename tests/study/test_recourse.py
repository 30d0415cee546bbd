"""Plans whose teams react: ours and given ones by the same code, on any number of workers, within bounds of memory."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pydantic import ValidationError

import sva_bench as sb
from sva_bench.analysis.reaction_results import ReactionResult
from sva_bench.analysis.reaction_table import REACTION_COLUMNS, reaction_rows
from sva_bench.analysis.summaries import ComparisonSummary, Summary
from sva_bench.choices import News, PolicyName
from sva_bench.errors import BadInput
from sva_bench.execution import drives as driving
from sva_bench.execution import plays
from sva_bench.execution import react as reacting
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.policies.registry import POLICIES, Means
from sva_bench.execution.react import Reacted, react
from sva_bench.files.records import as_dict, from_dict
from sva_bench.report.compared_reactions import reaction_lines
from sva_bench.solver.rest import plan_rest
from sva_bench.solver.two_stage import plan_stochastic
from sva_bench.study import recourse
from sva_bench.study.costs import instance_of, plan_costs
from sva_bench.study.given_plans import InfeasiblePlan
from tests.worlds_for_tests import SMALL, world_of

QUICK: dict[str, Any] = {"trials": 60, "rollouts": 3, "fidelity": "kinematic", "workers": 1}
REACTIONS: dict[str, Any] = {"policy": ["none", "resolve"], "news": ["report", "instant"]}


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> sb.World:
    return world_of(tmp_path_factory.mktemp("world"))


@pytest.fixture(scope="module")
def ours(world: sb.World) -> sb.Result[Summary]:
    return sb.run(world, anticipate=True, **REACTIONS, **QUICK)


def results_of(summary: Summary, scenario: str) -> tuple[ReactionResult, ...]:
    found = summary.scenario(scenario).reactions
    assert found is not None
    return found


def test_given_plans_react_as_ours_do(world: sb.World, ours: sb.Result[Summary]) -> None:
    plans = {name: plan for name, plan in ours.plans["half"].items() if name in ("stochastic", "deterministic")}
    given = sb.execute(world, plans, scenario="half", **REACTIONS, **QUICK)
    compared = given.summary.scenarios[0].reactions
    assert compared is not None
    assert [(row.policy, row.news) for row in compared] == [("resolve", "report"), ("resolve", "instant")]
    for row, our in zip(compared, results_of(ours.summary, "half"), strict=True):
        assert row.histories == our.histories
        for name in plans:
            assert as_dict(row.plans[name]) == as_dict(our.plans[name])
            assert row.value_of_recourse[name] == our.value_of_recourse[name]
        (pair,) = row.comparisons
        assert (pair.mean, pair.ci95) == (our.vss.executed.mean, our.vss.executed.ci95)
        assert {ranked.plan for ranked in row.ranking} == set(plans)


def test_a_line_for_each_reaction_ranks_the_plans_and_says_what_reacting_adds(world: sb.World) -> None:
    # uv2 is lost half of the time, and uv1 then takes its POIs, which earn it 30 (by p1 and p2).
    plans = {"split": sb.Plan(routes={"uv1": ("base", "p4", "p3", "base"), "uv2": ("base", "p1", "p2", "base")}),
             "idle": sb.Plan(routes={})}
    summary = sb.execute(world, plans, scenario="half", policy="resolve", news="instant", **QUICK).summary
    line, knows, histories = reaction_lines(summary)
    assert line.startswith("If the team re-plans the moment a robot fails, in half split is worth 120.0 [")
    assert "Re-planning adds 14 % to split" in line
    assert knows.startswith("Who knows what when: instant news:")
    assert "all histories of failures were played" in histories


def test_every_robot_of_an_infeasible_plan_that_has_no_safe_way_on_keeps_its_orders(tmp_path: Path) -> None:
    # Round trips take uv1 far longer than 12 s of fuel last, so it has no safe way home from anywhere; uv2, if it
    # can't leave, is replaced by nobody.
    world = world_of(tmp_path, SMALL.replace("fuel_capacity_s: 60", "fuel_capacity_s: 12", 1))
    plan = sb.Plan(routes={"uv1": ("base", "p3", "p4", "base"), "uv2": ("base", "p1", "base")})
    with pytest.raises(InfeasiblePlan):
        sb.execute(world, plan, policy="resolve", **QUICK)
    found = sb.execute(world, plan, policy="resolve", news="report", scenario="half", allow_infeasible=True, **QUICK)
    scenario = found.summary.scenarios[0]
    assert scenario.reactions is not None
    (reaction,) = scenario.reactions
    assert not scenario.plans["plan"].feasible
    assert reaction.plans["plan"].expected == scenario.plans["plan"].expected
    assert reaction.plans["plan"].end_shares["uv1"] == pytest.approx({"out_of_fuel": 1.0})
    assert reaction.value_of_recourse["plan"].mean == pytest.approx(0.0)


@pytest.mark.spread(1)
@pytest.mark.parametrize("fidelity", ["kinematic", "rollout"])
def test_reactions_are_the_same_on_any_number_of_workers(world: sb.World, fidelity: str) -> None:
    kind = {**QUICK, "fidelity": fidelity, "rollouts": 2, "trials": 10, "scenario": "half"}
    one, two = (sb.run(world, anticipate=True, **REACTIONS, **{**kind, "workers": workers}) for workers in (1, 2))
    assert as_dict(one.summary) == as_dict(two.summary)


POLICY_OF_CASE: tuple[tuple[PolicyName, News], ...] = (("none", "never"), ("resolve", "report"), ("resolve", "instant"))


def reacted(world: sb.World, settings: Settings) -> list[Reacted]:
    """A plan of the first scenario, without and with reactions."""
    costs = plan_costs(world, "prmstar", lambda *_: None)
    scenario = world.scenarios[0]
    means = Means(instance=replace(instance_of(world, costs, scenario), failure=world.execute_failure),
                  plans_rest=plan_rest)
    plan = sb.Plan(routes={"uv1": ("base", "p4", "p3", "base"), "uv2": ("base", "p1", "p2", "base")})
    cases = [Case(scenario=scenario, planner="given", plan=plan, policy=policy, news=news)
             for policy, news in POLICY_OF_CASE]
    return react(world, costs, cases, [POLICIES[case.policy](means) for case in cases], settings)


def settings_of(**changes: Any) -> Settings:
    return Settings(**{"seed": 3, "trials": 40, "rollouts": 4, "fidelity": "kinematic", **changes})


def per_leg(tmp_path: Path) -> sb.World:
    """Both robots may fail before every POI."""
    return world_of(tmp_path, SMALL.replace("{uv2: 0.5}", "{uv1: 0.8, uv2: 0.6}") + "failure: per_leg\n")


ARRAYS = [field.name for field in fields(Reacted) if field.name not in (
    "case", "robots", "enumerated", "bounds", "played", "nominal", "weight", "legs", "shown", "whole", "meetings")]


def test_what_isnt_recorded_holds_no_missions_and_is_the_same(world: sb.World) -> None:
    whole, lean = reacted(world, settings_of()), reacted(world, settings_of(recorded=False))
    for one, other in zip(whole, lean, strict=True):
        assert len(one.played) == len(one.rollout)
        assert other.played == ()
        for name in [*ARRAYS, "weight", "nominal"]:
            assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def test_sampled_trials_are_those_of_their_ranges_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plays, "MOST_HISTORIES", 0)
    world = per_leg(tmp_path)
    whole = reacted(world, settings_of(trials=30))
    parts = [reacted(world, settings_of(first=first, trials=15)) for first in (0, 15)]
    for number, one in enumerate(whole):
        assert not one.enumerated
        for name in [*ARRAYS, "nominal"]:
            assert_array_equal(getattr(one, name), np.concatenate([getattr(part[number], name) for part in parts]),
                               err_msg=name)


def test_a_sample_of_histories_means_what_all_of_them_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    world = per_leg(tmp_path)
    exact = [run.weight @ run.value.sum(axis=1) for run in reacted(world, settings_of())]
    monkeypatch.setattr(plays, "MOST_HISTORIES", 0)
    for run, mean in zip(reacted(world, settings_of(trials=3000, recorded=False)), exact, strict=True):
        values = run.value.sum(axis=1)
        assert abs(values.mean() - mean) < 4 * values.std() / np.sqrt(len(values))  # one in 16 000 is beyond


def test_more_trials_than_memory_holds_are_refused_unless_all_histories_are_played(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = per_leg(tmp_path)
    monkeypatch.setattr(reacting, "MOST_TRIALS_HELD", 60)
    assert all(run.enumerated for run in reacted(world, settings_of()))
    monkeypatch.setattr(plays, "MOST_HISTORIES", 0)
    with pytest.raises(BadInput, match=r"at most 10 trials can be sampled \(--trials\)"):
        reacted(world, settings_of(trials=11))
    reacted(world, settings_of(trials=10))


@pytest.mark.parametrize("command", ["run", "execute"])
def test_trials_that_memory_does_not_hold_are_refused_before_anything_is_driven(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def driven(*_: object) -> None:
        raise AssertionError("driven all the same")

    world = per_leg(tmp_path)
    monkeypatch.setattr(plays, "MOST_HISTORIES", 0)
    # Two robots; without reaction, under two kinds of news, and the anticipative plan of each with and without those.
    plans = 2 * 3 + 2 * 2 if command == "run" else 1 * 3
    monkeypatch.setattr(reacting, "MOST_TRIALS_HELD", 2 * plans * QUICK["trials"])
    given = sb.Plan(routes={"uv1": ("base", "p4", "base"), "uv2": ("base", "p1", "base")})

    def asked(trials: int) -> None:
        words = {**REACTIONS, **QUICK, "trials": trials, "scenario": "half"}
        if command == "run":
            sb.run(world, anticipate=True, **words)
        else:
            sb.execute(world, given, **words)

    asked(QUICK["trials"])
    monkeypatch.setattr(driving, "drive_route", driven)
    with pytest.raises(BadInput, match=f"61 trials of {plans} plans with and without reaction: .* at most 60 trials"):
        asked(QUICK["trials"] + 1)


def test_a_summary_with_reactions_is_read_as_it_was_written(world: sb.World) -> None:
    from sva_bench.files.records import from_dict

    plans = {"a": sb.Plan(routes={"uv1": ("base", "p4", "base")}), "b": sb.Plan(routes={"uv2": ("base", "p1", "base")})}
    summary = sb.execute(world, plans, policy="resolve", **QUICK).summary
    data = as_dict(summary)
    assert as_dict(from_dict(ComparisonSummary, data)) == data
    data["scenarios"][0]["reactions"][0]["ranking"].pop()
    with pytest.raises(ValueError, match="ranking"):
        from_dict(ComparisonSummary, data)


def test_the_plan_for_a_reaction_is_the_best_of_all_that_were_tried(ours: sb.Result[Summary]) -> None:
    for scenario in ours.summary.scenarios:
        for row in results_of(ours.summary, scenario.name):
            best = max(candidate.modelled for candidate in row.candidates)
            assert row.plans["anticipative"].modelled == best == max(plan.modelled for plan in row.plans.values())


def test_plans_of_the_best_ones_routes_are_the_best_too_and_no_others(ours: sb.Result[Summary]) -> None:
    columns = [REACTION_COLUMNS.index(name) for name in ("scenario", "policy", "news", "planner")]
    marked = {tuple(row[column] for column in columns) for row in reaction_rows(ours.summary)
              if row[REACTION_COLUMNS.index("best")]}
    best = {(scenario.name, row.policy, row.news): row.best.plan for scenario in ours.summary.scenarios
            for row in results_of(ours.summary, scenario.name)}
    plans = {(run.case.scenario.name, run.case.policy, run.case.news, run.case.planner): run.case.plan
             for run in ours.reacted}
    assert marked == {(scenario, policy, news, name) for (scenario, policy, news, name), plan in plans.items()
                      if plan.drives_like(plans[scenario, policy, news, best[scenario, policy, news]])}
    # Under "half" the deterministic plan is the best, and made for the reaction too; under "safe" all are alike.
    assert {row[3] for row in marked if row[0] == "half"} == {"deterministic", "anticipative"}
    assert {row[3] for row in marked if row[0] == "safe"} == {"stochastic", "deterministic", "anticipative"}


def test_only_what_isnt_solved_yet_is_solved_for_a_reaction(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solved: list[tuple[float, ...]] = []

    def counted(instance: sb.Instance, *others: Any, **named: Any) -> sb.Plan:
        solved.append(tuple(vehicle.availability for vehicle in instance.vehicles))
        return plan_stochastic(instance, *others, **named)

    monkeypatch.setattr(recourse, "plan_stochastic", counted)
    wanted: dict[str, Any] = {"policy": "resolve", "anticipate": True, **QUICK, "trials": 4}
    # Under "half" uv2 is there half of the time; theta 0 and 1 are those of both plans. Under "safe" nothing fails.
    sb.run(world_of(tmp_path), **wanted)
    assert solved == [(1.0, 0.5**theta) for theta in (0.25, 0.5, 0.75)]
    # A plan for other failures than those executed is no plan for them.
    solved.clear()
    sb.run(world_of(tmp_path), scenario="half", plan_failure="mission", execute_failure="per_leg", **wanted)
    assert solved == [(1.0, 0.5**theta) for theta in (0.25, 0.5, 0.75, 1.0)]


def test_lifetimes_are_sampled_where_a_robot_waits_to_be_told(tmp_path: Path) -> None:
    # Its setting off is timed by the failure itself, which a history knows only to lie between two events.
    world = world_of(tmp_path, SMALL.replace("{uv2: 0.5}", "{uv1: 0.8, uv2: 0.6}") + "failure: hazard\n")
    costs = plan_costs(world, "prmstar", lambda *_: None)
    scenario = world.scenarios[0]
    means = Means(instance=instance_of(world, costs, scenario), plans_rest=plan_rest)
    waits = sb.Plan(routes={"uv1": ("base", "p4", "p3", "base")})
    both = sb.Plan(routes={"uv1": ("base", "p4", "p3", "base"), "uv2": ("base", "p1", "p2", "base")})
    enumerated = []
    asked: tuple[tuple[sb.Plan, News], ...] = ((both, "instant"), (waits, "instant"), (waits, "never"))
    for plan, news in asked:
        case = Case(scenario=scenario, planner="given", plan=plan, policy="resolve", news=news)
        (run,) = react(world, costs, [case], [POLICIES["resolve"](means)], settings_of())
        enumerated.append(run.enumerated)
    assert enumerated == [True, False, True]


def test_a_summary_with_reactions_is_of_another_format(world: sb.World, ours: sb.Result[Summary]) -> None:
    assert ours.summary.format == "sva-bench/summary@2"
    assert sb.run(world, scenario="half", **QUICK).summary.format == "sva-bench/summary@1"
    data = as_dict(ours.summary)
    assert from_dict(Summary, data) == ours.summary
    with pytest.raises(ValidationError, match="format: expected 'sva-bench/summary@2'"):
        from_dict(Summary, {**data, "format": "sva-bench/summary@1"})


def test_a_result_with_reactions_is_shown_in_a_few_lines(ours: sb.Result[Summary]) -> None:
    assert len(ours.reacted) > 4
    for run in ours.reacted:
        assert len(repr(run)) < 200
        assert all(word in repr(run) for word in (run.case.scenario.name, run.case.planner, run.case.news))
    assert len(repr(ours.reacted)) < 200 * len(ours.reacted)


def test_to_record_a_plan_made_for_a_reaction_takes_its_policy(ours: sb.Result[Summary], tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="made for a reaction; add policy='resolve'"):
        sb.record(ours, tmp_path / "a.rrd", scenario="half", planner="anticipative")
    with pytest.raises(BadInput, match="planner 'nobody'"):
        sb.record(ours, tmp_path / "a.rrd", scenario="half", planner="nobody")
