"""Differences of teams that react in per cent of what they are of, and how they are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from sva_bench.analysis.over_trials import percent
from sva_bench.analysis.reaction_results import ReactionFigures, ReactionResult
from sva_bench.analysis.results import Estimate
from sva_bench.report.wording import DOUBTED, with_interval

MOST_PER_CENT = 1000.0
"""Beyond it a percentage says more about how little its base is than about what it is of."""


def in_per_cent(found: Estimate, of: float) -> Estimate | None:
    """A difference and its interval in per cent of a value; ``None`` of a value of nothing, or less, or next to it.

    No difference at all is none in per cent of anything.
    """
    if found.mean == 0 and found.ci95 == (0.0, 0.0):
        return Estimate(mean=0.0, ci95=(0.0, 0.0))
    low, mean, high = (percent(figure, of) for figure in (
        (found.ci95 or (found.mean,))[0], found.mean, (found.ci95 or (found.mean,))[-1]))
    if of <= 0 or low is None or mean is None or high is None:
        return None
    return Estimate(mean=mean, ci95=found.ci95 and (low, high))


def vss_pct(reaction: ReactionResult) -> Estimate | None:
    """VSS in per cent of the stochastic plan's value."""
    return in_per_cent(reaction.vss.executed, reaction.plans["stochastic"].executed.mean)


def without_pct(reaction: ReactionResult) -> Estimate | None:
    """VSS without reaction in per cent of the stochastic plan's value without."""
    return in_per_cent(reaction.vss_without_reaction, value_without(reaction, "stochastic"))


def value_without(reaction: ReactionFigures, plan: str) -> float:
    """Value of a plan if nobody reacts, by the same histories or trials."""
    return reaction.plans[plan].executed.mean - reaction.value_of_recourse[plan].mean


def recourse_pct(reaction: ReactionFigures, plan: str) -> Estimate | None:
    """Value of recourse in per cent of the plan's value without."""
    gain = reaction.value_of_recourse[plan]
    return in_per_cent(gain, value_without(reaction, plan))


def difference_pct(reaction: ReactionResult, gain: Estimate) -> Estimate | None:
    """A difference of two plans with the reaction in per cent of the stochastic plan's value, as VSS is."""
    return in_per_cent(gain, reaction.plans["stochastic"].executed.mean)


def lead_of(reaction: ReactionResult) -> Estimate:
    """How far the best plan tried is ahead of the next."""
    return Estimate(mean=reaction.best.mean, ci95=reaction.best.ci95)


def leads(reaction: ReactionResult) -> bool:
    """Whether the best plan tried is distinguishably ahead of the next: noise may turn that."""
    ahead = lead_of(reaction)
    return reaction.best.over is not None and ahead.mean > 0 and ahead.excludes_zero


def tell(found: Iterable[Estimate | None]) -> bool:
    """Whether percentages tell something: each is there, and none is absurd for the little that it is of."""
    return all(pct is not None and abs(pct.mean) <= MOST_PER_CENT for pct in found)


def doubted(found: Estimate | None, show: Callable[[Estimate], str] = with_interval) -> str:
    """A difference as tables show it: marked where it is not distinguishable from zero."""
    if found is None:
        return ""
    mean, bracket, ends = show(found).partition(" [")  # behind the mean, where no line breaks before it
    return mean + ("" if found.excludes_zero or found.ci95 in (None, (0.0, 0.0)) else DOUBTED) + bracket + ends
