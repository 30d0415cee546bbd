"""Precision asked for in place of trials: when a run has enough of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sva_bench.analysis.results import ScenarioSummary
from sva_bench.analysis.summaries import ReachedPrecision, Summary
from sva_bench.errors import BadInput


@dataclass(frozen=True, kw_only=True)
class Precision:
    """How sure a run is to be.

    Attributes:
        pct: Half-width of the executed VSS's interval in per cent of the stochastic plan's mean, in every scenario.
        max_trials: Trials at which it ends all the same.
    """

    pct: float
    max_trials: int

    def next_size(self, summary: Summary) -> tuple[int, int] | None:
        """Trials and rollouts to go on with: twice as many of both; ``None`` = enough.

        More trials of the same noise draws would not tell more of the noise, so both grow. Few looks, each at twice
        the data, keep the chance small that a lucky look ends the run too early.

        Source:
            Chow & Robbins (1965), On the Asymptotic Theory of Fixed-Width Sequential Confidence Intervals; Glynn &
            Whitt (1992), The Asymptotic Validity of Sequential Stopping Rules for Stochastic Simulations.
        """
        if self.reached(summary.scenarios).met or summary.trials >= self.max_trials:
            return None
        trials = min(2 * summary.trials, self.max_trials)
        return trials, math.ceil(summary.rollouts * trials / summary.trials)

    def reached(self, scenarios: Sequence[ScenarioSummary]) -> ReachedPrecision:
        """What became of it; met where every scenario is as sure as asked for."""
        reached = half_width_pct(scenarios)
        return ReachedPrecision(asked_pct=self.pct, reached_pct=reached, max_trials=self.max_trials,
                                met=reached is not None and reached <= self.pct)


def half_width_pct(scenarios: Sequence[ScenarioSummary]) -> float | None:
    """The greatest half-width of an executed VSS, in per cent of the stochastic plan's mean.

    Nothing varies: 0. ``None`` where there is no interval, or nothing that it could be per cent of.
    """
    widths = []
    for scenario in scenarios:
        half, mean = scenario.vss.executed.half_width, scenario.stochastic.executed.mean
        if half is None or (half > 0 and mean <= 0):
            return None
        widths.append(100 * half / mean if half > 0 else 0.0)
    return max(widths, default=0.0)


def precision_of(text: str, max_trials: int, trials: int, rollouts: int) -> Precision:
    """The precision that a command line asks for, such as ``1%``.

    Raises:
        BadInput: If it can't be meant, or never be met.
    """
    figure = text.strip()
    try:
        pct = float(figure.removesuffix("%")) if figure.endswith("%") else math.nan
    except ValueError:
        pct = math.nan
    if not (math.isfinite(pct) and pct > 0):
        raise BadInput(f"--precision {text}: expected per cent of the stochastic plan's mean, such as 1%")
    if max_trials < trials:
        raise BadInput(f"--max-trials {max_trials} is less than --trials {trials}, with which a run begins")
    if min(trials, rollouts) < 2:
        raise BadInput("--precision needs an interval from the start: at least 2 --trials and 2 --rollouts")
    return Precision(pct=pct, max_trials=max_trials)
