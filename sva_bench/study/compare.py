"""Given plans, executed in one world and compared pair by pair."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

from sva_bench.analysis.comparison import comparison_summary
from sva_bench.analysis.over_trials import Judged
from sva_bench.analysis.reactions import compared_reaction
from sva_bench.analysis.summaries import ComparisonSummary
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Drives
from sva_bench.execution.execute import execute
from sva_bench.execution.executed import Executed
from sva_bench.execution.react import Reacted
from sva_bench.mission.certify import certify, expected_value
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Plan
from sva_bench.study.costs import instance_of, reach_of
from sva_bench.study.options import Options, settings_of
from sva_bench.study.planning import unlimited
from sva_bench.study.publish import Run, Stopwatch, publish
from sva_bench.study.recordings import recorded_trials
from sva_bench.study.recourse import Stage, react_in_scenarios, refuse_trials_beyond_memory
from sva_bench.study.run import refuse_too_many_rows
from sva_bench.study.sources import Grounds, with_sources
from sva_bench.study.summing import by_case, head_of, with_drives
from sva_bench.travel.fuel import FuelCosts
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import World


@dataclass(frozen=True, eq=False, kw_only=True)
class Compared:
    """Plans from elsewhere executed and measured, nothing written yet."""

    instances: Mapping[str, Instance]
    executed: list[Executed]
    summary: ComparisonSummary
    clock: Stopwatch
    settings: Settings
    drives: Drives
    reacted: tuple[Reacted, ...] = ()


def execute_plans(
    world: World, plans: Mapping[str, Plan], options: Options, out: Path, executor: Executor | None,
    progress: OnProgress, costs: Mapping[str, FuelCosts],
) -> Run:
    """Execute given plans, compare them pair by pair, and write the run folder.

    Args:
        world: The world.
        plans: The plans by name; infeasible ones are executed too.
        options: Seed, trials, rollouts and fidelity; options of the solver are not used.
        out, executor, progress: As for ``run``.
        costs: Fuel costs of the world's robot models, as ``plan_costs`` gives them.
    """
    done = measure_plans(world, plans, options, executor, progress, costs)
    return publish_plans(world, plans, options, done, out, progress, costs, executor=executor)


def measure_plans(
    world: World, plans: Mapping[str, Plan], options: Options, executor: Executor | None, progress: OnProgress,
    costs: Mapping[str, FuelCosts],
) -> Compared:
    """Execute plans from anywhere and compare them; the arguments are those of ``execute_plans``."""
    refuse_too_many_rows(world, options.trials, len(plans))
    clock = Stopwatch()
    settings = settings_of(world, options)
    cases = [Case(scenario=scenario, planner=name, plan=plan) for scenario in world.scenarios
             for name, plan in plans.items()]
    refuse_trials_beyond_memory(world, costs, cases, options, settings)
    drives = Drives()
    with clock.phase("execution"):
        executed = execute(world, costs, cases, settings, executor,
                           lambda done, of: progress("driving routes", done, of), drives)
    runs, instances = by_case(executed), {s.name: instance_of(world, costs, s) for s in world.scenarios}
    robots = [robot.name for robot in world.robots]
    summary = ComparisonSummary(
        **vars(head_of(world, settings, costs, reproducible=True)), reach=reach_of(world, costs),
        scenarios=tuple(comparison_summary(
            [_judged(world, instances[s.name], plan, runs[s.name, name]) for name, plan in plans.items()], robots,
            noisy=world.noisy) for s in world.scenarios))
    with clock.phase("sources"):
        summary = with_sources(Grounds(world=world, costs=costs, settings=settings, executor=executor, drives=drives),
                               summary, executed)
    with clock.phase("reactions"):
        reactions = react_in_scenarios(Stage(
            world=world, costs=costs, instances=instances, executed=executed, settings=settings, executor=executor,
            drives=drives), options, compared_reaction, progress)
    if reactions:
        summary = summary.with_reactions({name: found.results for name, found in reactions.items()})
    summary = with_drives(summary, drives)
    return Compared(instances=instances, executed=executed, summary=summary, clock=clock, settings=settings,
                    drives=drives,
                    reacted=tuple(run for found in reactions.values() for run in found.reacted))


def publish_plans(
    world: World, plans: Mapping[str, Plan], options: Options, done: Compared, out: Path, progress: OnProgress,
    costs: Mapping[str, FuelCosts], command: Sequence[str] | None = None, executor: Executor | None = None,
) -> Run:
    """Write the run folder of plans that were compared; ``command``: as for ``publish``."""
    with done.clock.phase("recording"):
        recorded = recorded_trials(world, costs, done.executed, options.record, done.settings, executor, done.drives)
    return publish(world, options, costs, done.instances, done.executed, recorded, done.summary, out, done.clock,
                   progress, identity={"plans": {name: {robot: list(route) for robot, route in plan.routes.items()}
                                       for name, plan in plans.items()}}, command=command,
                   reacted=done.reacted)


def _judged(world: World, instance: Instance, plan: Plan, run: Executed) -> Judged:
    """A plan's trials, its value without fuel and time limits, and its feasibility."""
    truth = unlimited(replace(instance, failure=world.execute_failure))
    return Judged(expected=expected_value(truth, plan), executed=run,
                  feasible=certify(instance, replace(plan, value=None)).feasible)
