"""What intervals are made of, added up so that ranges of trials can be joined."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray, IntArray

Bounds = tuple[float, float]
"""The least and the greatest that an observation can be."""


@dataclass(frozen=True, kw_only=True)
class Moments:
    """A sample's count, mean and squares about it.

    Attributes:
        count: Number of trials.
        mean: Their mean.
        squares: Sum of the squares about the mean.
    """

    count: int
    mean: float
    squares: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Clusters:
    """Trials and their sum for each noise draw; none where there is no noise.

    Attributes:
        counts, sums: Shape (rollouts,).
    """

    counts: IntArray
    sums: FloatArray

    @property
    def means(self) -> FloatArray:
        """Mean of each draw that was met, shape (draws met,)."""
        met = self.counts > 0
        means: FloatArray = self.sums[met] / self.counts[met]
        return means


@dataclass(frozen=True, eq=False, kw_only=True)
class Figure:
    """A figure measured trial by trial, in two parts that vary for different reasons: ``drawn`` less ``taken``.

    Attributes:
        drawn: What the failures drawn leave of the plan had nothing else gone wrong: independent from trial to trial.
        drawn_bounds: What that can be.
        taken: What noise took of it: trials of one noise draw share it.
        taken_bounds: What a draw that was not met could take, as far as those that were met let us fear.
    """

    drawn: Moments
    drawn_bounds: Bounds
    taken: Clusters
    taken_bounds: Bounds

    @property
    def mean(self) -> float:
        """Mean over trials."""
        return self.drawn.mean - self.mean_taken

    @property
    def mean_taken(self) -> float:
        """Mean over trials of what noise took."""
        return float(self.taken.sums.sum()) / self.drawn.count


def figure_of(drawn: FloatArray, drawn_bounds: Bounds, taken: FloatArray, taken_bounds: Bounds, rollout: IntArray,
              *, noisy: bool) -> Figure:
    """A figure of trials.

    Args:
        drawn, taken: One figure per trial each, shape (trials,).
        drawn_bounds, taken_bounds: What they can be.
        rollout: Noise draw of each trial, shape (trials,).
        noisy: Whether noise draws differ. Without noise what is taken goes by the rules and depends on the failures
            alone: ``drawn`` holds the whole figure then.
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
        drawn_bounds=drawn_bounds, taken=shared, taken_bounds=taken_bounds)


def joined(a: Figure, b: Figure) -> Figure:
    """The figure of two ranges of trials together, which share their noise draws."""
    draws = max(len(a.taken.counts), len(b.taken.counts))  # a short range may not have met the last ones
    counts = [np.pad(part.taken.counts, (0, draws - len(part.taken.counts))) for part in (a, b)]
    sums = [np.pad(part.taken.sums, (0, draws - len(part.taken.sums))) for part in (a, b)]
    return _together(a, b, Clusters(counts=counts[0] + counts[1], sums=sums[0] + sums[1]))


def pooled(a: Figure, b: Figure) -> Figure:
    """The figure of trials under two seeds together: each seed has noise draws of its own."""
    return _together(a, b, Clusters(counts=np.concatenate([a.taken.counts, b.taken.counts]),
                                    sums=np.concatenate([a.taken.sums, b.taken.sums])))


def _together(a: Figure, b: Figure, taken: Clusters) -> Figure:
    """Both, with such clusters.

    Source:
        Chan, Golub & LeVeque (1979), Updating Formulae and a Pairwise Algorithm for Computing Sample Variances.
    """
    x, y = a.drawn, b.drawn
    count, step = x.count + y.count, y.mean - x.mean
    return Figure(
        drawn=Moments(count=count, mean=x.mean + step * y.count / count,
                      squares=x.squares + y.squares + step**2 * x.count * y.count / count),
        drawn_bounds=_hull(a.drawn_bounds, b.drawn_bounds), taken=taken,
        taken_bounds=_hull(a.taken_bounds, b.taken_bounds))


def _hull(a: Bounds, b: Bounds) -> Bounds:
    return min(a[0], b[0]), max(a[1], b[1])
