"""The way from a world and a seed to its trials: each step asks for jobs and is given their results."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from typing import Any

from sva_bench.analysis.summary import promise_of
from sva_bench.batch.grid import Grid, Point, options_at
from sva_bench.batch.jobs import DriveJob, PlansJob, TravelTimesJob, TrialsJob
from sva_bench.execution.execute import Case, drives_ahead
from sva_bench.study.options import Options, settings_of
from sva_bench.study.planning import Planned, reach_of
from sva_bench.study.summing import head, known_ahead, proved
from sva_bench.travel.fuel import FuelCosts, fuel_costs
from sva_bench.workers.engine import Job
from sva_bench.world.model import World

Strand = Generator[Sequence[Job], Sequence[Any], None]
"""Yields jobs, is sent their results in the same order."""


def strand(grid: Grid, point: Point, seed: int, done: frozenset[str]) -> Strand:
    """The jobs of one point and seed: travel times, plans, drives, and the trials that are not done yet."""
    world, options = point.world, options_at(grid, point, seed)
    left = [(first, count) for first, count in grid.ranges() if grid.unit_name(point, seed, first) not in done]
    if not left:
        return
    models = list({robot.model.name: robot.model for robot in world.robots}.values())
    times = yield [TravelTimesJob(world=world, model=model, planner=point.planner) for model in models]
    costs = {model.name: fuel_costs(time, world.margin) for model, time in zip(models, times, strict=True)}
    (planned,) = yield [PlansJob(world=world, costs=costs, options=options)]
    cases = tuple(Case(scenario=scenario, planner=name, plan=plan) for scenario in world.scenarios for name, plan in (
        ("stochastic", planned[scenario.name].stochastic), ("deterministic", planned[scenario.name].deterministic)))
    settings = settings_of(world, options)
    drives = {}
    if settings.fidelity != "physics":
        ahead = drives_ahead(world, costs, cases, settings)
        driven = yield [DriveJob(tasks=chunk.tasks, what=chunk.what) for chunk in ahead.chunks]
        drives = ahead.routes(driven)
    facts = facts_of(world, options, costs, planned)
    yield [TrialsJob(
        unit=grid.unit_name(point, seed, first), world=world, variant=point.variant, cases=cases, facts=facts,
        drives=drives, costs=costs if settings.fidelity == "physics" else {}, first=first, trials=count,
        settings=settings) for first, count in left]


def facts_of(
    world: World, options: Options, costs: Mapping[str, FuelCosts], planned: Mapping[str, Planned]
) -> dict[str, Any]:
    """A summary without its figures."""
    robots = [robot.name for robot in world.robots]
    scenarios = []
    for scenario in world.scenarios:
        plans = planned[scenario.name]
        known = known_ahead(world, plans)
        scenarios.append({
            "name": scenario.name, "availability": {name: scenario.availability[name] for name in robots},
            "plans": {"stochastic": promise_of(plans.stochastic, known["stochastic"]),
                      "deterministic": promise_of(plans.deterministic, known["deterministic"])},
            "modelled_range": None if known["modelled_range"] is None else [x + 0.0 for x in known["modelled_range"]],
            "same_plan": plans.stochastic.drives_like(plans.deterministic),
            **{figure: known[figure] for figure in ("vss_mean_value", "ws", "evpi", "value_of_process")}})
    return head(world, options, settings_of(world, options), costs) | {
        "reach": reach_of(world, costs),
        "reproducible": proved(planned), "scenarios": scenarios}
