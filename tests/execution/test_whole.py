"""Missions of reacting teams driven whole in physics, against those put together from legs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import sva_bench as sb
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.known_legs import KnownLegs
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.policies.registry import POLICIES, Means
from sva_bench.execution.react import Reacted, react
from sva_bench.execution.team import Team
from sva_bench.execution.whole import WholeDrives
from sva_bench.solver.rest import plan_rest
from sva_bench.study.costs import instance_of, plan_costs
from tests.worlds_for_tests import world_of

SETTINGS = Settings(seed=0, trials=10, rollouts=2, fidelity="rollout")


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[Reacted, Team, WholeDrives]:
    """A plan whose team reacts, what it was played with, and physics for whole missions."""
    world = world_of(Path(tmp_path_factory.mktemp("world")))
    costs = plan_costs(world, "prmstar", lambda *_: None)
    scenario = world.scenarios[0]
    means = Means(instance=replace(instance_of(world, costs, scenario), failure=world.execute_failure),
                  plans_rest=plan_rest)
    plan = sb.Plan(routes={"uv1": ("base", "p4", "p3", "base"), "uv2": ("base", "p1", "p2", "base")})
    case = Case(scenario=scenario, planner="given", plan=plan, policy="resolve", news="report")
    policy = POLICIES["resolve"](means)
    (run,) = react(world, costs, [case], [policy], SETTINGS)
    team = Team(orders=tuple(orders_of(world, case, planned_legs(world, costs, [case]))), base="base",
                pois=frozenset(poi.name for poi in world.pois), policy=policy, news="report",
                scheduled_s=KnownLegs(world, costs, SETTINGS).scheduled_s)
    return run, team, WholeDrives(world, costs, SETTINGS, None)


def test_a_typical_mission_of_each_reaction_is_driven_whole_and_ends_alike(
        played: tuple[Reacted, Team, WholeDrives]) -> None:
    run, team, drives = played
    assert run.whole is True
    row = int(run.reacted.argmax())
    assert run.reacted[row]
    assert drives.ends_alike(team, run.played[row], int(run.rollout[row]))


def test_a_mission_that_ends_otherwise_is_told_apart(played: tuple[Reacted, Team, WholeDrives]) -> None:
    run, team, drives = played
    row = int(run.reacted.argmax())
    mission = run.played[row]
    first, *others = mission.robots
    for other in (replace(first, incentive=first.incentive + 1), replace(first, end="out_of_fuel")):
        assert not drives.ends_alike(team, replace(mission, robots=(other, *others)), int(run.rollout[row]))
    unchanged = replace(mission, stops=(("base",), *mission.stops[1:]))
    assert not drives.ends_alike(team, unchanged, int(run.rollout[row]))
