"""Means and tails of trials, with confidence intervals that are valid where bad noise draws are rare."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import beta, norm
from scipy.stats import t as student_t

from sva_bench.analysis.moments import Bounds, Figure
from sva_bench.analysis.results import Distribution, Estimate
from sva_bench.arrays import FloatArray

CONFIDENCE = 0.95
POWER = 0.8
"""Probability to tell a difference from zero that counts as enough, by convention."""
WORST = 0.1
"""Share of the trials whose mean is reported as the tail (CVaR)."""
_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_SPREADLESS = 1e-12  # spread relative to the bounds that counts as rounding of sums


def estimate(figure: Figure, *, comparisons: int = 1) -> Estimate:
    """Mean of trials that share noise draws, with its interval.

    Failures vary from trial to trial and noise from draw to draw, so each part has an interval from its own sample;
    the two are combined by the method of variance estimates recovery. The losses' interval knows nothing of what the
    failures drawn left to lose, so the whole may go beyond what is possible; it is cut off there, which loses no truth.

    Args:
        figure: The figure, such as a difference of two plans under the same failures.
        comparisons: Number of intervals that hold simultaneously with 95 %.

    Source:
        Zou & Donner (2008), "Construction of confidence limits about effect measures" (MOVER); Bonferroni's inequality
        for simultaneous intervals.
    """
    drawn, taken = _drawn_interval(figure, comparisons), _taken_interval(figure, comparisons)
    if drawn is None or taken is None:
        return _estimate(figure.mean, None)
    middle, lost = figure.drawn.mean, figure.mean_taken
    below = math.hypot(middle - drawn[0], max(taken[1] - lost, 0.0))
    above = math.hypot(drawn[1] - middle, max(lost - taken[0], 0.0))
    return _within_certain(figure, figure.mean, figure.mean - below, figure.mean + above)


def detectable(estimate: Estimate) -> float | None:
    """The smallest true difference that a run like this one would have told from zero with 80 % power.

    Args:
        estimate: The difference; its interval says how far such runs vary.

    Returns:
        That difference; ``None`` where there is no interval.

    Source:
        The usual formula of power, (z_0.975 + z_0.8) standard errors, with the interval's longer half as 1.96 of them.
    """
    if estimate.ci95 is None:
        return None
    half = max(estimate.mean - estimate.ci95[0], estimate.ci95[1] - estimate.mean)
    return half * (1 + float(norm.ppf(POWER) / norm.ppf((1 + CONFIDENCE) / 2)))


def controlled(figure: Figure, expected: float) -> Estimate:
    """Variance-reduced mean of trials: the part due to failures is replaced by its closed form (a control variate).

    Without noise, losses are a function of the failures drawn, and the figure has no closed form: then the
    plain mean is returned.

    Args:
        figure: The figure.
        expected: The expectation of its drawn part.

    Source:
        Lavenberg & Welch (1981), "A perspective on the use of control variables to increase the efficiency of Monte
        Carlo simulations"; the coefficient is 1, which is optimal without losses.
    """
    if not len(figure.taken.counts):
        return estimate(figure)
    taken = _taken_interval(figure, 1)
    mean = expected - figure.mean_taken
    if taken is None:
        return _estimate(mean, None)
    return _within_certain(figure, mean, min(mean, expected - taken[1]), max(mean, expected - taken[0]))


def _within_certain(figure: Figure, mean: float, low: float, high: float) -> Estimate:
    """The estimate, its interval cut off where the mean certainly isn't; the estimated mean stays within."""
    if figure.certain is not None:
        low, high = max(low, min(figure.certain[0], mean)), min(high, max(figure.certain[1], mean))
    return _estimate(mean, (low, high))


def _estimate(mean: float, ci95: tuple[float, float] | None) -> Estimate:
    """An estimate without negative zeros."""
    return Estimate(mean=mean + 0.0, ci95=None if ci95 is None else (ci95[0] + 0.0, ci95[1] + 0.0))


def _drawn_interval(figure: Figure, comparisons: int) -> tuple[float, float] | None:
    drawn = figure.drawn
    if drawn.count < 2:
        return None
    return bounded_mean(drawn.count, drawn.mean, drawn.squares, figure.drawn_bounds, comparisons=comparisons)


