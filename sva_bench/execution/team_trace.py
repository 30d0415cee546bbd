"""One mission of a team that reacts over time: what each robot really drove, and how news changed its orders."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from sva_bench.arrays import FloatArray, frozen
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Courses, Drives, RouteKey, drive_all, pose_at
from sva_bench.execution.execute import NOTHING
from sva_bench.execution.executed import LegTime
from sva_bench.execution.known_legs import KnownLegs
from sva_bench.execution.noise import draw_noise
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.outcome import Outcome, Trace, trace_of
from sva_bench.execution.team_outcome import Reaction, TeamOutcome
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World


@dataclass(frozen=True, eq=False, kw_only=True)
class Rerouted:
    """A robot's remaining orders as news changes them.

    Attributes:
        robot: Its name.
        taken: POIs that it takes over.
        dropped: POIs that it leaves to others, or to nobody.
        old, new: The path of what was left of its orders, and of what is now [m], shape (k, 2).
    """

    robot: str
    taken: tuple[str, ...]
    dropped: tuple[str, ...]
    old: FloatArray
    new: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "old", frozen(self.old, (None, 2)))
        object.__setattr__(self, "new", frozen(self.new, (None, 2)))


@dataclass(frozen=True, eq=False, kw_only=True)
class NewsHeard:
    """News of failures: when it came [s], of whom, who learned of it, and whose orders changed."""

    time_s: float
    failed: tuple[str, ...]
    learned: tuple[str, ...]
    rerouted: tuple[Rerouted, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class TeamTrace:
    """One mission over time.

    Attributes:
        trial: Its number.
        traces: The first is that of the first robot, and so on; their routes are those that were driven.
        news: What was heard, in order.
    """

    trial: int
    traces: tuple[Trace, ...]
    news: tuple[NewsHeard, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Played:
    """A mission that was played: its case, number, noise draw and weight, and what came of it."""

    case: Case
    trial: int
    rollout: int
    weight: float
    outcome: TeamOutcome


def trace_teams(
    world: World, costs: Mapping[str, FuelCosts], settings: Settings, missions: Sequence[Played],
    executor: Executor | None = None, known: Drives | None = None,
) -> list[TeamTrace]:
    """Drive again what the robots of some missions drove, and keep where they were.

    Args:
        world, costs, settings: As the missions were played.
        missions: The missions.
        executor: Where drives run; ``None`` = here.
        known: What was driven already; hops that are traced are taken from there, and added.
    """
    wanted: dict[RouteKey, bool] = {
        (robot.name, stops, mission.rollout, 0): True for mission in missions
        for robot, stops in zip(world.robots, mission.outcome.stops, strict=True) if len(stops) > 1}
    # Whole routes that are known already may have no poses.
    drives, courses = Drives(hops={} if known is None else known.hops), Courses(world, costs, settings)
    drive_all(courses.chunks(wanted, drives), drives, executor, None)
    courses.compose(wanted, drives)
    return [_trace_team(world, costs, mission, drives, settings.seed) for mission in missions]


def _trace_team(world: World, costs: Mapping[str, FuelCosts], mission: Played, drives: Drives, seed: int) -> TeamTrace:
    traces = []
    for number, (robot, orders, stops, outcome) in enumerate(zip(
            world.robots, orders_of(world, mission.case, planned_legs(world, costs, [mission.case])),
            mission.outcome.stops, mission.outcome.robots, strict=True)):
        left = len(stops) > 1
        traces.append(trace_of(
            replace(orders, route=stops, planned_s=()) if left else orders,
            drives.routes[robot.name, stops, mission.rollout, 0] if left else NOTHING,
            outcome, pose_at(world, costs[world.kind_of(robot)], world.sites[0].name),
            path_of(costs[world.kind_of(robot)], orders.route),
            start_s=_departure_s(outcome),
            waves=draw_noise(world.noise, seed, mission.rollout, number).disturbance.waves))
    return TeamTrace(trial=mission.trial, traces=tuple(traces), news=news_of(world, costs, mission.outcome))


def _departure_s(outcome: Outcome) -> float:
    """When a robot leaves the base: one that was to stay may be sent out later."""
    return next((event.time_s for event in outcome.events if event.kind == "departed"), 0.0)


def news_of(world: World, costs: Mapping[str, FuelCosts], mission: TeamOutcome) -> tuple[NewsHeard, ...]:
    """What was heard in a mission, with the paths that orders change."""
    return tuple(_heard(world, costs, reaction, {
        robot.name for robot, outcome in zip(world.robots, mission.robots, strict=True)
        if outcome.end in _NO_MORE and outcome.end_time_s <= reaction.time_s}) for reaction in mission.reactions)


_NO_MORE = frozenset({"failed", "out_of_fuel", "stuck"})


def _heard(world: World, costs: Mapping[str, FuelCosts], reaction: Reaction, gone: Container[str]) -> NewsHeard:
    """What was heard of some failures; those who are ``gone`` by then are told, as nobody knows, and learn nothing."""
    pois, kinds = {site.name for site in world.pois}, {robot.name: world.kind_of(robot) for robot in world.robots}
    rerouted = []
    for robot, new in reaction.after.items():
        old, since, fuel = reaction.before[robot], reaction.since[robot], costs[kinds[robot]]
        rerouted.append(Rerouted(
            robot=robot, taken=tuple(site for site in new if site in pois and site not in old),
            dropped=tuple(site for site in old if site in pois and site not in new),
            old=path_of(fuel, (since, *old)), new=path_of(fuel, (since, *new))))
    return NewsHeard(time_s=reaction.time_s, failed=reaction.failed,
                     learned=tuple(robot for robot in reaction.learned if robot not in gone), rerouted=tuple(rerouted))


def path_of(costs: FuelCosts, stops: Sequence[str]) -> FloatArray:
    """The planned path over some stops [m], shape (k, 2); none for fewer than two."""
    paths = [costs.times.path(a, b) for leg in pairwise(stops) for a, b in pairwise(costs.chain(*leg))]
    return np.concatenate(paths) if paths else np.empty((0, 2))


def typical(missions: Iterable[Played]) -> Played | None:
    """The first mission of the most probable course of events with changed orders; ``None`` without any.

    Args:
        missions: Missions of one case.
    """
    weights: dict[tuple[object, ...], float] = {}
    first: dict[tuple[object, ...], Played] = {}
    for mission in missions:
        if mission.outcome.orders_change:
            course = mission.outcome.stops, tuple(robot.end for robot in mission.outcome.robots)
            weights[course] = weights.get(course, 0.0) + mission.weight
            first.setdefault(course, mission)
    # Equal weights differ by rounding, as sums over noise draws: of these the first.
    most = max(weights.values(), default=0.0) * (1 - 1e-9)
    return next((first[course] for course, weight in weights.items() if weight >= most), None)


def legs_used(robots: Sequence[str], missions: Iterable[Played], legs: KnownLegs) -> list[LegTime]:
    """Every leg that robots drove, from origin to destination once under each noise draw: in its first mission.

    Args:
        robots: Their names.
        missions: The missions of one case.
        legs: What is known of all their legs.
    """
    seen: set[tuple[int, int, str, str]] = set()
    rows = []
    for mission in missions:
        driven = legs.driven(mission.rollout)
        for robot, stops in enumerate(mission.outcome.stops):
            for leg, (origin, destination) in enumerate(pairwise(stops)):
                key = robot, mission.rollout, origin, destination
                if key not in seen:
                    seen.add(key)
                    done = driven(robot, stops[:leg + 2])
                    rows.append(LegTime(
                        trial=mission.trial, rollout=mission.rollout, robot=robots[robot], leg=leg, origin=origin,
                        destination=destination, planned_s=legs.planned(robot, stops[:leg + 2]).time_s,
                        driven_s=done.time_s, waited_s=done.waited_s, touches=done.touches, waits=done.waits,
                        held_by=done.held_by, cut_short=done.stuck))
    return rows
