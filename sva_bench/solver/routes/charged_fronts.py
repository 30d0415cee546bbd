"""Fronts of routes where charging takes time, in compiled code: the steps of ``fronts.py``, which has the others.

A stop at a station takes longer by a share of the fuel burnt since the last refuel. Forwards a front holds (time, fuel)
pairs as ever. Backwards it holds a third entry, the time that the rest of the route takes longer for each second of
fuel burnt before, at the next refuel; one dominates another if it is quicker both with an empty tank and with a full
one.
"""

from __future__ import annotations

import numpy as np
from numba import njit

FRONT = 12
"""Most pairs of a front. Typical ones have two to four; a longer one loses its slowest pairs, and the search routes."""


@njit(cache=True)
def _insert(time, fuel, charging, capacity, times, fuels, chargings, size):
    """Insert an entry into a front unless it is dominated, and drop those that it dominates; the front's length."""
    most = min(capacity, 1e300)  # finite: without charging its product is 0
    full = time + charging * (most - fuel)
    place = size
    while place > 0 and times[place - 1] > time:
        place -= 1
    for k in range(place):
        if fuels[k] <= fuel and times[k] + chargings[k] * (most - fuel) <= full:
            return size
    left = place
    for k in range(place, size):
        if fuels[k] < fuel or times[k] + chargings[k] * (most - fuels[k]) < time + charging * (most - fuels[k]):
            times[left], fuels[left], chargings[left] = times[k], fuels[k], chargings[k]
            left += 1
    size = left
    if size == FRONT:
        if place == FRONT:
            return size
        size -= 1
    for k in range(size, place, -1):
        times[k], fuels[k], chargings[k] = times[k - 1], fuels[k - 1], chargings[k - 1]
    times[place], fuels[place], chargings[place] = time, fuel, charging
    return size + 1


@njit(cache=True)
def charged_step(times, fuels, count, leg_time, leg_fuel, hops, begin, end, capacity, limit, to_times, to_fuels):
    """The forward front after one more leg, driven directly or by stations; its length."""
    size, none = 0, np.zeros(FRONT)
    for k in range(count):
        if fuels[k] + leg_fuel <= capacity and times[k] + leg_time <= limit:
            size = _insert(times[k] + leg_time, fuels[k] + leg_fuel, 0.0, capacity, to_times, to_fuels, none, size)
    for hop in range(begin, end):
        soonest = np.inf
        for k in range(count):
            if fuels[k] + hops[hop, 0] <= capacity:
                soonest = min(soonest, times[k] + hops[hop, 1] + hops[hop, 3] * fuels[k])
        if soonest <= limit:
            size = _insert(soonest, hops[hop, 2], 0.0, capacity, to_times, to_fuels, none, size)
    return size


@njit(cache=True)
def charged_step_back(behind, count, leg_time, leg_fuel, hops, begin, end, capacity, limit, to):
    """The backward front before one more leg, driven directly or by stations; its length.

    ``behind`` and ``to``: time to the end, fuel until the next refuel, and charging of a second's fuel there, of shape
    (3, FRONT).
    """
    size = 0
    for k in range(count):
        time = behind[0, k] + leg_time + behind[2, k] * leg_fuel
        if behind[1, k] + leg_fuel <= capacity and time <= limit:
            size = _insert(time, behind[1, k] + leg_fuel, behind[2, k], capacity, to[0], to[1], to[2], size)
    for hop in range(begin, end):
        soonest = np.inf
        for k in range(count):
            if behind[1, k] + hops[hop, 2] <= capacity:
                soonest = min(soonest, behind[0, k] + hops[hop, 1] + behind[2, k] * hops[hop, 2])
        if soonest <= limit:
            size = _insert(soonest, hops[hop, 0], hops[hop, 3], capacity, to[0], to[1], to[2], size)
    return size


@njit(cache=True)
def charged_time_with(poi, a, b, fuel, time, first, last, hops, capacity, limit, ahead, ahead_size, behind, behind_size,
                      scratch):
    """Least time of the route with one more POI between stops a and b; ``inf`` = infeasible. As ``time_with``."""
    count = charged_step(ahead[0], ahead[1], ahead_size, time[a, poi], fuel[a, poi], hops, first[a, poi], last[a, poi],
                         capacity, limit, scratch[0], scratch[1])
    best = np.inf
    for x in range(count):
        burnt = scratch[1, x] + fuel[poi, b]
        for y in range(behind_size):
            if burnt + behind[1, y] <= capacity:
                best = min(best, scratch[0, x] + time[poi, b] + behind[0, y] + behind[2, y] * burnt)
        for h in range(first[poi, b], last[poi, b]):
            if scratch[1, x] + hops[h, 0] > capacity:
                continue
            arrived = scratch[0, x] + hops[h, 1] + hops[h, 3] * scratch[1, x]
            for y in range(behind_size):
                if hops[h, 2] + behind[1, y] <= capacity:
                    best = min(best, arrived + behind[0, y] + behind[2, y] * hops[h, 2])
    return best if best <= limit else np.inf
