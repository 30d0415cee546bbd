"""Plans executed: fates drawn, legs driven once per noise draw, each trial settled by the rules of the mission."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.execution.case import Case as Case
from sva_bench.execution.case import Settings as Settings
from sva_bench.execution.drives import Chunk, Courses, Drives, RouteKey, drive_all, pose_at, receive
from sva_bench.execution.executed import Executed, LegTime
from sva_bench.execution.fate import Fate, draw_fate
from sva_bench.execution.margins import margins_of_team
from sva_bench.execution.noise import draw_noise
from sva_bench.execution.orders import PlannedLegs, orders_of, planned_legs
from sva_bench.execution.outcome import Assignment, Driven, Outcome, Trace, trace_of
from sva_bench.execution.rules import legs_of, settle
from sva_bench.execution.settling import left_by_draws, settle_alike
from sva_bench.execution.shared.execute import execute_team
from sva_bench.mission.failures import process_of
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World


def execute(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], settings: Settings,
    executor: Executor | None = None, progress: Callable[[int, int], None] | None = None,
    drives: Drives | None = None,
) -> list[Executed]:
    """Execute plans over all trials.

    Args:
        world: The world.
        costs: Fuel costs by what ``World.kind_of`` says of a robot.
        cases: Plans with their scenarios; drives that several of them share are made once.
        settings: Seed, trials, rollouts, fidelity.
        executor: Where drives run; ``None`` = here.
        progress: Called with the number of drives done and of all.
        drives: What was driven already; what is driven now is added.
    """
    drives = Drives() if drives is None else drives
    if world.meets:
        return execute_team(world, costs, cases, settings, executor, progress, drives.missions)
    planned = planned_legs(world, costs, cases)
    orders = [orders_of(world, case, planned) for case in cases]
    fates = [_fate(world, case, own, settings) for case, own in zip(cases, orders, strict=True)]
    wanted = _wanted(settings, orders, fates)
    courses = Courses(world, costs, settings)
    drive_all(courses.chunks(wanted, drives), drives, executor, progress)
    courses.compose(wanted, drives)
    return [_settle_all(world, costs, case, own, fate, settings, drives.routes)
            for case, own, fate in zip(cases, orders, fates, strict=True)]


@dataclass(frozen=True, eq=False, kw_only=True)
class Ahead:
    """Every drive that some trial may need, whatever its number.

    Attributes:
        courses: What they are of.
        wanted: The routes.
        chunks: What is to be driven for them.
    """

    courses: Courses
    wanted: tuple[RouteKey, ...]
    chunks: tuple[Chunk, ...]

    def drives(self, driven: Sequence[Sequence[Driven]]) -> Drives:
        """The routes and what they are composed of, from what came of each chunk."""
        drives = Drives()
        for chunk, results in zip(self.chunks, driven, strict=True):
            receive(drives, chunk, results)
        self.courses.compose(self.wanted, drives)
        return drives


def drives_ahead(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], settings: Settings
) -> Ahead:
    """Every drive that some trial may need; not for ``physics``, where each trial has its own."""
    wanted: dict[RouteKey, bool] = {}
    for case in cases:
        for robot in world.robots:
            route = case.plan.route(robot.name)
            can_leave = route and process_of(world.execute_failure).can_leave(case.scenario.reliability(robot))
            for rollout in range(min(settings.rollouts, settings.trials) if can_leave else 0):
                wanted[robot.name, route, rollout, 0] = False
    courses = Courses(world, costs, settings)
    return Ahead(courses=courses, wanted=tuple(wanted), chunks=tuple(courses.chunks(wanted, Drives())))


def settle_trials(
    world: World, cases: Sequence[Case], settings: Settings, drives: Mapping[RouteKey, Driven], planned: PlannedLegs
) -> list[Executed]:
    """Settle trials by routes driven ahead, which cannot be recorded."""
    settled = []
    for case in cases:
        orders = orders_of(world, case, planned)
        settled.append(_settle_all(world, {}, case, orders, _fate(world, case, orders, settings), settings, drives))
    return settled


def _fate(world: World, case: Case, orders: Sequence[Assignment], settings: Settings) -> Fate:
    return draw_fate(world, case.scenario, [sum(o.is_poi(site) for site in o.route) for o in orders], settings)


def _wanted(settings: Settings, orders: Sequence[Sequence[Assignment]], fates: Sequence[Fate]) -> dict[RouteKey, bool]:
    """The routes that some trial needs, and whether each is traced: a robot that fails at the base in all its trials
    drives none."""
    wanted: dict[RouteKey, bool] = {}
    for own, fate in zip(orders, fates, strict=True):
        for number, order in enumerate(own):
            failed = fate.fails[:, number]
            for row in (int(rows[0]) for rows in _alike(settings, failed)):
                key = _key(settings, order, settings.first + row, int(failed[row]))
                if key is not None:
                    traced = settings.recorded and (row == 0 or (key[2] == 0 and settings.fidelity != "physics"))
                    wanted[key] = wanted.get(key, False) or traced
    return wanted


def _alike(settings: Settings, failed: IntArray) -> list[IntArray]:
    """Rows of the trials that end alike but for their lifetimes, since they share a drive and are drawn to fail before
    the same POI; in order of the first of each kind."""
    rows = np.arange(len(failed))
    if settings.fidelity == "physics":
        return list(rows[:, None])
    _, how = np.unique(failed, return_inverse=True)
    kind = how * settings.rollouts + (settings.first + rows) % settings.rollouts
    kinds = np.split(np.argsort(kind, kind="stable"), np.cumsum(np.unique(kind, return_counts=True)[1])[:-1])
    return sorted(kinds, key=lambda alike: int(alike[0]))


def _key(settings: Settings, order: Assignment, trial: int, fails_before: int) -> RouteKey | None:
    """The drive behind a robot's trial; ``None`` if it never leaves.

    Up to ``rollout`` a route is driven whole and failures cut it off afterwards. Under ``physics`` each trial is
    simulated by itself, up to where the robot fails.
    """
    if not order.route or fails_before == 0:
        return None
    rollout = trial % settings.rollouts
    if settings.fidelity != "physics":
        return order.robot, order.route, rollout, 0
    pois = [k for k, site in enumerate(order.route) if order.is_poi(site)]
    driven = order.route if fails_before > len(pois) else order.route[: pois[fails_before - 1]]
    return order.robot, driven, rollout, trial


def _settle_all(
    world: World, costs: Mapping[str, FuelCosts], case: Case, orders: Sequence[Assignment], fate: Fate,
    settings: Settings, drives: Mapping[RouteKey, Driven],
) -> Executed:
    columns: list[dict[str, FloatArray]] = []
    traces = []
    mine: dict[RouteKey, tuple[int, Driven]] = {}
    for number, order in enumerate(orders):
        failed = fate.fails[:, number]
        parts = []
        kinds = _alike(settings, failed)
        for rows in kinds:
            key = _key(settings, order, settings.first + int(rows[0]), int(failed[rows[0]]))
            driven = _drive_of(drives, key)
            parts.append(settle_alike(order, driven, int(failed[rows[0]]), fate.lifetime_s[rows, number]))
            if key is not None:
                mine.setdefault(key, (settings.first + int(rows[0]), driven))
        back = np.argsort(np.concatenate(kinds))
        columns.append({name: np.concatenate([part[name] for part in parts])[back] for name in parts[0]})
        if settings.recorded:
            driven = _drive_of(drives, _key(settings, order, settings.first, int(failed[0])))
            noise = draw_noise(world.noise, settings.seed, settings.first % settings.rollouts, number)
            traces.append(_trace(world, costs[world.kind_of(world.robots[number])], order, driven,
                                 settle(order, driven, fate.of(0, number)), noise.disturbance.waves))
    figures = {name: np.column_stack([column[name] for column in columns]) for name in columns[0]}
    drawn = [left_by_draws(o, fate.fails[:, k], fate.lifetime_s[:, k]) for k, o in enumerate(orders)]
    return Executed(
        case=case, robots=tuple(robot.name for robot in world.robots), rollout=fate.rollout,
        planned_incentive=np.array([sum(o.incentives.get(s, 0.0) for s in o.route) for o in orders]),
        drawn_value=np.column_stack([value for value, _ in drawn]),
        drawn_failed=np.column_stack([fails for _, fails in drawn]),
        terms=process_of(world.execute_failure).terms([case.scenario.reliability(r) for r in world.robots]),
        margins=margins_of_team(orders, drives),
        available=figures["available"].astype(np.bool_), lost=figures["lost"].astype(np.bool_),
        incentive=figures["incentive"], value=figures["value"], end_time_s=figures["end_time_s"],
        fuel_used_s=figures["fuel_used_s"], waited_s=figures["waited_s"],
        **{name: figures[name].astype(np.int64) for name in ("pois_reached", "stops_reached", "end", "contacts")},
        legs=tuple(_leg_times(world, costs, mine)) if settings.recorded else (), traces=tuple(traces), meetings=None)


NOTHING = Driven(leg_s=np.empty(0), stuck=False, leg_of=np.empty(0), clock_s=np.empty(0), pose=np.empty((0, 3)))
"""The drive of a robot that never leaves."""


def _drive_of(drives: Mapping[RouteKey, Driven], key: RouteKey | None) -> Driven:
    """The drive of a robot; nothing where it never leaves."""
    return NOTHING if key is None else drives[key]


def _trace(world: World, costs: FuelCosts, order: Assignment, driven: Driven, outcome: Outcome, waves: FloatArray
           ) -> Trace:
    planned = [costs.times.path(a, b) for leg in pairwise(order.route) for a, b in pairwise(costs.chain(*leg))]
    return trace_of(order, driven, outcome, pose_at(world, costs, world.sites[0].name),
                    np.concatenate(planned) if planned else np.empty((0, 2)), waves=waves)


def _leg_times(world: World, costs: Mapping[str, FuelCosts], drives: Mapping[RouteKey, tuple[int, Driven]]
               ) -> list[LegTime]:
    """Every leg of the drives given, each with its first trial; of trials that share a drive, once."""
    kinds = {robot.name: world.kind_of(robot) for robot in world.robots}
    rows = []
    for (robot, route, rollout, _), (trial, driven) in drives.items():
        fuel = costs[kinds[robot]]
        for leg, (done, (origin, destination)) in enumerate(zip(legs_of(driven), pairwise(route), strict=False)):
            # a stuck robot drives fewer
            planned_ms = fuel.repaired_ms[fuel.times.sites.index(origin), fuel.times.sites.index(destination)]
            rows.append(LegTime(
                trial=trial, rollout=rollout, robot=robot, leg=leg, origin=origin, destination=destination,
                planned_s=int(planned_ms) / 1000, driven_s=done.time_s, waited_s=done.waited_s, touches=done.touches,
                waits=done.waits, held_by=done.held_by, cut_short=done.stuck))
    return rows
