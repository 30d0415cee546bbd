"""What a run says of a whole mission, against what is known of it beforehand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from sva_bench.bench import Options, measure
from sva_bench.world.model import World
from tests.worlds_for_tests import world_of

QUICK = Options(trials=2000, rollouts=4, fidelity="kinematic")


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    # 40 s instead of 120 s: not all can be had, so the plans differ.
    path = tmp_path_factory.mktemp("world")
    loaded = world_of(path)
    return replace(loaded, robots=tuple(replace(robot, mission_limit_s=40.0) for robot in loaded.robots))


def summary_of(world: World) -> Any:
    return measure(world, QUICK, None, lambda *_: None).summary


def test_figures_of_a_mission_agree_with_what_the_model_says(world: World) -> None:
    summary = summary_of(world)
    for scenario in summary["scenarios"]:
        plan, vss = scenario["plans"]["stochastic"], scenario["vss"]
        assert scenario["ws"] == pytest.approx(plan["expected"] + scenario["evpi"])
        assert scenario["value_of_process"] is None
        assert vss["executed_range"][0] <= vss["executed"]["mean"] <= vss["executed_range"][1]
        # Nobody runs dry or late here: the draws are all that moves the mean, and the control takes them out.
        if set(plan["ends"]) <= {"home", "failed"}:
            assert plan["executed_controlled"]["mean"] == pytest.approx(plan["expected"])


def test_planning_for_failures_along_the_route_is_worth_something_under_them_alone(world: World) -> None:
    along = summary_of(replace(world, execute_failure="per_leg"))["scenarios"][0]
    exact = summary_of(replace(world, plan_failure="per_leg", execute_failure="per_leg"))["scenarios"][0]
    assert along["value_of_process"] >= 0
    assert along["value_of_process"] == exact["value_of_process"] == pytest.approx(
        exact["plans"]["stochastic"]["expected"] - along["plans"]["stochastic"]["expected"])
    assert along["ws"] is along["evpi"] is along["vss_mean_value"] is along["vss"]["executed_range"] is None
