"""Ruin and recreate in compiled code: remove some POIs, insert others greedily, improve each route's order.

Source:
    Schrimpf et al. (2000), "Record breaking optimization results using the ruin and recreate principle".
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sva_bench.solver.polling import poll
from sva_bench.solver.routes.charged_fronts import FRONT
from sva_bench.solver.routes.fronts import fronts, route_time, time_with
from sva_bench.solver.routes.local_search import improve_order, route_value
from sva_bench.solver.routes.pool import keep
from sva_bench.solver.routes.tours import swap_routes

_RUIN = 0.6  # greatest share of the visits removed
_BAN = 0.7  # share of the iterations in which POIs are barred from a random vehicle
_SWAP = 0.1  # share of the iterations that begin by swapping the routes of two vehicles
_NOISE = 0.3
_EPSILON = 1e-9


@njit(cache=True)
def rounds(rng, count, done, cycle, heat, vehicle_class, base, fuel, time, quickest, first, last, hops, capacity, limit,
           near, weights, discounted, survival, departure, home, detour, current, current_length, best, best_length,
           pool, pool_length, pool_class, pool_size, pool_table, keys, ordered, stop):
    """The size of the pool after some iterations, which change ``current``, ``best`` and ``pool`` in place.

    Long because compiled: a dozen scratch arrays are made once, and each part would need nearly all of them.

    Args:
        rng: Random numbers.
        count: Iterations.
        done: Iterations before these.
        cycle: Iterations between two restarts; within a cycle the loss that is accepted falls to 0.
        heat: Loss that is accepted at the start of a cycle, relative to the best value.
        vehicle_class: Class of each vehicle, shape (M,).
        base: The base; it and the arrays up to ``limit`` are those of ``LegTables``.
        near: For each POI the others by their distance, shape (n, n).
        weights: Reward of a visit by vehicle m to site j, shape (M, n), not negative.
        discounted: Whether the value of vehicle m's route depends on its order, shape (M,).
        survival: Probability of vehicle m to survive the way from a site to another, shape (M, n, n).
        departure: Cost of leaving, shape (M,); ``home``: reward of the return, shape (M,).
        detour: Added to each detour, so that the ratio stays finite [s].
        current: POIs of each vehicle, in order, shape (M, n); ``current_length``: how many, shape (M,).
        best: The best plan, in the same form.
        pool: Routes found, shape (most, n), with length, class and a hash table of twice their number or more.
        keys: Random keys of the sites for hashing, shape (n,).
        ordered: Whether routes with the same POIs in another order are different ones.
        stop: The flag of ``polling``: not 0 once Ctrl-C was pressed.
    """
    vehicles, n = weights.shape
    orders, lengths = current.copy(), current_length.copy()
    visited = np.zeros(n, np.bool_)
    allowed, earning = np.zeros((vehicles, n), np.bool_), weights > 0
    factor = np.ones((vehicles, n))
    ahead, ahead_size = np.zeros((vehicles, n + 2, 2, FRONT)), np.zeros((vehicles, n + 2), np.int64)
    behind, behind_size = np.zeros((vehicles, n + 2, 3, FRONT)), np.zeros((vehicles, n + 2), np.int64)
    score, place = np.zeros((vehicles, n)), np.zeros((vehicles, n), np.int64)
    least, reward, total = np.zeros((vehicles, n)), np.zeros((vehicles, n)), np.zeros(vehicles)
    scratch, spare, removed = np.zeros((4, FRONT)), np.zeros(n, np.int64), np.zeros(n, np.bool_)
    sums = np.zeros((2, n + 2))
    current_value = best_value = 0.0
    for m in range(vehicles):
        current_value += route_value(current[m], current_length[m], base, weights[m], discounted[m], survival[m],
                                     departure[m], home[m])
        best_value += route_value(best[m], best_length[m], base, weights[m], discounted[m], survival[m],
                                     departure[m], home[m])
    for number in range(done, done + count):
        if poll(stop):
            break
        orders[:], lengths[:] = current, current_length
        if vehicles > 1 and rng.random() < _SWAP:
            swap_routes(rng, orders, lengths, earning, spare)
        _ruin(rng, orders, lengths, near, removed)
        for m in range(vehicles):
            k = vehicle_class[m]
            if np.isinf(route_time(orders[m], lengths[m], base, fuel[k], time[k], first[k], last[k], hops,
                                   capacity[k], limit[k], scratch)):
                lengths[m] = 0  # without the triangle inequality a POI may have been a shortcut
        power = 0.5 + 1.5 * rng.random()
        ban = 0.5 * rng.random() if vehicles > 1 and rng.random() < _BAN else 0.0
        for m in range(vehicles):
            for j in range(n):
                allowed[m, j] = weights[m, j] > 0
                factor[m, j] = 1.0 + _NOISE * (2.0 * rng.random() - 1.0)
        if ban > 0:
            for j in range(n):
                if rng.random() < ban:
                    allowed[int(rng.random() * vehicles), j] = False
        for again in range(2):
            _recreate(orders, lengths, visited, allowed, power, factor, vehicle_class, base, fuel, time, quickest,
                      first, last, hops, capacity, limit, weights, discounted, survival, departure, home, again == 1,
                      detour, ahead, ahead_size, behind, behind_size, score, place, least, reward, total, sums, scratch)
            if again == 0:
                for m in range(vehicles):
                    k = vehicle_class[m]
                    improve_order(orders[m], lengths[m], base, fuel[k], time[k], first[k], last[k], hops, capacity[k],
                               limit[k], weights[m], discounted[m], survival[m], departure[m], home[m], scratch, spare,
                               sums, stop)
                    if discounted[m] and route_value(orders[m], lengths[m], base, weights[m], True, survival[m],
                                                     departure[m], home[m]) < 0.0:
                        lengths[m] = 0  # its risk costs more than it earns: others may visit its POIs
                    for j in range(n):
                        allowed[m, j] = weights[m, j] > 0
                factor[:] = 1.0
                power = 1.0
        value = 0.0
        for m in range(vehicles):
            value += route_value(orders[m], lengths[m], base, weights[m], discounted[m], survival[m], departure[m],
                                 home[m])
            pool_size = keep(orders[m], lengths[m], vehicle_class[m], pool, pool_length, pool_class, pool_size,
                             pool_table, keys, ordered)
        if value > best_value + _EPSILON:
            best[:], best_length[:] = orders, lengths
            best_value = value
        left = 1.0 - (number % cycle) / cycle
        if value >= current_value - heat * left * best_value:
            current[:], current_length[:] = orders, lengths
            current_value = value
        if number % cycle == cycle - 1:  # restart, alternately from the empty plan and from the best
            current[:], current_length[:] = best, best_length
            current_value = best_value
            if number // cycle % 2 == 0:
                current_length[:] = 0
                current_value = 0.0
    return pool_size


@njit(cache=True)
def _ruin(rng, orders, lengths, near, removed):
    """Remove a segment of consecutive visits, the POIs around a random one, or random POIs."""
    visits = 0
    for m in range(len(lengths)):
        visits += lengths[m]
    if visits == 0:
        return
    count = 1 + int(rng.random() * max(1, int(_RUIN * visits)))
    operator = int(rng.random() * 3)
    removed[:] = False
    if operator == 0:  # each with the probability that removes ``count`` on average
        for m in range(len(lengths)):
            for k in range(lengths[m]):
                removed[orders[m, k]] = rng.random() * visits < count
    else:
        start = int(rng.random() * visits)
        seen = 0
        centre = -1
        for m in range(len(lengths)):
            for k in range(lengths[m]):
                if operator == 1:
                    removed[orders[m, k]] = start <= seen < start + count
                elif seen == start:
                    centre = orders[m, k]
                seen += 1
        if operator == 2:
            spread = int(count * len(near) / visits)
            for k in range(min(spread, len(near))):
                removed[near[centre, k]] = True
    for m in range(len(lengths)):
        left = 0
        for k in range(lengths[m]):
            if not removed[orders[m, k]]:
                orders[m, left] = orders[m, k]
                left += 1
        lengths[m] = left


@njit(cache=True)
def _recreate(orders, lengths, visited, allowed, power, factor, vehicle_class, base, fuel, time, quickest, first, last,
              hops, capacity, limit, weights, discounted, survival, departure, home, alone, detour, ahead, ahead_size,
              behind, behind_size, score, place, least, reward, total, sums, scratch):
    """Insert POIs greedily by reward per detour, until none fits; ``alone``: the first must be worth leaving for.

    Long because compiled: detours are kept from one insertion to the next, in arrays that each part would need.
    """
    vehicles, n = weights.shape
    visited[:] = False
    score[:] = 0.0
    inserted = -1
    for m in range(vehicles):
        for k in range(lengths[m]):
            visited[orders[m, k]] = True
        for j in range(n):
            if allowed[m, j]:
                reward[m, j] = weights[m, j]**power
    stale = -1  # all
    while True:
        for m in range(vehicles):
            if stale >= 0 and m != stale:
                continue
            k = vehicle_class[m]
            free = np.isinf(capacity[k])
            if free:
                total[m] = route_time(orders[m], lengths[m], base, fuel[k], time[k], first[k], last[k], hops,
                                      capacity[k], limit[k], scratch)
            else:
                total[m] = fronts(orders[m], lengths[m], base, fuel[k], time[k], first[k], last[k], hops, capacity[k],
                                  limit[k], ahead[m], ahead_size[m], behind[m], behind_size[m])
            # Where fuel can't bind, a detour is unchanged at every position but that of the last insertion.
            known = free and stale >= 0 and not discounted[m]
            chance, rest = sums[0], sums[1]
            if discounted[m]:
                _chances(orders[m], lengths[m], base, weights[m], survival[m], home[m], chance, rest)
            for j in range(n):
                if visited[j] or not allowed[m, j]:
                    continue
                begin, end, most = 0, lengths[m], 0.0
                if known and least[m, j] < np.inf and place[m, j] != inserted:
                    begin, end = inserted, inserted + 1
                    if place[m, j] > inserted:
                        place[m, j] += 1
                else:
                    least[m, j] = np.inf
                for position in range(begin, end + 1):
                    a = base if position == 0 else orders[m, position - 1]
                    b = base if position == lengths[m] else orders[m, position]
                    soonest = 0.0  # a lower bound, without refuels
                    if not free:
                        soonest = ahead[m, position, 0, 0] + quickest[k, a, j] + quickest[k, j, b] \
                            + behind[m, position + 1, 0, 0]
                        if soonest >= (limit[k] if discounted[m] else min(limit[k], total[m] + least[m, j])):
                            continue  # too late, or later than at another position
                    gained = 0.0
                    if discounted[m]:
                        there = chance[position] * survival[m, a, j]
                        gain = there * weights[m, j] + (there * survival[m, j, b]
                                                        - chance[position] * survival[m, a, b]) * rest[position + 1]
                        if lengths[m] == 0:
                            gain = there * weights[m, j]
                            if alone:
                                gain += there * survival[m, j, b] * home[m] - departure[m]
                        if gain <= _EPSILON:
                            continue
                        gained = gain**power
                        if not free and gained <= most * (max(soonest - total[m], 0.0) + detour):
                            continue
                    if free:
                        later = total[m] + time[k, a, j] + time[k, j, b] - (time[k, a, b] if lengths[m] > 0 else 0.0)
                    else:
                        later = time_with(j, a, b, fuel[k], time[k], first[k], last[k], hops, capacity[k],
                                          limit[k], ahead[m, position], ahead_size[m, position],
                                          behind[m, position + 1], behind_size[m, position + 1], scratch)
                    if discounted[m]:
                        if later <= limit[k]:
                            merit = gained / (max(later - total[m], 0.0) + detour)
                            if merit > most:
                                least[m, j], place[m, j], most = later - total[m], position, merit
                    elif later - total[m] < least[m, j]:
                        least[m, j], place[m, j] = later - total[m], position
                score[m, j] = 0.0
                if total[m] + least[m, j] <= limit[k]:
                    score[m, j] = factor[m, j] * (
                        most if discounted[m] else reward[m, j] / (max(least[m, j], 0.0) + detour))
        chosen, poi, most = -1, -1, 0.0
        for m in range(vehicles):
            for j in range(n):
                if not visited[j] and score[m, j] > most:
                    chosen, poi, most = m, j, score[m, j]
        if chosen < 0:
            return
        for k in range(lengths[chosen], place[chosen, poi], -1):
            orders[chosen, k] = orders[chosen, k - 1]
        orders[chosen, place[chosen, poi]] = poi
        lengths[chosen] += 1
        visited[poi] = True
        stale, inserted = chosen, place[chosen, poi]


@njit(cache=True)
def _chances(order, length, base, weights, survival, home, chance, rest):
    """Probability to get to each stop of a route, and what the rest of it is worth once there, base first and last."""
    chance[0] = 1.0
    rest[length + 1] = home
    for k in range(length):
        chance[k + 1] = chance[k] * survival[base if k == 0 else order[k - 1], order[k]]
    for k in range(length - 1, -1, -1):
        rest[k + 1] = weights[order[k]] + survival[order[k], base if k == length - 1 else order[k + 1]] * rest[k + 2]
