"""Simulated annealing over plans in compiled code, where fuel can't bind: strings of visits are removed, and POIs
inserted greedily.

Source:
    Christiaens & Vanden Berghe (2020), "Slack induction by string removals for vehicle routing problems".
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sva_bench.solver.polling import poll
from sva_bench.solver.routes.pool import keep
from sva_bench.solver.routes.tours import EPSILON, improve_tour, swap_routes, tour_time

_POLL_EVERY = 64  # rounds
_SWAP = 0.03  # share of the rounds in which two vehicles swap routes instead
_STRING, _LONG_STRING = 8, 24  # longest strings
_LONG = 0.1  # share of the rounds with long strings
_GAPS = 0.3  # share of the rounds in which some visits within a string stay
_BANS = 0.5  # share of the rounds in which some vehicles are barred from some POIs
_MOST_BANNED = 0.3  # of all pairs
_GOOD = 0.985  # value of a plan whose routes are kept, relative to the best
_NOISE = 0.5  # greatest, on the merit of an insertion
POWERS = np.linspace(0.6, 1.5, 10)
"""Powers of the reward in the merit of an insertion; each round takes one of them."""


@njit(cache=True)
def anneal(rng, begin, end, count, hot, cold, price, detour, vehicle_class, time, into, symmetric, limit, near,
           weights, powers, allowed, current, current_length, best, best_length, pool, pool_length, pool_class,
           pool_size, pool_table, keys, stop):
    """The size of the pool after some rounds of annealing, which change ``current``, ``best`` and ``pool`` in place.

    Long because compiled: scratch arrays are made once, and each part would need nearly all of them.

    Args:
        rng: Random numbers.
        begin: Number of the first of these rounds; ``end``: of the first after them.
        count: Rounds in all, over which the heat falls.
        hot: Loss that is accepted with probability 1/e in round 0.
        cold: The same in the last one.
        price: What a second of a route costs, in rewards.
        detour: Added to each detour, so that the ratio stays finite [s].
        vehicle_class: Class of each vehicle, shape (M,).
        time: Time from a site to another, shape (classes, n, n); site 0 is the base; ``into``: its transposes.
        symmetric: Whether it is the same both ways.
        limit: Mission limit [s], shape (classes,).
        near: For each site the POIs by their distance, itself included, shape (n, n - 1).
        weights: Reward of a visit by vehicle m to site j, shape (M, n).
        powers: Its ``POWERS``, shape (powers, M, n).
        allowed: Whether vehicle m may visit site j, shape (M, n).
        current: POIs of each vehicle, in order, shape (M, n); ``current_length``: how many, shape (M,).
        best: The best plan, in the same form.
        pool: Routes of good plans, shape (most, n), with length, class and a hash table of twice their number or more.
        keys: Random keys of the sites for hashing, shape (n,).
        stop: The flag of ``polling``: not 0 once Ctrl-C was pressed.
    """
    vehicles, n = weights.shape
    orders, lengths = current.copy(), current_length.copy()
    total, changed = np.zeros(vehicles), np.zeros(vehicles, np.bool_)
    merit, score, least = np.zeros((vehicles, n)), np.zeros((vehicles, n)), np.zeros((vehicles, n))
    place, where, legs = np.zeros((vehicles, n), np.int64), np.zeros(n, np.int64), np.zeros(n + 1)
    out, spare = np.zeros(n, np.int64), np.zeros(n, np.int64)
    following, previous = np.full(n, -1), np.full(n, -1)
    fresh, new = np.zeros(n + 1, np.bool_), np.zeros(n + 1, np.int64)
    improved_orders, improved_lengths = orders.copy(), lengths.copy()
    current_value, current_time = _worth(current, current_length, vehicle_class, time, weights)
    best_value, best_time = _worth(best, best_length, vehicle_class, time, weights)
    for number in range(begin, end):
        if number % _POLL_EVERY == 0 and poll(stop):
            break
        heat = hot * (cold / hot) ** (number / count)
        for m in range(vehicles):
            lengths[m], changed[m] = current_length[m], False
            orders[m, :lengths[m]] = current[m, :lengths[m]]
        if vehicles > 1 and rng.random() < _SWAP:
            for m in swap_routes(rng, orders, lengths, allowed, spare):
                changed[m] = True
        else:
            _remove_strings(rng, orders, lengths, near, where, changed)
        for m in range(vehicles):
            k = vehicle_class[m]
            total[m] = tour_time(orders[m], lengths[m], time[k])
            while not total[m] <= limit[k]:  # another vehicle's route, or a POI was a shortcut
                lengths[m] -= 1
                total[m] = tour_time(orders[m], lengths[m], time[k])
        left = _left_out(orders, lengths, n, where, out)
        _draw_merit(rng, out, left, powers, allowed, merit)
        left = _insert(orders, lengths, total, changed, out, left, vehicle_class, time, into, limit, merit, detour,
                       score, least, place, legs)
        for m in range(vehicles):
            k = vehicle_class[m]
            shorter = changed[m] and improve_tour(orders[m], lengths[m], time[k], into[k], symmetric, following,
                                                  previous, fresh, new, spare)
            if changed[m]:
                total[m] = tour_time(orders[m], lengths[m], time[k])
            for u in range(left):  # what was offered to a route that is no shorter doesn't fit
                offered = merit[m, u] > 0.0 and not shorter
                merit[m, u] = weights[m, out[u]] if allowed[m, out[u]] and not offered else 0.0
        improved_orders[:], improved_lengths[:] = orders, lengths
        _insert(orders, lengths, total, changed, out, left, vehicle_class, time, into, limit, merit, detour, score,
                least, place, legs)
        value = seconds = 0.0
        for m in range(vehicles):
            seconds += total[m]
            for k in range(lengths[m]):
                value += weights[m, orders[m, k]]
        gain = value - current_value - price * (seconds - current_time)
        if gain >= 0.0 or rng.random() < np.exp(gain / heat):
            current_value, current_time = value, seconds
            _note_legs(improved_orders, improved_lengths, following, previous)
            for m in range(vehicles):
                current_length[m] = lengths[m]
                current[m, :lengths[m]] = orders[m, :lengths[m]]
            if value > best_value + EPSILON or (value > best_value - EPSILON and seconds < best_time - EPSILON):
                best_value, best_time = value, seconds
                best[:], best_length[:] = current, current_length
            if value >= _GOOD * best_value:
                for m in range(vehicles):
                    if changed[m]:
                        pool_size = keep(orders[m], lengths[m], vehicle_class[m], pool, pool_length, pool_class,
                                         pool_size, pool_table, keys, False)
    return pool_size


@njit(cache=True)
def _note_legs(orders, lengths, following, previous):
    """Note the stops around each POI of a plan without moves that improve it."""
    following[:] = -1
    previous[:] = -1
    for m in range(len(lengths)):
        before = 0
        for k in range(lengths[m]):
            j = orders[m, k]
            previous[j] = before
            if before > 0:
                following[before] = j
            before = j
        if before > 0:
            following[before] = 0


@njit(cache=True)
def _worth(orders, lengths, vehicle_class, time, weights):
    """Value and time of a plan."""
    value = seconds = 0.0
    for m in range(len(lengths)):
        seconds += tour_time(orders[m], lengths[m], time[vehicle_class[m]])
        for k in range(lengths[m]):
            value += weights[m, orders[m, k]]
    return value, seconds


@njit(cache=True)
def _remove_strings(rng, orders, lengths, near, where, changed):
    """Remove strings of consecutive visits around a random POI."""
    vehicles, n = len(lengths), len(where)
    where[:] = -1
    for m in range(vehicles):
        for k in range(lengths[m]):
            where[orders[m, k]] = m
    strings = 1 + int(rng.random() * (3 if vehicles <= 2 else vehicles + 1))
    longest = _LONG_STRING if rng.random() < _LONG else _STRING
    gaps = rng.random() < _GAPS
    centre = 1 + int(rng.random() * (n - 1))
    for neighbour in range(n - 1):
        poi = near[centre, neighbour]
        m = where[poi]
        if m < 0:
            continue
        at = 0
        while orders[m, at] != poi:
            at += 1
        size = min(1 + int(rng.random() * longest), lengths[m])
        first = max(0, at - size + 1)
        first += int(rng.random() * (min(at, lengths[m] - size) - first + 1))
        left = first
        for k in range(first, lengths[m]):
            j = orders[m, k]
            if k < first + size and (j == poi or not gaps or rng.random() < 0.5):
                where[j] = -1
            else:
                orders[m, left] = j
                left += 1
        lengths[m] = left
        changed[m] = True
        strings -= 1
        if strings == 0:
            return


@njit(cache=True)
def _left_out(orders, lengths, n, where, out):
    """The POIs that no route visits, into ``out``; how many."""
    where[:] = -1
    for m in range(len(lengths)):
        for k in range(lengths[m]):
            where[orders[m, k]] = m
    left = 0
    for j in range(1, n):
        if where[j] < 0:
            out[left] = j
            left += 1
    return left


@njit(cache=True)
def _draw_merit(rng, out, left, powers, allowed, merit):
    """Draw what the visits left out count for in the round's insertions, shape (M, left); 0 = not allowed."""
    power = powers[int(rng.random() * len(powers))]
    noise = _NOISE * rng.random()
    banned = _MOST_BANNED * rng.random() if len(allowed) > 1 and rng.random() < _BANS else 0.0
    for m in range(len(allowed)):
        for u in range(left):
            j = out[u]
            if not allowed[m, j] or (banned > 0.0 and rng.random() < banned):
                merit[m, u] = 0.0
            else:
                merit[m, u] = power[m, j] * (1.0 + noise * (2.0 * rng.random() - 1.0))


