"""Strands: the steps from a world and a seed to its trials, each of which requests jobs and receives their results."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from typing import Any

from sva_bench.analysis.summaries import Facts
from sva_bench.batch.grid import Grid, Point, options_at
from sva_bench.batch.jobs import DriveJob, PlansJob, TravelTimesJob, TrialsJob
from sva_bench.batch.reactions import ReactionsJob
from sva_bench.batch.shards import Reactions
from sva_bench.execution.drives import Drives
from sva_bench.execution.execute import drives_ahead
from sva_bench.execution.orders import planned_legs
from sva_bench.study.costs import reach_of
from sva_bench.study.options import Options, reactions_of, settings_of
from sva_bench.study.planning import Planned, own_cases
from sva_bench.study.recourse import refuse_trials_beyond_memory
from sva_bench.study.summing import facts_of, head_of, proved
from sva_bench.travel.fuel import FuelCosts, fuel_costs
from sva_bench.workers.engine import Job
from sva_bench.world.model import World

Strand = Generator[Sequence[Job], Sequence[Any], None]
"""A generator that yields the jobs of a step, and is sent their results in the same order."""


def strand(grid: Grid, point: Point, seed: int, done: frozenset[str]) -> Strand:
    """The jobs of one point and seed: travel times, plans, drives, reactions, and the trials that are not done yet."""
    world, options = point.world, options_at(grid, point, seed)
    left = [(first, count) for first, count in grid.ranges() if grid.unit_name(point, seed, first) not in done]
    if not left:
        return
    kinds = {world.kind_of(robot): robot for robot in world.robots}
    times = yield [TravelTimesJob(world=world, model=robot.model, planner=point.planner,
                                  robot=robot.name if world.meets else None) for robot in kinds.values()]
    costs = {kind: fuel_costs(time, world.margin) for kind, time in zip(kinds, times, strict=True)}
    (planned,) = yield [PlansJob(world=world, costs=costs, options=options)]
    cases = tuple(case for scenario in world.scenarios for case in own_cases(scenario, planned[scenario.name]))
    settings = settings_of(world, options)
    reacting = tuple(case for case in cases if case.role != "calibrated")
    refuse_trials_beyond_memory(world, costs, reacting, options, settings)  # ends the batch
    drives = Drives()
    if settings.fidelity != "physics" and not world.meets:
        ahead = drives_ahead(world, costs, cases, settings)
        driven = yield [DriveJob(tasks=chunk.tasks, what=chunk.what) for chunk in ahead.chunks]
        drives = ahead.drives(driven)
    reactions: Reactions = {}
    if left[0][0] == 0 and reactions_of(world, options):  # the unit of the first trials has them with it
        (reactions,) = yield [ReactionsJob(
            world=world, costs=costs, options=options, drives=drives,
            cases=reacting,
            instances={name: plans.instance for name, plans in planned.items()})]
    facts, legs = facts_at(world, options, costs, planned), planned_legs(world, costs, cases)
    yield [TrialsJob(
        unit=grid.unit_name(point, seed, first), world=world, variant=point.variant, cases=cases, facts=facts,
        drives=drives.routes, planned=legs, reactions=reactions if first == 0 else {},
        costs=costs if settings.fidelity == "physics" or world.meets else {}, first=first, trials=count,
        settings=settings) for first, count in left]


def facts_at(
    world: World, options: Options, costs: Mapping[str, FuelCosts], planned: Mapping[str, Planned]
) -> Facts:
    """The modelled values of a world, known before any trial."""
    head = head_of(world, settings_of(world, options), costs, reproducible=proved(planned))
    return Facts(
        **vars(head), reach=reach_of(world, costs),
        scenarios=tuple(facts_of(world, scenario, planned[scenario.name]) for scenario in world.scenarios),
        calibrations={name: plans.calibrated.result for name, plans in planned.items() if plans.calibrated})
