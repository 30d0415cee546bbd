"""What given plans come to where their teams react: texts for the terminal and the page."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.reaction_results import ComparedReaction
from sva_bench.analysis.results import Comparison, Estimate
from sva_bench.analysis.summaries import ComparisonSummary
from sva_bench.report.reaction_wording import Answer, GivenReacting, assumptions_of, condition, gained
from sva_bench.report.wording import listed, with_interval


def given_reacting(summary: ComparisonSummary) -> list[GivenReacting]:
    """Every scenario under every policy and news, scenario by scenario."""
    return [GivenReacting(scenario, reaction) for scenario in summary.scenarios
            for reaction in scenario.reactions or ()]


def given_answers(summary: ComparisonSummary) -> list[Answer]:
    """Which plan is best by how much, and what reacting adds to each: an answer for each policy and news."""
    rows = given_reacting(summary)
    return [Answer(condition(policy, [news]), _said([
        row for row in rows if (row.reaction.policy, row.reaction.news) == (policy, news)]))
        for policy, news in dict.fromkeys((row.reaction.policy, row.reaction.news) for row in rows)]


def reaction_lines(summary: ComparisonSummary) -> list[str]:
    """The answers in lines, and what they rest on; none where nobody reacts."""
    return [*map(str, given_answers(summary)), *assumptions_of(given_reacting(summary))]


def _said(rows: Sequence[GivenReacting]) -> tuple[str, ...]:
    return ("; ".join(f"in {scenario.name} {_best(reaction)}" for scenario, reaction in rows) + ".",
            *(f"Re-planning adds {_added(reaction)} in {scenario.name}." for scenario, reaction in rows))


def _best(reaction: ComparedReaction) -> str:
    """The best plan, what it is worth, and how far ahead of the next it is."""
    first, *others = reaction.ranking
    worth = f"{first.plan} is worth {with_interval(reaction.plans[first.plan].executed)}"
    if not others:
        return worth
    ahead = _ahead(first.plan, others[0].plan, reaction.comparisons)
    if ahead is None:
        return f"{worth}, as much as {others[0].plan}: they drive alike"
    found, distinguishable = ahead
    if distinguishable:
        return f"{worth}, {with_interval(found)} more than the next best, {others[0].plan}"
    if found.ci95 == (0.0, 0.0):
        return f"{worth}, exactly as much as {others[0].plan}"
    return f"{worth}, not distinguishably more than the next best, {others[0].plan}"


def _ahead(first: str, other: str, comparisons: Sequence[Comparison]) -> tuple[Estimate, bool] | None:
    """One plan's lead over another, whichever way they were compared; ``None`` of plans that are the same."""
    pair = next(c for c in comparisons if {c.a, c.b} == {first, other})
    if pair.same_plan:
        return None
    if pair.a == first:
        return Estimate(mean=pair.mean, ci95=pair.ci95), pair.distinguishable
    return Estimate(mean=-pair.mean, ci95=pair.ci95 and (-pair.ci95[1], -pair.ci95[0])), pair.distinguishable


def _added(reaction: ComparedReaction) -> str:
    return listed([f"{gained(gain)} to {name}" for name, gain in reaction.value_of_recourse.items()])
