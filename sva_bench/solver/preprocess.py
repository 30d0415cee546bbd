"""Preprocessing: the sites and legs that a vehicle can use in an optimal plan, and bounds on its fuel and time.

Every bound is a shortest path, so only the removal of unrewarded stops needs the triangle inequality.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.mission.instance import TOLERANCE_S, Instance, Vehicle

_log = logging.getLogger(__name__)

SLACK_S = TOLERANCE_S / 2
"""Half the feasibility tolerance, added to capacities and limits: a route that meets its limit stays feasible."""
_ROUNDING_S = 1e-9  # of sums of legs


@dataclass(frozen=True, eq=False, kw_only=True)
class Scope:
    """The legs that one vehicle may drive, and the bounds on its fuel.

    Attributes:
        legs: Whether an optimal plan can use the leg from site i to site j, shape (n, n).
        driven_s: Driving time of a leg, kept or not [s], shape (n, n).
        fuel_s: Fuel of a leg and the stop at its end [s], shape (n, n).
        leg_time_s: Time of a leg on the mission clock [s], shape (n, n).
        time_s: The same, with the stop at its end, but without charging [s], shape (n, n).
        idle_s: Fuel of a stop [s], shape (n,).
        charging: Time that a stop takes for each second of fuel burnt since the last refuel, shape (n,).
        since_refuel_s: Least fuel burnt since the last refuel on arrival at a site [s], ``s_i``, shape (n,).
        to_refuel_s: Least fuel from a site to the next refuel or the base [s], ``t_i``, shape (n,).
        since_start_s: Least time of a path to a site, stop and charging there included [s], shape (n,).
        to_end_s: Least time from a site to the end [s], shape (n,).
        capacity_s: Fuel capacity [s]; ``inf`` where fuel can't bind.
        limit_s: Mission limit [s]; ``inf`` = none.
    """

    legs: BoolArray
    driven_s: FloatArray
    fuel_s: FloatArray
    leg_time_s: FloatArray
    time_s: FloatArray
    idle_s: FloatArray
    charging: FloatArray
    since_refuel_s: FloatArray
    to_refuel_s: FloatArray
    since_start_s: FloatArray
    to_end_s: FloatArray
    capacity_s: float
    limit_s: float


def is_metric(cost: FloatArray, base: int, *, tolerance_s: float = TOLERANCE_S) -> bool:
    """Whether a cost obeys the triangle inequality, except by way of the base, which no route can take.

    Args:
        cost: Cost from site i to site j [s], shape (n, n).
        base: The base.
        tolerance_s: Violation that is accepted [s].
    """
    for k in range(len(cost)):
        if k != base:
            excess = cost > cost[:, k, None] + cost[None, k, :] + max(tolerance_s, _ROUNDING_S)
            np.fill_diagonal(excess, False)
            if excess.any():
                return False
    return True


def shortest_paths(cost: FloatArray, base: int) -> FloatArray:
    """Cheapest chain of legs between two sites that doesn't run through the base, shape (n, n).

    Source:
        Floyd (1962), Algorithm 97.
    """
    shortest = cost.copy()
    np.fill_diagonal(shortest, 0.0)
    for k in range(len(cost)):
        if k != base:
            np.minimum(shortest, shortest[:, k, None] + shortest[None, k, :], out=shortest)
    return shortest


def burnt_by_legs(instance: Instance, vehicle: Vehicle) -> FloatArray:
    """Fuel of each leg, and of the stop at its end [s of driving], shape (n, n).

    Every POI is left again, so it makes no difference whether the fuel of its stop is due before the next leg or with
    the last one.
    """
    burnt: FloatArray = vehicle.fuel_s + instance.idle_fuel_s(vehicle)[None, :]
    np.fill_diagonal(burnt, vehicle.fuel_s.diagonal())
    return burnt


def clock_of_legs(instance: Instance, vehicle: Vehicle) -> FloatArray:
    """Time of each leg on the mission clock, and of the stop at its end, without charging [s], shape (n, n)."""
    time: FloatArray = vehicle.leg_time_s + instance.stop_s[None, :]
    return time


def can_run_dry(instance: Instance, vehicle: Vehicle) -> bool:
    """Whether the fuel capacity can bind where the mission limit doesn't."""
    if vehicle.fuel_capacity_s < vehicle.mission_limit_s:
        return True
    if vehicle.time_s is None or np.isinf(vehicle.fuel_capacity_s):
        return False
    return bool((burnt_by_legs(instance, vehicle) > clock_of_legs(instance, vehicle)).any())


def has_no_shortcuts(vehicle: Vehicle, base: int) -> bool:
    """Whether both fuel and time of legs obey the triangle inequality; stops and charging make no detour shorter."""
    return is_metric(vehicle.fuel_s, base) and (vehicle.time_s is None or is_metric(vehicle.time_s, base))


