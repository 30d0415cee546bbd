"""What routes are worth to the heuristic: exact but for fuel, which it ignores on the way from stop to stop."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.solver.discounts import Discounts, leg_survival
from sva_bench.solver.routes.fronts import LegTables


@dataclass(frozen=True, eq=False, kw_only=True)
class Worth:
    """The rewards and discounts of all vehicles as arrays, for compiled code.

    Attributes:
        base: The base.
        weights: Reward of a visit by vehicle m to site j, shape (M, n), not negative.
        discounted: Whether the value of vehicle m's route depends on its order, shape (M,).
        survival: Probability of vehicle m to survive the quickest way from a site to another, shape (M, n, n).
        departure: Cost of leaving, shape (M,).
        home: Reward of the return, shape (M,).
    """

    base: int
    weights: FloatArray
    discounted: BoolArray
    survival: FloatArray
    departure: FloatArray
    home: FloatArray

    def of_route(self, vehicle: int, order: tuple[int, ...]) -> float:
        """Value of one vehicle's route over POIs in this order."""
        weights = self.weights[vehicle]
        if not self.discounted[vehicle]:
            return math.fsum(weights[j] for j in order)
        if not order:
            return 0.0
        stops = np.array([self.base, *order, self.base])
        chances = np.cumprod(self.survival[vehicle][stops[:-1], stops[1:]])
        earned = float(chances[:-1] @ weights[stops[1:-1]])
        return earned + float(self.home[vehicle] * chances[-1] - self.departure[vehicle])

    def of(self, orders: tuple[tuple[int, ...], ...]) -> float:
        """Value of a plan."""
        return math.fsum(self.of_route(m, order) for m, order in enumerate(orders))


def worth_of(tables: LegTables, weights: FloatArray, discounts: Discounts | None) -> Worth:
    """What routes are worth.

    Args:
        tables: The legs of all vehicle classes.
        weights: Reward of a visit by vehicle m to site j, shape (M, n), not negative.
        discounts: Discounts of the rewards; ``None`` = none.
    """
    vehicles, n = weights.shape
    discounted, zeros = np.zeros(vehicles, dtype=np.bool_), np.zeros(vehicles)
    survival = np.ones((vehicles, n, n))
    if discounts is None:
        return Worth(base=tables.base, weights=weights, discounted=discounted, survival=survival, departure=zeros,
                     home=zeros)
    visited: BoolArray = np.any(weights > 0, axis=0)
    for m in range(vehicles):
        k, discount = tables.vehicle_class[m], discounts.of(m)
        discounted[m] = not discount.is_plain
        survival[m] = leg_survival(tables.driven_s[k], visited, discount)
    return Worth(base=tables.base, weights=weights, discounted=discounted, survival=survival,
                 departure=discounts.departure, home=discounts.home)
