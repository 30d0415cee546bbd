"""A good plan quickly: a search from several starts, then the best combination of all routes found; no proof.

Over many visits on long routes, where fuel can't bind, the search anneals; else it ruins and recreates.

Deterministic: it counts iterations, and reads the clock only to stop early.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.interrupts import deferring_ctrl_c
from sva_bench.solver.discounts import Discounts
from sva_bench.solver.polling import stop_flag
from sva_bench.solver.routes.charged_fronts import FRONT
from sva_bench.solver.routes.fronts import LegTables
from sva_bench.solver.routes.local_search import improve_order
from sva_bench.solver.routes.long_routes import guided, search_long, serves
from sva_bench.solver.routes.packing import Route, best_packing
from sva_bench.solver.routes.plans import Found, VisitOrders, as_arrays, as_orders
from sva_bench.solver.routes.ruin_recreate import rounds as run_rounds
from sva_bench.solver.routes.worth import Worth, worth_of

__all__ = ["STARTS", "Found", "VisitOrders", "guided", "search", "shorten"]

STARTS = 4
ROUNDS = 1000  # iterations from each start
_LARGE = 120  # sites beyond which there are fewer iterations, as each takes longer
_POOL = 5000  # routes kept of one start
_CYCLE = 50  # iterations between two restarts, from the best plan or the empty one
_HEAT = 0.03  # loss that is accepted at the start of a cycle, relative to the best value
_PAIRS = 150  # POIs times vehicles beyond which the search anneals
_LONG = 2.0  # mission limit, in longest legs, from which it does
_LONG_STARTS = 1.5  # so many times as many starts, and crossings of their plans: these take long to prove
_POLLS = 4  # times that each start reads the clock
_DETOUR = 0.01  # of the median leg; keeps the ratio finite for a POI that costs no detour


def search(
    tables: LegTables, weights: FloatArray, discounts: Discounts | None, start: VisitOrders, *, seed: int = 0,
    starts: int = STARTS, stop: Callable[[float], bool] = lambda value: False,  # noqa: ARG005
    offer: Callable[[VisitOrders], None] = lambda orders: None,  # noqa: ARG005
) -> Found:
    """A plan worth at least as much as the one it starts from.

    Args:
        tables: The legs of all vehicle classes.
        weights: Reward of a visit by vehicle m to site j, shape (M, n), not negative.
        discounts: Discounts of the rewards; ``None`` = the order of visits is indifferent.
        start: A feasible plan.
        seed: Seed of the random choices.
        starts: Number of starts: the first from the given plan, the others from the empty one.
        stop: Whether to stop, given the best value so far.
        offer: Takes every better plan as it is found, since Ctrl-C ends the search.
    """
    if not len(weights) or not (weights > 0).any():
        return Found(orders=start, routes=())
    worth = worth_of(tables, weights, discounts)
    if _anneals(tables, worth):
        best, routes = search_long(tables, weights, start, seed=seed, starts=round(_LONG_STARTS * starts), stop=stop,
                                   offer=offer)
    else:
        best, routes = _ruin_and_recreate(tables, worth, start, seed, starts, stop, offer)
    good: tuple[Route, ...] = ()
    if not stop(worth.of(best)):
        packed, good = best_packing(tables, worth, routes, best)
        if worth.of(packed) > worth.of(best):
            best = packed
    return Found(orders=best, routes=good)


def _anneals(tables: LegTables, worth: Worth) -> bool:
    """Whether annealing is the better search, by measurement: over many visits on long routes where fuel can't bind.

    With few it is no better than ruin and recreate; and short routes are proved by columns, for which more of them are
    worth more than a better plan.
    """
    pairs = int((worth.weights > 0).any(axis=0).sum()) * len(worth.weights)
    longest = float(tables.time_s[np.isfinite(tables.time_s)].max())
    return (pairs > _PAIRS and bool(tables.limit_s.min() >= _LONG * longest) and serves(tables)
            and not worth.discounted.any())


def _ruin_and_recreate(
    tables: LegTables, worth: Worth, start: VisitOrders, seed: int, starts: int, stop: Callable[[float], bool],
    offer: Callable[[VisitOrders], None],
) -> tuple[VisitOrders, tuple[Route, ...]]:
    """A plan by ruin and recreate, for any instance, and the routes met, each with its vehicle class."""
    n, weights, best = worth.weights.shape[1], worth.weights, start
    routes: dict[Route, None] = {}
    near, detour = _distances(tables)
    ordered = bool(worth.discounted.any())
    rounds = int(ROUNDS * min(1.0, (_LARGE / n) ** 1.5)) + 1
    for number in range(starts):
        if number and stop(worth.of(best)):
            break
        rng = np.random.default_rng((seed, number))
        current, current_length = as_arrays(start if number == 0 else tuple(() for _ in start), n)
        incumbent, incumbent_length = current.copy(), current_length.copy()
        pool = np.zeros((_POOL, n), np.int16)
        length, vehicle_class = np.zeros(_POOL, np.int64), np.zeros(_POOL, np.int64)
        table, keys = np.full(2 * _POOL + 1, -1, np.int64), rng.integers(0, 2**63, n, dtype=np.uint64)
        size = 0
        polls = (0, *range(1, rounds, -(-rounds // _POLLS)), rounds)  # the first plan is offered after one iteration
        for done, until in itertools.pairwise(polls):
            with deferring_ctrl_c():
                size = run_rounds(
                    rng, until - done, done, _CYCLE, _HEAT, tables.vehicle_class, tables.base, tables.fuel_s,
                    tables.time_s, tables.quickest_s, tables.first, tables.last, tables.hops, tables.capacity_s,
                    tables.limit_s, near, weights, worth.discounted, worth.survival, worth.departure, worth.home,
                    detour, current, current_length, incumbent, incumbent_length, pool, length, vehicle_class, size,
                    table, keys, ordered, stop_flag())
                found = as_orders(incumbent, incumbent_length)
                if worth.of(found) > worth.of(best):
                    best = found
                    offer(best)
            if stop(worth.of(best)):
                break
        routes.update(dict.fromkeys(
            (int(vehicle_class[k]), tuple(pool[k, :length[k]].tolist())) for k in range(size)))
    return best, tuple(routes)


def _distances(tables: LegTables) -> tuple[IntArray, float]:
    """For each site the others by their time there and back, shape (n, n); and the constant added to detours [s]."""
    both_ways = tables.time_s[0] + tables.time_s[0].T
    legs = both_ways[np.isfinite(both_ways) & (both_ways > 0)] / 2
    detour = _DETOUR * float(np.median(legs)) if len(legs) else _DETOUR
    return np.argsort(both_ways, axis=1, kind="stable"), detour


def shorten(tables: LegTables, orders: VisitOrders) -> VisitOrders:
    """The same visits in orders that are locally optimal in time, under 2-opt and Or-opt moves."""
    n = tables.fuel_s.shape[1]
    array, length = as_arrays(orders, n)
    spare, sums = np.zeros(n, np.int64), np.zeros((2, n + 2))
    with deferring_ctrl_c():
        for m, k in enumerate(tables.vehicle_class):
            if length[m]:
                improve_order(array[m], length[m], tables.base, tables.fuel_s[k], tables.time_s[k], tables.first[k],
                           tables.last[k], tables.hops, tables.capacity_s[k], tables.limit_s[k], np.zeros(n), False,
                           np.zeros((n, n)), 0.0, 0.0, np.zeros((4, FRONT)), spare, sums, stop_flag())
    return as_orders(array, length)
