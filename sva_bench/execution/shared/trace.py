"""A shared mission over time, for recordings, and leg by leg, for tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.execution.executed import LegTime
from sva_bench.execution.outcome import Assignment, Trace, believed
from sva_bench.execution.rules import legs_of
from sva_bench.execution.shared.driver import LegSoFar
from sva_bench.execution.shared.own_ways import Ways
from sva_bench.execution.shared.players import TeamDriven
from sva_bench.mission.instance import TOLERANCE_S
from sva_bench.travel.fuel import FuelCosts


def traces_of(ways: Ways, orders: Sequence[Assignment], mission: TeamDriven, waves: Sequence[FloatArray]
              ) -> tuple[Trace, ...]:
    """A traced mission over time.

    Args:
        ways: The ways of the robots.
        orders: Their orders.
        mission: The mission.
        waves: Those of the error of each robot's localisation.
    """
    return tuple(_trace(ways, number, own, mission, waves[number]) for number, own in enumerate(orders))


def _trace(ways: Ways, number: int, orders: Assignment, mission: TeamDriven, waves: FloatArray) -> Trace:
    outcome, stops, capacity = mission.robots[number], mission.stops[number], mission.driven[number].capacity
    times, fuels = [np.zeros(1)], [np.array([orders.fuel_capacity_s])]
    poses = [np.array([ways.start(number)])]
    tank = orders.fuel_capacity_s
    for site, parts in zip(stops[1:], mission.trails[number], strict=False):
        for part in parts:
            waited_s = sum(wait.lasts_s for wait in part.waits)
            begun_s = part.clock_s - part.driving_s - waited_s
            times.append(begun_s + part.since_s)
            poses.append(part.pose)
            stood = _waited(part, part.since_s)
            fuels.append(tank - (part.since_s - stood + orders.idle_share * stood) / capacity)
            tank -= (part.driving_s + orders.idle_share * waited_s) / capacity
        if site in orders.stations:
            tank = orders.fuel_capacity_s
        else:
            tank -= orders.idle_share * orders.stop_s[site] / capacity
    time, pose, fuel = np.concatenate(times), np.concatenate(poses), np.maximum(np.concatenate(fuels), 0.0)
    kept = np.append(np.diff(time) > 0, True) & (time <= outcome.end_time_s + TOLERANCE_S)
    kept[0] = True
    time, pose, fuel = time[kept], pose[kept], fuel[kept]
    if time[-1] < outcome.end_time_s:
        time, pose = np.append(time, outcome.end_time_s), np.append(pose, pose[-1:], axis=0)
        fuel = np.append(fuel, 0.0 if outcome.end == "out_of_fuel" else fuel[-1])
    planned = [np.concatenate([stretch.path for hop in way.leg for stretch in hop]) for way in mission.cuts[number]]
    return Trace(orders=replace(orders, route=stops if len(stops) > 1 else ()), outcome=outcome, time_s=time, pose=pose,
                 fuel_s=fuel, planned=np.concatenate(planned) if planned else np.empty((0, 2)),
                 believed=believed(pose, waves))


def _waited(part: LegSoFar, since_s: FloatArray) -> FloatArray:
    """How long it had waited at some moments since its leg was to begin [s]."""
    total, before_s = np.zeros(len(since_s)), 0.0
    for wait in part.waits:
        total = total + np.clip(since_s - (wait.since_s + before_s), 0.0, wait.lasts_s)
        before_s += wait.lasts_s
    return total


def leg_times(
    costs: Sequence[FuelCosts], robots: Sequence[str], missions: Mapping[int, tuple[int, TeamDriven]]
) -> Iterator[LegTime]:
    """Every leg of some missions.

    Args:
        costs: Fuel costs of each robot.
        robots: Their names.
        missions: Noise draw and mission by its first trial.
    """
    for trial, (rollout, mission) in missions.items():
        for robot, fuel, stops, driven, outcome in zip(
                robots, costs, mission.stops, mission.driven, mission.robots, strict=True):
            sites = fuel.times.sites
            for leg, (done, (origin, destination)) in enumerate(zip(legs_of(driven), pairwise(stops), strict=False)):
                planned_ms = fuel.repaired_ms[sites.index(origin), sites.index(destination)]
                yield LegTime(trial=trial, rollout=rollout, robot=robot, leg=leg, origin=origin,
                              destination=destination, planned_s=int(planned_ms) / 1000, driven_s=done.time_s,
                              waited_s=done.waited_s, touches=done.touches, waits=done.waits, held_by=done.held_by,
                              cut_short=leg >= outcome.stops_reached)  # it failed, ran dry or got stuck on it
