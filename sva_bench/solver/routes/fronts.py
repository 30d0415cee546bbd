"""Routes in compiled code: the quickest refuelling of POIs in a given order, and the best insertion of another POI.

A Pareto front at a stop holds the nondominated (time, fuel) pairs: forwards the time since the start and the
fuel burnt since the last refuel, backwards the time to the end and the fuel needed until the next refuel. The two are
mirror images, so one step function serves both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.interrupts import deferring_ctrl_c
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.solver.polling import poll, stop_flag
from sva_bench.solver.preprocess import SLACK_S, burnt_by_legs, can_run_dry, clock_of_legs, shortest_paths
from sva_bench.solver.routes.charged_fronts import FRONT, charged_step, charged_step_back, charged_time_with
from sva_bench.solver.routes.refuelling import charged


@dataclass(frozen=True, eq=False, kw_only=True)
class LegTables:
    """The legs of all vehicle classes as arrays, for compiled code. Vehicles of a class differ in rewards only.

    Attributes:
        vehicle_class: Class of each vehicle, shape (M,).
        base: The base.
        fuel_s: Fuel of a leg and the stop at its end [s], shape (classes, n, n).
        time_s: Time of a leg on the mission clock and the stop at its end [s], shape (classes, n, n).
        quickest_s: Least time from a site to another, directly or by stations, from a full tank [s], shape (classes, n,
            n).
        driven_s: Driving time of that way, or about it where charging takes time [s], shape (classes, n, n).
        first: Where the chains of stations between two sites begin in ``hops``, shape (classes, n, n).
        last: Where they end, shape (classes, n, n).
        hops: Chains of stations: fuel to the first station, time in all from a full tank, fuel from the last one [s],
            shape (hops, 3); and time longer for each second of fuel burnt before, where charging takes any, shape
            (hops, 4).
        capacity_s: Fuel capacity, half the feasibility tolerance included [s], shape (classes,); ``inf`` where fuel
            can't bind.
        limit_s: Mission limit, half the feasibility tolerance included [s], shape (classes,).
    """

    vehicle_class: IntArray
    base: int
    fuel_s: FloatArray
    time_s: FloatArray
    quickest_s: FloatArray
    driven_s: FloatArray
    first: IntArray
    last: IntArray
    hops: FloatArray
    capacity_s: FloatArray
    limit_s: FloatArray


def leg_tables(instance: Instance) -> LegTables:
    """The leg tables of an instance's vehicles, one for each vehicle class."""
    classes: list[Vehicle] = []
    vehicle_class = []
    for vehicle in instance.vehicles:
        same = [k for k, other in enumerate(classes) if other.fuel_capacity_s == vehicle.fuel_capacity_s
                and other.mission_limit_s == vehicle.mission_limit_s and other.idle_share == vehicle.idle_share
                and np.array_equal(other.fuel_s, vehicle.fuel_s)
                and np.array_equal(other.leg_time_s, vehicle.leg_time_s)]
        vehicle_class.append(same[0] if same else len(classes))
        if not same:
            classes.append(vehicle)
    n, stations = len(instance.sites), np.array(instance.stations, dtype=np.int64)
    shape = (len(classes), n, n)
    first, last, hops, offset = np.zeros(shape, np.int64), np.zeros(shape, np.int64), [np.zeros((0, 4))], 0
    fuel, time, quickest, driven = np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros(shape)
    capacity = np.array([v.fuel_capacity_s for v in classes]) + SLACK_S
    charging = instance.charging[stations]
    for k, vehicle in enumerate(classes):
        fuel[k], time[k] = burnt_by_legs(instance, vehicle), clock_of_legs(instance, vehicle)
        quickest[k] = np.where(fuel[k] <= capacity[k], time[k], np.inf)
        if not can_run_dry(instance, vehicle):
            capacity[k] = np.inf
        elif len(stations):
            across = np.ix_(stations, stations)
            chain = shortest_paths(charged(quickest[k][across], fuel[k][across], charging), -1)
            with deferring_ctrl_c():
                found, first[k], last[k] = _station_chains(
                    fuel[k], time[k], chain, stations, charging, float(capacity[k]), quickest[k], stop_flag())
            first[k] += offset
            last[k] += offset
            offset += len(found)
            hops.append(found)
        driven[k] = _driving_times(vehicle, stations, fuel[k], time[k], quickest[k], charging)
    return LegTables(
        vehicle_class=np.array(vehicle_class, dtype=np.int64), base=instance.base, fuel_s=fuel, time_s=time,
        quickest_s=quickest, driven_s=driven,
        first=first, last=last, hops=np.concatenate(hops)[:, :4 if charging.any() else 3].copy(), capacity_s=capacity,
        limit_s=np.array([v.mission_limit_s for v in classes]) + SLACK_S)


