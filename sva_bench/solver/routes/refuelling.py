"""Refuelling: the quickest route over POIs in a given order, exact, by a Pareto front of (time, fuel)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.solver.discounts import Discount
from sva_bench.solver.preprocess import SLACK_S, burnt_by_legs, clock_of_legs, shortest_paths


class _Hop(NamedTuple):
    """A chain of stations from one stop to the next.

    Attributes:
        fuel_s: Fuel to the first station [s].
        time_s: Time in all [s], for a vehicle that has burnt nothing before.
        burnt_s: Fuel burnt since the last refuel at the end [s].
        charging: Time that it takes longer for each second of fuel burnt before.
        stations: The stations, in order.
    """

    fuel_s: float
    time_s: float
    burnt_s: float
    charging: float
    stations: tuple[int, ...]


class Passage(NamedTuple):
    """A way from one stop to the next: a leg, or a chain of stations.

    Attributes:
        time_s: Time in all [s], for a vehicle that has burnt nothing before.
        driven_s: Driving time in all [s].
        fuel_s: Fuel to the first station, or to the end [s].
        burnt_s: Fuel from the last station, or in all [s].
        charging: Time that it takes longer for each second of fuel burnt before.
        stations: The stations, in order.
    """

    time_s: float
    driven_s: float
    fuel_s: float
    burnt_s: float
    charging: float
    stations: tuple[int, ...]


class TimedRoute(NamedTuple):
    """A route and the time it takes.

    Attributes:
        time_s: Driving, stops and charging [s].
        route: Sites from base to base.
    """

    time_s: float
    route: tuple[int, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class VehicleLegs:
    """One vehicle's legs, and the chains of stations between stops, computed as they are needed.

    Attributes:
        base: The base.
        fuel_s: Fuel of the leg from site i to site j, and of the stop at its end [s].
        time_s: Time of a leg on the mission clock and the stop at its end, without charging [s].
        driven_s: Driving time of a leg [s].
        stations: The stations.
        charging: Time that a stop at the k-th station takes for each second of fuel burnt since the last refuel.
        hop_s: Time from the k-th to the l-th station, charging there included; ``inf`` beyond the fuel capacity [s].
        chain_s: Least time from the k-th to the l-th station over such legs [s].
        capacity_s: Fuel capacity, half the feasibility tolerance included [s].
        limit_s: Mission limit, half the feasibility tolerance included [s].
        hops: Nondominated chains of stations between two stops, by their ends.
        known: Quickest route of each order of POIs asked for so far; ``None`` = infeasible.
        passages: Nondominated ways between two stops, driving time included, by their ends.
        chains: Nondominated chains of stations by their first one: time, driving time and stations, by their last one.
        ways: Value and sites of the most valuable route of each order, rewards and discount asked for so far.
    """

    base: int
    fuel_s: list[list[float]]
    time_s: list[list[float]]
    driven_s: list[list[float]]
    stations: tuple[int, ...]
    charging: list[float]
    hop_s: list[list[float]]
    chain_s: list[list[float]]
    capacity_s: float
    limit_s: float
    hops: dict[tuple[int, int], list[_Hop]] = field(default_factory=dict)
    known: dict[tuple[int, ...], TimedRoute | None] = field(default_factory=dict)
    passages: dict[tuple[int, int], list[Passage]] = field(default_factory=dict)
    chains: dict[int, dict[int, list[tuple[float, float, tuple[int, ...]]]]] = field(default_factory=dict)
    ways: dict[tuple[tuple[int, ...], tuple[float, ...], Discount], tuple[float, tuple[int, ...]] | None] = field(
        default_factory=dict)


def vehicle_legs(instance: Instance, vehicle: Vehicle) -> VehicleLegs:
    """The legs of one vehicle."""
    fuel, time = burnt_by_legs(instance, vehicle), clock_of_legs(instance, vehicle)
    capacity = vehicle.fuel_capacity_s + SLACK_S
    stations = list(instance.stations)
    charging, hop_fuel = instance.charging[stations], fuel[stations][:, stations]
    hop = charged(time[stations][:, stations], hop_fuel, charging)
    hop[hop_fuel > capacity] = math.inf
    return VehicleLegs(
        base=instance.base, fuel_s=fuel.tolist(), time_s=time.tolist(), driven_s=vehicle.fuel_s.tolist(),
        stations=instance.stations, charging=charging.tolist(), hop_s=hop.tolist(),
        chain_s=shortest_paths(hop, -1).tolist(), capacity_s=capacity, limit_s=vehicle.mission_limit_s + SLACK_S)


def charged(time: FloatArray, fuel: FloatArray, charging: FloatArray) -> FloatArray:
    """Time of legs with charging at their end, from a full tank [s], shape (m, n).

    Args:
        time: Time of a leg, without charging [s], shape (m, n).
        fuel: Fuel of a leg [s], shape (m, n); ``inf`` = no leg.
        charging: Time for each second of fuel at the end of a leg, shape (n,).
    """
    found: FloatArray = time + np.where(np.isfinite(fuel), fuel, 0.0) * charging[None, :]
    return found


def charged_leg(own_legs: VehicleLegs, here: int, number: int) -> float:
    """Time of the leg to the k-th station, charging there included, from a full tank [s]."""
    there, charging = own_legs.stations[number], own_legs.charging[number]
    return own_legs.time_s[here][there] + (charging * own_legs.fuel_s[here][there] if charging else 0.0)


def quickest_route(own_legs: VehicleLegs, pois: Sequence[int]) -> TimedRoute | None:
    """The quickest route that visits POIs in this order; ``None`` if none keeps fuel capacity and mission limit.

    Args:
        own_legs: The vehicle's legs.
        pois: The POIs, in order.
    """
    key = tuple(pois)
    if not key:
        return TimedRoute(0.0, ())
    if key not in own_legs.known:
        own_legs.known[key] = _quickest(own_legs, key)
    return own_legs.known[key]


def _quickest(own_legs: VehicleLegs, pois: tuple[int, ...]) -> TimedRoute | None:
    front: list[tuple[float, float, tuple[int, ...]]] = [(0.0, 0.0, (own_legs.base,))]
    here = own_legs.base
    for there in (*pois, own_legs.base):
        leg_fuel, leg_time = own_legs.fuel_s[here][there], own_legs.time_s[here][there]
        hops = _hops(own_legs, here, there)
        reached = []
        for time, burnt, route in front:
            if burnt + leg_fuel <= own_legs.capacity_s:
                reached.append((time + leg_time, burnt + leg_fuel, (*route, there)))
            reached += [(time + hop.time_s + hop.charging * burnt, hop.burnt_s, (*route, *hop.stations, there))
                        for hop in hops if burnt + hop.fuel_s <= own_legs.capacity_s]
        reached.sort()
        front, least = [], math.inf
        for label in reached:
            if label[1] < least and label[0] <= own_legs.limit_s:
                front.append(label)
                least = label[1]
        if not front:
            return None
        here = there
    return TimedRoute(front[0][0], front[0][2])


def _hops(own_legs: VehicleLegs, here: int, there: int) -> list[_Hop]:
    """The chains of at least one station from one stop to another, nondominated in time and fuel at both ends."""
    if (here, there) in own_legs.hops:
        return own_legs.hops[here, there]
    found = []
    for k, first in enumerate(own_legs.stations):
        if first == here:  # a robot that sets off from a station doesn't go there first
            continue
        for last_number, last in enumerate(own_legs.stations):
            hop = _Hop(own_legs.fuel_s[here][first],
                       charged_leg(own_legs, here, k) + own_legs.chain_s[k][last_number] + own_legs.time_s[last][there],
                       own_legs.fuel_s[last][there], own_legs.charging[k], (k, last_number))
            if math.isfinite(hop.time_s) and max(hop.fuel_s, hop.burnt_s) <= own_legs.capacity_s:
                found.append(hop)
    found.sort(key=lambda hop: (hop.time_s, hop.fuel_s, hop.burnt_s))
    kept: list[_Hop] = []
    for hop in found:
        if not any(other.fuel_s <= hop.fuel_s and other.burnt_s <= hop.burnt_s and other.charging <= hop.charging
                   for other in kept):
            kept.append(hop)
    own_legs.hops[here, there] = [hop._replace(stations=_station_path(own_legs, *hop.stations)) for hop in kept]
    return own_legs.hops[here, there]


def _station_path(own_legs: VehicleLegs, first: int, last: int) -> tuple[int, ...]:
    """The stations on the quickest chain from one station to another, both included."""
    chain = [first]
    while chain[-1] != last:
        here = chain[-1]
        following = [k for k in range(len(own_legs.stations)) if k not in chain and _is_leg_possible(own_legs, here, k)]
        chain.append(min(following, key=lambda k: (
            own_legs.hop_s[here][k] + own_legs.chain_s[k][last], k)))
    return tuple(own_legs.stations[k] for k in chain)


def _is_leg_possible(own_legs: VehicleLegs, first: int, second: int) -> bool:
    return own_legs.fuel_s[own_legs.stations[first]][own_legs.stations[second]] <= own_legs.capacity_s
