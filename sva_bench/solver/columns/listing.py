"""Enumeration of partial routes, and the coefficients of cuts for a route, in compiled code."""

from __future__ import annotations

import numpy as np
from numba import njit

from sva_bench.solver.columns.labelling import sum_of
from sva_bench.solver.polling import POLL_EVERY, now_s, poll

_EPSILON = 1e-9


@njit(cache=True)
def partial_routes(legs, time, fuel, bit, words, gain, charge, base, capacity, limit, bound, step, threshold, most,
                   in_cut, in_memory, at_first_visit, cut_dual, stop, left_s):
    """Partial routes from the base, nondominated in time, fuel and value among those of the same POIs and last site.

    Long because compiled: one loop over arrays that it fills, of which each part would need nearly all.

    Returns:
        Last site and parent of each; the last labels of the best routes, one for each set of POIs; whether labels or
        time ran out.
    """
    n = len(gain)
    site, parent = np.zeros(most, np.int32), np.full(most, -1, np.int32)
    t, q, x = np.zeros(most), np.zeros(most), np.zeros(most)
    mask, cut_state = np.zeros((most, words), np.uint64), np.zeros(most, np.uint64)
    dead = np.zeros(most, np.bool_)
    # Partial routes by site and set, and routes by set, in hash tables with open addressing.
    places = 1
    while places < 2 * most:
        places *= 2
    first, next_same_set = np.full(places, -1, np.int64), np.full(most, -1, np.int64)
    best, worth = np.full(places, -1, np.int64), np.zeros(places)
    site[0], cut_state[0], size = base, at_first_visit, 1
    new = np.zeros(words, np.uint64)
    label, end_s = 0, now_s() + left_s
    while label < size:
        if label % POLL_EVERY == 0 and (poll(stop) or now_s() > end_s):
            return site[:size], parent[:size], np.zeros(0, np.int64), True
        i = site[label]
        if dead[label]:
            label += 1
            continue
        if mask[label].any() and legs[i, base] and t[label] + time[i, base] <= limit \
                and q[label] + fuel[i, base] <= capacity:
            total = x[label] - charge * time[i, base]
            if total > threshold:
                place = _place(mask[label], -1, places)
                while best[place] >= 0 and not _same(mask[best[place]], mask[label]):
                    place = (place + 1) & (places - 1)
                if best[place] < 0 or total > worth[place]:
                    best[place], worth[place] = label, total
        for j in range(n):
            if j == base or not legs[i, j]:
                continue
            later, burnt = t[label] + time[i, j], q[label] + fuel[i, j]
            if later > limit or burnt > capacity:
                continue
            b = bit[j]
            for w in range(words):
                new[w] = mask[label, w]
            if b >= 0:
                if new[b >> 6] >> np.uint64(b & 63) & np.uint64(1):
                    continue
                new[b >> 6] |= np.uint64(1) << np.uint64(b & 63)
            else:
                burnt = 0.0
            value = x[label] + gain[j] - charge * time[i, j]
            ahead = cut_state[label] & in_memory[j]
            if in_cut[j]:
                value -= sum_of(cut_dual, ahead & in_cut[j])
                ahead = (ahead ^ (in_cut[j] & ~at_first_visit)) & ~(in_cut[j] & at_first_visit)
            if value + bound[int((limit - later) / step + 1e-9), j] <= threshold:
                continue
            place = _place(new, j, places)
            while first[place] >= 0 and not (site[first[place]] == j and _same(mask[first[place]], new)):
                place = (place + 1) & (places - 1)
            dominated, other = False, first[place]
            while other >= 0:
                if not dead[other]:
                    if t[other] <= later and q[other] <= burnt and x[other] >= value - _EPSILON:
                        dominated = True
                        break
                    if later <= t[other] and burnt <= q[other] and value >= x[other]:
                        dead[other] = True  # its extensions stay: dominated too, but harmless
                other = next_same_set[other]
            if dominated:
                continue
            if size == most:
                return site[:size], parent[:size], np.zeros(0, np.int64), True
            site[size], parent[size], t[size], q[size], x[size], cut_state[size] = j, label, later, burnt, value, ahead
            for w in range(words):
                mask[size, w] = new[w]
            if first[place] < 0:
                first[place] = size
            else:
                next_same_set[size], next_same_set[first[place]] = next_same_set[first[place]], size
            size += 1
        label += 1
    return site[:size], parent[:size], best[best >= 0], False


@njit(cache=True)
def _place(mask, site, places):
    key = np.uint64(site + 2)
    for word in mask:
        key = (key ^ word) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    return np.int64(key & np.uint64(places - 1))


@njit(cache=True)
def _same(one, other):
    different = np.uint64(0)
    for w in range(len(one)):
        different |= one[w] ^ other[w]
    return different == 0


@njit(cache=True)
def counts(member, memory, at_first_visit, route):
    """Coefficient of each cut for a route, shape (cuts,); members and memory by cut and site, shape (cuts, n)."""
    count = np.zeros(len(member))
    for k in range(len(member)):
        visited = False
        for j in route:
            visited &= memory[k, j]
            if member[k, j]:
                if at_first_visit[k]:
                    count[k] = 1.0
                    break
                if visited:
                    count[k] += 1.0
                visited = not visited
    return count
