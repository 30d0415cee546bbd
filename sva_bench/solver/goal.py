"""The objective and constraints of a solve, as arrays; independent of failure processes and methods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.solver.discounts import NO_DISCOUNT, Discount, Discounts
from sva_bench.solver.risk import Risk


@dataclass(frozen=True, eq=False, kw_only=True)
class Goal:
    """The objective of a solve, and lower bounds on other sums of rewards.

    Attributes:
        weights: Reward of a visit by vehicle m to site j, shape (M, n); may be negative.
        floors: Constraints: weights of shape (M, n), and the least sum of them over a plan's visits.
        driving: Cost of a second of driving and stopping.
        discounts: What failures along the routes leave of ``weights``, and the costs of losses; ``None`` = no failures.
            Then there are no floors, no cost of driving, no measure of risk and no negative weights.
        risk: A measure of risk, added to ``weights``; its outcomes are then the floors, which are rows of the measure
            and no constraints.
        arrival: Upper bound on the probability of vehicle m to get to site j, shape (M, n); ``None`` = 1.
    """

    weights: FloatArray
    floors: tuple[tuple[FloatArray, float], ...] = ()
    driving: float = 0.0
    discounts: Discounts | None = None
    risk: Risk | None = None
    arrival: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.discounts is not None and (
                self.floors or self.driving or self.risk is not None or bool((self.weights < 0).any())):
            raise ValueError("a goal with discounts has rewards that aren't negative, and nothing else")

    def discount(self, vehicle: int) -> Discount:
        """The discount of one vehicle."""
        return NO_DISCOUNT if self.discounts is None else self.discounts.of(vehicle)

    def times(self, factor: float) -> Goal:
        """The same goal with incentives, and all that is compared with them, multiplied by a factor."""
        return replace(
            self, weights=self.weights * factor, driving=self.driving * factor,
            discounts=None if self.discounts is None else self.discounts.times(factor),
            floors=tuple((weights * factor, floor * factor) for weights, floor in self.floors),
            risk=None if self.risk is None else self.risk.times(factor))

    def within(self, reach: BoolArray, arrival: FloatArray | None = None) -> Goal:
        """The same goal without the rewards of infeasible visits.

        Args:
            reach: Whether vehicle m can visit site j, shape (M, n).
            arrival: Upper bound on the probability of vehicle m to get to site j, shape (M, n); ``None`` = 1.
        """
        risk = self.risk and replace(self.risk, outcomes=replace(
            self.risk.outcomes, incentives=np.where(reach, self.risk.outcomes.incentives, 0.0)))
        return replace(self, weights=np.where(reach, self.weights, 0.0), risk=risk, arrival=arrival)

    def essential(self) -> Goal:
        """The same goal but for a constant: its measure of risk reduced to what is not linear in the visits."""
        if self.risk is None:
            return self
        risk = self.risk.essential()
        return replace(self, weights=self.weights + self.risk.linear(), risk=risk,
                       floors=() if risk is None else risk.floors())

    def rates(self) -> FloatArray:
        """The most that the visit of vehicle m to site j can earn, or cost, shape (M, n)."""
        rates: FloatArray = np.abs(self.weights) * (1.0 if self.arrival is None else self.arrival)
        return rates if self.risk is None else rates + self.risk.rates()

    def rewarded(self) -> BoolArray:
        """Whether the visit of vehicle m to site j counts anywhere, shape (M, n)."""
        counts: BoolArray = self.weights != 0
        for m in range(len(counts)):
            counts[m] &= not self.discount(m).is_hopeless
        for weights, _ in self.floors:
            counts = counts | (weights != 0)
        return counts


def sizes_of(floors: Sequence[tuple[FloatArray, float]]) -> FloatArray:
    """Scale of each floor's row, by which to divide it so that absolute tolerances are relative, shape (floors,)."""
    return np.array([max(abs(floor), float(np.abs(weights).max(initial=0.0))) or 1.0 for weights, floor in floors])
