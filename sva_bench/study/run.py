"""From a world to its summary: the composition root."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

from sva_bench.analysis.reactions import reaction_result
from sva_bench.analysis.summaries import Summary
from sva_bench.errors import BadInput
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Drives, Watch
from sva_bench.execution.execute import execute
from sva_bench.execution.executed import Executed
from sva_bench.execution.react import Reacted
from sva_bench.files.printable import counted
from sva_bench.study.assumptions import cross_table
from sva_bench.study.costs import plan_costs, reach_of
from sva_bench.study.informed import cases_of, combined_trials
from sva_bench.study.options import Options, settings_of
from sva_bench.study.planning import Planned, model_is_executed, own_cases, plan_scenarios, with_calibration
from sva_bench.study.publish import Run, Stopwatch, publish
from sva_bench.study.recordings import recorded_trials
from sva_bench.study.recourse import Stage, react_in_scenarios, refuse_trials_beyond_memory
from sva_bench.study.sources import Grounds, with_sources
from sva_bench.study.summing import head_of, proved, summarise, with_drives
from sva_bench.travel.fuel import FuelCosts
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import Scenario, World

MOST_ROWS = 50_000_000
"""Outcomes that a run holds in memory, at some 80 bytes each."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Measured:
    """A mission planned, executed and measured, nothing written yet."""

    costs: Mapping[str, FuelCosts]
    planned: Mapping[str, Planned]
    executed: list[Executed]
    summary: Summary
    clock: Stopwatch
    settings: Settings
    drives: Drives
    reacted: tuple[Reacted, ...] = ()


def run(world: World, options: Options, out: Path, executor: Executor | None, progress: OnProgress,
        watch: Watch | None = None) -> Run:
    """Plan, execute, measure and record a world's mission, and write the run folder.

    Args:
        world, options, out, executor, progress: What is run, how and where, and what is told of it.
        watch: Follows the drives as they are made.

    Raises:
        BadInput: If there are too many trials, or the folder can't be written.
        UnreachableSite: If a site can't be reached.
    """
    done = measure(world, options, executor, progress, watch)
    return publish_run(world, options, done, out, progress, executor=executor)


def publish_run(
    world: World, options: Options, done: Measured, out: Path, progress: OnProgress,
    command: Sequence[str] | None = None, executor: Executor | None = None,
) -> Run:
    """Write the run folder of what was measured; ``command``: as for ``publish``, ``executor``: as for ``run``."""
    instances = {name: p.instance for name, p in done.planned.items()}
    instances |= {f"{name}+calibrated": p.calibrated.instance for name, p in done.planned.items() if p.calibrated}
    with done.clock.phase("recording"):
        recorded = recorded_trials(world, done.costs, done.executed, options.record, done.settings, executor,
                                   done.drives)
    return publish(world, options, done.costs, instances, done.executed, recorded, done.summary, out, done.clock,
                   progress, command=command, reacted=done.reacted)


def measure(world: World, options: Options, executor: Executor | None, progress: OnProgress,
            watch: Watch | None = None) -> Measured:
    """Plan, execute and measure a world's mission; the arguments are those of ``run``.

    Raises:
        BadInput: If there are more trials than a run can keep in memory.
    """
    refuse_too_many_rows(world, max(options.trials, options.precision.max_trials if options.precision else 0),
                         2 if options.calibrate is None else 3)
    clock = Stopwatch()
    with clock.phase("travel"):
        costs = plan_costs(world, options.planner, progress)
    with clock.phase("planning"):
        planned = plan_scenarios(world, costs, options, progress)
    with clock.phase("calibration"):
        planned = with_calibration(world, costs, planned, options, executor, progress)
    cases = [case for scenario in world.scenarios for case in _cases_of(world, scenario, planned[scenario.name])]
    refuse_trials_beyond_memory(world, costs, [case for case in cases if case.role in ("stochastic", "deterministic")],
                                options, settings_of(world, options))
    drives = Drives(watch=watch)
    reach = reach_of(world, costs)
    while True:
        settings = settings_of(world, options)
        with clock.phase("execution"):
            executed = execute(world, costs, cases, settings, executor,
                               lambda done, of: progress("driving routes", done, of), drives)
        executed = _with_informed(world, planned, executed)
        head = head_of(world, settings, costs, reproducible=proved(planned))
        summary = summarise(world, options, head, planned, executed, reach)
        larger = options.precision.next_size(summary) if options.precision else None
        if larger is None:
            break
        assert options.precision is not None
        options = replace(options, trials=larger[0], rollouts=larger[1], precision=options.precision.after_look())
    with clock.phase("sources"):
        summary = with_sources(Grounds(world=world, costs=costs, settings=settings, executor=executor, drives=drives),
                               summary, executed)
    if options.assumptions:
        plans = {name: p.by_process for name, p in planned.items() if p.by_process is not None}
        with clock.phase("execution"):
            rows = cross_table(world, costs, plans, settings, executor, drives)
        summary = replace(summary, scenarios=tuple(
            replace(scenario, assumptions=tuple(rows[scenario.name])) for scenario in summary.scenarios))
    with clock.phase("reactions"):
        reactions = react_in_scenarios(Stage(
            world=world, costs=costs, instances={name: p.instance for name, p in planned.items()}, settings=settings,
            executed=[run for run in executed if run.case.role in ("stochastic", "deterministic")], executor=executor,
            drives=drives), options, reaction_result, progress)
    if reactions:
        summary = summary.with_reactions({name: found.results for name, found in reactions.items()})
    summary = with_drives(summary, drives)
    return Measured(costs=costs, planned=planned, clock=clock, summary=summary, settings=settings, drives=drives,
                    reacted=tuple(run for found in reactions.values() for run in found.reacted),
                    executed=[run for run in executed if run.case.role != "worst_tie"])


def _cases_of(world: World, scenario: Scenario, planned: Planned) -> list[Case]:
    """All cases to be executed in a scenario."""
    cases = own_cases(scenario, planned)
    if model_is_executed(world) and planned.worst is not None:  # the VSS against the least fortunate of the ties
        cases.append(Case(scenario=scenario, planner="worst of ties", plan=planned.worst, role="worst_tie"))
    return cases if planned.informed is None else [*cases, *cases_of(scenario, planned.informed)]


def _with_informed(world: World, planned: Mapping[str, Planned], executed: Sequence[Executed]) -> list[Executed]:
    """The executed cases, with the parts of the informed planner combined, scenario by scenario."""
    found: list[Executed] = []
    for scenario in world.scenarios:
        mine = [run for run in executed if run.case.scenario.name == scenario.name]
        found += [run for run in mine if run.case.role != "informed_part"]
        if (informed := planned[scenario.name].informed) is not None:
            parts = [run for run in mine if run.case.role == "informed_part"]
            found.append(combined_trials(dict(zip(informed.plans, parts, strict=True))))
    return found


def refuse_too_many_rows(world: World, trials: int, plans: int) -> None:
    """Refuse a run whose outcomes would not fit into memory, which holds all of them.

    Raises:
        BadInput: If it has more than ``MOST_ROWS``.
    """
    rows = trials * len(world.scenarios) * plans * len(world.robots)
    if rows > MOST_ROWS:
        raise BadInput(f"{rows} outcomes ({counted(trials, 'trial')} x {counted(len(world.scenarios), 'scenario')} x "
                       f"{counted(plans, 'plan')} x {counted(len(world.robots), 'robot')}); a run keeps "
                       f"{MOST_ROWS} at most: take fewer trials, or a batch, which measures them unit by unit")
