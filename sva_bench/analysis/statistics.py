"""Means, shares and tails with intervals, paired and clustered by rollout."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student_t

from sva_bench.arrays import FloatArray, IntArray

CONFIDENCE = 0.95
WORST = 0.1
"""Share of the trials whose mean is reported as the tail (CVaR)."""
_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A mean and its 95 % interval; ``None`` where the data carry none."""

    mean: float
    interval: tuple[float, float] | None

    @property
    def distinguishable(self) -> bool:
        """Whether the interval leaves zero out. Differences that are all zero are not distinguishable from it."""
        return self.interval is not None and (self.interval[0] > 0 or self.interval[1] < 0)

    @property
    def half_width(self) -> float | None:
        """Half of the interval's width."""
        return None if self.interval is None else (self.interval[1] - self.interval[0]) / 2

    def as_dict(self) -> dict[str, Any]:
        """As in ``summary.json``."""
        return {"mean": self.mean + 0.0, "ci95": None if self.interval is None else [x + 0.0 for x in self.interval]}


def estimate(values: FloatArray, rollout: IntArray, *, noisy: bool, comparisons: int = 1) -> Estimate:
    """Mean of trials that share noise draws, with its interval.

    Trials of one rollout share its noise, so the rollouts are the sample: the interval has K - 1 degrees of freedom.
    Without noise the trials are independent and are the sample themselves.

    Args:
        values: One figure per trial, or a difference of two plans that met the same failures, shape (trials,).
        rollout: Noise draw of each trial, shape (trials,).
        noisy: Whether rollouts differ.
        comparisons: How many intervals are to hold together with 95 %; each is widened accordingly.

    Source:
        Cluster-robust variance of a mean: Cameron & Miller (2015), A Practitioner's Guide to Cluster-Robust
        Inference, with the factor K / (K - 1). Several at a time: Bonferroni's inequality, whatever they share.
    """
    mean = float(np.mean(values))
    variance, count = _variance(values, rollout, noisy=noisy)
    if count < 2:
        return Estimate(mean=mean, interval=None)
    half = _quantile(count - 1, comparisons) * math.sqrt(variance)
    return Estimate(mean=mean, interval=(mean - half, mean + half))


def controlled(
    values: FloatArray, control: FloatArray, expected: float, rollout: IntArray, *, noisy: bool,
) -> Estimate:
    """Mean of trials, told apart from the luck of the draw by a figure whose expectation is known.

    The control is what the failures drawn would have left had nothing else gone wrong; its expectation is a plan's
    closed form. What the trials owe to draws better or worse than that is taken out by a fitted slope, which costs
    one degree of freedom. Where everything went as drawn, the closed form itself is left, with no interval to speak of.

    Args:
        values: One figure per trial, shape (trials,).
        control: The control of each trial, shape (trials,).
        expected: Its expectation.
        rollout: Noise draw of each trial, shape (trials,).
        noisy: Whether rollouts differ.

    Source:
        Control variates with a fitted coefficient: Lavenberg & Welch (1981), A Perspective on the Use of Control
        Variables; the bias of the fit is of the order of 1 / trials.
    """
    about = control - np.mean(control)
    spread = float(about @ about)
    scale = max(1.0, float(np.abs(control).max(initial=0.0)))
    if spread <= (1e-9 * scale) ** 2 * len(values):  # nothing drawn, nothing to take out: the slope is that of luck
        slope, freedom = 1.0, 1
    else:
        slope, freedom = float(about @ (values - np.mean(values))) / spread, 2
    adjusted = values - slope * (control - expected)
    mean = float(np.mean(adjusted))
    variance, count = _variance(adjusted, rollout, noisy=noisy)
    if count <= freedom:
        return Estimate(mean=mean, interval=None)
    half = _quantile(count - freedom) * math.sqrt(variance)
    return Estimate(mean=mean, interval=(mean - half, mean + half))


def share(happened: FloatArray, rollout: IntArray, *, noisy: bool) -> Estimate:
    """Share of trials in which something happened, with Wilson's interval.

    Trials that share their noise count for less: the sample size is that at which independent trials would vary as
    much as these do. Where all trials agree that can't be seen, and the rollouts are taken as the sample.

    Args:
        happened: 1 where it happened, else 0, shape (trials,).
        rollout: Noise draw of each trial, shape (trials,).
        noisy: Whether rollouts differ.

    Source:
        Wilson (1927); for clusters with their effective sample size and t: Dean & Pagano (2015), Evaluating
        Confidence Interval Methods for Binomial Proportions in Clustered Surveys.
    """
    p = float(np.mean(happened))
    variance, count = _variance(happened, rollout, noisy=noisy)
    if count < 2:
        return Estimate(mean=p, interval=None)
    trials = float(len(happened))
    size = float(count) if p in (0.0, 1.0) else min(trials, p * (1 - p) / variance if variance > 0 else trials)
    z2 = _quantile(count - 1) ** 2
    middle = (p + z2 / (2 * size)) / (1 + z2 / size)
    half = math.sqrt(z2 * (p * (1 - p) + z2 / (4 * size)) / size) / (1 + z2 / size)
    return Estimate(mean=p, interval=(0.0 if p == 0 else max(0.0, middle - half),
                                      1.0 if p == 1 else min(1.0, middle + half)))


def distribution(values: FloatArray) -> dict[str, float]:
    """Quantiles of trials, all of them figures that a trial came to, and the mean of the worst tenth."""
    found = {f"q{round(100 * q):02d}": float(np.quantile(values, q, method="inverted_cdf")) for q in _QUANTILES}
    return {"least": float(np.min(values)), **found, "greatest": float(np.max(values)),
            "cvar10": tail_mean(values, WORST)}


def tail_mean(values: FloatArray, worst: float) -> float:
    """Mean of the worst trials, a given share of them: conditional value at risk.

    Args:
        values: One figure per trial, more is better, shape (trials,).
        worst: Share of the trials, above 0; a trial on its edge counts in part.

    Source:
        Rockafellar & Uryasev (2002), Conditional Value-at-Risk for General Loss Distributions.
    """
    ordered = np.sort(values)
    weights = np.clip(worst * len(values) - np.arange(len(values)), 0.0, 1.0)
    return float(weights @ ordered / weights.sum()) + 0.0


def _variance(values: FloatArray, rollout: IntArray, *, noisy: bool) -> tuple[float, int]:
    """Variance of the mean, and the number of clusters behind it; nothing to speak of for one."""
    if not noisy:
        count = len(values)
        return (float(np.var(values, ddof=1)) / count if count > 1 else math.inf), count
    count = len(np.unique(rollout))
    if count < 2:
        return math.inf, count
    sums = np.bincount(rollout, weights=values - np.mean(values))
    return count / (count - 1) * float(sums @ sums) / len(values) ** 2, count


def _quantile(freedom: int, comparisons: int = 1) -> float:
    return float(student_t.ppf(1 - (1 - CONFIDENCE) / (2 * comparisons), freedom))
