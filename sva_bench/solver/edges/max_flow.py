"""Minimum cuts between the base and each site of an undirected network; compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

_ZERO = 1e-9  # residual capacity that counts as none


@njit(cache=True)
def minimum_cuts(n, ends, capacity, base, demand):
    """Sets that enclose a site with less capacity across than the site demands; compiled.

    For every site of positive demand whose maximum flow from the base falls short of it: the smallest and the largest
    of the sets S with the site, but without the base, across whose border that flow is the capacity.

    Args:
        n: Number of sites.
        ends: Ends of each edge, shape (edges, 2).
        capacity: Capacity of each edge, in either direction, shape (edges,).
        base: The base.
        demand: Least flow that each site demands, shape (n,).

    Returns:
        The sets, shape (sets, n), and the capacity across their borders, shape (sets,).

    Source:
        Edmonds, Karp (1972), "Theoretical improvements in algorithmic efficiency for network flow problems".
    """
    edges = len(capacity)
    first = np.zeros(n + 1, np.int64)  # the arcs out of a site: 2 e from ends[e, 0], 2 e + 1 from ends[e, 1]
    for e in range(edges):
        first[ends[e, 0] + 1] += 1
        first[ends[e, 1] + 1] += 1
    for i in range(n):
        first[i + 1] += first[i]
    arcs, filled = np.zeros(2 * edges, np.int64), first[:-1].copy()
    for e in range(edges):
        for side in range(2):
            i = ends[e, side]
            arcs[filled[i]] = 2 * e + side
            filled[i] += 1
    residual = np.zeros(2 * edges)
    reached, via, queue = np.zeros(n, np.bool_), np.zeros(n, np.int64), np.zeros(n, np.int64)
    sets, across, found = np.zeros((2 * n, n), np.bool_), np.zeros(2 * n), 0
    for site in range(n):
        if demand[site] <= 0.0 or site == base:
            continue
        for e in range(edges):
            residual[2 * e] = residual[2 * e + 1] = capacity[e]
        flow = 0.0
        while flow < demand[site]:
            _reach(base, site, True, first, arcs, ends, residual, reached, via, queue)
            if not reached[site]:
                break
            most, at = np.inf, site
            while at != base:
                most = min(most, residual[via[at]])
                at = ends[via[at] // 2, via[at] % 2]
            at = site
            while at != base:
                residual[via[at]] -= most
                residual[via[at] ^ 1] += most
                at = ends[via[at] // 2, via[at] % 2]
            flow += most
        if flow >= demand[site]:
            continue
        for i in range(n):
            sets[found, i] = not reached[i]  # the largest
        across[found] = flow
        _reach(site, -1, False, first, arcs, ends, residual, reached, via, queue)
        differs = False
        for i in range(n):
            differs |= reached[i] != sets[found, i]
        found += 1
        if differs:
            sets[found], across[found] = reached, flow
            found += 1
    return sets[:found], across[:found]


@njit(cache=True)
def _reach(start, goal, forward, first, arcs, ends, residual, reached, via, queue):
    """Mark the sites that have a path of residual capacity from a site, or to it; stop at a goal."""
    reached[:] = False
    reached[start] = True
    queue[0] = start
    head, tail = 0, 1
    while head < tail:
        i = queue[head]
        head += 1
        for k in range(first[i], first[i + 1]):
            arc = arcs[k]
            j = ends[arc // 2, 1 - arc % 2]
            if not reached[j] and residual[arc if forward else arc ^ 1] > _ZERO:
                reached[j], via[j] = True, arc
                if j == goal:
                    return
                queue[tail] = j
                tail += 1
