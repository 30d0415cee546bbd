"""What a robot is told to do, what it drove, and what came of it: the types, and the trace of a mission."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from sva_bench.arrays import FloatArray, IntArray, frozen
from sva_bench.choices import End, EventKind, Fault
from sva_bench.execution.touch import Touch
from sva_bench.mission.failures import NEVER
from sva_bench.mission.instance import TOLERANCE_S
from sva_bench.robot.disturbance import NO_WAVES, error_at, room_for


@dataclass(frozen=True, kw_only=True)
class Wait:
    """A wait on the way.

    Attributes:
        leg: The leg of the route.
        lasts_s: How long [s].
        x_m, y_m: Where the robot has to stop [m].
        cause: Name of the passage that was shut, or of the robot that was in the way; or ``people``.
        since_s: After how much driving since the leg began [s]; by its place along the path, so about.
    """

    leg: int
    lasts_s: float
    x_m: float
    y_m: float
    cause: str
    since_s: float = 0.0


HELD_S = 10.0  # contact so shortly before a robot gave up is what held it: it takes so long to give up


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
        touches: Each time that the hull came to touch an obstacle.
        waits: Each time that it waits on its way; they are no part of ``leg_s``.
        capacity: Factor on what the robot's tank holds.
        in_physics: Share of its driving time that was driven in physics.
        twin_s: Driving time by the twin [s], where physics drove to check it; else ``None``.
        fault: Why it got stuck where nothing held it.
        start_s: When it sets off [s on the mission clock].
    """

    leg_s: FloatArray
    stuck: bool
    leg_of: FloatArray
    clock_s: FloatArray
    pose: FloatArray
    touches: tuple[Touch, ...] = ()
    waits: tuple[Wait, ...] = ()
    capacity: float = 1.0
    in_physics: float = 0.0
    twin_s: float | None = None
    fault: Fault | None = None
    start_s: float = 0.0

    def __post_init__(self) -> None:
        n = len(self.clock_s)
        object.__setattr__(self, "leg_s", frozen(self.leg_s, (None,)))
        object.__setattr__(self, "leg_of", frozen(self.leg_of, (n,)))
        object.__setattr__(self, "clock_s", frozen(self.clock_s, (n,)))
        object.__setattr__(self, "pose", frozen(self.pose, (n, 3)))

    @property
    def contacts(self) -> IntArray:
        """How many times the hull came to touch an obstacle on each leg, shape (legs,)."""
        return np.bincount(np.array([touch.leg for touch in self.touches], dtype=np.int64), minlength=len(self.leg_s))

    def touches_on(self, leg: int) -> tuple[Touch, ...]:
        """The touches on a leg."""
        return tuple(touch for touch in self.touches if touch.leg == leg)

    def waits_on(self, leg: int) -> tuple[Wait, ...]:
        """The waits on a leg, as it would be driven to its end."""
        return tuple(wait for wait in self.waits if wait.leg == leg)

    @property
    def held_by(self) -> str:
        """What a stuck robot was held by: its fault, the obstacle that it touches to the end, or nothing."""
        if not self.stuck or self.fault:
            return self.fault or ""
        last, end_s = len(self.leg_s) - 1, float(self.leg_s[-1])
        held = [touch.solid for touch in self.touches
                if touch.leg == last and touch.since_s + touch.lasted_s >= end_s - HELD_S]
        return held[-1] if held else ""

    @property
    def waited_s(self) -> FloatArray:
        """How long it waits on each leg [s], shape (legs,); not on legs that it doesn't begin."""
        waited = np.zeros(len(self.leg_s))
        for wait in self.waits:
            if wait.leg < len(waited):
                waited[wait.leg] += wait.lasts_s
        return waited


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
        idle_share: Share of the fuel of driving that it burns while it stands.
        charge_rate: Seconds of driving gained per second at a station, of those where it takes its time.
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
    idle_share: float = 0.0
    charge_rate: Mapping[str, float] = field(default_factory=dict)

    def is_poi(self, site: str) -> bool:
        """Whether a site of the route is a POI."""
        return site != self.route[0] and site not in self.stations


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something worth telling.

    Attributes:
        time_s: When [s on the mission clock].
        kind: What.
        site: Where; of what happens on the way, the site that the robot is going to.
        incentive: What it earned.
        what: What was touched, or made it wait; of a stuck robot, what held it.
        lasts_s: How long it waits, or touched it [s].
        at_m: Where it waits, or touched it [m].
    """

    time_s: float
    kind: EventKind
    site: str
    incentive: float = 0.0
    what: str = ""
    lasts_s: float = 0.0
    at_m: tuple[float, float] | None = None


def met_on_leg(to: str, begun_s: float, waits: Sequence[Wait], touches: Sequence[Touch], driven_s: float
               ) -> tuple[Event, ...]:
    """Waits and touches on a leg as events, in order of time.

    Args:
        to: Where it leads.
        begun_s: When it began [s on the mission clock].
        waits, touches: Those of the leg.
        driven_s: How long it was driven [s]; what would come later never happens.
    """
    met: list[tuple[float, EventKind, Wait | Touch, str, float]] = [
        *((wait.since_s, "waits", wait, wait.cause, wait.lasts_s) for wait in waits),
        *((touch.since_s, "touches", touch, touch.solid, touch.lasted_s) for touch in touches)]
    events, waited_s = [], 0.0
    for since_s, kind, one, what, lasts_s in sorted(met, key=lambda m: m[0]):
        if since_s <= driven_s + TOLERANCE_S:
            events.append(Event(time_s=begun_s + waited_s + since_s, kind=kind, site=to, what=what, lasts_s=lasts_s,
                                at_m=(one.x_m, one.y_m)))
            waited_s += lasts_s if kind == "waits" else 0.0
    return tuple(events)


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
        driven_s: How long it drove [s].
        waited_s: How long it waited beside its stops [s].
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
    driven_s: float
    waited_s: float
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
        believed: x, y where it believes to be at each time [m], shape (n, 2); empty if it knows where it is.
    """

    orders: Assignment
    outcome: Outcome
    time_s: FloatArray
    pose: FloatArray
    fuel_s: FloatArray
    planned: FloatArray
    believed: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))

    def __post_init__(self) -> None:
        n = len(self.time_s)
        object.__setattr__(self, "believed", frozen(self.believed, (None, 2)))
        object.__setattr__(self, "time_s", frozen(self.time_s, (n,)))
        object.__setattr__(self, "pose", frozen(self.pose, (n, 3)))
        object.__setattr__(self, "fuel_s", frozen(self.fuel_s, (n,)))
        object.__setattr__(self, "planned", frozen(self.planned, (None, 2)))


