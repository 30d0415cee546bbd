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
from sva_bench.execution.shared.switching import Switching
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
        around: Of each of these, whether it leads another way than the shortest.
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
    around: tuple[bool, ...]
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
        around: Of each of its legs, whether it leads another way than the shortest.
        kept_off: Who keeps it from a stop, or from going on.
        on_its_way: Whether its first leg is what is left of the one that it was on.
        begun_m: From where along that [m].
    """

    ahead: tuple[str, ...]
    lane: Lane | None
    needs: tuple[IntArray, ...]
    around: tuple[bool, ...]
    kept_off: str = ""
    on_its_way: bool = False
    begun_m: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class _Wayout:
    ahead: tuple[str, ...]
    legs: tuple[tuple[Cut, ...], ...]
    around: tuple[bool, ...]
    kept_off: str
    on_its_way: bool = False


def plan_onward(ways: Ways, team: Sequence[Present], now_s: float) -> tuple[list[Onward], Switching]:
    """Plan the rest of a mission from where everybody stands.

    Robots that stand for good are driven round. If the others can't all go on, they may step aside first, to their
    berths or to sites near by. If that doesn't help, those stay where they are, as few as it takes by trying one after
    the other, without which they can.

    Args:
        ways: The ways of the robots.
        team: The robots.
        now_s: Mission clock [s].

    Returns:
        What each robot is to do, and the order of those that go on.
    """
    discs = [_disc(ways, robot) for robot in team if robot.down]
    held: set[int] = set()
    while True:
        moving = [robot.number for robot in team if robot.ahead and robot.number not in held]
        for more in ((), *((number,) for number in moving)):
            for aside in (False, True):
                found = _tried(ways, team, discs, held.union(more), now_s, aside=aside)
                if found is not None:
                    return found
        held.add(moving[-1])


def _disc(ways: Ways, robot: Present) -> Disc:
    return Disc(x_m=robot.pose[0], y_m=robot.pose[1], radius_m=ways.model(robot.number).radius_m, name=robot.name)


def _tried(ways: Ways, team: Sequence[Present], discs: Sequence[Disc], held: set[int], now_s: float,
           *, aside: bool) -> tuple[list[Onward], Switching] | None:
    """The rest of a mission with some robots held; ``None`` if the others can't go on, stepping aside or not."""
    around = [*discs, *(_disc(ways, robot) for robot in team if robot.number in held)]
    wayouts = [_Wayout(ahead=(), legs=(), around=(), kept_off="") if not robot.ahead or robot.number in held
               else _way_out(ways, robot, around, aside=aside) for robot in team]
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
            onward.append(Onward(ahead=(), lane=None, needs=(), around=(), kept_off=by))
            continue
        nothing = np.zeros(len(order.needs[k][k]), dtype=np.int64)
        needs = tuple(order.needs[k][place[other.number]] if other.number in place else nothing for other in team)
        usual = order.lanes[k].cuts[0] is out.legs[0][0]
        onward.append(Onward(
            ahead=out.ahead, lane=order.lanes[k], needs=needs, kept_off=out.kept_off, begun_m=robot.arc_m or 0.0,
            around=(out.around[0] or not usual, *out.around[1:]), on_its_way=out.on_its_way and usual))
    return onward, Switching(order.crossings, planned)


def _way_out(ways: Ways, robot: Present, discs: Sequence[Disc], *, aside: bool) -> _Wayout:
    """A robot's ways to what is left of its stops; those that it can't get to are left out."""
    number, here, at, ahead = robot.number, robot.pose, robot.site, []
    legs: list[tuple[Cut, ...]] = []
    around: list[bool] = []
    kept_off, on_its_way = "", False
    sites = (robot.site, *robot.ahead)
    for k, site in enumerate(robot.ahead):
        led_round = False
        if k == 0 and robot.arc_m is not None:
            led_round = robot.around[0]
            candidates: tuple[Cut, ...] = (ways.rest(number, robot.cuts[0].leg, robot.arc_m, robot.pose[2]),)
        elif at is None:
            candidates = ()
        elif at == site:  # stops between are left out
            continue
        elif at == sites[k] and k < len(robot.cuts):
            candidates, led_round = (robot.cuts[k],), robot.around[k]
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
            free, led_round = (round_it,), True
        on_its_way = on_its_way or (k == 0 and free == candidates and bool(robot.cuts))
        legs.append((*free, *ways.aside(number, here, site, discs)) if aside and not legs else free)
        ahead.append(site)
        around.append(led_round)
        x, y = free[0].leg[-1][-1].path[-1]
        here = float(x), float(y), free[0].leg[-1][-1].heading_rad
        at = ways.site_at(number, site, free[0])
    if not ahead or ahead[-1] != robot.ahead[-1]:
        return _Wayout(ahead=(), legs=(), around=(), kept_off=kept_off)  # it can't get home
    return _Wayout(ahead=tuple(ahead), legs=tuple(legs), around=tuple(around), kept_off=kept_off,
                   on_its_way=on_its_way)
