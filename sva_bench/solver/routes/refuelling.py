"""Refuelling: the quickest route over POIs in a given order, exact, by a Pareto front of (time, fuel)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.solver.preprocess import SLACK_S, shortest_paths


class _Hop(NamedTuple):
    """A chain of stations from one stop to the next.

    Attributes:
        fuel_s: Fuel to the first station [s].
        time_s: Time in all [s].
        burnt_s: Fuel burnt since the last refuel at the end [s].
        stations: The stations, in order.
    """

    fuel_s: float
    time_s: float
    burnt_s: float
    stations: tuple[int, ...]


class Drive(NamedTuple):
    """A route and the time it takes.

    Attributes:
        time_s: Driving and stops [s].
        route: Sites from base to base.
    """

    time_s: float
    route: tuple[int, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Road:
    """One vehicle's legs, and the chains of stations, computed as they are needed.

    Attributes:
        base: The base.
        fuel_s: Fuel of a leg [s].
        time_s: Driving time of a leg and the stop at its end [s].
        stations: The stations.
        chain_s: Least time from the k-th to the l-th station over legs that one filling allows [s].
        capacity_s: Fuel capacity [s].
        limit_s: Mission limit [s].
        hops: Ways between two stops that a refuel may make possible, by their ends.
        known: Quickest drive of each order of POIs met so far; ``None`` = infeasible.
    """

    base: int
    fuel_s: list[list[float]]
    time_s: list[list[float]]
    stations: tuple[int, ...]
    chain_s: list[list[float]]
    capacity_s: float
    limit_s: float
    hops: dict[tuple[int, int], list[_Hop]] = field(default_factory=dict)
    known: dict[tuple[int, ...], Drive | None] = field(default_factory=dict)


def road_of(instance: Instance, vehicle: Vehicle) -> Road:
    """The road of one vehicle."""
    fuel = vehicle.fuel_s
    time = fuel + instance.stop_s[None, :]
    capacity = vehicle.fuel_capacity_s + SLACK_S
    stations = list(instance.stations)
    hop = time.copy()
    hop[fuel > capacity] = math.inf
    chain = shortest_paths(hop[stations][:, stations], -1)
    return Road(base=instance.base, fuel_s=fuel.tolist(), time_s=time.tolist(), stations=instance.stations,
                chain_s=chain.tolist(), capacity_s=capacity, limit_s=vehicle.mission_limit_s + SLACK_S)


def quickest(road: Road, pois: Sequence[int]) -> Drive | None:
    """The quickest route that visits POIs in this order; ``None`` if none keeps fuel and limit.

    Args:
        road: The vehicle's road.
        pois: The POIs, in order.
    """
    key = tuple(pois)
    if not key:
        return Drive(0.0, ())
    if key not in road.known:
        road.known[key] = _quickest(road, key)
    return road.known[key]


def _quickest(road: Road, pois: tuple[int, ...]) -> Drive | None:
    front: list[tuple[float, float, tuple[int, ...]]] = [(0.0, 0.0, (road.base,))]
    here = road.base
    for there in (*pois, road.base):
        leg_fuel, leg_time = road.fuel_s[here][there], road.time_s[here][there]
        hops = _hops(road, here, there)
        reached = []
        for time, burnt, route in front:
            if burnt + leg_fuel <= road.capacity_s:
                reached.append((time + leg_time, burnt + leg_fuel, (*route, there)))
            reached += [(time + hop.time_s, hop.burnt_s, (*route, *hop.stations, there))
                        for hop in hops if burnt + hop.fuel_s <= road.capacity_s]
        reached.sort()
        front, least = [], math.inf
        for label in reached:
            if label[1] < least and label[0] <= road.limit_s:
                front.append(label)
                least = label[1]
        if not front:
            return None
        here = there
    return Drive(front[0][0], front[0][2])


def _hops(road: Road, here: int, there: int) -> list[_Hop]:
    """The chains of at least one station from here to there that no other one dominates."""
    if (here, there) in road.hops:
        return road.hops[here, there]
    found = []
    for k, first in enumerate(road.stations):
        for last_number, last in enumerate(road.stations):
            hop = _Hop(road.fuel_s[here][first],
                       road.time_s[here][first] + road.chain_s[k][last_number] + road.time_s[last][there],
                       road.fuel_s[last][there], (k, last_number))
            if math.isfinite(hop.time_s) and max(hop.fuel_s, hop.burnt_s) <= road.capacity_s:
                found.append(hop)
    found.sort(key=lambda hop: (hop.time_s, hop.fuel_s, hop.burnt_s))
    kept: list[_Hop] = []
    for hop in found:
        if not any(other.fuel_s <= hop.fuel_s and other.burnt_s <= hop.burnt_s for other in kept):
            kept.append(hop)
    road.hops[here, there] = [hop._replace(stations=_chain(road, *hop.stations)) for hop in kept]
    return road.hops[here, there]


def _chain(road: Road, first: int, last: int) -> tuple[int, ...]:
    """The stations on the quickest chain from one to another, both included."""
    chain = [first]
    while chain[-1] != last:
        here = chain[-1]
        following = [k for k in range(len(road.stations)) if k not in chain and _joined(road, here, k)]
        chain.append(min(following, key=lambda k: (
            road.time_s[road.stations[here]][road.stations[k]] + road.chain_s[k][last], k)))
    return tuple(road.stations[k] for k in chain)


def _joined(road: Road, first: int, second: int) -> bool:
    return road.fuel_s[road.stations[first]][road.stations[second]] <= road.capacity_s
