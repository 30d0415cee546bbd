"""Plans executed: each route driven once per noise draw, then each trial settled by its failures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.choices import ENDS, Fidelity, Role
from sva_bench.execution.engines.bullet import Simulator, downsampled
from sva_bench.execution.margins import Margins, margins_of_team
from sva_bench.execution.outcome import Assignment, Driven, Outcome, Trace, settle, trace_of
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.mission.failures import NEVER, FailureDraw, Reliability, process_of
from sva_bench.mission.plan import Plan, Route
from sva_bench.robot.follower import Stretch
from sva_bench.robot.model import RobotModel
from sva_bench.robot.twin import drive as drive_twin
from sva_bench.seeds import Stream, rng_for
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import Noise, Robot, Scenario, World

TRACE_HZ = 20.0

Hop = tuple[Stretch, ...]
Leg = tuple[Hop, ...]
"""A leg of a route: the hops of the chain that its repaired cost stands for."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """One plan under one scenario, and what it is executed for."""

    scenario: Scenario
    planner: str
    plan: Plan
    role: Role = "given"


@dataclass(frozen=True, eq=False, kw_only=True)
class Settings:
    """How plans are executed.

    Attributes:
        seed: Root of failures and noise.
        trials: Number of trials.
        rollouts: Number of noise draws; trial t has that of rollout t mod ``rollouts``. 1 without noise.
        fidelity: ``kinematic`` (the twin), ``rollout`` (physics, once per noise draw) or ``physics`` (every trial).
        first: Number of the first trial: a range of trials is settled as if all before it had been too.
        recorded: Whether legs and traces are kept; a batch has no use for them.
    """

    seed: int
    trials: int
    rollouts: int
    fidelity: Fidelity
    first: int = 0
    recorded: bool = True


@dataclass(frozen=True, kw_only=True)
class LegTime:
    """A leg as planned (the repaired twin time, without margin) and as driven [s]."""

    rollout: int
    robot: str
    leg: int
    origin: str
    destination: str
    planned_s: float
    driven_s: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Executed:
    """What came of one case, trial by trial. Arrays have shape (trials, robots) unless said otherwise.

    Attributes:
        case: Plan and scenario.
        robots: Names of the robots, in order.
        rollout: Noise draw of each trial, shape (trials,).
        available: Whether the robot was never drawn to fail.
        incentive: What it collected.
        pois_reached, stops_reached: How far it got.
        end: Index into ``ENDS``.
        end_time_s, fuel_used_s: When it ended, and on how much.
        planned_incentive: What each robot's route holds, shape (robots,).
        drawn_incentive: What the failures drawn would have left of that, had nothing else gone wrong.
        margins: What fuel and time each route left under the draws that were driven; none of robots that stay home.
        legs: Every leg that was driven; none unless recorded.
        traces: The first trial over time, a trace for each robot; none unless recorded.
    """

    case: Case
    robots: tuple[str, ...]
    rollout: IntArray
    available: BoolArray
    incentive: FloatArray
    pois_reached: IntArray
    stops_reached: IntArray
    end: IntArray
    end_time_s: FloatArray
    fuel_used_s: FloatArray
    planned_incentive: FloatArray
    drawn_incentive: FloatArray
    margins: tuple[Margins, ...]
    legs: tuple[LegTime, ...]
    traces: tuple[Trace, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class DriveTask:
    """One robot's route under one noise draw: all that a worker needs."""

    obstacles: Obstacles
    model: RobotModel
    start: tuple[float, float, float]
    legs: tuple[Leg, ...]
    wheel_gains: tuple[float, float]
    fidelity: Fidelity
    traced: bool


def drive_route(task: DriveTask) -> Driven:
    """Drive a whole route, in physics or by the twin."""
    if task.fidelity == "kinematic":
        return _drive_legs(task, _twin_driver(task))
    with Simulator(task.obstacles, task.model, task.start, task.wheel_gains) as simulator:
        return _drive_legs(task, simulator.drive)


Driver = Callable[[Hop, list[tuple[float, float, float]] | None], tuple[float, bool]]