@njit(cache=True)
def _insert(orders, lengths, total, changed, out, left, vehicle_class, time, into, limit, merit, detour, score, least,
            place, legs):
    """Insert POIs greedily by merit per detour, until none fits; how many are left out.

    Each keeps its cheapest position in each route, which an insertion changes only where it was.
    """
    vehicles = len(lengths)
    for m in range(vehicles):
        k = vehicle_class[m]
        _cheapest_of_all(orders[m], lengths[m], out, left, time[k], into[k], legs, total[m], limit[k], merit[m], detour,
                         score[m], least[m], place[m])
    while True:
        most, m, chosen = 0.0, -1, -1
        for vehicle in range(vehicles):
            for u in range(left):
                if score[vehicle, u] > most:
                    most, m, chosen = score[vehicle, u], vehicle, u
        if m < 0:
            return left
        poi, at = out[chosen], place[m, chosen]
        for i in range(lengths[m], at, -1):
            orders[m, i] = orders[m, i - 1]
        orders[m, at] = poi
        lengths[m] += 1
        total[m] += least[m, chosen]
        changed[m] = True
        left -= 1
        out[chosen] = out[left]
        for vehicle in range(vehicles):
            merit[vehicle, chosen], score[vehicle, chosen] = merit[vehicle, left], score[vehicle, left]
            least[vehicle, chosen], place[vehicle, chosen] = least[vehicle, left], place[vehicle, left]
        k = vehicle_class[m]
        _cheapest_beside(at, orders[m], lengths[m], out, left, time[k], into[k], total[m], limit[k], merit[m], detour,
                         score[m], least[m], place[m])


