"""``reactions.csv``: a row for each scenario, policy, news and plan."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

from sva_bench.analysis.reaction_results import ReactingPlan, ReactionFigures, ReactionLedger, ReactionResult
from sva_bench.analysis.results import Distribution, Estimate
from sva_bench.analysis.summaries import AnySummary, ComparisonSummary

Cell = str | float | int | bool | None

_LEDGER = [entry.name for entry in fields(ReactionLedger) if entry.name not in ("promised", "executed")]
_OVER_MISSIONS = [entry.name for entry in fields(Distribution)]


def _with_ends(name: str) -> list[str]:
    return [name, f"{name}_low", f"{name}_high"]


REACTION_COLUMNS: tuple[str, ...] = (
    "scenario", "policy", "news", "planner", "histories", "missions", "promised", "expected", "modelled",
    *_with_ends("executed"), *_with_ends("value_of_recourse"), "value_of_recourse_pct", "best", "reacted", "doubled",
    *(f"ledger.{name}" for name in _LEDGER), *(f"distribution.{name}" for name in _OVER_MISSIONS),
    *_with_ends("vss"), "vss_pct", *_with_ends("vss_without_reaction"), "vss_without_reaction_pct",
    *_with_ends("vss_with_recourse"), "vss_with_recourse_pct",
    *_with_ends("anticipation"), "anticipation_pct", *_with_ends("lead"))
"""Columns of ``reactions.csv``; those from ``vss`` on are of the reaction, and the same for all its plans."""


GIVEN_COLUMNS = tuple("rank" if column == "best" else column
                      for column in REACTION_COLUMNS[:REACTION_COLUMNS.index("vss")])
"""The same of given plans: the rank of each in place of whether it is the best, and no VSS."""


def reaction_columns(summary: AnySummary) -> tuple[str, ...]:
    """The columns of ``reactions.csv``."""
    return GIVEN_COLUMNS if isinstance(summary, ComparisonSummary) else REACTION_COLUMNS


def reaction_rows(summary: AnySummary) -> list[list[Cell]]:
    """The rows of ``reactions.csv``; none where nobody reacts."""
    if isinstance(summary, ComparisonSummary):
        return [[scenario.name, reaction.policy, reaction.news, name, *_plan(reaction, name, plan, next(
            row.rank for row in reaction.ranking if row.plan == name))]
            for scenario in summary.scenarios for reaction in scenario.reactions or ()
            for name, plan in reaction.plans.items()]
    return [[scenario.name, reaction.policy, reaction.news, name,
             *_plan(reaction, name, plan, name in reaction.best_plans), *_reaction(reaction)]
            for scenario in summary.scenarios for reaction in scenario.reactions or ()
            for name, plan in reaction.plans.items()]


def _plan(reaction: ReactionFigures, name: str, plan: ReactingPlan, place: Cell) -> Iterator[Cell]:
    recourse = reaction.value_of_recourse[name]
    yield from (reaction.histories, plan.missions, plan.promised, plan.expected, plan.modelled)
    yield from (*_estimate(plan.executed), *_estimate(recourse), recourse.pct, place)
    yield from (plan.reacted, plan.doubled, *(getattr(plan.ledger, entry) for entry in _LEDGER))
    yield from (getattr(plan.distribution, entry) for entry in _OVER_MISSIONS)


def _reaction(reaction: ReactionResult) -> Iterator[Cell]:
    yield from (*_estimate(reaction.vss.executed), reaction.vss.executed_pct)
    for gain in (reaction.vss_without_reaction, reaction.vss_with_recourse, reaction.anticipation):
        yield from (*_estimate(gain), gain.pct)
    best = reaction.best
    yield from _estimate(Estimate(mean=best.mean, ci95=best.ci95)) if best.over is not None else (None, None, None)


def _estimate(found: Estimate) -> tuple[Cell, Cell, Cell]:
    return (found.mean, *(found.ci95 or (None, None)))
