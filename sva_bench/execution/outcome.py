"""What comes of a driven route: who got how far, when, and with what. Pure functions of driven times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sva_bench.arrays import FloatArray, frozen
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
    """

    leg_s: FloatArray
    stuck: bool
    leg_of: FloatArray
    clock_s: FloatArray
    pose: FloatArray

    def __post_init__(self) -> None:
        n = len(self.clock_s)
        object.__setattr__(self, "leg_s", frozen(self.leg_s, (None,)))
        object.__setattr__(self, "leg_of", frozen(self.leg_of, (n,)))
        object.__setattr__(self, "clock_s", frozen(self.clock_s, (n,)))
        object.__setattr__(self, "pose", frozen(self.pose, (n, 3)))


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
    """

    robot: str
    route: tuple[str, ...]
    stations: frozenset[str]
    incentives: Mapping[str, float]
    stop_s: Mapping[str, float]
    fuel_capacity_s: float
    mission_limit_s: float

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
        available: Whether it was never drawn to fail.
        incentive: What it collected.
        pois_reached: POIs it reached, those too late to earn anything included.
        stops_reached: Stops it reached, the base at the end included.
        end: How it ended.
        end_time_s: When [s on the mission clock].
        fuel_used_s: Fuel of the whole mission [s of driving].
        events: What happened, in order.
    """

    available: bool
    incentive: float
    pois_reached: int
    stops_reached: int
    end: End
    end_time_s: float
    fuel_used_s: float
    events: tuple[Event, ...]


def settle(orders: Assignment, driven: Driven, fails_before: int = NEVER) -> Outcome:
    """What comes of a driven route under the rules of the mission.

    A POI is collected when its stop is over, if that is within the mission limit. A late robot drives on and earns
    nothing more. Fuel burns while driving; the tank is filled at each station's stop.

    Args:
        orders: Route and rules.
        driven: Driving time of its legs, at least of those before a failure.
        fails_before: 0: fails before leaving the base; k: on leaving its last stop for the k-th POI; ``NEVER``.
    """
    available = fails_before == NEVER
    if not orders.route:
        return Outcome(available=available, incentive=0.0, pois_reached=0, stops_reached=0, end="home", end_time_s=0.0,
                       fuel_used_s=0.0, events=())
    base = orders.route[0]
    if fails_before == 0:
        return Outcome(available=False, incentive=0.0, pois_reached=0, stops_reached=0, end="failed", end_time_s=0.0,
                       fuel_used_s=0.0, events=(Event(time_s=0.0, kind="failed", site=base),))
    clock = fuel = incentive = 0.0
    tank = orders.fuel_capacity_s
    pois = stops = 0
    late = False
    events = [Event(time_s=0.0, kind="departed", site=base)]

    def ended(end: End, where: str) -> Outcome:
        events.append(Event(time_s=clock, kind=end, site=where))
        return Outcome(available=available, incentive=incentive, pois_reached=pois, stops_reached=stops, end=end,
                       end_time_s=clock, fuel_used_s=fuel, events=tuple(events))

    times = driven.leg_s.tolist()
    for leg, (origin, site) in enumerate(pairwise(orders.route)):
        if orders.is_poi(site) and pois + 1 == fails_before:
            return ended("failed", origin)
        time_s = times[leg]
        drives = min(time_s, max(tank, 0.0)) if time_s > tank + TOLERANCE_S else time_s
        clock, fuel, tank = clock + drives, fuel + drives, tank - drives
        if drives < time_s:
            return ended("out_of_fuel", site)
        if driven.stuck and leg == len(times) - 1:
            return ended("stuck", site)
        stops += 1
        events.append(Event(time_s=clock, kind="arrived", site=site))
        clock += orders.stop_s[site]
        if clock > orders.mission_limit_s + TOLERANCE_S and not late:
            late = True
            events.append(Event(time_s=clock, kind="late", site=site))
        if site in orders.stations:
            tank = orders.fuel_capacity_s
            events.append(Event(time_s=clock, kind="refuelled", site=site))
        elif orders.is_poi(site):
            pois += 1
            if not late:
                earned = orders.incentives.get(site, 0.0)
                incentive += earned
                events.append(Event(time_s=clock, kind="collected", site=site, incentive=earned))
    return ended("late" if late else "home", base)


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
    orders: Assignment, driven: Driven, outcome: Outcome, start: tuple[float, float, float], planned: FloatArray
) -> Trace:
    """Lay a traced drive on the mission clock: stops put in, cut off where the mission ended."""
    times, poses, fuels = [np.zeros(1)], [np.array([start])], [np.array([orders.fuel_capacity_s])]
    clock, tank = 0.0, orders.fuel_capacity_s
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