@njit(cache=True)
def _cheapest_of_all(order, length, out, left, time, into, legs, total, limit, merit, detour, score, least, place):
    """For each POI left out the position at which it prolongs a route least, and its merit per detour there."""
    before = 0
    for k in range(length):
        legs[k] = time[before, order[k]]
        before = order[k]
    legs[length] = time[before, 0] if length else 0.0
    for u in range(left):
        score[u] = 0.0
        if merit[u] > 0.0:
            _cheapest(order, length, time[out[u]], into[out[u]], legs, u, least, place)
            if total + least[u] <= limit:
                score[u] = merit[u] / (max(least[u], 0.0) + detour)


@njit(cache=True)
def _cheapest(order, length, onward, into, legs, u, least, place):
    """The position at which one POI prolongs a route least."""
    most, at, ahead = np.inf, 0, into[0]
    for position in range(length):
        there = order[position]
        extra = ahead + onward[there] - legs[position]
        if extra < most:
            most, at = extra, position
        ahead = into[there]
    extra = ahead + onward[0] - legs[length]
    if extra < most:
        most, at = extra, length
    least[u], place[u] = most, at


@njit(cache=True)
def _cheapest_beside(at, order, length, out, left, time, into, total, limit, merit, detour, score, least, place):
    """The same once a POI was inserted at a position."""
    poi, before, after = order[at], 0 if at == 0 else order[at - 1], 0 if at == length - 1 else order[at + 1]
    onward, back = time[poi], into[poi]
    first, second = time[before, poi], time[poi, after]
    from_before, to_after = time[before], into[after]
    for u in range(left):
        if merit[u] <= 0.0:
            continue
        j = out[u]
        if place[u] == at:
            most, there, here = np.inf, 0, 0
            for position in range(length + 1):
                following = 0 if position == length else order[position]
                extra = time[here, j] + time[j, following] - time[here, following]
                if extra < most:
                    most, there = extra, position
                here = following
            least[u], place[u] = most, there
        else:
            if place[u] > at:
                place[u] += 1
            extra = from_before[j] + back[j] - first
            if extra < least[u]:
                least[u], place[u] = extra, at
            extra = onward[j] + to_after[j] - second
            if extra < least[u]:
                least[u], place[u] = extra, at + 1
        score[u] = merit[u] / (max(least[u], 0.0) + detour) if total + least[u] <= limit else 0.0