def trace_of(
    orders: Assignment, driven: Driven, outcome: Outcome, start: tuple[float, float, float], planned: FloatArray,
    start_s: float = 0.0, waves: FloatArray = NO_WAVES,
) -> Trace:
    """Lay a traced drive on the mission clock: stops put in, cut off where the mission ended.

    Args:
        orders: Its orders; the route is the one driven.
        driven: The drive.
        outcome: What came of it.
        start: Where it stands at rest: x, y [m], yaw [rad].
        planned: The path that was planned [m], shape (k, 2).
        start_s: When it leaves the base [s].
        waves: Those of the error of its localisation; none if it knows where it is.
    """
    times, poses, fuels = [np.zeros(1)], [np.array([start])], [np.array([orders.fuel_capacity_s])]
    clock, tank, burnt = start_s, orders.fuel_capacity_s, 0.0
    met: list[Event] = []
    if start_s > 0:
        times, poses, fuels = [np.array([0.0, start_s])], [np.array([start] * 2)], [np.full(2, tank)]
    for leg, leg_s in enumerate(driven.leg_s.tolist()):
        mine = driven.leg_of == leg
        until_s = max(outcome.driven_s - float(driven.leg_s[:leg].sum()), 0.0)
        waits = [_located(wait, driven.clock_s[mine], driven.pose[mine], until_s) for wait in driven.waits_on(leg)]
        met += met_on_leg(orders.route[leg + 1], clock, waits, driven.touches_on(leg), math.inf)
        driven_s, waited_s, pose = _paused(driven.clock_s[mine], driven.pose[mine], waits, poses[-1][-1])
        times.append(clock + driven_s + waited_s)
        poses.append(pose)
        fuels.append(tank - (driven_s + orders.idle_share * waited_s) / driven.capacity)
        all_waited_s = sum(wait.lasts_s for wait in waits)
        site = orders.route[leg + 1]
        clock, burnt = clock + leg_s + all_waited_s, burnt + leg_s + orders.idle_share * all_waited_s
        stop_s = orders.stop_s[site]
        if site in orders.stations:
            stop_s, burnt = stop_s + burnt / orders.charge_rate.get(site, math.inf), 0.0
        elif leg < len(orders.route) - 2:
            burnt += orders.idle_share * stop_s
        tank = orders.fuel_capacity_s - burnt / driven.capacity
        if stop_s > 0 and len(poses[-1]):
            clock += stop_s
            times.append(np.array([clock]))
            poses.append(poses[-1][-1:])
            fuels.append(np.array([tank]))
    time, pose, fuel = np.concatenate(times), np.concatenate(poses), np.maximum(np.concatenate(fuels), 0.0)
    kept = time <= outcome.end_time_s + TOLERANCE_S
    time, pose, fuel = time[kept], pose[kept], fuel[kept]
    if time[-1] < outcome.end_time_s:
        time, pose = np.append(time, outcome.end_time_s), np.append(pose, pose[-1:], axis=0)
        fuel = np.append(fuel, 0.0 if outcome.end == "out_of_fuel" else fuel[-1])
    return Trace(orders=orders, outcome=replace(outcome, events=_retold(outcome.events, met)), time_s=time, pose=pose,
                 fuel_s=fuel, planned=planned, believed=believed(pose, waves))


