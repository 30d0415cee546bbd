"""Pricing: the routes of greatest reduced value. ``labelling.py`` has the labels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.solver.columns.graph import Graph
from sva_bench.solver.columns.labelling import completion, grow, join
from sva_bench.solver.columns.subset_row import CutDuals
from sva_bench.solver.polling import stop_flag

STEPS = 500  # of time, for completion bounds
MOST_STEPS = 4000


@dataclass(frozen=True, eq=False, kw_only=True)
class Priced:
    """What a pricing run found.

    Attributes:
        routes: Sites of the best routes, base to base, best first; they may visit a POI again that they forgot.
        best: Reduced value of the first; the threshold if there is none.
        complete: Whether ``best`` is an upper bound on every route's reduced value: labels did not overflow, and the
            run was exact.
        labels: Labels kept.
    """

    routes: tuple[tuple[int, ...], ...]
    best: float
    complete: bool
    labels: int


def price(
    graph: Graph, reward: FloatArray, dual: FloatArray, charge: float, memory: NDArray[np.uint64], *, threshold: float,
    exact: bool, most_routes: int, most_labels: int, cut_duals: CutDuals, left_s: float = math.inf,
) -> Priced:
    """The routes of greatest reduced value.

    Args:
        graph: What the vehicle may drive.
        reward: Reward of each site, shape (n,); ``-inf`` = not to be visited.
        dual: Dual of each site's visit, shape (n,).
        charge: Cost of a second of driving and stopping.
        memory: ng-sets: which POIs each site remembers, bit by bit, shape (n, words).
        threshold: Routes worth no more are of no interest.
        exact: Whether to find the best ng-route; else elementary routes, quickly, some of them good.
        most_routes: How many to return.
        most_labels: Labels from one end after which an exact run gives up its proof.
        cut_duals: Duals of the cuts; none where rewards are discounted.
        left_s: Time after which labels stop growing, which then prove nothing [s].
    """
    if len(cut_duals.dual) and graph.survival < 1.0:
        raise ValueError("discounted labels can't account for the duals of cuts")
    local = local_of(graph, reward, dual, cut_duals)
    legs, time, fuel, base, half = local.legs, local.time_s, local.fuel_s, local.base, graph.limit_s / 2
    memory = memory[local.sites] if exact else np.full((len(legs), local.words), np.uint64(0xFFFFFFFFFFFFFFFF))
    none = np.zeros((0, len(legs)))
    step, ahead_bound, behind_bound = bounds_of(graph, local, charge) if exact else (1.0, none, none)
    following, count = _adjacent(legs)
    stop = stop_flag()
    ahead = behind = grow(
        following, count, time, fuel, local.bit, memory, local.reward, local.dual, charge, graph.survival, base, half,
        graph.capacity_s, graph.limit_s, ahead_bound, step, threshold, exact, True, most_labels, local.touch,
        local.recall, cut_duals.once, cut_duals.dual, stop, left_s)
    if not graph.symmetric:
        following, count = _adjacent(legs.T)
        behind = grow(
            following, count, time.T.copy(), fuel.T.copy(), local.bit, memory, local.reward, local.dual, charge,
            graph.survival, base, half, graph.capacity_s, graph.limit_s, behind_bound, step, threshold, exact,
            graph.survival == 1.0, most_labels, local.touch, local.recall, cut_duals.once, cut_duals.dual, stop, left_s)
    value, left, right = join(
        legs, time, fuel, charge, base, half, graph.capacity_s, graph.limit_s, threshold, graph.survival < 1.0,
        cut_duals.once, cut_duals.dual, stop, *ahead[1:7], ahead[8], *behind[1:7], behind[8])
    order = np.argsort(-value, kind="stable")[:most_routes]
    routes = []
    for k in order:
        first, second = _chain(ahead, int(left[k])), _chain(behind, int(right[k])) if right[k] >= 0 else []
        routes.append(tuple(local.sites[[*first[::-1], *(second or [base])]].tolist()))
    return Priced(routes=tuple(dict.fromkeys(routes)), best=float(value[order[0]]) if len(order) else threshold,
                  complete=exact and not ahead[9] and not behind[9], labels=len(ahead[0]))


@dataclass(frozen=True, eq=False, kw_only=True)
class Local:
    """The part of a graph that pricing needs, its sites numbered anew.

    Attributes:
        sites: Their own numbers, shape (k,).
        base: The base.
        bit: Number of each POI, -1 for base and stations, shape (k,).
        words: Words of 64 POIs that a set takes.
        legs: Whether a leg is of use, shape (k, k).
        time_s: Time of a leg [s], shape (k, k).
        fuel_s: Fuel of a leg [s], shape (k, k).
        reward: Reward of each site, shape (k,).
        dual: Dual of each site's visit, shape (k,).
        touch: Cuts of which a site is a POI, shape (k,), uint64.
        recall: Cuts in whose memory a site is, shape (k,), uint64.
    """

    sites: IntArray
    base: int
    bit: IntArray
    words: int
    legs: BoolArray
    time_s: FloatArray
    fuel_s: FloatArray
    reward: FloatArray
    dual: FloatArray
    touch: NDArray[np.uint64]
    recall: NDArray[np.uint64]


def local_of(graph: Graph, reward: FloatArray, dual: FloatArray, cut_duals: CutDuals, *, loss: float = 0.0) -> Local:
    """The part of a graph that is of use at these duals: for the best route, or for those worth less by a loss."""
    usable = np.isfinite(reward)
    if graph.metric and (graph.survival == 1.0 or bool((reward[usable] >= 0).all())):
        # A POI that costs more than it earns is better left out: that makes no route longer and violates no cut.
        usable &= (graph.bit < 0) | (graph.survival * reward > dual - loss)
    sites = np.flatnonzero(usable)
    across = np.ix_(sites, sites)
    return Local(
        sites=sites, base=int(np.searchsorted(sites, graph.base)), bit=graph.bit[sites],
        words=max(1, -(-int(graph.bit.max(initial=0) + 1) // 64)), legs=graph.legs[across],
        time_s=graph.time_s[across], fuel_s=graph.fuel_s[across], reward=reward[sites], dual=dual[sites],
        touch=cut_duals.touch[sites], recall=cut_duals.recall[sites])


def bounds_of(graph: Graph, local: Local, charge: float) -> tuple[float, FloatArray, FloatArray]:
    """A time step, and upper bounds on what a path from a site to the end, or from the start to it, can add.

    The arrays have shape (steps + 1, k), and are empty where legs are too short for steps.
    """
    shortest = float(local.time_s[local.legs].min(initial=np.inf))
    if shortest <= graph.limit_s / MOST_STEPS:  # a leg would take no step, and the bound no end
        return 1.0, np.zeros((0, len(local.sites))), np.zeros((0, len(local.sites)))
    steps = STEPS if math.isinf(shortest) else max(STEPS, int(np.ceil(graph.limit_s / shortest)) + 1)
    step = graph.limit_s / steps
    gain = graph.survival * local.reward - local.dual
    stop = stop_flag()
    ahead = completion(local.legs, local.time_s, gain, charge, local.bit, local.base, step, steps, stop)
    if graph.symmetric:
        return step, ahead, ahead
    return step, ahead, completion(local.legs.T.copy(), local.time_s.T.copy(), gain, charge, local.bit, local.base,
                                   step, steps, stop)


def _adjacent(legs: BoolArray) -> tuple[IntArray, IntArray]:
    """Sites that follow each site, and how many they are."""
    count = legs.sum(axis=1)
    following = np.zeros((len(legs), max(int(count.max(initial=0)), 1)), dtype=np.int64)
    for i, row in enumerate(legs):
        following[i, :count[i]] = np.flatnonzero(row)
    return following, count


def _chain(labels: tuple[Any, ...], number: int) -> list[int]:
    """Sites from a label's own back to the base."""
    site, parent = labels[0], labels[7]
    found = []
    while number >= 0:
        found.append(int(site[number]))
        number = int(parent[number])
    return found
