"""Ctrl-C that ended a solve early is heard by whoever has no use for the best plan so far."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sva_bench.generate import mission as proposal
from sva_bench.generate.mission import propose_mission
from sva_bench.solver import two_stage
from sva_bench.solver.two_stage import SolveLimits, knowledge_of
from sva_bench.study import planning
from sva_bench.study.costs import instance_of, plan_costs
from sva_bench.study.options import Options
from sva_bench.study.planning import plan_informed, plan_scenarios
from tests.worlds_for_tests import world_of


def interrupted(solve: Callable[..., Any]) -> Callable[..., Any]:
    """What a solve gives that Ctrl-C ended."""
    return lambda *arguments, **options: replace(solve(*arguments, **options), status="interrupted")


@pytest.mark.parametrize(("module", "solve", "options"), [
    (planning, "plan_nominal", Options()), (planning, "plan_stochastic", Options()),
    (planning, "plan_stochastic", Options(assumptions=True)), (two_stage, "_solve_expected", Options(evpi=True)),
])
def test_a_run_has_no_use_for_a_plan_that_was_interrupted(
    module: Any, solve: str, options: Options, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = world_of(tmp_path)
    costs = plan_costs(world, "prmstar", lambda *_: None)
    monkeypatch.setattr(module, solve, interrupted(getattr(module, solve)))
    with pytest.raises(KeyboardInterrupt):
        plan_scenarios(world, costs, options, lambda *_: None)


def test_the_informed_planner_has_no_use_for_one_either(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    world = world_of(tmp_path)
    instance = instance_of(world, plan_costs(world, "prmstar", lambda *_: None), world.scenarios[0])
    monkeypatch.setattr(planning, "plan_stochastic", interrupted(two_stage.plan_stochastic))
    with pytest.raises(KeyboardInterrupt):
        plan_informed(instance, SolveLimits(), knowledge_of(instance), force=False)


def test_a_mission_that_is_proposed_is_the_same_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Taken for a proof, an interrupted plan's bound made other missions of the same seed.
    world = world_of(tmp_path)
    (costs,) = plan_costs(world, "prmstar", lambda *_: None).values()
    monkeypatch.setattr(proposal, "plan_nominal", interrupted(two_stage.plan_nominal))
    with pytest.raises(KeyboardInterrupt):
        propose_mission(world.sites, costs.cost_s, robots=2, seed=0, key=())
