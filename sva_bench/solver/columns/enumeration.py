"""All routes that could be part of a better plan, once few enough are left: the rest is a set-packing program.

Source:
    Baldacci, Christofides, Mingozzi (2008), "An exact algorithm for the vehicle routing problem based on the set
    partitioning formulation with additional cuts".
"""

from __future__ import annotations

import math

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.solver.columns.graph import Graph
from sva_bench.solver.columns.listing import partial_routes
from sva_bench.solver.columns.pricing import Local, bounds_of, local_of
from sva_bench.solver.columns.subset_row import CutDuals
from sva_bench.solver.polling import stop_flag

MOST_PARTIAL = 400_000  # partial routes of one vehicle


def routes_above(
    graph: Graph, reward: FloatArray, dual: FloatArray, charge: float, cut_duals: CutDuals, *, best: float, loss: float,
    left_s: float = math.inf,
) -> tuple[tuple[int, ...], ...] | None:
    """For each set of POIs the best route over it, if it is nearly the best of all; ``None`` if too many are possible.

    Only for vehicles whose rewards don't depend on the order of visits.

    Args:
        graph: What the vehicle may drive.
        reward: Reward of each site, shape (n,); ``-inf`` = not to be visited.
        dual: Dual of each site's visit, shape (n,).
        charge: Cost of a second of driving and stopping.
        cut_duals: Duals of the cuts; here routes forget nothing.
        best: Reduced value that no route exceeds.
        loss: Routes that fall behind it by so much are of no use.
        left_s: Time after which they count as too many [s].
    """
    local = local_of(graph, reward, dual, cut_duals, loss=loss)
    step, bound, _ = bounds_of(graph, local, charge)
    if not len(bound):
        return None
    everything = np.full_like(local.recall, np.uint64(0xFFFFFFFFFFFFFFFF))
    site, parent, ends, overflow = partial_routes(
        local.legs, local.time_s, local.fuel_s, local.bit, local.words, local.reward - local.dual, charge, local.base,
        graph.capacity_s, graph.limit_s, bound, step, best - loss, MOST_PARTIAL, local.touch, everything,
        cut_duals.once, cut_duals.dual, stop_flag(), left_s)
    if overflow:
        return None
    return tuple(_route(local, site, parent, int(label)) for label in ends)


def _route(local: Local, site: IntArray, parent: IntArray, label: int) -> tuple[int, ...]:
    backwards = [local.base]
    while label >= 0:
        backwards.append(int(site[label]))
        label = int(parent[label])
    return tuple(local.sites[backwards[::-1]].tolist())