def warn_of_unreachable(instance: Instance) -> None:
    """Log the POIs that no vehicle can reach and return from, whatever its fuel and limit."""
    connected = np.zeros(len(instance.sites), dtype=np.bool_)
    for vehicle in instance.vehicles:
        _, part = connected_components(np.isfinite(vehicle.fuel_s), connection="strong")
        connected |= part == part[instance.base]
    for poi in instance.pois:
        if instance.vehicles and not connected[poi]:
            _log.warning("instance %s: POI %s cannot be reached and left again; it is left out of the plan",
                         instance.name, instance.sites[poi])


def scope_of(instance: Instance, vehicle: Vehicle, rewarded: BoolArray) -> Scope:
    """The legs that one vehicle can use in an optimal plan, and bounds on its fuel and time.

    Args:
        instance: The instance.
        vehicle: One of its vehicles.
        rewarded: Sites whose visit counts in an objective or a constraint of the solve, shape (n,).

    Source:
        Proposition 2 of the paper for ``s`` and ``t``. A leg is kept where a chain base .. q .. i j .. r .. base
        exists that keeps the limit and, between the refuels q and r around the leg, the fuel capacity.
    """
    base, n = instance.base, len(instance.sites)
    fuel, time = burnt_by_legs(instance, vehicle), clock_of_legs(instance, vehicle)
    leg_time, charging = vehicle.leg_time_s.copy(), instance.charging
    capacity = vehicle.fuel_capacity_s if can_run_dry(instance, vehicle) else np.inf
    keep = np.zeros(n, dtype=np.bool_)
    if rewarded.any():
        keep[:] = True
        if has_no_shortcuts(vehicle, base):  # then a stop without reward improves no route
            keep[list(instance.pois)] = rewarded[list(instance.pois)]
            keep[list(instance.stations)] = np.isfinite(capacity)
        keep[base] = True
    for costs in (fuel, time, leg_time):
        costs[~keep], costs[:, ~keep] = np.inf, np.inf
    refuels = [base, *(r for r in instance.stations if keep[r])]
    if np.isinf(capacity) and charging[refuels].any():  # what a route burns between refuels still takes time to charge
        capacity = float(np.where(np.isfinite(fuel), fuel, 0.0).max(axis=1).sum())
    to_refuel, since_refuel, arrival, departure = _fuel_and_time_around(fuel, time, base, refuels, capacity, charging)
    legs = np.zeros((n, n), dtype=np.bool_)
    for q in range(len(refuels)):
        for r, refuel in enumerate(refuels):
            burnt = since_refuel[q][:, None] + fuel + to_refuel[r][None, :]
            mission = arrival[q][:, None] + time + departure[r][None, :]
            if charging[refuel]:
                mission += charging[refuel] * burnt
            legs |= (burnt <= capacity + TOLERANCE_S) & (mission <= vehicle.mission_limit_s + TOLERANCE_S) \
                & np.isfinite(mission)
    np.fill_diagonal(legs, False)
    if charging.any():  # a refuel's own stop ends after its charging
        departure = departure + np.where(np.isfinite(to_refuel), to_refuel, 0.0) * charging[refuels][:, None]
    return Scope(
        legs=legs, driven_s=vehicle.fuel_s, fuel_s=fuel, leg_time_s=leg_time, time_s=time,
        idle_s=instance.idle_fuel_s(vehicle), charging=charging,
        since_refuel_s=since_refuel.min(axis=0), to_refuel_s=to_refuel.min(axis=0),
        since_start_s=arrival.min(axis=0), to_end_s=departure.min(axis=0), capacity_s=capacity,
        limit_s=vehicle.mission_limit_s)


def _fuel_and_time_around(
    fuel: FloatArray, time: FloatArray, base: int, refuels: list[int], capacity: float, charging: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """For each refuel and site, shape (refuels, n): fuel from the site to the refuel and from the refuel to the site;
    time from the start to the site over the refuel, and from the site over the refuel to the end, without charging at
    the refuel for the latter."""
    fuel_paths, time_paths = shortest_paths(fuel, base), shortest_paths(time, base)
    possible = fuel_paths <= capacity + TOLERANCE_S
    hop = np.where(possible, time_paths, np.inf)[np.ix_(refuels, refuels)]
    if charging.any():
        hop += charging[refuels] * np.where(possible, fuel_paths, 0.0)[np.ix_(refuels, refuels)]
    hop = shortest_paths(hop, 0)
    since_refuel, to_refuel = fuel_paths[refuels].copy(), fuel_paths[:, refuels].T.copy()
    arrival = hop[0][:, None] + time_paths[refuels]
    departure = hop[:, 0][:, None] + time_paths[:, refuels].T
    since_refuel[np.isinf(arrival)], to_refuel[np.isinf(departure)] = np.inf, np.inf
    for number, site in enumerate(refuels):  # at a refuel the tank is full: that is its only state
        for array in (since_refuel, to_refuel, arrival, departure):
            array[:, site] = np.inf
        since_refuel[number, site] = to_refuel[number, site] = 0.0
        arrival[number, site], departure[number, site] = hop[0, number], hop[number, 0]
    return to_refuel, since_refuel, arrival, departure
