"""A good plan quickly: ruin and recreate from several starts, then the best combination of all routes found; no proof.

Deterministic: it counts iterations, and reads the clock only to stop early.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.interrupts import deferring_ctrl_c
from sva_bench.solver.discounts import Discounts
from sva_bench.solver.polling import stop_flag
from sva_bench.solver.routes.charged_fronts import FRONT
from sva_bench.solver.routes.fronts import LegTables
from sva_bench.solver.routes.local_search import improve_order
from sva_bench.solver.routes.packing import Route, best_packing
from sva_bench.solver.routes.ruin_recreate import rounds as run_rounds
from sva_bench.solver.routes.worth import worth_of

VisitOrders = tuple[tuple[int, ...], ...]
"""POIs of each vehicle, in order of visit."""

STARTS = 4
ROUNDS = 1000  # iterations from each start
_LARGE = 120  # sites beyond which there are fewer iterations, as each takes longer
_POOL = 5000  # routes kept of one start
_CYCLE = 50  # iterations between two restarts, from the best plan or the empty one
_HEAT = 0.03  # loss that is accepted at the start of a cycle, relative to the best value
_POLLS = 4  # times that each start reads the clock
_DETOUR = 0.01  # of the median leg; keeps the ratio finite for a POI that costs no detour


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """The result of the search.

    Attributes:
        orders: The best plan.
        routes: The routes of greatest reduced cost in the set-packing relaxation, each with its vehicle.
    """

    orders: VisitOrders
    routes: tuple[Route, ...]


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
    vehicles, n = weights.shape
    best = start
    routes: dict[Route, None] = {}
    if not vehicles or not (weights > 0).any():
        return Found(orders=best, routes=())
    near, detour = _distances(tables)
    worth = worth_of(tables, weights, discounts)
    ordered = bool(worth.discounted.any())
    rounds = int(ROUNDS * min(1.0, (_LARGE / n) ** 1.5)) + 1
    for number in range(starts):
        if number and stop(worth.of(best)):
            break
        rng = np.random.default_rng((seed, number))
        current, current_length = _as_arrays(start if number == 0 else tuple(() for _ in start), n)
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
                found = _as_orders(incumbent, incumbent_length)
                if worth.of(found) > worth.of(best):
                    best = found
                    offer(best)
            if stop(worth.of(best)):
                break
        routes.update(dict.fromkeys(
            (int(vehicle_class[k]), tuple(pool[k, :length[k]].tolist())) for k in range(size)))
    good: tuple[Route, ...] = ()
    if not stop(worth.of(best)):
        packed, good = best_packing(tables, worth, tuple(routes), best)
        if worth.of(packed) > worth.of(best):
            best = packed
    return Found(orders=best, routes=good)


def _distances(tables: LegTables) -> tuple[IntArray, float]:
    """For each site the others by their time there and back, shape (n, n); and the constant added to detours [s]."""
    both_ways = tables.time_s[0] + tables.time_s[0].T
    legs = both_ways[np.isfinite(both_ways) & (both_ways > 0)] / 2
    detour = _DETOUR * float(np.median(legs)) if len(legs) else _DETOUR
    return np.argsort(both_ways, axis=1, kind="stable"), detour


def shorten(tables: LegTables, orders: VisitOrders) -> VisitOrders:
    """The same visits in orders that are locally optimal in time, under 2-opt and Or-opt moves."""
    n = tables.fuel_s.shape[1]
    array, length = _as_arrays(orders, n)
    spare, sums = np.zeros(n, np.int64), np.zeros((2, n + 2))
    with deferring_ctrl_c():
        for m, k in enumerate(tables.vehicle_class):
            if length[m]:
                improve_order(array[m], length[m], tables.base, tables.fuel_s[k], tables.time_s[k], tables.first[k],
                           tables.last[k], tables.hops, tables.capacity_s[k], tables.limit_s[k], np.zeros(n), False,
                           np.zeros((n, n)), 0.0, 0.0, np.zeros((4, FRONT)), spare, sums, stop_flag())
    return _as_orders(array, length)


def _as_arrays(orders: VisitOrders, n: int) -> tuple[IntArray, IntArray]:
    array, length = np.zeros((len(orders), n), np.int64), np.array([len(order) for order in orders], dtype=np.int64)
    for m, order in enumerate(orders):
        array[m, :len(order)] = order
    return array, length


def _as_orders(array: IntArray, length: IntArray) -> VisitOrders:
    return tuple(tuple(array[m, :length[m]].tolist()) for m in range(len(length)))
