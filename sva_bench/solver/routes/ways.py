"""The way of greatest value over POIs in a given order, exact.

Where vehicles fail while driving, the quickest way isn't always best: a refuel before a rewarding POI delays it, one
after it doesn't. So labels hold time, fuel, survival and value, of which none may be worse for one to dominate another.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

from sva_bench.solver.discounts import Discount
from sva_bench.solver.preprocess import SLACK_S
from sva_bench.solver.routes.refuelling import Passage, VehicleLegs, charged_leg, quickest_route


class ValuedRoute(NamedTuple):
    """A route and its expected value.

    Attributes:
        value: Its value.
        route: Sites from base to base; empty for a vehicle that stays.
    """

    value: float
    route: tuple[int, ...]


class _Label(NamedTuple):
    """A way to a stop: time and fuel since the last refuel [s], probability to get there, and reward so far."""

    time_s: float
    burnt_s: float
    survival: float
    earned: float
    route: tuple[int, ...]


def best_way(
    own_legs: VehicleLegs, pois: Sequence[int], weights: Sequence[float], discount: Discount,
) -> ValuedRoute | None:
    """The most valuable route that visits POIs in this order; ``None`` if none keeps fuel capacity and mission limit.

    Args:
        own_legs: The vehicle's legs.
        pois: The POIs, in order.
        weights: Reward of each of them.
        discount: The vehicle's discount.
    """
    order = tuple(pois)
    if not order:
        return ValuedRoute(0.0, ())
    key = (order, tuple(weights), discount)
    if key not in own_legs.ways:
        quickest = quickest_route(own_legs, order)
        if quickest is None:
            own_legs.ways[key] = None
        else:
            route = quickest.route
            if discount.rate > 0 and not discount.is_hopeless:
                route = _most_valuable(own_legs, order, key[1], discount)
            reward = dict(zip(order, key[1], strict=True))
            own_legs.ways[key] = (value_on(own_legs, route, reward, discount), route)
    found = own_legs.ways[key]
    return None if found is None else ValuedRoute(*found)


def value_on(
    own_legs: VehicleLegs, route: Sequence[int], reward: dict[int, float], discount: Discount,
) -> float:
    """Expected value of a route, given the reward of its POIs.

    Source:
        ``docs/model.md``, "Failure along the route".
    """
    if len(route) < 2:
        return 0.0
    if discount.is_plain:
        return math.fsum(reward[j] for j in route if j in reward)
    parts, driven_s, visits = [-discount.departure], 0.0, 0
    for i, j in itertools.pairwise(route):
        driven_s += own_legs.driven_s[i][j]
        if j in reward:
            visits += 1
            parts.append(discount.chance(visits, driven_s) * reward[j])
    return math.fsum([*parts, discount.home * discount.chance(visits, driven_s)])


def way_home(own_legs: VehicleLegs, site: int, burnt_s: float, left_s: float) -> tuple[float, tuple[int, ...]] | None:
    """The way of least driving from another site to the base: its driving time [s], and the sites after the first.

    ``None`` if none keeps fuel capacity and time.

    Args:
        own_legs: The vehicle's legs.
        site: Where it is.
        burnt_s: Fuel burnt since it was filled last [s].
        left_s: Time left [s].
    """
    ways = [way for way in _ways(own_legs, site, own_legs.base)
            if burnt_s + way.fuel_s <= own_legs.capacity_s and way.time_s + way.charging * burnt_s <= left_s + SLACK_S]
    if not ways:
        return None
    best = min(ways, key=lambda way: (way.driven_s, way.time_s))
    return best.driven_s, (*best.stations, own_legs.base)


def _most_valuable(
    own_legs: VehicleLegs, pois: tuple[int, ...], weights: tuple[float, ...], discount: Discount,
) -> tuple[int, ...]:
    """The most valuable route over an order that has a feasible one; of several the quickest."""
    front, here = [_Label(0.0, 0.0, 1.0, 0.0, (own_legs.base,))], own_legs.base
    for there, weight in zip((*pois, own_legs.base), (*weights, discount.home), strict=True):
        kept = 1.0 if there == own_legs.base else discount.survival
        reached = []
        for label in front:
            for way in _ways(own_legs, here, there):
                time_s = label.time_s + way.time_s + way.charging * label.burnt_s
                if label.burnt_s + way.fuel_s <= own_legs.capacity_s and time_s <= own_legs.limit_s:
                    burnt_s = way.burnt_s if way.stations else label.burnt_s + way.burnt_s
                    survival = label.survival * kept * math.exp(-discount.rate * way.driven_s)
                    reached.append(_Label(time_s, burnt_s, survival, label.earned + survival * weight,
                                          (*label.route, *way.stations, there)))
        front, here = _nondominated(reached), there
    return max(front, key=lambda label: (label.earned, -label.time_s)).route


def _nondominated(labels: list[_Label]) -> list[_Label]:
    kept: list[_Label] = []
    for label in sorted(labels):
        if not any(other.burnt_s <= label.burnt_s and other.survival >= label.survival
                   and other.earned >= label.earned for other in kept):
            kept.append(label)
    return kept


def _ways(own_legs: VehicleLegs, here: int, there: int) -> list[Passage]:
    """The direct leg, and the chains of stations, nondominated in time, driving time, and fuel at both ends."""
    if (here, there) in own_legs.passages:
        return own_legs.passages[here, there]
    fuel, time, driven = own_legs.fuel_s, own_legs.time_s, own_legs.driven_s
    found = [Passage(time[here][there], driven[here][there], fuel[here][there], fuel[here][there], 0.0, ())]
    for k, first in enumerate(own_legs.stations):
        # A vehicle that sets off from a station doesn't go there first.
        if first == here or not fuel[here][first] <= own_legs.capacity_s:
            continue
        for last, chains in _station_chains(own_legs, k).items():
            if fuel[own_legs.stations[last]][there] <= own_legs.capacity_s:
                end = own_legs.stations[last]
                found += [Passage(charged_leg(own_legs, here, k) + chain_s + time[end][there],
                                  driven[here][first] + driven_s + driven[end][there], fuel[here][first],
                                  fuel[end][there], own_legs.charging[k], tuple(own_legs.stations[i] for i in chain))
                          for chain_s, driven_s, chain in chains]
    kept: list[Passage] = []
    for way in sorted(way for way in found if math.isfinite(way.time_s)):
        if not any(other.driven_s <= way.driven_s and other.fuel_s <= way.fuel_s and other.burnt_s <= way.burnt_s
                   and other.charging <= way.charging and (other.stations or not way.stations) for other in kept):
            kept.append(way)
    own_legs.passages[here, there] = kept
    return kept


def _station_chains(own_legs: VehicleLegs, first: int) -> dict[int, list[tuple[float, float, tuple[int, ...]]]]:
    """Time, driving time and stations of the chains from the k-th station to each, nondominated in the two times."""
    if first in own_legs.chains:
        return own_legs.chains[first]
    found: dict[int, list[tuple[float, float, tuple[int, ...]]]] = {}
    waiting: list[tuple[float, float, tuple[int, ...]]] = [(0.0, 0.0, (first,))]
    while waiting:
        time_s, driven_s, chain = heapq.heappop(waiting)
        here, known = own_legs.stations[chain[-1]], found.setdefault(chain[-1], [])
        if any(other[1] <= driven_s for other in known):
            continue
        known.append((time_s, driven_s, chain))
        for k, there in enumerate(own_legs.stations):
            if k not in chain and own_legs.fuel_s[here][there] <= own_legs.capacity_s:
                heapq.heappush(waiting, (time_s + own_legs.hop_s[chain[-1]][k],
                                         driven_s + own_legs.driven_s[here][there], (*chain, k)))
    own_legs.chains[first] = found
    return found