def _twin_driver(task: DriveTask) -> Driver:
    pose = np.array(task.start)

    def drive(hop: Hop, poses: list[tuple[float, float, float]] | None) -> tuple[float, bool]:
        time_s, trace = drive_twin(task.model, hop, pose, task.wheel_gains, traced=poses is not None)
        if poses is not None:
            poses.extend((x, y, yaw) for x, y, yaw in trace.tolist())
        return (time_s, True) if np.isfinite(time_s) else (0.0, False)

    return drive


def _drive_legs(task: DriveTask, drive: Driver) -> Driven:
    times: list[float] = []
    leg_of, clock, poses = [np.empty(0)], [np.empty(0)], [np.empty((0, 3))]
    arrived = True
    for number, leg in enumerate(task.legs):
        kept: list[tuple[float, float, float]] | None = [] if task.traced else None
        total = 0.0
        for hop in leg:
            time_s, arrived = drive(hop, kept)
            total += time_s
            if not arrived:
                break
        times.append(total)
        if kept:
            at, where = downsampled(kept, TRACE_HZ)
            leg_of.append(np.full(len(at), float(number)))
            clock.append(at)
            poses.append(where)
        if not arrived:
            break
    return Driven(leg_s=np.array(times), stuck=not arrived, leg_of=np.concatenate(leg_of),
                  clock_s=np.concatenate(clock), pose=np.concatenate(poses))


def wheel_gains(seed: int, rollout: int, robot: int, noise: Noise) -> tuple[float, float]:
    """Gains of a robot's left and right wheel in a rollout, the same for every plan."""
    if noise.silent:
        return 1.0, 1.0
    left, right = 1.0 + noise.wheel_gain_sd * rng_for(seed, Stream.NOISE, rollout, robot).standard_normal(2)
    return float(left), float(right)


Key = tuple[str, Route, int, int]
"""Robot, legs driven, rollout, and the trial under ``physics``, else 0: what a drive depends on in one execution."""


Drives = dict[Key, Driven]
"""What was driven already, of the same world, seed and fidelity."""


def execute(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], settings: Settings,
    executor: Executor | None = None, progress: Callable[[int, int], None] | None = None,
    drives: Drives | None = None,
) -> list[Executed]:
    """Execute plans over all trials.

    Args:
        world: The world.
        costs: Fuel costs by the name of the robot model.
        cases: Plans with their scenarios; drives that several of them share are made once.
        settings: Seed, trials, rollouts, fidelity.
        executor: Where drives run; ``None`` = here.
        progress: Called with the number of drives done and of all.
        drives: What was driven already; what is driven now is added.
    """
    drives = {} if drives is None else drives
    orders = [[_orders(world, robot, case.plan.route(robot.name)) for robot in world.robots] for case in cases]
    fails = [_failures(world, case, own, settings) for case, own in zip(cases, orders, strict=True)]
    tasks = _tasks(world, costs, settings, orders, fails)
    drives.update(_drive_all({key: task for key, task in tasks.items() if key not in drives}, executor, progress))
    return [_settle_all(world, costs, case, own, failed, settings, drives)
            for case, own, failed in zip(cases, orders, fails, strict=True)]


def drives_ahead(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], settings: Settings
) -> dict[Key, DriveTask]:
    """Every drive that some trial may need, whatever its number; not for ``physics``, where each trial has its own."""
    tasks: dict[Key, DriveTask] = {}
    for case in cases:
        for number, robot in enumerate(world.robots):
            route = case.plan.route(robot.name)
            can_leave = route and process_of(world.execute_failure).can_leave(_reliability(robot, case))
            for rollout in range(min(settings.rollouts, settings.trials) if can_leave else 0):
                key = (robot.name, route, rollout, 0)
                if key not in tasks:
                    tasks[key] = _task(world, costs, settings, number, key, traced=False)
    return tasks


def settle_trials(
    world: World, cases: Sequence[Case], settings: Settings, drives: Mapping[Key, Driven]
) -> list[Executed]:
    """Settle trials by drives made ahead, which cannot be recorded."""
    settled = []
    for case in cases:
        orders = [_orders(world, robot, case.plan.route(robot.name)) for robot in world.robots]
        settled.append(_settle_all(world, {}, case, orders, _failures(world, case, orders, settings), settings, drives))
    return settled