def believed(pose: FloatArray, waves: FloatArray) -> FloatArray:
    """Where a robot believes to be, shape (n, 2); nothing without an error."""
    parts = room_for(waves)
    errors = [error_at(waves, parts, x, y)[:2] for x, y, _ in pose.tolist()] if parts.size else []
    return pose[:, :2] + np.array(errors) if errors else np.zeros((0, 2))


def _retold(events: Sequence[Event], met: Sequence[Event]) -> tuple[Event, ...]:
    """Events of a mission, its waits and touches at the times that poses give; as many of these as it told."""
    end_s, again = events[-1].time_s if events else 0.0, iter(met)
    return tuple(replace(known, time_s=min(known.time_s, end_s)) if event.kind in ("waits", "touches")
                 and (known := next(again, None)) is not None else event for event in events)


def _located(wait: Wait, clock_s: FloatArray, pose: FloatArray, until_s: float) -> Wait:
    """A wait where the robot comes nearest to the place of it, or where it drives no further."""
    since_s = wait.since_s
    if len(clock_s):
        since_s = float(clock_s[np.hypot(pose[:, 0] - wait.x_m, pose[:, 1] - wait.y_m).argmin()])
    return replace(wait, since_s=min(since_s, until_s))


def _paused(clock_s: FloatArray, pose: FloatArray, waits: Sequence[Wait], begun: FloatArray
            ) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A leg over time with its waits.

    Args:
        clock_s, pose: As of ``Driven``, of the leg.
        waits: Its waits.
        begun: The pose in which it begins.

    Returns:
        Time driven, time waited, and pose at each moment.
    """
    clock_s, pose = np.concatenate([[0.0], clock_s]), np.concatenate([begun[None], pose])
    waited_s = np.zeros(len(clock_s))
    for wait in waits:
        at = max(int(np.searchsorted(clock_s, wait.since_s, side="right")), 1)
        clock_s, pose = np.insert(clock_s, at, clock_s[at - 1]), np.insert(pose, at, pose[at - 1], axis=0)
        waited_s = np.insert(waited_s, at, waited_s[at - 1])
        waited_s[at:] += wait.lasts_s
    return clock_s[1:], waited_s[1:], pose[1:]
