"""Routes changed in compiled code: swapped between vehicles, or, where fuel can't bind, their order improved."""

from __future__ import annotations

from numba import njit

EPSILON = 1e-9
_MOST_MOVED = 3  # POIs of a block that Or-opt moves


@njit(cache=True)
def tour_time(order, length, time):
    """Time of a route from site 0 over POIs in order and back [s]; 0 if it visits none."""
    if length == 0:
        return 0.0
    total = time[0, order[0]]
    for k in range(1, length):
        total += time[order[k - 1], order[k]]
    return total + time[order[length - 1], 0]


@njit(cache=True)
def improve_tour(order, length, time, into, symmetric, following, previous, fresh, new, spare):
    """Improve a route in place by 2-opt (reversals) and Or-opt (moves of up to three POIs), around its new legs.

    Args:
        order: Its POIs, in order; site 0 is the base.
        length: How many.
        time: Time from a site to another, shape (n, n); ``into``: its transpose.
        symmetric: Whether it is the same both ways.
        following: The stop after each POI when no move at the leg to it was left, shape (n,); -1 = none.
        previous: The stop before it, likewise. Only moves at other legs are tried.
        fresh: Room for whether the leg to the k-th stop is new, shape (n + 1,).
        new: Room for the numbers of these legs, shape (n + 1,).
        spare: Room for a block that moves, shape (n,).

    Returns:
        Whether it changed.
    """
    changed = False
    improved = length > 1
    while improved:
        count = _new_legs(order, length, symmetric, following, previous, fresh, new)
        improved = _reversals(order, length, time, symmetric, following, previous, fresh, new, count)
        if improved:
            count = _new_legs(order, length, symmetric, following, previous, fresh, new)
        improved |= _moves(order, length, time, into, symmetric, following, previous, fresh, new, count, spare)
        changed |= improved
    return changed


@njit(cache=True)
def _new_legs(order, length, symmetric, following, previous, fresh, new):
    """Mark the new legs and list their numbers; how many."""
    count, a = 0, 0
    for k in range(length + 1):
        b = order[k] if k < length else 0
        known = (a > 0 and following[a] == b) or (b > 0 and previous[b] == a)
        if symmetric and not known:
            known = (b > 0 and following[b] == a) or (a > 0 and previous[a] == b)
        fresh[k] = not known
        if not known:
            new[count] = k
            count += 1
        a = b
    return count


@njit(cache=True)
def _reversals(order, length, time, symmetric, following, previous, fresh, new, count):
    """One pass of 2-opt over a route; whether it found any move."""
    improved = False
    for i in range(length - 1):
        every = fresh[i] or not symmetric
        before, first = 0 if i == 0 else order[i - 1], order[i]
        from_before, from_first = time[before], time[first]
        leg, turned = from_before[first], 0.0
        u = 0 if every else _first_beyond(new, count, i + 1)
        least, last_of = -EPSILON, -1
        j = i
        while True:
            if every:
                j += 1
                if j >= length:
                    break
                if not symmetric:  # by how much the legs within the block take longer in reverse
                    turned += time[order[j], order[j - 1]] - time[order[j - 1], order[j]]
            else:
                if u >= count:
                    break
                j = new[u] - 1
                u += 1
            last, after = order[j], 0 if j == length - 1 else order[j + 1]
            change = from_before[last] + from_first[after] + turned - leg - time[last, after]
            if change < least:
                least, last_of = change, j
        if last_of >= 0:
            a, b = i, last_of
            while a < b:
                order[a], order[b] = order[b], order[a]
                a += 1
                b -= 1
            improved = True
            count = _new_legs(order, length, symmetric, following, previous, fresh, new)
    return improved


@njit(cache=True)
def _first_beyond(new, count, number):
    """Where the numbers above one begin in a list of numbers in order."""
    u = 0
    while u < count and new[u] <= number:
        u += 1
    return u


@njit(cache=True)
def _moves(order, length, time, into, symmetric, following, previous, fresh, new, count, spare):
    """One pass of Or-opt over a route; whether it found any move."""
    improved = False
    for size in range(1, min(_MOST_MOVED, length - 1) + 1):
        for i in range(length - size + 1):
            first, last = order[i], order[i + size - 1]
            before, after = 0 if i == 0 else order[i - 1], 0 if i + size == length else order[i + size]
            saved = time[before, first] + time[last, after] - time[before, after] - EPSILON
            if saved <= 0.0:
                continue
            turned = 0.0
            if not symmetric:
                for k in range(i, i + size - 1):
                    turned += time[order[k + 1], order[k]] - time[order[k], order[k + 1]]
            to_first, to_last, from_first, from_last = into[first], into[last], time[first], time[last]
            every = fresh[i] or fresh[i + size]
            least, place, backwards = saved, -1, False
            for u in range(length + 1 if every else count):
                position = u if every else new[u]
                if i <= position <= i + size:
                    continue
                a, b = 0 if position == 0 else order[position - 1], 0 if position == length else order[position]
                leg = time[a, b]
                ahead = to_first[a] + from_last[b] - leg
                if ahead < least:
                    least, place, backwards = ahead, position, False
                if size > 1:
                    back = to_last[a] + from_first[b] - leg + turned
                    if back < least:
                        least, place, backwards = back, position, True
            if place >= 0:
                _shift(order, i, size, place, backwards, spare)
                improved = True
                count = _new_legs(order, length, symmetric, following, previous, fresh, new)
    return improved


@njit(cache=True)
def _shift(order, start, size, place, backwards, spare):
    """Move a block of a route before another position, reversed if ``backwards``."""
    for k in range(size):
        spare[k] = order[start + size - 1 - k] if backwards else order[start + k]
    to = place if place < start else place - size
    if place < start:
        for k in range(start - 1, place - 1, -1):
            order[k + size] = order[k]
    else:
        for k in range(start + size, place):
            order[k - size] = order[k]
    for k in range(size):
        order[to + k] = spare[k]


@njit(cache=True)
def swap_routes(rng, orders, lengths, allowed, spare):
    """Swap the routes of two random vehicles, without the POIs that the other may not visit: which two."""
    a = int(rng.random() * len(lengths))
    b = (a + 1 + int(rng.random() * (len(lengths) - 1))) % len(lengths)
    length = lengths[a]
    spare[:length] = orders[a, :length]
    lengths[a] = 0
    for k in range(lengths[b]):
        if allowed[a, orders[b, k]]:
            orders[a, lengths[a]] = orders[b, k]
            lengths[a] += 1
    lengths[b] = 0
    for k in range(length):
        if allowed[b, spare[k]]:
            orders[b, lengths[b]] = spare[k]
            lengths[b] += 1
    return a, b