def _taken_interval(figure: Figure, comparisons: int) -> tuple[float, float] | None:
    """Interval of the mean loss due to noise; the sample is the noise draws."""
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
    """Confidence interval of the mean of independent observations within known bounds.

    For each limit one observation is added at the bound, and the observations get random weights as in a Bayesian
    bootstrap; the weighted mean's distribution is approximated by a beta with its moments. For a share it is exactly
    Clopper and Pearson's interval, so an event that did not occur in ``n`` observations may have a share of about
    3 / n; for many observations it is the normal interval.

    Args:
        count: Number of observations, at least 1.
        mean: Their mean.
        squares: Sum of their squared deviations from it.
        bounds: Least and greatest possible observation.
        comparisons: Number of intervals that hold simultaneously.
        seen: Least and greatest observation, by which the bounds are widened if necessary.

    Source:
        Gaffke (2005), "Three test statistics for a nonparametric one-sided hypothesis on the mean of a nonnegative
        variable"; Phan, Thomas & Learned-Miller (2021), "Towards practical mean bounds for small samples"; Clopper &
        Pearson (1934).
    """
    low, high = bounds if seen is None else (min(bounds[0], seen[0]), max(bounds[1], seen[1]))
    low, high = min(low, mean), max(high, mean)
    if high - low <= _SPREADLESS * max(abs(low), abs(high)):
        return mean, mean
    tail = (1 - CONFIDENCE) / (2 * comparisons)
    share = (mean - low) / (high - low)
    spread = min(squares / (high - low) ** 2, count * share * (1 - share))  # the greatest possible within the bounds
    upper = _upper(count, share, spread, tail)
    lower = 1 - _upper(count, 1 - share, spread, tail)
    return low + (high - low) * lower, low + (high - low) * upper


def _upper(count: int, mean: float, squares: float, tail: float) -> float:
    """Upper confidence limit of the mean of observations in [0, 1]."""
    total, second = count * mean, squares + count * mean**2
    middle = (total + 1) / (count + 1)
    variance = ((second + 1) / (count + 1) - middle**2) / (count + 2)
    if middle >= 1 or variance <= 0:
        return 1.0
    size = middle * (1 - middle) / variance - 1
    return float(beta.ppf(1 - tail, middle * size, (1 - middle) * size))


def sample_mean(values: Sequence[float], *, comparisons: int = 1) -> Estimate:
    """Mean of a sample, such as of maps, with its confidence interval; none from fewer than two, or if all are equal.

    Student's t interval is too narrow where most maps have values near 0 and a few large ones, so it is widened to
    ``bounded_mean`` with bounds beyond the observations by their range over the square root of their number. It is not
    cut off anywhere: nothing is certain of the maps that were not observed.

    Args:
        values: The sample.
        comparisons: Number of intervals that hold simultaneously.

    Raises:
        ValueError: If the sample is empty.
    """
    if not len(values):
        raise ValueError("the sample is empty")
    sample = np.asarray(values, dtype=np.float64)
    mean, count = float(np.mean(sample)), len(sample)
    beyond = float(np.ptp(sample)) / math.sqrt(count)
    if count < 2 or beyond <= _SPREADLESS * abs(mean):
        return _estimate(mean, None)
    squares = float(np.sum((sample - mean) ** 2))
    quantile = float(student_t.isf((1 - CONFIDENCE) / (2 * comparisons), count - 1))
    half = quantile * math.sqrt(squares / (count - 1) / count)
    low, high = bounded_mean(count, mean, squares, (float(sample.min()) - beyond, float(sample.max()) + beyond),
                             comparisons=comparisons)
    return _estimate(mean, (min(low, mean - half), max(high, mean + half)))


def distribution(values: FloatArray) -> Distribution:
    """Quantiles of trials (each an observed value), and the mean of the worst tenth.

    Args:
        values: Shape (trials,).
    """
    q05, q25, q50, q75, q95 = (float(np.quantile(values, q, method="inverted_cdf")) for q in _QUANTILES)
    return Distribution(least=float(np.min(values)), q05=q05, q25=q25, q50=q50, q75=q75, q95=q95,
                        greatest=float(np.max(values)), cvar10=tail_mean(values, WORST))


def weighted_distribution(values: FloatArray, weights: FloatArray) -> Distribution:
    """Quantiles of values with probabilities, and the mean of the worst tenth of the probability.

    Args:
        values, weights: Shape (n,).
    """
    order = np.argsort(values, kind="stable")
    ordered, below = values[order], np.cumsum(weights[order])
    total = float(below[-1])
    q05, q25, q50, q75, q95 = (float(ordered[min(int(np.searchsorted(below, (q - 1e-12) * total)), len(values) - 1)])
                               for q in _QUANTILES)
    worst = np.clip(WORST * total - (below - weights[order]), 0.0, weights[order])
    return Distribution(least=float(ordered[0]), q05=q05, q25=q25, q50=q50, q75=q75, q95=q95,
                        greatest=float(ordered[-1]), cvar10=float(worst @ ordered / worst.sum()) + 0.0)


def tail_mean(values: FloatArray, worst: float) -> float:
    """Conditional value at risk: the mean of a given share of worst trials.

    Args:
        values: One value per trial, greater is better, shape (trials,).
        worst: Share of the trials, above 0; the trial at its boundary counts in part.

    Source:
        Rockafellar & Uryasev (2002), "Conditional value-at-risk for general loss distributions".
    """
    ordered = np.sort(values)
    weights = np.clip(worst * len(values) - np.arange(len(values)), 0.0, 1.0)
    return float(weights @ ordered / weights.sum()) + 0.0