def _orders(world: World, robot: Robot, route: Route) -> Assignment:
    return Assignment(
        robot=robot.name, route=route, stations=frozenset(s.name for s in world.stations),
        incentives=robot.incentives, stop_s={s.name: s.stop_s for s in world.sites},
        fuel_capacity_s=robot.fuel_capacity_s, mission_limit_s=robot.mission_limit_s)


def _failures(world: World, case: Case, orders: Sequence[Assignment], settings: Settings) -> IntArray:
    pois = np.array([sum(o.is_poi(site) for site in o.route) for o in orders])
    fails = process_of(world.execute_failure).draw(FailureDraw(
        seed=settings.seed, vehicles=tuple(robot.name for robot in world.robots), trials=settings.trials,
        first=settings.first, pois=int(pois.max(initial=0)), joint=case.scenario.joint,
        reliability=tuple(_reliability(robot, case) for robot in world.robots))).before_poi
    return np.where(fails > pois, NEVER, fails)  # draws for a longer route of another robot mean nothing to this one


def _reliability(robot: Robot, case: Case) -> Reliability:
    return Reliability(availability=case.scenario.availability[robot.name], mission_limit_s=robot.mission_limit_s)


def _tasks(
    world: World, costs: Mapping[str, FuelCosts], settings: Settings, orders: Sequence[Sequence[Assignment]],
    fails: Sequence[IntArray],
) -> dict[Key, DriveTask]:
    """The drives that some trial needs: a robot that fails at the base in all its trials drives none."""
    tasks: dict[Key, DriveTask] = {}
    for own, failed in zip(orders, fails, strict=True):
        for number, order in enumerate(own):
            for row in _alike(settings, failed[:, number])[0]:
                trial = settings.first + row
                key = _key(settings, order, trial, int(failed[row, number]))
                if key is not None and key not in tasks:
                    traced = settings.recorded and (row == 0 or (key[2] == 0 and settings.fidelity != "physics"))
                    tasks[key] = _task(world, costs, settings, number, key, traced=traced)
    return tasks


def _task(
    world: World, costs: Mapping[str, FuelCosts], settings: Settings, number: int, key: Key, *, traced: bool
) -> DriveTask:
    base, model = world.sites[0], world.robots[number].model
    solids = replace(world.obstacles, cells=None)  # a worker needs the boxes alone
    return DriveTask(
        obstacles=solids, model=model, start=(base.x_m, base.y_m, base.heading_rad),
        legs=_legs(costs[model.name], key[1]), wheel_gains=wheel_gains(settings.seed, key[2], number, world.noise),
        fidelity=settings.fidelity, traced=traced)


