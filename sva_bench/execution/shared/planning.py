"""The plan in space and time of a whole mission, and of what is left of one when somebody stands in the way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sva_bench.arrays import IntArray
from sva_bench.execution.engines.engine import Pose
from sva_bench.execution.outcome import Assignment
from sva_bench.execution.shared.lanes import Cut, Itinerary, Lane, Order
from sva_bench.execution.shared.own_ways import Disc, Ways
from sva_bench.execution.shared.space_time import plan_order
from sva_bench.mission.plan import Route


def first_order(ways: Ways, orders: Sequence[Assignment], leaves: Sequence[bool]) -> Order | None:
    """The plan in space and time of a whole mission.

    Args:
        ways: The ways of the robots.
        orders: Their orders.
        leaves: Whether each leaves its berth.

    Returns:
        The order; ``None`` if there is none.
    """
    routes = tuple(own.route if goes else () for own, goes in zip(orders, leaves, strict=True))
    if routes not in ways.orders:
        ways.orders[routes] = _first_order(ways, orders, routes)
    return ways.orders[routes]


def _first_order(ways: Ways, orders: Sequence[Assignment], routes: Sequence[Route]) -> Order | None:
    itineraries = []
    for number, (own, route) in enumerate(zip(orders, routes, strict=True)):
        legs = tuple(ways.candidates(number, a, b) for a, b in pairwise(route))
        itineraries.append(_itinerary(ways, number, ways.start(number), 0.0, legs,
                                      _stops_s(own, route[1:], 0.0, [leg[0].lasts_s for leg in legs])))
    return plan_order(itineraries, ways.gap_m)


def _itinerary(ways: Ways, number: int, stands: Pose, ready_s: float, legs: tuple[tuple[Cut, ...], ...],
               stop_s: tuple[float, ...]) -> Itinerary:
    return Itinerary(radius_m=ways.model(number).radius_m, ready_s=ready_s, legs=legs, stop_s=stop_s,
                     place_m=stands[:2])


def _stops_s(orders: Assignment, stops: Sequence[str], burnt_s: float, lasts_s: Sequence[float]) -> tuple[float, ...]:
    """How long each stop is planned to take [s], time at the charger included."""
    planned = []
    for site, leg_s in zip(stops, lasts_s, strict=True):
        burnt_s, stop_s = burnt_s + leg_s, orders.stop_s[site]
        if site in orders.stations:
            stop_s, burnt_s = stop_s + burnt_s / orders.charge_rate.get(site, math.inf), 0.0
        planned.append(stop_s)
    return tuple(planned)


def uncoordinated(cuts: Sequence[Cut]) -> Lane:
    """The lane of a robot that heeds nobody."""
    cells = [len(way.place_m) for way in cuts]
    first: IntArray = np.concatenate([[0], np.cumsum(cells)]).astype(np.int64)
    starts = np.concatenate([[0.0], np.cumsum([way.lasts_s for way in cuts])])
    return Lane(cuts=tuple(cuts), first_cell=first, place_m=np.concatenate([way.place_m for way in cuts]),
                enter_s=np.concatenate([start + way.enter_s for start, way in zip(starts, cuts, strict=False)]))


@dataclass(frozen=True, eq=False, kw_only=True)
class Present:
    """A robot at rest in the middle of a mission.

    Attributes:
        number: Its position in its team.
        orders: Its orders.
        pose: Where it stands: x, y [m], yaw [rad].
        site: The site at whose place it stands exactly; ``None`` = it is on its way, or beside a site.
        ahead: Stops that are left, the base last; none of a robot whose mission is over.
        ready_s: When it can go on [s].
        burnt_s: Fuel burnt since it was filled [s].
        cuts: The ways of its legs as planned, the one that it is on first; none of legs that are new.
        arc_m: How far along its leg it stands [m]; ``None`` at a stop.
        down: Whether it stands for good.
        name: Its name.
    """

    number: int
    orders: Assignment
    pose: Pose
    site: str | None
    ahead: tuple[str, ...]
    ready_s: float
    burnt_s: float
    cuts: tuple[Cut, ...]
    arc_m: float | None
    down: bool
    name: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Onward:
    """What a robot is to do from now on.

    Attributes:
        ahead: Its stops.
        lane: Its lane; ``None`` = it stays where it is for good.
        needs: Its gate.
        detours: How many of its legs lead round somebody.
        kept_off: Who keeps it from a stop, or from going on.
    """

    ahead: tuple[str, ...]
    lane: Lane | None
    needs: tuple[IntArray, ...]
    detours: int
    kept_off: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Wayout:
    ahead: tuple[str, ...]
    legs: tuple[tuple[Cut, ...], ...]
    detours: int
    kept_off: str


def plan_onward(ways: Ways, team: Sequence[Present], now_s: float) -> list[Onward]:
    """Plan the rest of a mission from where everybody stands.

    Robots that stand for good are driven round. If the others can't all go on, those stay where they are, as few as
    it takes by trying one after the other, without which they can.

    Args:
        ways: The ways of the robots.
        team: The robots.
        now_s: Mission clock [s].
    """
    discs = [_disc(ways, robot) for robot in team if robot.down]
    held: set[int] = set()
    while True:
        found = _tried(ways, team, discs, held, now_s)
        if found is not None:
            return found
        moving = [robot for robot in team if robot.ahead and robot.number not in held]
        for robot in moving:
            found = _tried(ways, team, discs, held | {robot.number}, now_s)
            if found is not None:
                return found
        held.add(moving[-1].number)


def _disc(ways: Ways, robot: Present) -> Disc:
    return Disc(x_m=robot.pose[0], y_m=robot.pose[1], radius_m=ways.model(robot.number).radius_m, name=robot.name)


def _tried(ways: Ways, team: Sequence[Present], discs: Sequence[Disc], held: set[int], now_s: float
           ) -> list[Onward] | None:
    """The rest of a mission with some robots held; ``None`` if the others can't go on."""
    around = [*discs, *(_disc(ways, robot) for robot in team if robot.number in held)]
    wayouts = [_Wayout(ahead=(), legs=(), detours=0, kept_off="") if not robot.ahead or robot.number in held
               else _way_out(ways, robot, around) for robot in team]
    itineraries, planned = [], []
    for robot, out in zip(team, wayouts, strict=True):
        if robot.down or robot.number in held:
            continue  # it is driven round, not waited for
        planned.append(robot.number)
        itineraries.append(_itinerary(
            ways, robot.number, robot.pose, max(robot.ready_s, now_s), out.legs,
            _stops_s(robot.orders, out.ahead, robot.burnt_s, [leg[0].lasts_s for leg in out.legs])))
    order = plan_order(itineraries, ways.gap_m)
    if order is None:
        return None
    place = {number: k for k, number in enumerate(planned)}
    onward = []
    for robot, out in zip(team, wayouts, strict=True):
        k = place.get(robot.number)
        if k is None or not out.legs:
            by = "" if not robot.ahead else out.kept_off or "no way on"
            onward.append(Onward(ahead=(), lane=None, needs=(), detours=0, kept_off=by))
            continue
        nothing = np.zeros(len(order.needs[k][k]), dtype=np.int64)
        needs = tuple(order.needs[k][place[other.number]] if other.number in place else nothing for other in team)
        onward.append(Onward(ahead=out.ahead, lane=order.lanes[k], needs=needs, detours=out.detours,
                             kept_off=out.kept_off))
    return onward


