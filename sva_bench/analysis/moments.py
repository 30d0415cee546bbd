"""Sufficient statistics of intervals, which add up over ranges of trials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray, IntArray

Bounds = tuple[float, float]
"""Least and greatest possible value of an observation."""


@dataclass(frozen=True, kw_only=True)
class Moments:
    """Count, mean and sum of squared deviations of a sample.

    Attributes:
        count: Number of trials.
        mean: Their mean.
        squares: Sum of squared deviations from the mean.
    """

    count: int
    mean: float
    squares: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Clusters:
    """Count and sum of the trials of each noise draw (the clusters); empty without noise.

    Attributes:
        counts, sums: Shape (rollouts,).
    """

    counts: IntArray
    sums: FloatArray

    @property
    def means(self) -> FloatArray:
        """Mean of each noise draw that has trials, shape (draws with trials,)."""
        has_trials = self.counts > 0
        means: FloatArray = self.sums[has_trials] / self.counts[has_trials]
        return means


@dataclass(frozen=True, eq=False, kw_only=True)
class Figure:
    """A figure measured trial by trial: ``drawn``, due to the failures, less ``taken``, the losses due to noise.

    Attributes:
        drawn: The figure under the failures drawn alone; independent from trial to trial.
        drawn_bounds: Its least and greatest possible value.
        taken: The losses due to noise; trials of one noise draw are correlated.
        taken_bounds: Least and greatest loss possible in a noise draw that was not observed (``analysis.unseen``).
        certain: What its mean can't lie beyond, whatever failures and noise do; ``None`` = not known.
    """

    drawn: Moments
    drawn_bounds: Bounds
    taken: Clusters
    taken_bounds: Bounds
    certain: Bounds | None = None

    @property
    def mean(self) -> float:
        """Mean over trials."""
        return self.drawn.mean - self.mean_taken

    @property
    def mean_taken(self) -> float:
        """Mean over trials of the losses due to noise."""
        return float(self.taken.sums.sum()) / self.drawn.count


def figure_of(drawn: FloatArray, drawn_bounds: Bounds, taken: FloatArray, taken_bounds: Bounds, rollout: IntArray,
              *, noisy: bool, certain: Bounds | None = None) -> Figure:
    """The figure of some trials.

    Args:
        drawn, taken: Both parts of each trial, shape (trials,).
        drawn_bounds, taken_bounds: Their least and greatest possible value.
        rollout: Noise draw of each trial, shape (trials,).
        noisy: Whether noise draws differ. Without noise, losses are a function of the failures,
            so ``drawn`` holds the whole figure.
        certain: What its mean can't lie beyond.
    """
    shared = Clusters(counts=np.zeros(0, dtype=np.int64), sums=np.zeros(0))
    if noisy:
        shared = Clusters(counts=np.bincount(rollout), sums=np.bincount(rollout, weights=taken).astype(np.float64))
    else:
        drawn, drawn_bounds = drawn - taken, (drawn_bounds[0] - taken_bounds[1], drawn_bounds[1] - taken_bounds[0])
        taken_bounds = 0.0, 0.0
    mean = float(np.mean(drawn))
    return Figure(
        drawn=Moments(count=len(drawn), mean=mean, squares=float(np.sum((drawn - mean) ** 2))),
        drawn_bounds=drawn_bounds, taken=shared, taken_bounds=taken_bounds, certain=certain)


def joined(a: Figure, b: Figure) -> Figure:
    """The figure of two ranges of trials under the same noise draws."""
    draws = max(len(a.taken.counts), len(b.taken.counts))  # a short range may lack trials of the last ones
    counts = [np.pad(part.taken.counts, (0, draws - len(part.taken.counts))) for part in (a, b)]
    sums = [np.pad(part.taken.sums, (0, draws - len(part.taken.sums))) for part in (a, b)]
    return _combined(a, b, Clusters(counts=counts[0] + counts[1], sums=sums[0] + sums[1]))


def pooled(a: Figure, b: Figure) -> Figure:
    """The figure of trials under two seeds, each with noise draws of its own."""
    return _combined(a, b, Clusters(counts=np.concatenate([a.taken.counts, b.taken.counts]),
                                    sums=np.concatenate([a.taken.sums, b.taken.sums])))


def _combined(a: Figure, b: Figure, taken: Clusters) -> Figure:
    """The figure of both samples, with these clusters.

    Source:
        Chan, Golub & LeVeque (1979), "Updating formulae and a pairwise algorithm for computing sample variances".
    """
    x, y = a.drawn, b.drawn
    count, step = x.count + y.count, y.mean - x.mean
    return Figure(
        drawn=Moments(count=count, mean=x.mean + step * y.count / count,
                      squares=x.squares + y.squares + step**2 * x.count * y.count / count),
        drawn_bounds=_hull(a.drawn_bounds, b.drawn_bounds), taken=taken,
        taken_bounds=_hull(a.taken_bounds, b.taken_bounds),
        certain=None if a.certain is None or b.certain is None else _hull(a.certain, b.certain))


def _hull(a: Bounds, b: Bounds) -> Bounds:
    return min(a[0], b[0]), max(a[1], b[1])
