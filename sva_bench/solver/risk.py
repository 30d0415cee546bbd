"""Measures of risk over the outcomes of a plan.

With ``Pi_m`` the sum of incentives on vehicle m's route, and ``Pi(w) = sum_m alpha_m(w) Pi_m`` the reward in outcome w:

- ``cvar``: ``(1 - l) E[Pi] + l CVaR``, the mean of the worst ``1 - beta`` share of outcomes;
- ``excess``: ``(1 - l) E[Pi] - l E[max(T - Pi, 0)]``, the expected shortfall below a target.

Both are linear programs in ``Pi`` with a row for each outcome, and depend on the joint distribution.

Source:
    Rockafellar, Uryasev (2000), "Optimization of conditional value-at-risk"; the paper's section 6 on expected excess.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.choices import RiskKind
from sva_bench.solver.outcomes import Outcomes


@dataclass(frozen=True, kw_only=True)
class RiskMeasure:
    """A measure of risk, maximised in place of the expected incentive.

    Attributes:
        kind: The measure.
        weight: Share ``l`` of the measure in the objective; the rest is the expected incentive.
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
        constant: What every plan's value has besides, weight included; relative gaps include it.
    """

    measure: RiskMeasure
    outcomes: Outcomes
    constant: float = 0.0

    def times(self, factor: float) -> Risk:
        """The same measure with incentives in another unit."""
        return Risk(measure=replace(self.measure, target=self.measure.target * factor),
                    outcomes=self.outcomes.times(factor), constant=self.constant * factor)

    def linear(self) -> FloatArray:
        """What a visit by vehicle m to site j adds to the measure in every plan, weight included, shape (M, n).

        That is all of ``excess`` in the outcomes whose target no plan exceeds: their shortfall is the target less the
        incentive, whatever the plan.
        """
        outcomes = self.outcomes
        if self.measure.kind != "excess":
            return np.zeros_like(outcomes.incentives)
        share = (outcomes.probability * self._never_beyond_target()) @ outcomes.available
        return self.measure.weight / math.fsum(outcomes.probability) * share[:, None] * outcomes.incentives

    def essential(self) -> Risk | None:
        """The same measure but for ``constant`` and ``linear``, over the other outcomes; ``None`` where none is left.

        An outcome without reward, whatever the plan, may have nearly all the probability; the part of the measure that
        a plan can change would then be lost to rounding. Without such outcomes the tail of ``cvar`` begins among the
        others, with the rest of its probability. For ``excess``, incentives are truncated at the target.
        """
        measure, outcomes = self.measure, self.outcomes
        probability = outcomes.probability / math.fsum(outcomes.probability)
        if measure.kind == "excess":
            kept = ~self._never_beyond_target()
            chance = min(math.fsum(probability[kept]), 1.0)
            left = chance if measure.target > 0 else 0.0
            lost = self.constant - measure.weight * measure.target * math.fsum(probability[~kept])
            measure = replace(measure, weight=measure.weight * chance)
            incentives = np.minimum(outcomes.incentives, measure.target)
        else:
            kept = outcomes.available @ outcomes.incentives.any(axis=1) > 0
            chance = min(math.fsum(probability[kept]), 1.0)
            lost, left, incentives = self.constant, chance - measure.beta, outcomes.incentives
            if left > 0:
                measure = replace(measure, weight=measure.weight * left / (1 - measure.beta),
                                  beta=measure.beta / chance)
        if left <= 0 or measure.weight == 0:
            return None
        return Risk(measure=measure, constant=lost, outcomes=replace(
            outcomes, incentives=incentives, probability=probability[kept] / chance,
            available=outcomes.available[kept]))

    def _never_beyond_target(self) -> BoolArray:
        """Outcomes in which all POIs together earn no more than the target, shape (outcomes,)."""
        most = (self.outcomes.available[:, :, None] * self.outcomes.incentives).max(axis=1, initial=0.0).sum(axis=1)
        return np.asarray(most <= self.measure.target)

    def rates(self) -> FloatArray:
        """The most that a visit by vehicle m to site j can add to the measure, weight included, shape (M, n)."""
        share, earned = self.outcomes.probability @ self.outcomes.available, self.outcomes.incentives
        if self.measure.kind == "excess":
            earned = np.minimum(earned, self.measure.target)
        else:
            share = np.minimum(share / (1.0 - self.measure.beta), 1.0)
        return self.measure.weight * share[:, None] * earned

    def floors(self) -> tuple[tuple[FloatArray, float], ...]:
        """Weights and right-hand side of each outcome's row."""
        return tuple((available[:, None] * self.outcomes.incentives, self.rhs)
                     for available in self.outcomes.available)

    def of(self, sums: FloatArray) -> float:
        """Value of the measure, without its weight, for sums of incentives by vehicle, shape (M,)."""
        paid = self.outcomes.available @ sums
        if self.measure.kind == "excess":
            return -float(self.outcomes.probability @ np.maximum(self.measure.target - paid, 0.0))
        tail = 1.0 - self.measure.beta
        # From the best outcome down: its probability may be so small that 1 minus it rounds to 1.
        order = np.argsort(-paid, kind="stable")
        better = np.concatenate([[0.0], np.cumsum(self.outcomes.probability[order])[:-1]])
        share = self.outcomes.probability[order]
        share = share - np.clip(self.measure.beta - better, 0.0, share)
        return float(share @ paid[order]) / tail

    @property
    def rhs(self) -> float:
        """Right-hand side of an outcome's row: ``sum_m alpha_m Pi_m + u >= target``, or ``... + u - eta >= 0``."""
        return self.measure.target if self.measure.kind == "excess" else 0.0

    def costs(self) -> tuple[FloatArray, FloatArray]:
        """Objective of the auxiliary columns ``u`` of each outcome, then ``eta`` for ``cvar``; and their row entries.

        Returns:
            Shapes (columns,) and (outcomes, columns). All columns are at least 0: ``eta`` too, as rewards are.
        """
        outcomes, weight = len(self.outcomes.probability), self.measure.weight
        if self.measure.kind == "excess":
            return -weight * self.outcomes.probability, np.eye(outcomes)
        lost = -weight * self.outcomes.probability / (1.0 - self.measure.beta)
        return np.append(lost, weight), np.hstack([np.eye(outcomes), -np.ones((outcomes, 1))])
