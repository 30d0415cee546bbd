"""A good plan quickly where fuel can't bind: annealing from several starts, then near what their plans share; no proof.

Deterministic: it counts rounds, and reads the clock only to stop early.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.interrupts import deferring_ctrl_c
from sva_bench.solver.polling import stop_flag
from sva_bench.solver.routes.annealing import POWERS, anneal
from sva_bench.solver.routes.fronts import LegTables
from sva_bench.solver.routes.packing import Route
from sva_bench.solver.routes.plans import VisitOrders, as_arrays, as_orders

ROUNDS = 2_500
"""Rounds of a start, and of each part of a crossing."""
CROSSINGS = 3
"""Crossings for each start."""
GUIDED_ROUNDS = 5_000
"""Rounds over the allowed pairs, and as many over all."""

_FEW = 60  # sites below which there are fewer rounds
_HOT, _COLD = 0.02, 0.0005  # loss that is accepted at first and in the end, relative to a typical value
_TYPICAL = 0.7  # value of a plan, relative to that of all visits
_AGAIN = 1 / 3  # of the heat, where a plan is improved
_ELITE = 4  # plans that are crossed, the best with different visits ...
_PARENTS = 3  # ... so many of them at a time
_PRICE = 0.05  # what a second of a route costs, in mean rewards of a second
_DETOUR = 0.006  # of the median leg; keeps the ratio finite for a POI that costs no detour
_POOL = 20_000  # routes kept
_POLLS = 4  # times that each start reads the clock
_ROUNDING = 1e-12  # relative; what sums of legs in another order differ by
_ROUNDING_S = 1e-9


def serves(tables: LegTables) -> bool:
    """Whether fuel can't bind for any vehicle: then the clock is a sum over legs, which the search requires."""
    return bool(np.isinf(tables.capacity_s).all())


@dataclass(frozen=True, eq=False, kw_only=True)
class Tours:
    """The sites where visits are rewarded, and the legs between them, as arrays for compiled code.

    Attributes:
        sites: Their numbers in the instance, the base first, shape (n,).
        vehicle_class: Class of each vehicle, shape (M,).
        time_s: Time of a leg and of the stop at its end, or half of the stops at both [s], shape (classes, n, n).
        into_s: The transposes, shape (classes, n, n).
        symmetric: Whether times are the same both ways.
        limit_s: Mission limit, half the feasibility tolerance included [s], shape (classes,).
        near: For each site the POIs by their time there and back, shape (n, n - 1).
        weights: Reward of a visit by vehicle m to site j, shape (M, n).
        powers: Its ``POWERS``, shape (powers, M, n).
        value: A typical plan's value.
        price: What a second of a route costs.
        detour_s: Added to each detour [s].
    """

    sites: IntArray
    vehicle_class: IntArray
    time_s: FloatArray
    into_s: FloatArray
    symmetric: bool
    limit_s: FloatArray
    near: IntArray
    weights: FloatArray
    powers: FloatArray
    value: float
    price: float
    detour_s: float


def tours_of(tables: LegTables, weights: FloatArray) -> Tours:
    """The tours over an instance's POIs.

    Args:
        tables: The legs of all vehicle classes.
        weights: Reward of a visit by vehicle m to site j, shape (M, n).

    Raises:
        ValueError: If fuel can bind, or a weight is NaN.
    """
    if not serves(tables):
        raise ValueError("the search over long routes needs tanks that last for the whole mission")
    if np.isnan(weights).any():
        raise ValueError("a weight is NaN")
    rewarded: BoolArray = np.any(weights > 0, axis=0)
    rewarded[tables.base] = False
    sites = np.array([tables.base, *np.flatnonzero(rewarded)], dtype=np.int64)
    time, symmetric = _both_ways(tables.time_s[:, sites[:, None], sites[None, :]])
    own = np.maximum(weights[:, sites], 0.0)
    own[:, 0] = 0.0
    both_ways = time[0] + time[0].T
    legs = both_ways[np.isfinite(both_ways) & (both_ways > 0)] / 2
    limits = tables.limit_s[tables.vehicle_class]
    value = _TYPICAL * float(own.max(axis=0).sum())
    return Tours(
        sites=sites, vehicle_class=tables.vehicle_class, time_s=time, into_s=time.transpose(0, 2, 1).copy(),
        symmetric=symmetric, limit_s=tables.limit_s - _ROUNDING_S - _ROUNDING * np.where(
            np.isfinite(tables.limit_s), tables.limit_s, 0.0),
        near=np.argsort(both_ways[:, 1:], axis=1, kind="stable") + 1, weights=own,
        powers=np.array([own**power for power in POWERS]), value=value,
        price=_PRICE * value / float(limits.sum()), detour_s=_DETOUR * float(np.median(legs)) if len(legs) else _DETOUR)


