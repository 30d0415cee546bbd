"""Means with intervals, paired and clustered by rollout."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student_t

from sva_bench.arrays import FloatArray, IntArray

CONFIDENCE = 0.95


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A mean and its 95 % interval; ``None`` where the data carry none."""

    mean: float
    interval: tuple[float, float] | None

    @property
    def distinguishable(self) -> bool:
        """Whether the interval leaves zero out. Differences that are all zero are not distinguishable from it."""
        return self.interval is not None and (self.interval[0] > 0 or self.interval[1] < 0)

    def as_dict(self) -> dict[str, Any]:
        """As in ``summary.json``."""
        return {"mean": self.mean + 0.0, "ci95": None if self.interval is None else [x + 0.0 for x in self.interval]}


def estimate(values: FloatArray, rollout: IntArray, *, noisy: bool) -> Estimate:
    """Mean of trials that share noise draws, with its interval.

    Trials of one rollout share its noise, so the rollouts are the sample: the interval has K - 1 degrees of freedom.
    Without noise the trials are independent and are the sample themselves.

    Args:
        values: One figure per trial, or a difference of two plans that met the same failures, shape (trials,).
        rollout: Noise draw of each trial, shape (trials,).
        noisy: Whether rollouts differ.

    Source:
        Cluster-robust variance of a mean: Cameron & Miller (2015), A Practitioner's Guide to Cluster-Robust
        Inference, with the factor K / (K - 1).
    """
    mean = float(np.mean(values))
    clusters = rollout if noisy else np.arange(len(values))
    count = len(np.unique(clusters))
    if count < 2:
        return Estimate(mean=mean, interval=None)
    sums = np.bincount(clusters, weights=values - mean)
    variance = count / (count - 1) * float(sums @ sums) / len(values) ** 2
    half = float(student_t.ppf(0.5 + CONFIDENCE / 2, count - 1)) * math.sqrt(variance)
    return Estimate(mean=mean, interval=(mean - half, mean + half))
