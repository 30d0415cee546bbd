"""Pricing: the routes of greatest reduced value, by bidirectional labelling (``labelling.py``)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.solver.columns.graph import Graph
from sva_bench.solver.columns.labelling import completion, extend_labels, join_labels
from sva_bench.solver.columns.subset_row import CutDuals
from sva_bench.solver.polling import stop_flag

STEPS = 500  # of time, for completion bounds
MOST_STEPS = 4000
_MIDDLE = 0.6  # share of the limit up to which labels grow from the start under a discount: from the end, without
# knowing their probability to be reached, more of them stay undominated
_FEW, _NEAREST = 3, 8  # runs that compare so few POIs go from a POI to so many others only
_TYPICAL = 0.3  # share of the greatest worth of the rest, and probability of a site, at which heuristic runs compare


@dataclass(frozen=True, eq=False, kw_only=True)
class Priced:
    """What a pricing run found.

    Attributes:
        routes: Sites of the best routes, base to base, best first; ng-routes, which may visit a POI twice.
        best: Reduced value of the first; the threshold if there is none.
        complete: Whether ``best`` is an upper bound on every route's reduced value: neither labels nor time ran out,
            and the run was exact.
        labels: Labels kept.
    """

    routes: tuple[tuple[int, ...], ...]
    best: float
    complete: bool
    labels: int


def price(
    graph: Graph, reward: FloatArray, dual: FloatArray, charge: float, memory: NDArray[np.uint64], *, threshold: float,
    compared: int | None, most_routes: int, most_labels: int, cut_duals: CutDuals, left_s: float = math.inf,
) -> Priced:
    """The routes of greatest reduced value.

    Args:
        graph: The vehicle's graph.
        reward: Reward of each site, shape (n,); ``-inf`` = forbidden.
        dual: Dual of each site's visit, shape (n,).
        charge: Cost of a second of driving and stopping.
        memory: ng-sets: the POIs that each site remembers, as bits, shape (n, words).
        threshold: Reduced value that a route must exceed.
        compared: How many POIs of each site's ng-set dominance compares, the nearest, and twice as many at stations.
            ``None`` = all, which proves the best ng-route; fewer find good routes sooner, up to 3 over short legs only;
            0 finds some elementary ones.
        most_routes: Most routes to return.
        most_labels: Labels from one end after which an exact run ends without a proof.
        cut_duals: Duals of the cuts; none under a discount.
        left_s: Time limit, after which the run ends without a proof [s].

    Raises:
        ValueError: If there are cuts and a discount.

    Source:
        Righini, Salani (2006), "Symmetry helps: bounded bi-directional dynamic programming".
    """
    end_s = monotonic() + left_s
    plain, cost, home = graph.is_plain, graph.discount.departure, graph.discount.home
    if len(cut_duals.dual) and not plain:
        raise ValueError("discounted labels can't account for the duals of cuts")
    subgraph = pricing_graph(graph, reward, dual, cut_duals)
    legs, time, fuel, base = _legs(subgraph, compared), subgraph.time_s, subgraph.fuel_s, subgraph.base
    half = graph.limit_s * (0.5 if plain else _MIDDLE)
    everything = np.full((len(legs), subgraph.words), np.uint64(0xFFFFFFFFFFFFFFFF))
    quick, exact = compared == 0, compared is None
    memory = everything if quick else memory[subgraph.sites]
    weighed = everything if compared is None else _nearest(subgraph, memory, compared)
    none = np.zeros((0, len(legs)))
    step, ahead_bound, behind_bound = (1.0, none, none) if quick else bounds_of(graph, subgraph, charge)
    following, count = _adjacent(legs)
    stop, survival = stop_flag(), subgraph.survival
    low, high, least, most = _ranges(graph, subgraph, quick=quick)
    ahead = behind = extend_labels(
        following, count, time, fuel, subgraph.bit, memory, weighed, subgraph.reward, subgraph.dual, charge, not plain,
        survival, low, high, 0.0 if plain else -cost, base, half, graph.capacity_s, graph.limit_s,
        ahead_bound, step, threshold, True, most_labels, subgraph.in_cut, subgraph.in_memory,
        cut_duals.at_first_visit, cut_duals.dual, stop, end_s - monotonic())
    if not graph.symmetric:
        following, count = _adjacent(legs.T)
        behind = extend_labels(
            following, count, time.T.copy(), fuel.T.copy(), subgraph.bit, memory, weighed, subgraph.reward,
            subgraph.dual, charge, not plain, survival.T.copy(), least, most, 0.0 if plain else home, base,
            graph.limit_s - half, graph.capacity_s, graph.limit_s, behind_bound, step, threshold, plain, most_labels,
            subgraph.in_cut, subgraph.in_memory, cut_duals.at_first_visit, cut_duals.dual, stop,
            end_s - monotonic())
    value, left, right, cut_short = join_labels(
        legs, time, fuel, charge, base, half, graph.capacity_s, graph.limit_s, threshold, not plain, survival,
        subgraph.arrival, home, cut_duals.at_first_visit, cut_duals.dual, stop, end_s - monotonic(),
        *ahead[1:7], ahead[8], *behind[1:7], behind[8])
    order = np.argsort(-value, kind="stable")[:most_routes]
    routes = [_route(subgraph, _chain(ahead, int(left[k])), _chain(behind, int(right[k]))) for k in order]
    return Priced(routes=tuple(dict.fromkeys(routes)), best=float(value[order[0]]) if len(order) else threshold,
                  complete=exact and not (ahead[9] or behind[9] or cut_short), labels=len(ahead[0]))


@dataclass(frozen=True, eq=False, kw_only=True)
class PricingGraph:
    """The induced subgraph of the sites that a pricing run can use, renumbered.

    Where charging takes time, it is proportional to the fuel burnt since the last refuel, and so to that of each leg.
    Then there is a copy of a POI for each charging time of a second's fuel at the next refuel, and legs lead from copy
    to copy of the same; their time includes their share of charging. So labels from either end know it.

    Attributes:
        sites: Number of each site in the whole graph, shape (k,).
        base: The base.
        bit: Number of each POI, -1 for base and stations, shape (k,).
        words: 64-bit words of a set of POIs.
        legs: Whether a leg is of use, shape (k, k).
        time_s: Time of a leg, with its share of charging [s], shape (k, k).
        fuel_s: Fuel of a leg [s], shape (k, k).
        survival: Probability to survive a leg, shape (k, k).
        arrival: Greatest probability to get to a site, shape (k,).
        reward: Reward of each site, shape (k,).
        dual: Dual of each site's visit, shape (k,).
        in_cut: Cuts of which a site is a member, as bits, shape (k,).
        in_memory: Cuts in whose memory a site is, as bits, shape (k,).
    """

    sites: IntArray
    base: int
    bit: IntArray
    words: int
    legs: BoolArray
    time_s: FloatArray
    fuel_s: FloatArray
    survival: FloatArray
    arrival: FloatArray
    reward: FloatArray
    dual: FloatArray
    in_cut: NDArray[np.uint64]
    in_memory: NDArray[np.uint64]


def pricing_graph(
    graph: Graph, reward: FloatArray, dual: FloatArray, cut_duals: CutDuals, *, loss: float = 0.0,
) -> PricingGraph:
    """The sites that the best route at these duals can visit, or a route of up to ``loss`` less reduced value."""
    usable = np.isfinite(reward)
    if graph.metric:
        # Under the triangle inequality, dropping a POI whose dual exceeds its reward improves any route. It shortens
        # the drive, so under a discount, where no reward is negative, the others are worth as much or more.
        usable &= (graph.bit < 0) | (graph.arrival * np.where(usable, reward, 0.0) > dual - loss)
    sites = np.flatnonzero(usable)
    across = np.ix_(sites, sites)
    legs, time = graph.legs[across], graph.time_s[across]
    if graph.charging[sites].any():
        sites, charging = _copies(graph, sites)
        across = np.ix_(sites, sites)
        refuels = graph.bit[sites] < 0
        legs = graph.legs[across] & (refuels[:, None] | (charging[:, None] == charging[None, :]))
        time = np.where(legs, graph.time_s[across] + graph.fuel_s[across] * charging[None, :], 0.0)
    return PricingGraph(
        sites=sites, base=int(np.flatnonzero(sites == graph.base)[0]), bit=graph.bit[sites],
        words=max(1, -(-int(graph.bit.max(initial=0) + 1) // 64)), legs=legs,
        time_s=time, fuel_s=graph.fuel_s[across], survival=graph.survival[across],
        arrival=graph.arrival[sites], reward=reward[sites], dual=dual[sites],
        in_cut=cut_duals.in_cut[sites], in_memory=cut_duals.in_memory[sites])


def _copies(graph: Graph, sites: IntArray) -> tuple[IntArray, FloatArray]:
    """A copy of each POI for each charging time of a second's fuel, and the refuels: their sites, and charging times.

    Arrays have shape (k,).
    """
    refuels, pois = sites[graph.bit[sites] < 0], sites[graph.bit[sites] >= 0]
    each = np.unique(graph.charging[refuels])
    return (np.concatenate([refuels, np.tile(pois, len(each))]),
            np.concatenate([graph.charging[refuels], np.repeat(each, len(pois))]))


def bounds_of(graph: Graph, subgraph: PricingGraph, charge: float) -> tuple[float, FloatArray, FloatArray]:
    """A time step [s], and completion bounds: upper bounds on what the rest of a route, or its beginning, can add.

    The arrays have shape (steps + 1, k), and are empty where a leg is shorter than a step.
    """
    shortest = float(subgraph.time_s[subgraph.legs].min(initial=np.inf))
    if shortest <= graph.limit_s / MOST_STEPS:  # a leg of 0 steps would make the recursion unbounded
        return 1.0, np.zeros((0, len(subgraph.sites))), np.zeros((0, len(subgraph.sites)))
    steps = STEPS if math.isinf(shortest) else max(STEPS, int(np.ceil(graph.limit_s / shortest)) + 1)
    step = graph.limit_s / steps
    ahead_gain = behind_gain = (subgraph.reward - subgraph.dual)[None, :]
    if not graph.is_plain:
        ahead_gain, behind_gain = _discounted_gains(graph, subgraph, step * np.arange(1.0, steps + 2))
    stop = stop_flag()
    ahead = completion(subgraph.legs, subgraph.time_s, ahead_gain, charge, subgraph.bit, subgraph.base, step, steps,
                       stop)
    if graph.symmetric:
        return step, ahead, ahead
    return step, ahead, completion(subgraph.legs.T.copy(), subgraph.time_s.T.copy(), behind_gain, charge, subgraph.bit,
                                   subgraph.base, step, steps, stop)


def _discounted_gains(graph: Graph, subgraph: PricingGraph, left_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Upper bounds on what a visit adds to the rest of a route, shape (steps + 1, k), and to its beginning, (1, k).

    A vehicle reaches a site with no greater probability than by the safest way there, and with none greater than that
    to have driven all the time before what is left of its mission.

    Args:
        graph: The vehicle's graph.
        subgraph: The sites that can be visited.
        left_s: Upper bound on the time left after a visit, by time steps left [s], shape (steps + 1,).
    """
    driven_s = graph.driving * np.maximum(graph.limit_s - left_s, 0.0)
    rate = 0.0 if graph.discount.is_hopeless else graph.discount.rate
    chance = np.minimum(np.exp(-rate * driven_s)[:, None], subgraph.arrival[None, :])
    reward, base = subgraph.reward.copy(), subgraph.base
    reward[base] = graph.discount.home
    behind = subgraph.arrival * reward - subgraph.dual
    behind[base] = -graph.discount.departure
    return chance * reward - subgraph.dual, behind[None, :]


