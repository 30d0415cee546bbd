"""Routes valued and improved in compiled code: the value of an order of POIs, and local search over orders.

Under a discount the value of an order is taken along the quickest ways between its stops, whatever fuel they need. It
guides the search; the value of the way that is driven is that of ``ways.best_way``.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sva_bench.solver.polling import poll
from sva_bench.solver.routes.fronts import route_time

_SHORT = 8  # POIs up to which moves that lengthen the route without refuels are tried: they may save a refuel
_EPSILON = 1e-9


@njit(cache=True)
def route_value(order, length, base, weights, discounted, survival, departure, home):
    """Value of a route: each POI's weight times the probability to get that far, less the expected cost of its loss.

    Args:
        order: Its POIs, in order.
        length: How many.
        base: The base.
        weights: Reward of a visit, shape (n,).
        discounted: Whether the arguments after it count.
        survival: Probability to survive the way from a site to another, shape (n, n).
        departure: Cost of leaving.
        home: Reward of the return.
    """
    total, chance, here = 0.0, 1.0, base
    if not discounted:
        for k in range(length):
            total += weights[order[k]]
        return total
    if length == 0:
        return 0.0
    for k in range(length):
        chance *= survival[here, order[k]]
        here = order[k]
        total += chance * weights[here]
    return total - departure + home * chance * survival[here, base]


@njit(cache=True)
def improve_order(order, length, base, fuel, time, first, last, hops, capacity, limit, weights, discounted, survival,
                  departure, home, scratch, spare, sums, stop):
    """Improve a route in place by 2-opt (reversals) and Or-opt (moves of up to three POIs) to a local optimum.

    Long because compiled: moves share arrays that each part would need.

    On a long route only moves are tried that save time without refuels, or under a discount gain value. Ends early,
    with a route that is as good as before or better, once ``stop`` is not 0.
    """
    now = route_time(order, length, base, fuel, time, first, last, hops, capacity, limit, scratch)
    earned = route_value(order, length, base, weights, discounted, survival, departure, home)
    refuels = last[base, base] > first[base, base]
    ahead, back = sums[0], sums[1]
    _sums(order, length, base, time, ahead, back)
    improved = True
    while improved and not poll(stop):
        improved = False
        for i in range(length):
            for j in range(i + 1, length):
                before = base if i == 0 else order[i - 1]
                after = base if j == length - 1 else order[j + 1]
                change = time[before, order[j]] + back[j + 1] - back[i + 1] + time[order[i], after] \
                    - (ahead[j + 2] - ahead[i])
                longer = change >= -_EPSILON and (length > _SHORT or not refuels)
                if longer and not discounted:
                    continue
                spare[:length] = order[:length]
                for k in range(i, j + 1):
                    spare[k] = order[i + j - k]
                gain = _gain(spare, length, base, weights, discounted, survival, departure, home, earned)
                if gain < -_EPSILON or (longer and gain <= _EPSILON):
                    continue
                later = route_time(spare, length, base, fuel, time, first, last, hops, capacity, limit, scratch)
                if (later < now - _EPSILON and gain >= -_EPSILON) or (gain > _EPSILON and later < np.inf):
                    order[:length] = spare[:length]
                    _sums(order, length, base, time, ahead, back)
                    now, earned, improved = later, earned + gain, True
        for size in range(1, 4):
            for i in range(length - size + 1):
                for position in range(length + 1):
                    if i <= position <= i + size:
                        continue
                    before = base if i == 0 else order[i - 1]
                    after = base if i + size == length else order[i + size]
                    without = ahead[i + size + 1] - ahead[i] - (time[before, after] if before != after else 0.0)
                    a = base if position == 0 else order[position - 1]
                    b = base if position == length else order[position]
                    for backwards in range(2 if size > 1 else 1):
                        if backwards == 0:
                            change = time[a, order[i]] + ahead[i + size] - ahead[i + 1] + time[order[i + size - 1], b]
                        else:
                            change = time[a, order[i + size - 1]] + back[i + size] - back[i + 1] + time[order[i], b]
                        change -= without + time[a, b]
                        longer = change >= -_EPSILON and (length > _SHORT or not refuels)
                        if longer and not discounted:
                            continue
                        _move(order, length, i, size, position, backwards, spare)
                        gain = _gain(spare, length, base, weights, discounted, survival, departure, home, earned)
                        if gain < -_EPSILON or (longer and gain <= _EPSILON):
                            continue
                        later = route_time(spare, length, base, fuel, time, first, last, hops, capacity, limit,
                                           scratch)
                        if (later < now - _EPSILON and gain >= -_EPSILON) or (gain > _EPSILON and later < np.inf):
                            order[:length] = spare[:length]
                            _sums(order, length, base, time, ahead, back)
                            now, earned, improved = later, earned + gain, True
                            break


@njit(cache=True)
def _gain(order, length, base, weights, discounted, survival, departure, home, before):
    """By how much an order of the same POIs is worth more than another one."""
    if not discounted:
        return 0.0
    return route_value(order, length, base, weights, discounted, survival, departure, home) - before


@njit(cache=True)
def _sums(order, length, base, time, ahead, back):
    """Cumulative driving time up to each stop, and of the same stops in reverse."""
    ahead[0] = back[0] = 0.0
    for k in range(length + 1):
        a = base if k == 0 else order[k - 1]
        b = base if k == length else order[k]
        ahead[k + 1] = ahead[k] + time[a, b]
        back[k + 1] = back[k] + time[b, a]


@njit(cache=True)
def _move(order, length, start, size, position, backwards, to):
    """The order with a block moved before another position, reversed if ``backwards`` is 1."""
    filled = 0
    for k in range(length + 1):
        if k == position:
            for b in range(size):
                to[filled] = order[start + b] if backwards == 0 else order[start + size - 1 - b]
                filled += 1
        if k < length and not start <= k < start + size:
            to[filled] = order[k]
            filled += 1
