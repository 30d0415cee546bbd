"""Labels from both ends of a route, in compiled code.

A label is a partial route from the base to a site: time, fuel burnt since the last refuel, value, and the visited POIs
that its site remembers (its ng-set). Labels grow up to half the mission limit from either end and are joined over
the leg that crosses the middle. A label is dominated by another one at its site that is nowhere worse. A label that
can't exceed a threshold even with the completion bound is dropped, so a run without results proves that no route does.

Under discounts a forward label also carries the probability ``D`` to get so far; a backward label what the rest is
worth once its site is reached, ``W``, and apart minus its duals. A route's value is linear in ``W`` and in ``D``, so a
label is nowhere worse than another if it isn't at either end of their range. The return is a reward within ``W``: a
cost of losses paid bit by bit would let a label's value fall with ``D``.

Source:
    Baldacci, Mingozzi, Roberti (2011), "New route relaxation and pricing strategies for the vehicle routing problem";
    Righini, Salani (2006), "Symmetry helps: bounded bi-directional dynamic programming".
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sva_bench.solver.polling import POLL_EVERY, now_s, poll

CHUNK = 32  # labels of a site that are tested for dominance together
KEYS = 5  # POIs by which a site's labels are grouped: only those with a subset of a label's can dominate it
BUCKETS = 256  # of time, in whose order labels are extended
POLL_STEPS = 100_000  # legs and pairs of labels between two polls of the join: each takes nanoseconds
_EPSILON = 1e-9


@njit(cache=True)
def completion(legs, time, gain, charge, bit, base, step, steps, stop):
    """Upper bound on what a path from a site to the base can add within a number of time steps, shape (steps + 1, n).

    Paths may repeat sites, but have no 2-cycles of POIs; fuel is ignored; a leg's time steps are rounded down.

    Args:
        gain: What the visit of a site adds, by the time steps left after it, shape (steps + 1, n); or shape (1, n).
    """
    n, timed = gain.shape[1], len(gain) > 1
    best, second = np.full((steps + 1, n), -np.inf), np.full((steps + 1, n), -np.inf)
    by = np.full((steps + 1, n), -1, np.int64)
    for t in range(steps + 1):
        if poll(stop):
            break
        for i in range(n):
            if i == base:
                continue
            for j in range(n):
                if not legs[i, j]:
                    continue
                left = t - int(time[i, j] / step - 1e-9)
                if left < 0:
                    continue
                value = gain[left if timed else 0, j] - charge * time[i, j]
                if j != base:
                    # No 2-cycle: out of j to a site other than i, if i is a POI.
                    back = bit[i] >= 0 and by[left, j] == i
                    value += second[left, j] if back else best[left, j]
                if value > best[t, i]:
                    second[t, i] = best[t, i]
                    best[t, i], by[t, i] = value, j
                elif value > second[t, i]:
                    second[t, i] = value
    return best


@njit(cache=True)
def extend_labels(following, count, time, fuel, bit, memory, compared, reward, dual, charge, discounted, survival, low,
                  high, start, base, half, capacity, limit, bound, step, threshold, forwards, most_labels, in_cut,
                  in_memory, at_first_visit, cut_dual, stop, left_s):
    """All nondominated labels from one end of the route up to half the limit.

    Long because compiled: its arrays grow, and each part would need nearly all of them.

    Args:
        compared: The POIs of each site's ng-set that dominance compares, as bits, shape (n, words): all of them, or
            fewer for a heuristic; none = it compares no cuts either.
        discounted: Whether ``survival``, ``low``, ``high`` and ``start`` count.
        survival: Probability to survive a leg, shape (n, n).
        low: Least weight of the value, or probability, that the other end of a route multiplies a label's with.
        high: The greatest, shape (n,).
        start: What a route's first label is worth.

    Returns:
        Site, time, fuel, value, second value, memory, state of the cuts, parent, and labels by site, each site's by
        decreasing value: first the index at which each site's begin. Then whether labels or time ran out. The second
        value is, forwards, the probability to get so far; backwards, minus the duals of the visits, and the value is
        then what the rest is worth if the site is reached, without duals.
    """
    n, words = memory.shape
    room = 4096
    site, parent, after = np.zeros(room, np.int32), np.full(room, -1, np.int32), np.full(room, -1, np.int32)
    t, q = np.zeros(room), np.zeros(room)
    x, y = np.zeros(room), np.zeros(room)
    mask = np.zeros((room, words), np.uint64)
    cut_state = np.zeros(room, np.uint64)  # cuts whose dual is subtracted at the next visit to one of their POIs
    kept = np.zeros(room, np.bool_)
    site[0], x[0], y[0], cut_state[0], size = base, start, 1.0 if forwards else 0.0, at_first_visit, 1
    has_cuts = len(cut_dual) > 0
    width = half / BUCKETS
    head = np.full(BUCKETS + 1, -1, np.int64)
    head[0] = 0
    # Nondominated labels, in chunks by site and key, the latest chunk first.
    chunks = 256
    chunk_of, chunk_next, chunk_size = np.full((n, 1 << KEYS), -1, np.int64), np.full(chunks, -1, np.int64), \
        np.zeros(chunks, np.int64)
    keys, exact = _keys(bit, compared, time), compared.any()
    c_t, c_q = np.zeros((chunks, CHUNK)), np.zeros((chunks, CHUNK))
    c_x, c_y = np.zeros((chunks, CHUNK)), np.zeros((chunks, CHUNK))
    c_mask, c_cut_state = np.zeros((chunks, CHUNK, words), np.uint64), np.zeros((chunks, CHUNK), np.uint64)
    c_least_fuel, c_most_value = np.zeros(chunks), np.zeros(chunks)
    used, overflow, polled, end_s = 0, False, 0, now_s() + left_s
    bounded = len(bound) > 0
    new = np.zeros(words, np.uint64)
    for bucket in range(BUCKETS + 1):
        while head[bucket] >= 0:
            number = 0
            label = head[bucket]
            while label >= 0:
                number += 1
                label = after[label]
            batch, when = np.zeros(number, np.int64), np.zeros(number)
            label = head[bucket]
            for k in range(number):
                batch[k], when[k] = label, t[label]
                label = after[label]
            head[bucket] = -1
            for position in np.argsort(when):
                label = batch[position]
                polled += 1
                if polled % POLL_EVERY == 0 and (poll(stop) or now_s() > end_s):
                    overflow = True
                    break
                i = site[label]
                best, worst = x[label], 0.0
                if discounted:
                    best, worst = _at_both_ends(forwards, x[label], y[label], low, high[i])
                # Dominance, against the labels whose key is a subset of this one's.
                dominated = False
                key = 0
                if exact:
                    for k in range(KEYS):
                        b = keys[i, k]
                        if b >= 0 and mask[label, b >> 6] >> np.uint64(b & 63) & np.uint64(1):
                            key |= 1 << k
                subset = key
                while not dominated:
                    chunk = chunk_of[i, subset]
                    while chunk >= 0 and not dominated:
                        if c_most_value[chunk] >= best - _EPSILON and c_least_fuel[chunk] <= q[label] + _EPSILON:
                            for k in range(chunk_size[chunk]):
                                if c_x[chunk, k] >= best - _EPSILON and c_q[chunk, k] <= q[label] + _EPSILON \
                                        and c_t[chunk, k] <= t[label] + _EPSILON \
                                        and c_y[chunk, k] >= worst - _EPSILON:
                                    dominated = True
                                    if exact:
                                        for w in range(words):
                                            if c_mask[chunk, k, w] & ~mask[label, w] & compared[i, w]:
                                                dominated = False
                                                break
                                        if dominated and has_cuts:
                                            more = sum_of(cut_dual, c_cut_state[chunk, k] & ~cut_state[label])
                                            dominated = c_x[chunk, k] - more >= best - _EPSILON
                                    if dominated:
                                        break
                        chunk = chunk_next[chunk]
                    if subset == 0:
                        break
                    subset = (subset - 1) & key  # the next subset
                if dominated:
                    continue
                kept[label] = True
                chunk = chunk_of[i, key]
                if chunk < 0 or chunk_size[chunk] == CHUNK:
                    if used == chunks:
                        chunks *= 2
                        chunk_next, chunk_size = _longer(chunk_next, chunks), _longer(chunk_size, chunks)
                        c_t, c_q, c_x, c_y = _taller(c_t, chunks), _taller(c_q, chunks), _taller(c_x, chunks), \
                            _taller(c_y, chunks)
                        larger = np.zeros((chunks, CHUNK, words), np.uint64)
                        larger[:used] = c_mask
                        c_mask, c_cut_state = larger, _taller(c_cut_state, chunks)
                        c_least_fuel, c_most_value = _longer(c_least_fuel, chunks), _longer(c_most_value, chunks)
                    chunk = used
                    used += 1
                    chunk_next[chunk], chunk_of[i, key], chunk_size[chunk] = chunk_of[i, key], chunk, 0
                    c_least_fuel[chunk], c_most_value[chunk] = np.inf, -np.inf
                k = chunk_size[chunk]
                chunk_size[chunk] += 1
                c_t[chunk, k], c_q[chunk, k], c_x[chunk, k], c_y[chunk, k] = t[label], q[label], best, worst
                c_least_fuel[chunk] = min(c_least_fuel[chunk], q[label])
                c_most_value[chunk] = max(c_most_value[chunk], best)
                c_cut_state[chunk, k] = cut_state[label]
                for w in range(words):
                    c_mask[chunk, k, w] = mask[label, w]
                # Extension to the next sites.
                for k in range(count[i]):
                    j = following[i, k]
                    if j == base:
                        continue
                    later = t[label] + time[i, j]
                    burnt = q[label] + fuel[i, j]
                    if later > half or burnt > capacity:
                        continue
                    b = bit[j]
                    if b >= 0:
                        if mask[label, b >> 6] >> np.uint64(b & 63) & np.uint64(1):
                            continue
                    else:
                        burnt = 0.0
                    second = y[label]
                    if not discounted:
                        value = x[label] - charge * time[i, j] + reward[j] - dual[j]
                        most = value
                    elif forwards:
                        second *= survival[i, j]
                        value = x[label] + second * reward[j] - dual[j]
                        most = value
                    else:
                        value = reward[j] + survival[i, j] * x[label]
                        second -= dual[j]
                        most = high[j] * value + second
                    ahead = cut_state[label] & in_memory[j]
                    if has_cuts and in_cut[j]:
                        less = sum_of(cut_dual, ahead & in_cut[j])
                        value -= less
                        most -= less
                        ahead = (ahead ^ (in_cut[j] & ~at_first_visit)) & ~(in_cut[j] & at_first_visit)
                    if bounded and most + bound[int((limit - later) / step + 1e-9), j] <= threshold:
                        continue
                    if size == room:
                        if size >= most_labels:
                            overflow = True
                            break
                        room *= 2
                        site, parent, after = _longer(site, room), _longer(parent, room), _longer(after, room)
                        t, q, x, y = _longer(t, room), _longer(q, room), _longer(x, room), _longer(y, room)
                        mask, kept, cut_state = _taller(mask, room), _longer(kept, room), _longer(cut_state, room)
                    for w in range(words):
                        new[w] = mask[label, w] & memory[j, w]
                    if b >= 0:
                        new[b >> 6] |= np.uint64(1) << np.uint64(b & 63)
                    site[size], parent[size], kept[size], cut_state[size] = j, label, False, ahead
                    t[size], q[size], x[size], y[size] = later, burnt, value, second
                    for w in range(words):
                        mask[size, w] = new[w]
                    place = min(int(later / width), BUCKETS)
                    after[size], head[place] = head[place], size
                    size += 1
                if overflow:
                    break
            if overflow:
                break
        if overflow:
            break
    begin = np.zeros(n + 1, np.int64)
    for label in range(size):
        if kept[label]:
            begin[site[label] + 1] += 1
    for i in range(n):
        begin[i + 1] += begin[i]
    undominated = np.flatnonzero(kept[:size])
    worth = x[undominated]
    if discounted:
        for k, label in enumerate(undominated):
            worth[k] = _at_both_ends(forwards, x[label], y[label], low, high[site[label]])[0]
    by_value = undominated[np.argsort(-worth)]
    placed, by_site = begin.copy(), np.zeros(len(undominated), np.int64)
    for label in by_value:
        by_site[placed[site[label]]] = label
        placed[site[label]] += 1
    return site[:size], t[:size], q[:size], x[:size], y[:size], mask[:size], cut_state[:size], parent[:size], \
        (begin, by_site), overflow


@njit(cache=True)
def _at_both_ends(forwards, x, y, low, high):
    """A label's value at the greatest, and at the least, that its second factor can become at the other end."""
    if forwards:
        return x + high * y, x + low * y
    return high * x + y, low * x + y


