"""What each source of noise does to a plan: it is switched off, and everything else stays as it was drawn.

A source of the twin is worth what the twin makes of all sources less what it makes of all the others, on the trials and
noise draws of the run. What physics makes of a plan beside the twin is of what only physics knows. Sources that act
together leave a rest, the interplay, so that all add up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from sva_bench.analysis.results import PlanResult, SourceEffect
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.analysis.summaries import ComparisonSummary, Summary
from sva_bench.choices import NoiseName, SourceName
from sva_bench.execution.case import Case
from sva_bench.execution.drives import Drives, RouteKey
from sva_bench.execution.execute import execute
from sva_bench.execution.executed import Executed
from sva_bench.execution.orders import planned_legs
from sva_bench.execution.outcome import Driven
from sva_bench.execution.sources import OF_PHYSICS, ON_CLOCK_OR_TANK, sources_on, without
from sva_bench.mission.plan import Route
from sva_bench.study.effects import Effects
from sva_bench.study.effects import Grounds as Grounds
from sva_bench.study.met_sources import met_effects
from sva_bench.world.model import World

SummaryT = TypeVar("SummaryT", Summary, ComparisonSummary)
ScenarioT = TypeVar("ScenarioT", ScenarioSummary, ComparedScenario)

_Cause = NoiseName | None
"""The source that was switched off; ``None`` = none was."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Twin:
    """What the twin makes of some cases, without one source or with all.

    Attributes:
        value: Mean value of each case.
        routes: What was driven.
    """

    value: Mapping[tuple[str, str], float]
    routes: Mapping[RouteKey, Driven]


def with_sources(grounds: Grounds, summary: SummaryT, executed: Sequence[Executed]) -> SummaryT:
    """The summary with what each source of noise did to each plan, and other robots where they meet.

    It is the same where there is neither.

    Args:
        grounds: What the run was executed with.
        summary: Its summary.
        executed: Its trials; those of plans that are one for each trial have no sources.
    """
    sources = sources_on(grounds.world)
    runs = [run for run in executed if run.case.role in ("stochastic", "deterministic", "calibrated", "given")]
    cases = [run.case for run in runs]
    if grounds.world.meets:
        found = met_effects(grounds, cases)
    elif sources:
        found = _noise_effects(grounds, cases, sources)
    else:
        return summary
    return replace(summary, scenarios=tuple(_attached(scenario, found, {
        case.planner: run for run in runs if (case := run.case).scenario.name == scenario.name})
        for scenario in summary.scenarios))


def _noise_effects(grounds: Grounds, cases: Sequence[Case], sources: Sequence[NoiseName]
                   ) -> dict[tuple[str, str], Effects]:
    """What is known of the sources of plans whose robots do not meet."""
    driven = [source for source in sources if source not in OF_PHYSICS]
    twins: dict[_Cause, _Twin] = {None: _by_twin(grounds, grounds.world, cases, {})}
    for source in driven:
        shared = twins[None].routes if source in ON_CLOCK_OR_TANK else {}
        twins[source] = _by_twin(grounds, without(grounds.world, source), cases, shared)
    of_physics = next((source for source in OF_PHYSICS if source in sources), None)
    planned = planned_legs(grounds.world, grounds.costs, cases)
    return {(case.scenario.name, case.planner): _effects(
        grounds, case, twins, planned, None if grounds.settings.fidelity == "kinematic" else of_physics)
        for case in cases}


def _by_twin(
    grounds: Grounds, world: World, cases: Sequence[Case], whole: Mapping[RouteKey, Driven]
) -> _Twin:
    """What the twin makes of cases in a world, on the trials and noise draws of the run."""
    drives = Drives(whole={key: replace(driven, waits=(), capacity=1.0) for key, driven in whole.items()})
    settings = replace(grounds.settings, fidelity="kinematic", recorded=False)
    executed = execute(world, grounds.costs, cases, settings, grounds.executor, None, drives)
    return _Twin(routes=drives.routes, value={
        (run.case.scenario.name, run.case.planner): float(np.mean(run.value.sum(axis=1))) for run in executed})


def _effects(
    grounds: Grounds, case: Case, twins: Mapping[_Cause, _Twin], planned: Mapping[tuple[str, Route], Sequence[float]],
    of_physics: NoiseName | None,
) -> Effects:
    key = case.scenario.name, case.planner
    routes = [(robot.name, case.plan.route(robot.name)) for robot in grounds.world.robots]
    taken = {source: _taken_s(twin.routes, routes) for source, twin in twins.items()}
    value = {source: twin.value[key] for source, twin in twins.items()}
    by_source: dict[SourceName, SourceEffect] = {source: SourceEffect(incentive=value[None] - value[source] + 0.0,
                                      seconds=taken[None] - taken[source] + 0.0)
                 for source in twins if source is not None}
    physics_s = 0.0 if grounds.settings.fidelity == "kinematic" else _beyond_s(
        grounds.drives.routes, twins[None].routes, routes)
    beyond_plan = taken[None] - math.fsum(
        math.fsum(planned[route]) for route in routes if _of(twins[None].routes, *route))
    rest_s = beyond_plan - math.fsum(effect.seconds for effect in by_source.values())
    return Effects(by_source=by_source, twin=value[None], rest_s=rest_s if of_physics else rest_s + physics_s,
                    of_physics=(of_physics, physics_s) if of_physics else None)


def _of(driven: Mapping[RouteKey, Driven], robot: str, route: Route) -> list[tuple[int, float]]:
    """Noise draw and time of each drive of a robot's whole route [s]; of one that got stuck, until then."""
    return [(rollout, float(drive.leg_s.sum() + drive.waited_s.sum()))
            for (name, stops, rollout, _), drive in driven.items() if (name, stops) == (robot, route)]


def _taken_s(driven: Mapping[RouteKey, Driven], routes: Sequence[tuple[str, Route]]) -> float:
    """Mean time that routes take, added up over robots [s]; none of robots that never leave."""
    times = [[time_s for _, time_s in _of(driven, *route)] for route in routes]
    return math.fsum(math.fsum(each) / len(each) for each in times if each)


def _beyond_s(
    physics: Mapping[RouteKey, Driven], twin: Mapping[RouteKey, Driven], routes: Sequence[tuple[str, Route]]
) -> float:
    """How much longer routes take in the run than by the twin under the same draws, added up over robots [s]."""
    total = 0.0
    for route in routes:
        by_twin = dict(_of(twin, *route))
        apart = [time_s - by_twin[rollout] for rollout, time_s in _of(physics, *route) if rollout in by_twin]
        total += math.fsum(apart) / len(apart) if apart else 0.0
    return total


def _attached(
    scenario: ScenarioT, found: Mapping[tuple[str, str], Effects], runs: Mapping[str, Executed]
) -> ScenarioT:
    """The scenario with the sources of its plans."""
    plans = {name: replace(plan, sources=_sources_of(plan, found[scenario.name, name])) if name in runs else plan
             for name, plan in scenario.plans.items()}
    return replace(scenario, plans=plans)


def _sources_of(plan: PlanResult, effects: Effects) -> dict[SourceName, SourceEffect]:
    """All sources and the interplay, which add up to what the noise did to the plan."""
    sources = dict(effects.by_source)
    if effects.of_physics is not None:
        name, seconds = effects.of_physics
        sources[name] = SourceEffect(incentive=plan.executed.mean - effects.twin + 0.0, seconds=seconds + 0.0)
    rest = plan.beside_draws - math.fsum(effect.incentive for effect in sources.values())
    sources["interplay"] = SourceEffect(incentive=rest + 0.0, seconds=effects.rest_s + 0.0)
    return sources
