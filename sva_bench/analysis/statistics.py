"""Means and tails of trials, with intervals that hold where bad noise draws are rare."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import beta
from scipy.stats import t as student_t

from sva_bench.analysis.moments import Bounds, Figure
from sva_bench.analysis.results import Distribution, Estimate
from sva_bench.arrays import FloatArray

CONFIDENCE = 0.95
WORST = 0.1
"""Share of the trials whose mean is reported as the tail (CVaR)."""
_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_SPREADLESS = 1e-12  # relative to the bounds: rounding of sums, not spread


def estimate(figure: Figure, *, comparisons: int = 1) -> Estimate:
    """Mean of trials that share noise draws, with its interval.

    Failures vary from trial to trial and noise from draw to draw, so each part has an interval of its own sample, and
    the two are put together: as far as the drawn part may be below its mean and noise may have taken more than it did,
    the mean may be too high.

    Args:
        figure: The figure, or a difference of two plans that met the same failures.
        comparisons: How many intervals are to hold together with 95 %; each is widened accordingly.

    Source:
        Two parts together: Zou & Donner (2008), Construction of Confidence Limits about Effect Measures (MOVER).
        Several intervals at a time: Bonferroni's inequality, whatever they share.
    """
    drawn, taken = _drawn_interval(figure, comparisons), _taken_interval(figure, comparisons)
    if drawn is None or taken is None:
        return _estimate(figure.mean, None)
    middle, lost = figure.drawn.mean, figure.mean_taken
    below = math.hypot(middle - drawn[0], max(taken[1] - lost, 0.0))
    above = math.hypot(drawn[1] - middle, max(lost - taken[0], 0.0))
    return _estimate(figure.mean, (figure.mean - below, figure.mean + above))


def controlled(figure: Figure, expected: float) -> Estimate:
    """Mean of trials, free of the luck of the draw: what the failures leave has a closed form, what noise took is left.

    Without noise all is as the rules have it, and what a robot loses to them is a matter of the draw: then only the
    plain mean is known, and is given.

    Args:
        figure: The figure.
        expected: The expectation of its drawn part.

    Source:
        A control variate with the slope of 1, which is right where noise takes nothing: Lavenberg & Welch (1981).
    """
    if not len(figure.taken.counts):
        return estimate(figure)
    taken = _taken_interval(figure, 1)
    mean = expected - figure.mean_taken
    if taken is None:
        return _estimate(mean, None)
    return _estimate(mean, (min(mean, expected - taken[1]), max(mean, expected - taken[0])))


def _estimate(mean: float, ci95: tuple[float, float] | None) -> Estimate:
    """An estimate without minus zeros."""
    return Estimate(mean=mean + 0.0, ci95=None if ci95 is None else (ci95[0] + 0.0, ci95[1] + 0.0))


def _drawn_interval(figure: Figure, comparisons: int) -> tuple[float, float] | None:
    drawn = figure.drawn
    if drawn.count < 2:
        return None
    return bounded_mean(drawn.count, drawn.mean, drawn.squares, figure.drawn_bounds, comparisons=comparisons)


def _taken_interval(figure: Figure, comparisons: int) -> tuple[float, float] | None:
    """Interval of what noise takes on average: its sample are the draws."""
    if not len(figure.taken.counts):
        return 0.0, 0.0
    means = figure.taken.means
    if len(means) < 2:
        return None
    mean = float(np.mean(means))
    return bounded_mean(len(means), mean, float(np.sum((means - mean) ** 2)), figure.taken_bounds,
                        comparisons=comparisons, seen=(float(means.min()), float(means.max())))


def bounded_mean(
    count: int, mean: float, squares: float, bounds: Bounds, *, comparisons: int = 1, seen: Bounds | None = None,
) -> tuple[float, float]:
    """Interval of the mean of independent observations that can't lie outside known bounds.

    To each side, one more observation is put on the bound, and the observations are weighted at random as a Bayesian
    bootstrap does; the weighted mean's distribution is that of a beta with its moments. For a share it is exactly
    Clopper and Pearson's interval, so what was not seen in ``n`` observations may have a share of about 3 / n; for many
    observations it is the normal interval.

    Args:
        count: Number of observations, at least 1.
        mean: Their mean.
        squares: Sum of their squares about it.
        bounds: The least and the greatest that one can be.
        comparisons: How many intervals are to hold together.
        seen: The least and the greatest observation, where the bounds might be too tight for them.

    Source:
        Gaffke (2005), Three test statistics for a nonparametric one-sided hypothesis on the mean of a nonnegative
        variable; Phan, Thomas & Learned-Miller (2021), Towards Practical Mean Bounds for Small Samples; Clopper &
        Pearson (1934).
    """
    low, high = bounds if seen is None else (min(bounds[0], seen[0]), max(bounds[1], seen[1]))
    low, high = min(low, mean), max(high, mean)
    if high - low <= _SPREADLESS * max(abs(low), abs(high)):
        return mean, mean
    tail = (1 - CONFIDENCE) / (2 * comparisons)
    share = (mean - low) / (high - low)
    spread = min(squares / (high - low) ** 2, count * share * (1 - share))  # no more fits between the bounds
    upper = _upper(count, share, spread, tail)
    lower = 1 - _upper(count, 1 - share, spread, tail)
    return low + (high - low) * lower, low + (high - low) * upper


def _upper(count: int, mean: float, squares: float, tail: float) -> float:
    """Upper limit of a mean of observations between 0 and 1."""
    total, second = count * mean, squares + count * mean**2
    middle = (total + 1) / (count + 1)
    variance = ((second + 1) / (count + 1) - middle**2) / (count + 2)
    if middle >= 1 or variance <= 0:
        return 1.0
    size = middle * (1 - middle) / variance - 1
    return float(beta.ppf(1 - tail, middle * size, (1 - middle) * size))


def sample_mean(values: Sequence[float]) -> Estimate:
    """Mean of a sample of anything, such as maps, with its interval; none from fewer than two, or if all are alike.

    Student's t is too narrow where most maps show nothing and a few show much, so the interval is widened to that of
    observations which could lie beyond those met by their range over the square root of their number.
    """
    if not len(values):
        raise ValueError("no sample, no mean")
    sample = np.asarray(values, dtype=np.float64)
    mean, count = float(np.mean(sample)), len(sample)
    beyond = float(np.ptp(sample)) / math.sqrt(count)
    if count < 2 or beyond <= _SPREADLESS * abs(mean):
        return _estimate(mean, None)
    squares = float(np.sum((sample - mean) ** 2))
    half = float(student_t.ppf(0.5 + CONFIDENCE / 2, count - 1)) * math.sqrt(squares / (count - 1) / count)
    low, high = bounded_mean(count, mean, squares, (float(sample.min()) - beyond, float(sample.max()) + beyond))
    return _estimate(mean, (min(low, mean - half), max(high, mean + half)))


def distribution(values: FloatArray) -> Distribution:
    """Quantiles of trials, all of them figures that a trial came to, and the mean of the worst tenth."""
    q05, q25, q50, q75, q95 = (float(np.quantile(values, q, method="inverted_cdf")) for q in _QUANTILES)
    return Distribution(least=float(np.min(values)), q05=q05, q25=q25, q50=q50, q75=q75, q95=q95,
                        greatest=float(np.max(values)), cvar10=tail_mean(values, WORST))


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
