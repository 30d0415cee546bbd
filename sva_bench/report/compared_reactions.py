"""What given plans come to where their teams react, in lines for a terminal."""

from __future__ import annotations

from collections.abc import Mapping

from sva_bench.analysis.reaction_results import ComparedReaction, Gain
from sva_bench.analysis.summaries import ComparisonSummary
from sva_bench.choices import HistoryMode
from sva_bench.report.wording import with_interval

_HISTORIES: Mapping[HistoryMode, str] = {"enumerated": "all histories of failures", "sampled": "a sample of failures"}


def reaction_lines(summary: ComparisonSummary) -> list[str]:
    """A line for each scenario, policy and kind of news: the plans from best to worst, and what reacting adds."""
    return [f"{scenario.name}, {reaction.name} ({_HISTORIES[reaction.histories]}): {_ranked(reaction)}; reacting adds "
            f"{_added(reaction.value_of_recourse)}."
            for scenario in summary.scenarios for reaction in scenario.reactions or ()]


def _ranked(reaction: ComparedReaction) -> str:
    return "; ".join(f"{row.rank}. {row.plan} {with_interval(reaction.plans[row.plan].executed)}"
                     for row in reaction.ranking)


def _added(gains: Mapping[str, Gain]) -> str:
    return ", ".join(f"{with_interval(gain)} to {name}" for name, gain in gains.items())