@njit(cache=True)
def _keys(bit, compared, time):
    """The POIs by which each site's labels are grouped: the nearest of those compared, shape (n, KEYS)."""
    n = len(bit)
    keys, taken = np.full((n, KEYS), -1, np.int64), np.zeros(n, np.bool_)
    for i in range(n):
        taken[:] = False
        for found in range(KEYS):
            best, least = -1, np.inf
            for j in range(n):
                b = bit[j]
                if b < 0 or j == i or taken[j] or not compared[i, b >> 6] >> np.uint64(b & 63) & np.uint64(1):
                    continue
                far = time[j, i] if time[j, i] > 0 else 1e300  # 0 marks a leg outside the graph
                if far < least:
                    best, least = j, far
            if best < 0:
                break
            keys[i, found] = bit[best]
            taken[best] = True
    return keys


@njit(cache=True)
def sum_of(cut_dual, which):
    """Sum of the duals of a set of cuts, given as bits."""
    total, k = 0.0, 0
    while which:
        if which & np.uint64(1):
            total += cut_dual[k]
        which >>= np.uint64(1)
        k += 1
    return total


@njit(cache=True)
def _longer(array, size):
    larger = np.zeros(size, array.dtype)
    larger[:len(array)] = array
    return larger


@njit(cache=True)
def _taller(array, size):
    larger = np.zeros((size, array.shape[1]), array.dtype)
    larger[:len(array)] = array
    return larger