def _driving_times(
    vehicle: Vehicle, stations: IntArray, fuel: FloatArray, time: FloatArray, quickest: FloatArray,
    charging: FloatArray,
) -> FloatArray:
    """Driving time of the quickest way from a site to another [s], shape (n, n): what a search takes for it.

    Where the mission clock runs by fuel, that is the time of the way but for the stop at its end; else driving time of
    the way by which it is least.
    """
    if vehicle.time_s is None and not charging.any():
        there = np.isfinite(time)
        stop_s = np.where(there, time, 0.0) - np.where(there, vehicle.fuel_s, 0.0)
        return np.asarray(quickest - stop_s.max(axis=0)[None, :])
    legs = np.where(fuel <= vehicle.fuel_capacity_s + SLACK_S, vehicle.fuel_s, np.inf)
    if not len(stations):
        return legs
    chain = shortest_paths(legs[np.ix_(stations, stations)], -1)
    to_last = (legs[:, stations][:, :, None] + chain[None, :, :]).min(axis=1)
    by_stations = np.array([(row[:, None] + legs[stations]).min(axis=0) for row in to_last])
    return np.where(np.isfinite(legs), legs, by_stations)


@njit(cache=True)
def _station_chains(fuel, time, chain, stations, charging, capacity, quickest, stop):
    """The chains of stations that are nondominated in fuel, time, fuel and charging of what was burnt before, by
    increasing time; lowers ``quickest``."""
    n, count = len(fuel), len(stations)
    first, last = np.zeros((n, n), np.int64), np.zeros((n, n), np.int64)
    found = np.empty((1024, 4))
    size = 0
    candidates = np.empty((count * count, 4))
    for a in range(n):
        for b in range(n):
            if poll(stop):  # with a thousand stations each pair of sites has a million chains
                return found[:0].copy(), np.zeros((n, n), np.int64), np.zeros((n, n), np.int64)
            first[a, b] = size
            number = 0
            for k in range(count):
                for l in range(count):  # noqa: E741
                    r, s = stations[k], stations[l]
                    if r == a or s == b or fuel[a, r] > capacity or fuel[s, b] > capacity:
                        continue
                    if not np.isfinite(chain[k, l]):
                        continue
                    candidates[number, 0] = fuel[a, r]
                    candidates[number, 1] = time[a, r] + charging[k] * fuel[a, r] + chain[k, l] + time[s, b]
                    candidates[number, 2] = fuel[s, b]
                    candidates[number, 3] = charging[k]
                    number += 1
            for x in np.argsort(candidates[:number, 1]):
                dominated = False
                for y in range(first[a, b], size):
                    if found[y, 0] <= candidates[x, 0] and found[y, 2] <= candidates[x, 2] \
                            and found[y, 3] <= candidates[x, 3]:
                        dominated = True
                        break
                if dominated:
                    continue
                if size == len(found):
                    larger = np.empty((2 * size, 4))
                    larger[:size] = found
                    found = larger
                found[size] = candidates[x]
                size += 1
            last[a, b] = size
            if last[a, b] > first[a, b]:
                quickest[a, b] = min(quickest[a, b], found[first[a, b], 1])
    return found[:size].copy(), first, last


@njit(cache=True)
def step(times, fuels, count, leg_time, leg_fuel, hops, begin, end, near, far, capacity, limit, to_times, to_fuels):
    """The front after one more leg, driven directly or by stations; its length.

    ``near`` and ``far`` are the columns of ``hops`` with the fuel at this end and at the other one: 0 and 2
    forwards, 2 and 0 backwards. Fronts are sorted by increasing time and decreasing fuel.
    """
    size = 0
    direct = 0
    hop = begin
    while True:
        # Next direct candidate, and next chain of stations, in order of time.
        while direct < count and fuels[direct] + leg_fuel > capacity:
            direct += 1
        time_direct = times[direct] + leg_time if direct < count else np.inf
        time_hop, fuel_hop = np.inf, 0.0
        if hop < end:
            for k in range(count):
                if fuels[k] + hops[hop, near] <= capacity:
                    time_hop = times[k] + hops[hop, 1]
                    break
            fuel_hop = hops[hop, far]
            if np.isinf(time_hop):
                hop += 1
                continue
        if np.isinf(time_direct) and np.isinf(time_hop):
            return size
        if time_direct <= time_hop:
            time, fuel = time_direct, fuels[direct] + leg_fuel
            direct += 1
        else:
            time, fuel = time_hop, fuel_hop
            hop += 1
        if time > limit:
            if direct >= count and hop >= end:
                return size
            continue
        # Insert into the front: chains are sorted by their own time, not by the sum.
        place = size
        while place > 0 and to_times[place - 1] > time:
            place -= 1
        if place > 0 and to_fuels[place - 1] <= fuel:
            continue
        stop = place
        while stop < size and to_fuels[stop] >= fuel:
            stop += 1
        if stop == place:  # none dominated: make room
            if size == FRONT:
                if place == FRONT:
                    continue
                size -= 1
            for k in range(size, place, -1):
                to_times[k], to_fuels[k] = to_times[k - 1], to_fuels[k - 1]
            size += 1
        else:
            for k in range(stop, size):
                to_times[place + 1 + k - stop], to_fuels[place + 1 + k - stop] = to_times[k], to_fuels[k]
            size -= stop - place - 1
        to_times[place], to_fuels[place] = time, fuel


