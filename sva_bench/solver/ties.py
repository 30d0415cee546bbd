"""The plans that share the greatest sum of incentives, and the sums that compare plans."""

from __future__ import annotations

import logging
import math

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import Method
from sva_bench.mission.instance import Instance
from sva_bench.solver.goal import Goal
from sva_bench.solver.knowledge import Clock, Knowledge, Solution
from sva_bench.solver.routes.heuristic import VisitOrders
from sva_bench.solver.solve import solve

_log = logging.getLogger(__name__)

FLOOR = 1e-8  # relative; keeps a known optimum feasible when its value becomes a constraint
ROUNDING = 1e-12  # relative; of sums of incentives, and of availabilities that are the same


class Ties:
    """The plans that share the greatest sum of incentives.

    Among them ``sum p e y`` is, but for a constant, ``sum (p - least p) e y``: in that form, the ties of two vehicles
    are the same in all scenarios.
    """

    def __init__(self, instance: Instance, nominal: VisitOrders, known: Knowledge, clock: Clock, gap: float,
                 method: Method) -> None:
        self._instance, self._known, self._clock, self._gap = instance, known, clock, gap
        self._method: Method = method
        self._incentives, availability = incentives_of(instance), availability_of(instance)
        best = sum_of(self._incentives, nominal)
        self._floor = best - FLOOR * abs(best)
        spread = availability - availability.min(initial=1.0)
        self._equal = float(spread.max(initial=0.0)) <= ROUNDING * float(availability.max(initial=0.0))
        self._shares = np.zeros(len(spread)) if self._equal else spread / spread.max()

    def solutions(self, interrupted: bool) -> tuple[Solution | None, Solution | None, Solution | None]:
        """The tied plans of most and least expected value, and the quickest of the former; ``None`` = not solved."""
        weights = self._incentives * self._shares[:, None]
        most = least = None
        if not self._equal and not interrupted:
            most = self._solve("most", Goal(weights=weights, floors=((self._incentives, self._floor),)))
            interrupted = most.status == "interrupted"
        if not self._equal and not interrupted:
            least = self._solve("least", Goal(weights=-weights, floors=((self._incentives, self._floor),)))
            interrupted = least.status == "interrupted"
        if interrupted:
            return most, least, None
        floors = [(self._incentives, self._floor)]
        if most is not None:
            floors.append((weights, most.value - FLOOR * abs(most.value)))
        quickest = self._solve("soonest", Goal(weights=np.zeros_like(weights), floors=tuple(floors), driving=1.0))
        return most, least, quickest

    def _solve(self, what: str, goal: Goal) -> Solution:
        key = (what, tuple(self._shares.tolist()), self._gap, *(floor for _, floor in goal.floors))
        return solve_unless_known(key, self._instance, goal, self._known, self._clock, self._gap, self._method)


def solve_unless_known(
    key: tuple[object, ...], instance: Instance, goal: Goal, known: Knowledge, clock: Clock,
    gap: float, method: Method,
) -> Solution:
    """Solve, unless a proved solution of the same goal is known."""
    if key in known.solutions:
        return known.solutions[key]
    solution = solve(instance, goal, known, clock, gap, method)
    if solution.status == "optimal":
        known.solutions[key] = solution
    _log.debug("%s: %s, %.9g of %.9g, %d nodes, %s", key[0], solution.status, solution.value, solution.bound,
               solution.nodes, {phase: round(s, 3) for phase, s in solution.seconds.items()})
    return solution


def incentives_of(instance: Instance) -> FloatArray:
    """Incentive of a visit by vehicle m to site j, shape (M, n)."""
    return np.array([v.incentives for v in instance.vehicles]).reshape(len(instance.vehicles), len(instance.sites))


def availability_of(instance: Instance) -> FloatArray:
    """Availability of each vehicle, shape (M,)."""
    return np.array([v.availability for v in instance.vehicles], dtype=np.float64)


def sum_of(weights: FloatArray, orders: VisitOrders) -> float:
    """Sum of the weights, of shape (M, n), of a plan's visits."""
    return math.fsum(weights[m, j] for m, order in enumerate(orders) for j in order)


def expected_of(instance: Instance, orders: VisitOrders) -> float:
    """Expected incentive of a plan under failures of whole missions."""
    return sum_of(incentives_of(instance) * availability_of(instance)[:, None], orders)