@njit(cache=True)
def join_labels(legs, time, fuel, charge, base, half, capacity, limit, threshold, discounted, survival, high, home,
                at_first_visit, cut_dual, stop, left_s, t, q, x, y, mask, cut_state, of_site, t_b, q_b, x_b, y_b,
                mask_b, cut_state_b, of_site_b):
    """For each forward label the backward label that completes it to the best route above the threshold.

    Long because compiled: nested loops over arrays that each part would need.

    Returns:
        Value, forward label, and backward label or -1 for a leg straight to the base; of each route found. Then whether
        time ran out, and there may be more.
    """
    begin, by_site = of_site
    begin_b, by_site_b = of_site_b
    n, words = len(legs), mask.shape[1]
    number = len(by_site)
    value, left, right = np.zeros(number), np.zeros(number, np.int64), np.full(number, -1, np.int64)
    found, steps, end_s = 0, POLL_STEPS, now_s() + left_s
    for i in range(n):
        for k in range(begin[i], begin[i + 1]):
            # By pairs, not by labels: a label has up to as many partners as there are labels.
            if steps >= POLL_STEPS:
                if poll(stop) or now_s() > end_s:
                    return value[:found], left[:found], right[:found], True
                steps = 0
            steps += n
            label = by_site[k]
            best, partner = threshold, -2
            if legs[i, base] and t[label] + time[i, base] <= limit and q[label] + fuel[i, base] <= capacity:
                total = x[label] - charge * time[i, base]
                if discounted:
                    total += y[label] * survival[i, base] * home
                if total > best:
                    best, partner = total, -1
            for j in range(n):
                if j == base or not legs[i, j] or t[label] + time[i, j] <= half:
                    continue
                most_time = limit - t[label] - time[i, j]
                most_fuel = capacity - q[label] - fuel[i, j]
                if most_fuel < 0 or most_time < 0:
                    continue
                so_far = x[label] - charge * time[i, j]
                # Cuts that count the first visit alone: both labels may have subtracted the dual.
                refund = sum_of(cut_dual, at_first_visit & ~cut_state[label])
                chance = y[label] * survival[i, j]
                for k_b in range(begin_b[j], begin_b[j + 1]):
                    steps += 1
                    other = by_site_b[k_b]
                    most = x_b[other]
                    if discounted:
                        most = high[j] * most + y_b[other]
                    if so_far + most + refund <= best:
                        break
                    if t_b[other] > most_time or q_b[other] > most_fuel:
                        continue
                    total = so_far + x_b[other]
                    if discounted:
                        total = so_far + chance * x_b[other] + y_b[other]
                    elif len(cut_dual) > 0:
                        total += sum_of(cut_dual, at_first_visit & ~cut_state[label] & ~cut_state_b[other]) \
                            - sum_of(cut_dual, ~at_first_visit & cut_state[label] & cut_state_b[other])
                    if total <= best:
                        continue
                    disjoint = True
                    for w in range(words):
                        if mask[label, w] & mask_b[other, w]:
                            disjoint = False
                            break
                    if disjoint:
                        best, partner = total, other
            if partner > -2:
                value[found], left[found], right[found] = best, label, partner
                found += 1
    return value[:found], left[:found], right[:found], False
