"""Pricing: the routes of greatest reduced value. ``labelling.py`` has the labels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.solver.graph import Graph
from sva_bench.solver.labelling import completion, grow, join

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
    exact: bool, most_routes: int, most_labels: int,
) -> Priced:
    """The routes of greatest reduced value.

    Args:
        graph: What the vehicle may drive.
        reward: Reward of each site, shape (n,); ``-inf`` = not to be visited.
        dual: Price of each site's visit, shape (n,).
        charge: Price of a second of driving and stopping.
        memory: ng-sets: which POIs each site remembers, bit by bit, shape (n, words).
        threshold: Routes worth no more are of no interest.
        exact: Whether to find the best ng-route; else elementary routes, quickly, some of them good.
        most_routes: How many to return.
        most_labels: Labels from one end after which an exact run gives up its proof.
    """
    usable = np.isfinite(reward)
    legs = graph.legs & usable[:, None] & usable[None, :]
    reward = np.where(usable, reward, 0.0)
    n = len(reward)
    half = graph.limit_s / 2
    if not exact:
        memory = np.full_like(memory, np.uint64(0xFFFFFFFFFFFFFFFF))
    bound_ahead = bound_behind = np.zeros((0, n))
    step = 1.0
    shortest = float(graph.time_s[legs].min(initial=np.inf)) if exact else 0.0
    if shortest > graph.limit_s / MOST_STEPS:  # else a leg would take no step, and the bound no end
        steps = max(STEPS, int(np.ceil(graph.limit_s / shortest)) + 1)
        step = graph.limit_s / steps
        gain = graph.survival * reward - dual
        bound_ahead = completion(legs, graph.time_s, gain, charge, graph.bit, graph.base, step, steps)
        bound_behind = bound_ahead if graph.symmetric else completion(
            legs.T.copy(), graph.time_s.T.copy(), gain, charge, graph.bit, graph.base, step, steps)
    following, count = _adjacent(legs)
    ahead = behind = grow(
        following, count, graph.time_s, graph.fuel_s, graph.bit, memory, reward, dual, charge, graph.survival,
        graph.base, half, graph.capacity_s, graph.limit_s, bound_ahead, step, threshold, exact, True, most_labels)
    if not graph.symmetric:
        following, count = _adjacent(legs.T)
        behind = grow(
            following, count, graph.time_s.T.copy(), graph.fuel_s.T.copy(), graph.bit, memory, reward, dual, charge,
            graph.survival, graph.base, half, graph.capacity_s, graph.limit_s, bound_behind, step, threshold, exact,
            graph.survival == 1.0, most_labels)
    value, left, right = join(
        legs, graph.time_s, graph.fuel_s, charge, graph.base, half, graph.capacity_s, graph.limit_s, threshold,
        graph.survival < 1.0, *ahead[1:6], ahead[7], *behind[1:6], behind[7])
    order = np.argsort(-value, kind="stable")[:most_routes]
    routes = []
    for k in order:
        first, second = _chain(ahead, int(left[k])), _chain(behind, int(right[k])) if right[k] >= 0 else []
        routes.append((*first[::-1], *(second or [graph.base])))
    return Priced(routes=tuple(dict.fromkeys(routes)), best=float(value[order[0]]) if len(order) else threshold,
                  complete=exact and not ahead[8] and not behind[8], labels=len(ahead[0]))


def _adjacent(legs: BoolArray) -> tuple[IntArray, IntArray]:
    """Sites that follow each site, and how many they are."""
    count = legs.sum(axis=1)
    following = np.zeros((len(legs), max(int(count.max(initial=0)), 1)), dtype=np.int64)
    for i, row in enumerate(legs):
        following[i, :count[i]] = np.flatnonzero(row)
    return following, count


def _chain(labels: tuple[Any, ...], number: int) -> list[int]:
    """Sites from a label's own back to the base."""
    site, parent = labels[0], labels[6]
    found = []
    while number >= 0:
        found.append(int(site[number]))
        number = int(parent[number])
    return found
