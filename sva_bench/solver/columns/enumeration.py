"""Route enumeration: all routes that a better plan can contain, once few are left; the rest is a set-packing program.

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
from sva_bench.solver.columns.pricing import PricingGraph, bounds_of, pricing_graph
from sva_bench.solver.columns.subset_row import CutDuals
from sva_bench.solver.polling import stop_flag

MOST_PARTIAL = 400_000  # partial routes of one vehicle


def routes_above(
    graph: Graph, reward: FloatArray, dual: FloatArray, charge: float, cut_duals: CutDuals, *, best: float, loss: float,
    left_s: float = math.inf,
) -> tuple[tuple[int, ...], ...] | None:
    """For each set of POIs its best route, if within ``loss`` of the best of all; ``None`` if they are too many.

    Only for vehicles whose rewards don't depend on the order of visits.

    Args:
        graph: The vehicle's graph.
        reward: Reward of each site, shape (n,); ``-inf`` = forbidden.
        dual: Dual of each site's visit, shape (n,).
        charge: Cost of a second of driving and stopping.
        cut_duals: Duals of the cuts, here with full memory.
        best: Upper bound on the reduced value of a route.
        loss: How far below ``best`` a route's reduced value may be.
        left_s: Time limit, after which they count as too many [s].
    """
    subgraph = pricing_graph(graph, reward, dual, cut_duals, loss=loss)
    step, bound, _ = bounds_of(graph, subgraph, charge)
    if not len(bound):
        return None
    everything = np.full_like(subgraph.in_memory, np.uint64(0xFFFFFFFFFFFFFFFF))
    site, parent, ends, overflow = partial_routes(
        subgraph.legs, subgraph.time_s, subgraph.fuel_s, subgraph.bit, subgraph.words, subgraph.reward - subgraph.dual,
        charge, subgraph.base,
        graph.capacity_s, graph.limit_s, bound, step, best - loss, MOST_PARTIAL, subgraph.in_cut, everything,
        cut_duals.at_first_visit, cut_duals.dual, stop_flag(), left_s)
    if overflow:
        return None
    return tuple(_route(subgraph, site, parent, int(label)) for label in ends)


def _route(subgraph: PricingGraph, site: IntArray, parent: IntArray, label: int) -> tuple[int, ...]:
    backwards = [subgraph.base]
    while label >= 0:
        backwards.append(int(site[label]))
        label = int(parent[label])
    return tuple(subgraph.sites[backwards[::-1]].tolist())
