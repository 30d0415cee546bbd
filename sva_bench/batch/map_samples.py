"""Means over maps, which are a sample of all that there might be."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.over_maps import Percentage
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.statistics import sample_mean


def over(figures: Sequence[float], *, sure: bool) -> Estimate:
    """Mean of a sample of maps, with its interval; ``sure`` where the value is the same on every possible map."""
    found = sample_mean(figures)
    alike = sure and len(figures) > 1 and len(set(figures)) == 1
    return Estimate(mean=found.mean, ci95=(found.mean, found.mean)) if alike else found


def percentage_of(figures: Sequence[float], maps: int, *, sure: bool) -> Percentage:
    """Mean over the maps that have a percentage."""
    fewer = None if len(figures) == maps else len(figures)
    if not figures:
        return Percentage(mean=None, ci95=None, maps=fewer)
    found = over(figures, sure=sure)
    return Percentage(mean=found.mean, ci95=found.ci95, maps=fewer)