@njit(cache=True)
def route_time(order, length, base, fuel, time, first, last, hops, capacity, limit, scratch):
    """Least time of a route that visits POIs in this order; ``inf`` = infeasible. ``scratch``: shape (4, FRONT)."""
    if length == 0:
        return 0.0
    here, count, turn = base, 1, 0
    scratch[0, 0] = scratch[1, 0] = 0.0
    charged = hops.shape[1] > 3
    for k in range(length + 1):
        there = base if k == length else order[k]
        if charged:
            count = charged_step(scratch[2 * turn], scratch[2 * turn + 1], count, time[here, there], fuel[here, there],
                                 hops, first[here, there], last[here, there], capacity, limit, scratch[2 - 2 * turn],
                                 scratch[3 - 2 * turn])
        else:
            count = step(scratch[2 * turn], scratch[2 * turn + 1], count, time[here, there], fuel[here, there], hops,
                         first[here, there], last[here, there], 0, 2, capacity, limit,
                         scratch[2 - 2 * turn], scratch[3 - 2 * turn])
        if count == 0:
            return np.inf
        turn = 1 - turn
        here = there
    return scratch[2 * turn, 0]


@njit(cache=True)
def fronts(order, length, base, fuel, time, first, last, hops, capacity, limit, ahead, ahead_size, behind, behind_size):
    """Both fronts at every stop of a route, base first and base last; its least time, ``inf`` = infeasible.

    ``ahead``: shape (stops, 2, FRONT); ``behind``: shape (stops, 3, FRONT); their sizes: shape (stops,).
    """
    stops = length + 2
    charged = hops.shape[1] > 3
    ahead[0, :, 0] = 0.0
    ahead_size[0] = 1
    for k in range(1, stops):
        a = base if k == 1 else order[k - 2]
        b = base if k == stops - 1 else order[k - 1]
        if length == 0:
            ahead[1, :, 0] = 0.0
            ahead_size[1] = 1
        elif charged:
            ahead_size[k] = charged_step(ahead[k - 1, 0], ahead[k - 1, 1], ahead_size[k - 1], time[a, b], fuel[a, b],
                                         hops, first[a, b], last[a, b], capacity, limit, ahead[k, 0], ahead[k, 1])
        else:
            ahead_size[k] = step(ahead[k - 1, 0], ahead[k - 1, 1], ahead_size[k - 1], time[a, b], fuel[a, b], hops,
                                 first[a, b], last[a, b], 0, 2, capacity, limit, ahead[k, 0], ahead[k, 1])
        if ahead_size[k] == 0:
            return np.inf
    behind[stops - 1, :, 0] = 0.0
    behind_size[stops - 1] = 1
    for k in range(stops - 2, -1, -1):
        a = base if k == 0 else order[k - 1]
        b = base if k == stops - 2 else order[k]
        if length == 0:
            behind[0, :, 0] = 0.0
            behind_size[0] = 1
        elif charged:
            behind_size[k] = charged_step_back(behind[k + 1], behind_size[k + 1], time[a, b], fuel[a, b], hops,
                                               first[a, b], last[a, b], capacity, limit, behind[k])
        else:
            behind_size[k] = step(behind[k + 1, 0], behind[k + 1, 1], behind_size[k + 1], time[a, b], fuel[a, b], hops,
                                  first[a, b], last[a, b], 2, 0, capacity, limit, behind[k, 0], behind[k, 1])
        if behind_size[k] == 0:
            return np.inf
    return ahead[stops - 1, 0, 0]


@njit(cache=True)
def time_with(poi, a, b, fuel, time, first, last, hops, capacity, limit, ahead, ahead_size, behind, behind_size,
              scratch):
    """Least time of the route with one more POI between stops a and b; ``inf`` = infeasible.

    ``ahead`` is the front at a, of shape (2, FRONT), ``behind`` the one at b, of shape (3, FRONT).
    """
    if hops.shape[1] > 3:
        return charged_time_with(poi, a, b, fuel, time, first, last, hops, capacity, limit, ahead, ahead_size, behind,
                                 behind_size, scratch)
    count = step(ahead[0], ahead[1], ahead_size, time[a, poi], fuel[a, poi], hops, first[a, poi], last[a, poi], 0, 2,
                 capacity, limit, scratch[0], scratch[1])
    best = np.inf
    for x in range(count):
        for y in range(behind_size):
            if scratch[1, x] + fuel[poi, b] + behind[1, y] <= capacity:
                best = min(best, scratch[0, x] + time[poi, b] + behind[0, y])
                break
        for h in range(first[poi, b], last[poi, b]):
            if scratch[1, x] + hops[h, 0] > capacity:
                continue
            for y in range(behind_size):
                if hops[h, 2] + behind[1, y] <= capacity:
                    best = min(best, scratch[0, x] + hops[h, 1] + behind[0, y])
                    break
    return best if best <= limit else np.inf
