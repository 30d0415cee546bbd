"""Risk: what a plan is worth when it matters how bad the bad outcomes are.

With ``Pi_m`` the sum of incentives on vehicle m's route, and ``Pi(w) = sum_m alpha_m(w) Pi_m`` what outcome w pays:

- ``cvar``: ``(1 - l) E[Pi] + l CVaR``, the mean of the worst ``1 - beta`` share of outcomes;
- ``excess``: ``(1 - l) E[Pi] - l E[max(T - Pi, 0)]``, the expected shortfall below a target.

Both are linear programs in ``Pi`` with a row for each outcome, and the joint distribution counts.

Source:
    Rockafellar, Uryasev (2000), "Optimization of conditional value-at-risk"; the paper's section 6 on expected excess.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.solver.outcomes import Outcomes

RiskKind = Literal["cvar", "excess"]


@dataclass(frozen=True, kw_only=True)
class RiskMeasure:
    """What is to be maximised in place of the expected incentive.

    Attributes:
        kind: The measure.
        weight: Share ``l`` of the measure in the objective, the rest is the expected incentive.
        beta: Confidence level of ``cvar``.
        target: Target of ``excess``.
    """

    kind: RiskKind
    weight: float = 1.0
    beta: float = 0.9
    target: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.weight <= 1 or not 0 <= self.beta < 1 or not 0 <= self.target < math.inf:
            raise ValueError("weight is in [0, 1], beta in [0, 1), and a target is finite and not negative")


@dataclass(frozen=True, eq=False, kw_only=True)
class Risk:
    """A measure over the outcomes of an instance.

    Attributes:
        measure: The measure.
        outcomes: The outcomes.
    """

    measure: RiskMeasure
    outcomes: Outcomes

    def times(self, factor: float) -> Risk:
        """The same measure with incentives in another unit."""
        return Risk(measure=replace(self.measure, target=self.measure.target * factor),
                    outcomes=self.outcomes.times(factor))

    def of(self, sums: FloatArray) -> float:
        """Value of the measure, without its weight, for sums of incentives by vehicle, shape (M,)."""
        paid = self.outcomes.available @ sums
        if self.measure.kind == "excess":
            return -float(self.outcomes.probability @ np.maximum(self.measure.target - paid, 0.0))
        tail = 1.0 - self.measure.beta
        order = np.argsort(paid, kind="stable")
        before = np.concatenate([[0.0], np.cumsum(self.outcomes.probability[order])[:-1]])
        share = np.clip(tail - before, 0.0, self.outcomes.probability[order])
        return float(share @ paid[order]) / tail

    @property
    def side(self) -> float:
        """Right side of an outcome's row: ``sum_m alpha_m Pi_m + u >= target``, or ``... + u - eta >= 0``."""
        return self.measure.target if self.measure.kind == "excess" else 0.0

    def costs(self) -> tuple[FloatArray, FloatArray]:
        """Objective of the columns ``u`` by outcome, then ``eta`` for ``cvar``; and their entries in the rows.

        Returns:
            Shapes (columns,) and (outcomes, columns). All columns are at least 0: ``eta`` is, as nothing is paid back.
        """
        outcomes, weight = len(self.outcomes.probability), self.measure.weight
        if self.measure.kind == "excess":
            return -weight * self.outcomes.probability, np.eye(outcomes)
        lost = -weight * self.outcomes.probability / (1.0 - self.measure.beta)
        return np.append(lost, weight), np.hstack([np.eye(outcomes), -np.ones((outcomes, 1))])