def _alike(settings: Settings, failed: IntArray) -> tuple[list[int], IntArray]:
    """Trials that end alike, since they share a drive and fail alike.

    Returns:
        The first row of each kind, in order; the kind of each row, shape (trials,).
    """
    rows = np.arange(len(failed))
    if settings.fidelity == "physics":
        return rows.tolist(), rows
    _, how = np.unique(failed, return_inverse=True)
    kind = how * settings.rollouts + (settings.first + rows) % settings.rollouts
    _, first, kind = np.unique(kind, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return first[order].tolist(), rank[kind]


def _key(settings: Settings, order: Assignment, trial: int, fails_before: int) -> Key | None:
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


def _legs(costs: FuelCosts, route: Route) -> tuple[Leg, ...]:
    return tuple(tuple(costs.times.course(a, b) for a, b in pairwise(costs.chain(*leg))) for leg in pairwise(route))


def _drive_all(
    tasks: Mapping[Key, DriveTask], executor: Executor | None, progress: Callable[[int, int], None] | None
) -> Drives:
    drives: Drives = {}
    if executor is None:
        for key, task in tasks.items():
            drives[key] = drive_route(task)
            if progress:
                progress(len(drives), len(tasks))
        return drives
    # The longest first, so that no worker is left with one at the end.
    order = sorted(tasks, key=lambda key: -len(tasks[key].legs))
    futures = {executor.submit(drive_route, tasks[key]): key for key in order}
    try:
        for future in as_completed(futures):
            drives[futures[future]] = future.result()
            if progress:
                progress(len(drives), len(tasks))
    finally:
        for future in futures:
            future.cancel()
    return drives


def _settle_all(
    world: World, costs: Mapping[str, FuelCosts], case: Case, orders: Sequence[Assignment], fails: IntArray,
    settings: Settings, drives: Mapping[Key, Driven],
) -> Executed:
    shape = fails.shape
    rollout = (settings.first + np.arange(settings.trials)) % settings.rollouts
    incentive, end_time, fuel = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    pois, stops, end = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    traces = []
    mine: dict[Key, Driven] = {}
    for number, order in enumerate(orders):
        rows, kind = _alike(settings, fails[:, number])
        outcomes = []
        for row in rows:
            failed = int(fails[row, number])
            key = _key(settings, order, settings.first + row, failed)
            driven = _drive_of(drives, key)
            outcomes.append(settle(order, driven, failed))
            if key is not None:
                mine[key] = driven
        for column, figures in (
                (incentive, [o.incentive for o in outcomes]), (end_time, [o.end_time_s for o in outcomes]),
                (fuel, [o.fuel_used_s for o in outcomes]), (end, [ENDS.index(o.end) for o in outcomes]),
                (pois, [o.pois_reached for o in outcomes]), (stops, [o.stops_reached for o in outcomes])):
            column[:, number] = np.array(figures)[kind]
        if settings.recorded:
            key = _key(settings, order, settings.first, int(fails[0, number]))
            traces.append(_trace(world, costs[world.robots[number].model.name], order, _drive_of(drives, key),
                                 outcomes[kind[0]]))
    return Executed(
        case=case, robots=tuple(robot.name for robot in world.robots), rollout=rollout,
        available=fails == NEVER, incentive=incentive, pois_reached=pois, stops_reached=stops, end=end,
        end_time_s=end_time, fuel_used_s=fuel,
        planned_incentive=np.array([sum(o.incentives.get(s, 0.0) for s in o.route) for o in orders]),
        drawn_incentive=np.column_stack([_left_by_draws(o, fails[:, k]) for k, o in enumerate(orders)]),
        margins=margins_of_team(orders, drives),
        legs=tuple(_leg_times(world, costs, mine)) if settings.recorded else (), traces=tuple(traces))


def _left_by_draws(orders: Assignment, fails: IntArray) -> FloatArray:
    """What each trial's draw leaves of a route: the POIs before the failure, shape (trials,)."""
    earned = [orders.incentives.get(site, 0.0) for site in orders.route if orders.is_poi(site)]
    collected = np.concatenate([[0.0], np.cumsum(earned)])
    left: FloatArray = collected[np.where(fails == NEVER, len(earned), np.maximum(fails - 1, 0))]
    return left


_NOTHING = Driven(leg_s=np.empty(0), stuck=False, leg_of=np.empty(0), clock_s=np.empty(0), pose=np.empty((0, 3)))


def _drive_of(drives: Mapping[Key, Driven], key: Key | None) -> Driven:
    """The drive of a robot; nothing where it never leaves."""
    return _NOTHING if key is None else drives[key]


def _trace(world: World, costs: FuelCosts, order: Assignment, driven: Driven, outcome: Outcome) -> Trace:
    base = world.sites[0]
    planned = [costs.times.path(a, b) for leg in pairwise(order.route) for a, b in pairwise(costs.chain(*leg))]
    return trace_of(order, driven, outcome, (base.x_m, base.y_m, base.heading_rad),
                    np.concatenate(planned) if planned else np.empty((0, 2)))


def _leg_times(world: World, costs: Mapping[str, FuelCosts], drives: Mapping[Key, Driven]) -> list[LegTime]:
    """Every leg of the drives given; of trials that share a drive, once."""
    models = {robot.name: robot.model.name for robot in world.robots}
    rows = []
    for (robot, route, rollout, _), driven in drives.items():
        fuel = costs[models[robot]]
        for leg, (driven_s, (origin, destination)) in enumerate(
                zip(driven.leg_s.tolist(), pairwise(route), strict=False)):  # a stuck robot drives fewer
            planned_ms = fuel.repaired_ms[fuel.times.sites.index(origin), fuel.times.sites.index(destination)]
            rows.append(LegTime(rollout=rollout, robot=robot, leg=leg, origin=origin, destination=destination,
                                planned_s=int(planned_ms) / 1000, driven_s=driven_s))
    return rows