def _both_ways(time: FloatArray) -> tuple[FloatArray, bool]:
    """Times of legs with half of the stops at both ends, if these are the same both ways for all classes; and whether.

    A route takes as long by them as by times with the stop at the end of each leg.
    """
    stop = np.where(np.isfinite(time[:, 0]) & np.isfinite(time[:, :, 0]), time[:, 0], 0.0) \
        - np.where(np.isfinite(time[:, 0]) & np.isfinite(time[:, :, 0]), time[:, :, 0], 0.0)
    halves = time + (stop[:, :, None] - stop[:, None, :]) / 2
    back = halves.transpose(0, 2, 1)
    if np.allclose(halves, back, rtol=_ROUNDING, atol=_ROUNDING_S / 10) and bool((halves >= 0).all()):
        return (halves + back) / 2, True
    return np.ascontiguousarray(time), False


def search_long(
    tables: LegTables, weights: FloatArray, start: VisitOrders, *, seed: int, starts: int,
    stop: Callable[[float], bool] = lambda value: False,  # noqa: ARG005
    offer: Callable[[VisitOrders], None] = lambda orders: None,  # noqa: ARG005
) -> tuple[VisitOrders, tuple[Route, ...]]:
    """A plan worth at least as much as the one it starts from, and routes of good plans, each with its vehicle class.

    After short starts it crosses the best plans: it anneals over the pairs of vehicle and POI of some of them, then
    over all pairs from there. Which vehicle serves which area decides the value of large plans; annealing alone keeps
    the areas of its first rounds, and crossing chooses among those of several starts.

    Args:
        tables: The legs of all vehicle classes.
        weights: Reward of a visit by vehicle m to site j, shape (M, n).
        start: A feasible plan.
        seed: Seed of the random choices.
        starts: Number of starts: the first from the given plan, the others from the empty one.
        stop: Whether to stop, given the best value so far.
        offer: Takes every better plan as it is found, since Ctrl-C ends the search.

    Raises:
        ValueError: If fuel can bind, or a weight is NaN.
    """
    run = _Run(tables, weights, start, stop, offer)
    n = len(run.tours.sites)
    rounds = 1 + int(ROUNDS * min(1.0, n / _FEW))
    plans: list[VisitOrders] = []
    for number in range(starts if n > 1 else 0):
        if number and run.is_over():
            break
        rng = np.random.default_rng((seed, number))
        plans.append(run.anneal(rng, start if number == 0 else tuple(() for _ in start), rounds, 1.0, weights > 0))
    rng = np.random.default_rng((seed, starts))
    for _ in range(CROSSINGS * starts):
        elite = run.elite(plans)
        if run.is_over() or len(elite) < 2:
            break
        parents = [elite[k] for k in rng.permutation(len(elite))[:_PARENTS]]
        plans = [*elite, run.anneal_near(rng, _pairs(weights.shape, parents), rounds)]
    return run.best, run.routes()


def guided(
    tables: LegTables, weights: FloatArray, start: VisitOrders, allowed: BoolArray, *, seed: int, onward: bool = True,
    rounds: int = GUIDED_ROUNDS, stop: Callable[[float], bool] = lambda value: False,  # noqa: ARG005
) -> VisitOrders:
    """A plan worth at least as much as another one, found near the pairs of vehicle and POI of a relaxation's point.

    Rounds over the allowed pairs, from no visits; then as many over all pairs from there, at a third of the heat.

    Args:
        tables: The legs of all vehicle classes.
        weights: Reward of a visit by vehicle m to site j, shape (M, n).
        start: A feasible plan.
        allowed: Whether vehicle m may visit site j, shape (M, n).
        seed: Seed of the random choices.
        onward: Whether to go on over all pairs; without it, only allowed ones are added to what ``start`` may have.
        rounds: Rounds of each part.
        stop: Whether to stop, given the best value so far.

    Raises:
        ValueError: If fuel can bind, a weight is NaN, or ``allowed`` has another shape than ``weights``.
    """
    if allowed.shape != weights.shape:
        raise ValueError(f"allowed pairs need the shape of the weights, {weights.shape}, not {allowed.shape}")
    run = _Run(tables, weights, start, stop)
    if len(run.tours.sites) > 1:
        rng = np.random.default_rng(seed)
        run.anneal_near(rng, allowed, rounds, onward=onward)
    return run.best


def _pairs(shape: tuple[int, ...], plans: Sequence[VisitOrders]) -> BoolArray:
    """The pairs of vehicle and POI of some plans, shape (M, n)."""
    pairs: BoolArray = np.zeros(shape, dtype=np.bool_)
    for orders in plans:
        for m, order in enumerate(orders):
            pairs[m, list(order)] = True
    return pairs


