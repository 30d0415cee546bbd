"""Means over maps, which are a sample of all that there might be."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from sva_bench.analysis.over_maps import Percentage
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.statistics import sample_mean

Maps = Sequence[Sequence[Estimate]]
"""Estimates of each map, seed by seed."""


def over_maps(maps: Maps, *, sure: bool, comparisons: int = 1) -> Estimate:
    """Mean over maps of each map's mean over its seeds, with its interval.

    Maps are a sample, and so are the trials of each. All maps of one seed meet the same draws, and what those did to
    all maps alike does not show in how maps differ. So the interval over maps is combined with the mean of the maps'
    own intervals, as if draws moved all maps together: as far as they do not, it errs on the wide side. A map whose
    trials give no interval leaves that part unknown, and out.

    Args:
        maps: What was found on each.
        sure: Whether the figure is the same on every possible map.
        comparisons: Number of intervals that hold simultaneously, for which those of ``maps`` are widened already.

    Source:
        Cameron, Gelbach & Miller (2011), "Robust inference with multiway clustering", with Minkowski's bound in place
        of the covariances; Zou & Donner (2008), "Construction of confidence limits about effect measures" (MOVER).
    """
    own = [_over_seeds(seeds) for seeds in maps]
    means = [each.mean for each in own]
    found = sample_mean(means, comparisons=comparisons)
    if sure and len(means) > 1 and len(set(means)) == 1:
        return Estimate(mean=found.mean, ci95=(found.mean, found.mean))
    known = [each.ci95 for each in own if each.ci95 is not None]
    if found.ci95 is None or len(known) < len(own):
        return found
    low, high = (float(np.mean([ends[side] for ends in known])) - found.mean for side in (0, 1))
    return Estimate(mean=found.mean, ci95=(found.mean - math.hypot(found.mean - found.ci95[0], min(low, 0.0)),
                                           found.mean + math.hypot(found.ci95[1] - found.mean, max(high, 0.0))))


def percentage_over_maps(maps: Sequence[Sequence[Estimate | None]], *, sure: bool) -> Percentage:
    """The same of the maps that have a percentage."""
    shares = [[each for each in seeds if each is not None] for seeds in maps]
    known = [seeds for seeds in shares if seeds]
    fewer = None if len(known) == len(maps) else len(known)
    if not known:
        return Percentage(mean=None, ci95=None, maps=fewer)
    found = over_maps(known, sure=sure)
    return Percentage(mean=found.mean, ci95=found.ci95, maps=fewer)


def in_per_cent(found: Estimate, pct: float | None, whole: float) -> Estimate | None:
    """An estimate in per cent.

    Args:
        found: As a value.
        pct: Its mean in per cent; ``None`` where it has none.
        whole: What it is a percentage of.
    """
    if pct is None or whole <= 0:
        return None
    scale = 100.0 / whole
    return Estimate(mean=pct, ci95=None if found.ci95 is None else (
        pct + scale * (found.ci95[0] - found.mean), pct + scale * (found.ci95[1] - found.mean)))


def _over_seeds(seeds: Sequence[Estimate]) -> Estimate:
    """Mean over seeds, whose draws are independent."""
    mean = float(np.mean([seed.mean for seed in seeds]))

    def half(of: Callable[[float, tuple[float, float]], float]) -> float:
        return math.hypot(*(of(seed.mean, seed.ci95) for seed in seeds if seed.ci95 is not None)) / len(seeds)

    if any(seed.ci95 is None for seed in seeds):
        return Estimate(mean=mean, ci95=None)
    return Estimate(mean=mean, ci95=(mean - half(lambda middle, ends: middle - ends[0]),
                                     mean + half(lambda middle, ends: ends[1] - middle)))
