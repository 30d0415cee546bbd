"""Plans under the failures they were made for and under the others: what the wrong assumption costs."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

from sva_bench.analysis.figures import difference_figure, value_figure
from sva_bench.analysis.statistics import estimate
from sva_bench.choices import FailureProcess
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Drives
from sva_bench.execution.execute import execute
from sva_bench.mission.certify import expected_value
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Plan
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

PROCESSES: tuple[FailureProcess, ...] = ("mission", "per_leg")


@dataclass(frozen=True, eq=False, kw_only=True)
class PlansByProcess:
    """The plans of a scenario.

    Attributes:
        instance: What they were made for.
        stochastic: The best plan under each failure process.
        deterministic: The plan that knows no failures.
    """

    instance: Instance
    stochastic: Mapping[FailureProcess, Plan]
    deterministic: Plan


def cross_table(
    world: World, costs: Mapping[str, FuelCosts], plans: Mapping[str, PlansByProcess], settings: Settings,
    executor: Executor | None, drives: Drives,
) -> dict[str, list[dict[str, Any]]]:
    """Every plan executed under both failure processes, the same trials for all; rows by scenario.

    The loss of a plan is what the plan for the failures executed collects beyond it, trial by trial.
    """
    rows: dict[str, list[dict[str, Any]]] = {scenario.name: [] for scenario in world.scenarios}
    for process in PROCESSES:
        cases = [Case(scenario=scenario, planner=name, plan=plan) for scenario in world.scenarios
                 for name, _, plan in _named(plans[scenario.name])]
        executed = iter(execute(replace(world, execute_failure=process), costs, cases, settings, executor, None,
                                drives))
        for scenario in world.scenarios:
            mine = plans[scenario.name]
            runs = {name: next(executed) for name, _, _ in _named(mine)}
            right = runs[f"stochastic for {process}"]
            truth = replace(mine.instance, failure=process)
            best = expected_value(truth, mine.stochastic[process])
            for name, made_for, plan in _named(mine):
                run, noisy = runs[name], not world.noise.silent
                loss = estimate(difference_figure(right, run, noisy=noisy))
                expected = expected_value(truth, plan)
                rows[scenario.name].append({
                    "executed_under": process, "planner": name.split()[0], "planned_for": made_for,
                    "expected": expected + 0.0, "executed": estimate(value_figure(run, noisy=noisy)).as_dict(),
                    "loss_modelled": best - expected + 0.0,
                    "loss": {**loss.as_dict(), "distinguishable": loss.distinguishable,
                             "same_plan": plan.drives_like(mine.stochastic[process])}})
    return rows


def _named(plans: PlansByProcess) -> list[tuple[str, str | None, Plan]]:
    """Name, failures planned for, and plan."""
    return [*((f"stochastic for {process}", process, plan) for process, plan in plans.stochastic.items()),
            ("deterministic", None, plans.deterministic)]