class _Run:
    """A running search and its best plan."""

    def __init__(self, tables: LegTables, weights: FloatArray, start: VisitOrders, stop: Callable[[float], bool],
                 offer: Callable[[VisitOrders], None] = lambda orders: None) -> None:  # noqa: ARG005
        self.tours = tours_of(tables, weights)
        self._tables, self._weights, self._stop, self._offer = tables, weights, stop, offer
        self.best, self.value = start, self.worth(start)
        n = len(self.tours.sites)
        self._pool = np.zeros((_POOL, n), np.int16), np.zeros(_POOL, np.int64), np.zeros(_POOL, np.int64)
        self._table, self._size = np.full(2 * _POOL + 1, -1, np.int64), 0
        self._keys = np.random.default_rng(0).integers(0, 2**63, n, dtype=np.uint64)

    def is_over(self) -> bool:
        """Whether to stop."""
        return self._stop(self.value)

    def anneal(self, rng: np.random.Generator, start: VisitOrders, rounds: int, heat: float, allowed: BoolArray,
               ) -> VisitOrders:
        """The best plan of one annealing, which becomes the run's best if it is better.

        Args:
            rng: Random numbers.
            start: A feasible plan.
            rounds: Rounds.
            heat: Share of the usual heat.
            allowed: Whether vehicle m may visit site j, shape (M, n).
        """
        tours = self.tours
        own = allowed[:, tours.sites] & (tours.weights > 0)
        current, current_length = as_arrays(self._within(start), len(tours.sites))
        incumbent, incumbent_length = current.copy(), current_length.copy()
        found = start
        polls = (0, *range(1, rounds, -(-rounds // _POLLS)), rounds)  # the first plan is offered after one round
        for begin, end in itertools.pairwise(polls):
            with deferring_ctrl_c():
                self._size = anneal(
                    rng, begin, end, rounds, _HOT * heat * tours.value, _COLD * heat * tours.value, tours.price,
                    tours.detour_s, tours.vehicle_class, tours.time_s, tours.into_s, tours.symmetric, tours.limit_s,
                    tours.near, tours.weights, tours.powers, own, current, current_length, incumbent, incumbent_length,
                    *self._pool, self._size, self._table, self._keys, stop_flag())
                orders = tuple(tuple(tours.sites[list(order)].tolist())
                               for order in as_orders(incumbent, incumbent_length))
                if all(self._fits(m, order) for m, order in enumerate(orders)):  # up to rounding it does
                    found = max(found, orders, key=self.worth)
                if self.worth(found) > self.value:
                    self.best, self.value = found, self.worth(found)
                    self._offer(found)
            if self.is_over():
                break
        return found

    def anneal_near(self, rng: np.random.Generator, allowed: BoolArray, rounds: int, *, onward: bool = True,
                    ) -> VisitOrders:
        """The best plan of an annealing over some pairs, from no visits, and of one over all pairs from there.

        Args:
            rng: Random numbers.
            allowed: Whether vehicle m may visit site j, shape (M, n).
            rounds: Rounds of each part.
            onward: Whether to go on over all pairs.
        """
        earns = self._weights > 0
        near = self.anneal(rng, tuple(() for _ in self._weights), rounds, 1.0, allowed & earns)
        if onward and not self.is_over():
            near = max(near, self.anneal(rng, near, rounds, _AGAIN, earns), key=self.worth)
        return near

    def elite(self, plans: Sequence[VisitOrders]) -> list[VisitOrders]:
        """The best of some plans that differ in their visits, by value."""
        different = {tuple(frozenset(order) for order in orders): orders for orders in plans}
        return sorted(different.values(), key=self.worth)[-_ELITE:]

    def routes(self) -> tuple[Route, ...]:
        """Routes of good plans, each with its vehicle class."""
        pool, length, vehicle_class = self._pool
        return tuple((int(vehicle_class[k]), tuple(self.tours.sites[pool[k, :length[k]]].tolist()))
                     for k in range(self._size))

    def worth(self, orders: VisitOrders) -> float:
        """Value of a plan."""
        return math.fsum(self._weights[m, j] for m, order in enumerate(orders) for j in order)

    def _within(self, orders: VisitOrders) -> VisitOrders:
        """A plan over the tours' sites: without visits that earn nothing, unless they were shortcuts."""
        number = {int(site): k for k, site in enumerate(self.tours.sites)}
        kept = [tuple(j for j in order if j in number and self._weights[m, j] > 0) for m, order in enumerate(orders)]
        return tuple(tuple(number[j] for j in order) if self._fits(m, order) else () for m, order in enumerate(kept))

    def _fits(self, vehicle: int, order: tuple[int, ...]) -> bool:
        """Whether a route keeps the mission limit: the sum that the certificate takes."""
        k, base = self._tables.vehicle_class[vehicle], self._tables.base
        stops = (base, *order, base) if order else ()
        total_s = sum(float(self._tables.time_s[k, a, b]) for a, b in itertools.pairwise(stops))
        return total_s <= float(self._tables.limit_s[k])
