"""What a robot is told to do, what it drove, and what came of it: the types, and the trace of a mission."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from sva_bench.arrays import FloatArray, IntArray, frozen, frozen_int
from sva_bench.choices import End, EventKind
from sva_bench.mission.failures import NEVER
from sva_bench.mission.instance import TOLERANCE_S


@dataclass(frozen=True, eq=False, kw_only=True)
class Driven:
    """One robot's whole route, driven once.

    Attributes:
        leg_s: Driving time of each leg [s], shape (legs,); a leg it got stuck on holds the time until it gave up,
            and is the last.
        stuck: Whether it got stuck on the last leg.
        leg_of: Leg that each pose belongs to, shape (poses,); empty unless traced.
        clock_s: Driving time at each pose since its leg began [s], shape (poses,).
        pose: x, y [m], yaw [rad] over time, shape (poses, 3).
        contacts: How many times the hull came to touch an obstacle on each leg, shape (legs,); none unless given.
    """

    leg_s: FloatArray
    stuck: bool
    leg_of: FloatArray
    clock_s: FloatArray
    pose: FloatArray
    contacts: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __post_init__(self) -> None:
        n = len(self.clock_s)
        if not len(self.contacts):
            object.__setattr__(self, "contacts", np.zeros(len(self.leg_s), dtype=np.int64))
        object.__setattr__(self, "contacts", frozen_int(self.contacts, (len(self.leg_s),)))
        object.__setattr__(self, "leg_s", frozen(self.leg_s, (None,)))
        object.__setattr__(self, "leg_of", frozen(self.leg_of, (n,)))
        object.__setattr__(self, "clock_s", frozen(self.clock_s, (n,)))
        object.__setattr__(self, "pose", frozen(self.pose, (n, 3)))


class RobotFate(NamedTuple):
    """When one robot fails; it does so by whichever comes first.

    Attributes:
        before_poi: 0: before it leaves the base; k: on leaving its last stop for the k-th POI that it tries; ``NEVER``.
        lifetime_s: Driving time after which it fails, on whatever leg [s]; ``inf`` = never.
    """

    before_poi: int = NEVER
    lifetime_s: float = math.inf


@dataclass(frozen=True, eq=False, kw_only=True)
class Assignment:
    """One robot's orders: its route, and the rules it drives under.

    Attributes:
        robot: Its name.
        route: Site names from base to base; empty = it stays home.
        stations: Names of the refuelling stations.
        incentives: What it earns at each POI.
        stop_s: Time that a stop at each site takes.
        fuel_capacity_s: Driving time on one filling [s].
        mission_limit_s: Longest mission that still earns [s].
        loss_cost: Cost if it doesn't come home [incentive].
        planned_s: Driving time of each leg as planned [s], without margin, length (legs,); nothing where unknown.
    """

    robot: str
    route: tuple[str, ...]
    stations: frozenset[str]
    incentives: Mapping[str, float]
    stop_s: Mapping[str, float]
    fuel_capacity_s: float
    mission_limit_s: float
    loss_cost: float = 0.0
    planned_s: tuple[float, ...] = ()

    def is_poi(self, site: str) -> bool:
        """Whether a site of the route is a POI."""
        return site != self.route[0] and site not in self.stations


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something worth telling: what, when, where, and what it earned."""

    time_s: float
    kind: EventKind
    site: str
    incentive: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One robot's mission.

    Attributes:
        available: Whether it was never drawn to fail; of lifetimes, whether its own outlasted what it drove.
        incentive: What it collected.
        lost: Whether it failed on its way, ran out of fuel or got stuck: it doesn't come home.
        value: What it collected, less the cost of its loss.
        pois_reached: POIs it reached, those too late to earn anything included.
        stops_reached: Stops it reached, the base at the end included.
        end: How it ended.
        end_time_s: When [s on the mission clock].
        fuel_used_s: Fuel of the whole mission [s of driving].
        contacts: How many times its hull came to touch an obstacle; on a leg that it ran dry or failed on, all of it.
        events: What happened, in order.
    """

    available: bool
    incentive: float
    lost: bool
    value: float
    pois_reached: int
    stops_reached: int
    end: End
    end_time_s: float
    fuel_used_s: float
    contacts: int
    events: tuple[Event, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Trace:
    """One robot's mission over time, for the recording.

    Attributes:
        orders: Its orders.
        outcome: What came of them.
        time_s: Mission clock, ascending, shape (n,); stops included, cut off where the mission ended.
        pose: x, y [m], yaw [rad], shape (n, 3).
        fuel_s: Fuel left [s of driving], shape (n,); ``inf`` without a limit.
        planned: The path that was planned [m], shape (k, 2); empty if it stays home.
    """

    orders: Assignment
    outcome: Outcome
    time_s: FloatArray
    pose: FloatArray
    fuel_s: FloatArray
    planned: FloatArray

    def __post_init__(self) -> None:
        n = len(self.time_s)
        object.__setattr__(self, "time_s", frozen(self.time_s, (n,)))
        object.__setattr__(self, "pose", frozen(self.pose, (n, 3)))
        object.__setattr__(self, "fuel_s", frozen(self.fuel_s, (n,)))
        object.__setattr__(self, "planned", frozen(self.planned, (None, 2)))


def trace_of(
    orders: Assignment, driven: Driven, outcome: Outcome, start: tuple[float, float, float], planned: FloatArray,
    start_s: float = 0.0,
) -> Trace:
    """Lay a traced drive on the mission clock: stops put in, cut off where the mission ended.

    Args:
        orders: Its orders; the route is the one driven.
        driven: The drive.
        outcome: What came of it.
        start: Where it stands at rest: x, y [m], yaw [rad].
        planned: The path that was planned [m], shape (k, 2).
        start_s: When it leaves the base [s].
    """
    times, poses, fuels = [np.zeros(1)], [np.array([start])], [np.array([orders.fuel_capacity_s])]
    clock, tank = start_s, orders.fuel_capacity_s
    if start_s > 0:
        times, poses, fuels = [np.array([0.0, start_s])], [np.array([start] * 2)], [np.full(2, tank)]
    for leg, leg_s in enumerate(driven.leg_s.tolist()):
        mine = driven.leg_of == leg
        times.append(clock + driven.clock_s[mine])
        poses.append(driven.pose[mine])
        fuels.append(tank - driven.clock_s[mine])
        site = orders.route[leg + 1]
        clock, tank = clock + leg_s, tank - leg_s
        wait = orders.stop_s[site]
        if site in orders.stations:
            tank = orders.fuel_capacity_s
        if wait > 0 and len(poses[-1]):
            clock += wait
            times.append(np.array([clock]))
            poses.append(poses[-1][-1:])
            fuels.append(np.array([tank]))
    time, pose, fuel = np.concatenate(times), np.concatenate(poses), np.concatenate(fuels)
    kept = time <= outcome.end_time_s + TOLERANCE_S
    time, pose, fuel = time[kept], pose[kept], fuel[kept]
    if time[-1] < outcome.end_time_s:
        time, pose = np.append(time, outcome.end_time_s), np.append(pose, pose[-1:], axis=0)
        fuel = np.append(fuel, 0.0 if outcome.end == "out_of_fuel" else fuel[-1])
    return Trace(orders=orders, outcome=outcome, time_s=time, pose=pose, fuel_s=fuel, planned=planned)