def _way_out(ways: Ways, robot: Present, discs: Sequence[Disc]) -> _Wayout:
    """A robot's ways to what is left of its stops; those that it can't get to are left out."""
    number, here, at, legs, ahead = robot.number, robot.pose, robot.site, [], []
    detours, kept_off = 0, ""
    sites = (robot.site, *robot.ahead)
    for k, site in enumerate(robot.ahead):
        if k == 0 and robot.arc_m is not None:
            candidates: tuple[Cut, ...] = (ways.rest(number, robot.cuts[0].leg, robot.arc_m, robot.pose[2]),)
        elif at is None:
            candidates = ()
        elif at == site:  # stops between are left out
            continue
        elif at == sites[k] and k < len(robot.cuts):
            candidates = (robot.cuts[k],)
        elif k >= len(robot.cuts):  # its orders are new from here on
            candidates = ways.candidates(number, at, site)
        else:
            candidates = (ways.shortest(number, at, site),)
        free = tuple(way for way in candidates if ways.blocked(number, way, discs) is None)
        if not free:
            round_it = ways.round(number, here, site, discs)
            if round_it is None:
                blocker = next((ways.blocked(number, way, discs) for way in candidates), None)
                kept_off = kept_off or ("no way on" if blocker is None else blocker.name)
                continue
            free, detours = (round_it,), detours + 1
        legs.append(free)
        ahead.append(site)
        x, y = free[0].leg[-1][-1].path[-1]
        here = float(x), float(y), free[0].leg[-1][-1].heading_rad
        at = ways.site_at(number, site, free[0])
    if not ahead or ahead[-1] != robot.ahead[-1]:
        return _Wayout(ahead=(), legs=(), detours=0, kept_off=kept_off)  # it can't get home
    return _Wayout(ahead=tuple(ahead), legs=tuple(legs), detours=detours, kept_off=kept_off)
