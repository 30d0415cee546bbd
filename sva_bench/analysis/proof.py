"""The share of bad missions that a number of draws proves."""

from __future__ import annotations

from sva_bench.analysis.results import Share
from sva_bench.analysis.statistics import bounded_mean


def share_of(bad: int, draws: int, *, varies: bool = True) -> Share:
    """A share of draws with its interval, Clopper and Pearson's; exact where all draws are equal."""
    share = bad / draws
    if not varies:
        return Share(share=share, ci95=(share, share))
    return Share(share=share, ci95=bounded_mean(draws, share, draws * share * (1 - share), (0.0, 1.0)))


def proves(found: Share, target: float) -> bool:
    """Whether the upper end of a share's interval is at most the one asked for."""
    return found.ci95 is not None and found.ci95[1] <= target


def most_bad(draws: int, target: float) -> int:
    """The greatest number of bad draws that still proves a share; -1 where none does."""
    bad = -1
    while bad < draws and proves(share_of(bad + 1, draws), target):
        bad += 1
    return bad