def _ranges(graph: Graph, subgraph: PricingGraph, *, quick: bool) -> tuple[float, FloatArray, float, FloatArray]:
    """Over which a label dominates: of what the rest of a route is worth if it is reached, and of the probability to.

    Least and greatest of both, the greatest by site, shape (k,); a quick run takes one value of each.
    """
    home, sites = graph.discount.home, len(subgraph.sites)
    if quick:
        typical = _TYPICAL * (home + float(subgraph.reward.sum()))
        return typical, np.full(sites, typical), _TYPICAL, np.full(sites, _TYPICAL)
    high = home + graph.most_visits * float(subgraph.reward.max(initial=0.0))
    return home * graph.least_survival, np.full(sites, high), graph.least_survival, subgraph.arrival


def _nearest(subgraph: PricingGraph, memory: NDArray[np.uint64], most: int) -> NDArray[np.uint64]:
    """The POIs nearest to each site of those that it remembers, as bits, shape (k, words)."""
    found = np.zeros_like(memory)
    for i, order in enumerate(np.argsort(_apart(subgraph), axis=1, kind="stable") if most else ()):
        near = [b for b in subgraph.bit[order] if b >= 0 and memory[i, b >> 6] >> np.uint64(b & 63) & np.uint64(1)]
        for b in near[:most if subgraph.bit[i] >= 0 else 2 * most]:
            found[i, b >> 6] |= np.uint64(1) << np.uint64(b & 63)
    return found


