"""Plans executed under each failure process: the loss by a wrong assumption."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace

from sva_bench.analysis.figures import difference_figure, value_figure
from sva_bench.analysis.results import AssumptionRow, Loss
from sva_bench.analysis.statistics import estimate
from sva_bench.choices import FailureProcess
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Drives
from sva_bench.execution.execute import execute
from sva_bench.execution.executed import Executed
from sva_bench.mission.certify import expected_value
from sva_bench.mission.failures import PROCESSES
from sva_bench.mission.plan import Plan
from sva_bench.study.planning import PlansByProcess
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import Scenario, World


@dataclass(frozen=True, eq=False, kw_only=True)
class _MadeFor:
    """A plan, and the failure process that it was made for; ``None`` for the deterministic plan."""

    process: FailureProcess | None
    plan: Plan

    @property
    def planner(self) -> str:
        """Who made it."""
        return "deterministic" if self.process is None else "stochastic"

    def case(self, scenario: Scenario) -> Case:
        """To be executed."""
        name = self.planner if self.process is None else f"{self.planner} for {self.process}"
        return Case(scenario=scenario, planner=name, plan=self.plan,
                    role="deterministic" if self.process is None else "stochastic")


def cross_table(
    world: World, costs: Mapping[str, FuelCosts], plans: Mapping[str, PlansByProcess], settings: Settings,
    executor: Executor | None, drives: Drives,
) -> dict[str, list[AssumptionRow]]:
    """Every plan executed under every failure process, the same trials for all; rows by scenario.

    The loss of a plan is what the plan for the failures executed collects beyond it, trial by trial.
    """
    rows: dict[str, list[AssumptionRow]] = {scenario.name: [] for scenario in world.scenarios}
    known = plans[world.scenarios[0].name].stochastic
    for process in (name for name in PROCESSES if name in known):
        cases = [made.case(scenario) for scenario in world.scenarios for made in _all_of(plans[scenario.name])]
        executed = iter(execute(replace(world, execute_failure=process), costs, cases, settings, executor, None,
                                drives))
        for scenario in world.scenarios:
            mine = plans[scenario.name]
            runs = [(made, next(executed)) for made in _all_of(mine)]
            right = next(run for made, run in runs if made.process == process)
            rows[scenario.name] += [_row(process, mine, made, run, right, noisy=world.noisy)
                                    for made, run in runs]
    return rows


def _row(process: FailureProcess, plans: PlansByProcess, made: _MadeFor, run: Executed, right: Executed, *,
         noisy: bool) -> AssumptionRow:
    """What a plan is worth under a failure process, beside the plan for that process, executed as ``right``."""
    truth, best = replace(plans.instance, failure=process), plans.stochastic[process]
    expected = expected_value(truth, made.plan)
    loss = estimate(difference_figure(right, run, noisy=noisy))
    return AssumptionRow(
        executed_under=process, planner=made.planner, planned_for=made.process, expected=expected + 0.0,
        executed=estimate(value_figure(run, noisy=noisy)),
        loss_modelled=expected_value(truth, best) - expected + 0.0,
        loss=Loss(mean=loss.mean, ci95=loss.ci95, distinguishable=loss.excludes_zero,
                  same_plan=made.plan.drives_like(best)))


def _all_of(plans: PlansByProcess) -> list[_MadeFor]:
    """All plans of a scenario."""
    made = plans.stochastic
    return [*(_MadeFor(process=process, plan=made[process]) for process in PROCESSES if process in made),
            _MadeFor(process=None, plan=plans.deterministic)]
