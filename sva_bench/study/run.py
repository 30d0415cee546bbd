"""The bench on one screen: from a world to its summary. The composition root."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sva_bench.analysis.summary import Judged, comparison_summary
from sva_bench.errors import BadInput
from sva_bench.execution.case import Case
from sva_bench.execution.drives import Drives
from sva_bench.execution.execute import Executed, execute
from sva_bench.mission.certify import certify, expected_value
from sva_bench.mission.plan import Plan
from sva_bench.study.assumptions import cross_table
from sva_bench.study.informed import cases_of, is_part, put_together
from sva_bench.study.options import Options, Progress, settings_of
from sva_bench.study.planning import Planned, instance_of, plan_costs, plan_scenarios, reach_of, unlimited
from sva_bench.study.publish import Run, Stopwatch, publish
from sva_bench.study.summing import WORST, by_case, head, model_is_executed, summarise
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

MOST_ROWS = 50_000_000
"""Outcomes that a run holds in memory, at some 80 bytes each."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Measured:
    """A mission planned, executed and measured, nothing written yet."""

    costs: Mapping[str, FuelCosts]
    planned: Mapping[str, Planned]
    executed: list[Executed]
    summary: Mapping[str, Any]
    clock: Stopwatch


def run(world: World, options: Options, out: Path, executor: Executor | None, progress: Progress) -> Run:
    """Plan, execute, measure and record a world's mission."""
    done = measure(world, options, executor, progress)
    return publish(world, options, done.costs, {name: p.instance for name, p in done.planned.items()}, done.executed,
                    done.summary, out, done.clock, progress)


def measure(world: World, options: Options, executor: Executor | None, progress: Progress) -> Measured:
    """Plan, execute and measure a world's mission.

    Raises:
        BadInput: If there are more trials than a run can keep in memory.
    """
    refuse_too_many_rows(world, max(options.trials, options.precision.max_trials if options.precision else 0), 2)
    clock = Stopwatch()
    with clock.phase("travel"):
        costs = plan_costs(world, options.planner, progress)
    with clock.phase("planning"):
        planned = plan_scenarios(world, costs, options, progress)
    cases = [Case(scenario=scenario, planner=name, plan=plan) for scenario in world.scenarios for name, plan in (
        ("stochastic", planned[scenario.name].stochastic), ("deterministic", planned[scenario.name].deterministic))]
    if model_is_executed(world):  # what the VSS would be against the least fortunate of the tied plans
        cases += [Case(scenario=scenario, planner=WORST, plan=worst) for scenario in world.scenarios
                  if (worst := planned[scenario.name].worst) is not None]
    cases += [case for scenario in world.scenarios if (known := planned[scenario.name].informed) is not None
              for case in cases_of(scenario, known)]
    drives = Drives()
    reach = reach_of(world, costs)
    while True:
        settings = settings_of(world, options)
        with clock.phase("execution"):
            executed = execute(world, costs, cases, settings, executor,
                               lambda done, of: progress("driving routes", done, of), drives)
        executed = _with_informed(world, executed)
        summary = summarise(world, options, settings, costs, planned, executed) | {"reach": reach}
        larger = options.precision.next_size(summary) if options.precision else None
        if larger is None:
            break
        options = replace(options, trials=larger[0], rollouts=larger[1])
    if options.assumptions:
        plans = {name: p.by_process for name, p in planned.items() if p.by_process is not None}
        with clock.phase("execution"):
            rows = cross_table(world, costs, plans, settings, executor, drives)
        summary["scenarios"] = [{**s, "assumptions": rows[s["name"]]} for s in summary["scenarios"]]
    return Measured(costs=costs, planned=planned, clock=clock, summary=summary,
                    executed=[run for run in executed if run.case.planner != WORST])


def _with_informed(world: World, executed: list[Executed]) -> list[Executed]:
    """What was executed, the parts of the informed planner put together, scenario by scenario."""
    found: list[Executed] = []
    for scenario in world.scenarios:
        mine = [run for run in executed if run.case.scenario.name == scenario.name]
        parts = [run for run in mine if is_part(run.case.planner)]
        found += [run for run in mine if not is_part(run.case.planner)]
        if parts:
            found.append(put_together(parts, [robot.name for robot in world.robots]))
    return found


def execute_plans(
    world: World, plans: Mapping[str, Plan], options: Options, out: Path, executor: Executor | None,
    progress: Progress, costs: Mapping[str, FuelCosts],
) -> Run:
    """Execute plans from anywhere and compare them, pair by pair.

    Args:
        world: The world.
        plans: The plans by the name they go by; feasible, or meant to be seen failing.
        options: Seed, trials, rollouts, fidelity; what solvers are told is not used.
        out, executor, progress: As for ``run``.
        costs: Fuel costs of the world's robot models, as ``plan_costs`` gives them.
    """
    refuse_too_many_rows(world, options.trials, len(plans))
    clock = Stopwatch()
    settings = settings_of(world, options)
    cases = [Case(scenario=scenario, planner=name, plan=plan) for scenario in world.scenarios
             for name, plan in plans.items()]
    with clock.phase("execution"):
        executed = execute(world, costs, cases, settings, executor,
                           lambda done, of: progress("driving routes", done, of))
    runs, instances = by_case(executed), {s.name: instance_of(world, costs, s) for s in world.scenarios}
    robots, entries = [robot.name for robot in world.robots], []
    for scenario in world.scenarios:
        # What the routes are worth if fuel and limits allow them: an infeasible plan may be here to be seen failing.
        truth = unlimited(replace(instances[scenario.name], failure=world.execute_failure))
        judged = [Judged(expected=expected_value(truth, plan), executed=runs[scenario.name, name],
                         feasible=certify(instances[scenario.name], replace(plan, value=None)).feasible)
                  for name, plan in plans.items()]
        entries.append(comparison_summary(judged, robots, noisy=not world.noise.silent))
    summary = head(world, options, settings, costs) | {
        "reach": reach_of(world, costs), "reproducible": True, "scenarios": entries}
    return publish(world, options, costs, instances, executed, summary, out, clock, progress,
                    identity={"plans": {name: {robot: list(route) for robot, route in plan.routes.items()}
                                        for name, plan in plans.items()}})


def refuse_too_many_rows(world: World, trials: int, plans: int) -> None:
    """Refuse a run whose trials would not fit into memory: all of them are at hand until its figures are worked out."""
    rows = trials * len(world.scenarios) * plans * len(world.robots)
    if rows > MOST_ROWS:
        raise BadInput(f"{rows} outcomes ({trials} trials x {len(world.scenarios)} scenarios x {plans} plans x "
                       f"{len(world.robots)} robots); a run keeps {MOST_ROWS} at most: take fewer trials, or a batch, "
                       "which measures them unit by unit")