def _apart(subgraph: PricingGraph) -> FloatArray:
    """Time between sites, the shorter way, by legs that are of use [s], shape (k, k)."""
    far = np.where(subgraph.legs, subgraph.time_s, np.inf)
    return np.minimum(far, far.T)


def _legs(subgraph: PricingGraph, compared: int | None) -> BoolArray:
    """The legs that a run takes, shape (k, k): a quick one from a POI to its nearest only, and to other sites."""
    if compared is None or compared > _FEW:
        return subgraph.legs
    refuels = subgraph.bit < 0
    far = _apart(subgraph)
    far[:, refuels] = np.inf
    near = np.argsort(np.argsort(far, axis=1, kind="stable"), axis=1, kind="stable") < _NEAREST
    found: BoolArray = subgraph.legs & (near | near.T | refuels[:, None] | refuels[None, :])
    return found


def _adjacent(legs: BoolArray) -> tuple[IntArray, IntArray]:
    """Successors of each site, shape (k, most), and their number, shape (k,)."""
    count = legs.sum(axis=1)
    following = np.zeros((len(legs), max(int(count.max(initial=0)), 1)), dtype=np.int64)
    for i, row in enumerate(legs):
        following[i, :count[i]] = np.flatnonzero(row)
    return following, count


def _chain(labels: tuple[Any, ...], number: int) -> list[int]:
    """Sites of a label's partial route, from its own back to the base."""
    site, parent = labels[0], labels[7]
    found = []
    while number >= 0:
        found.append(int(site[number]))
        number = int(parent[number])
    return found


def _route(subgraph: PricingGraph, ahead: list[int], behind: list[int]) -> tuple[int, ...]:
    """Sites of the whole route that two chains make; without the second, the first goes back to the base at once."""
    return tuple(subgraph.sites[[*ahead[::-1], *(behind or [subgraph.base])]].tolist())
