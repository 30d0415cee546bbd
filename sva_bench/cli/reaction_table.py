"""What reacting is worth, on the terminal."""

from __future__ import annotations

from rich.console import Console

from sva_bench.analysis.reaction_results import ReactionResult
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.summaries import ComparisonSummary, Summary
from sva_bench.cli.sheets import Column, Sheet, print_sheet
from sva_bench.report.compared_reactions import given_reacting, reaction_lines
from sva_bench.report.reaction_shares import (
    difference_pct,
    doubted,
    lead_of,
    leads,
    recourse_pct,
    tell,
    vss_pct,
    without_pct,
)
from sva_bench.report.reaction_wording import (
    GivenReacting,
    Reacting,
    changed,
    doubles,
    reacting,
    reaction_answers,
    reaction_assumptions,
)
from sva_bench.report.wording import DOUBTED, listed, with_interval

_MOST_NAMED = 6


def print_reactions(summary: Summary, console: Console, *, wide: bool = False) -> None:
    """Print what planning for failures is worth to a team that re-plans; nothing where none does."""
    rows = reacting(summary)
    if not rows:
        return
    for policy in dict.fromkeys(row.reaction.policy for row in rows):
        print_sheet(reaction_table([row for row in rows if row.reaction.policy == policy]), console, wide=wide,
                    apart=True)
    console.print("Adds: value of recourse of the stochastic and the deterministic plan; in per cent, of its value "
                  "without reaction. VSS, and the lead of the best plan tried over the next: in per cent of the "
                  "stochastic plan's value. All in incentive where the value in question is too "
                  "little for per cent. Orders change: in so many per cent of missions. "
                  f"{DOUBTED}: not distinguishable from zero.", highlight=False)
    for said in (*map(str, reaction_answers(summary)), *reaction_assumptions(summary)):
        console.print(said, highlight=False)
    if twice := doubles(rows):
        more = [f"{len(twice) - _MOST_NAMED} more in report.html"] if len(twice) > _MOST_NAMED else []
        console.print(f"POIs visited by two robots: {listed([*twice[:_MOST_NAMED], *more])}.", highlight=False)


def print_given_reactions(summary: ComparisonSummary, console: Console, *, wide: bool = False) -> None:
    """Print what reacting makes of given plans; nothing where nobody reacts."""
    rows = given_reacting(summary)
    for policy in dict.fromkeys(row.reaction.policy for row in rows):
        print_sheet(given_table([row for row in rows if row.reaction.policy == policy]), console, wide=wide,
                    apart=True)
    for said in reaction_lines(summary):
        console.print(said, highlight=False, markup=False)


def given_table(rows: list[GivenReacting]) -> Sheet:
    """Each given plan under each kind of news: its value, what re-planning adds, its rank, and how often orders change.

    What is added is in per cent of the plan's value without reaction, in incentive where that tells nothing.
    """
    pct = tell(recourse_pct(reaction, name) for _, reaction in rows for name in reaction.plans)
    cells, ends = list[list[str]](), set[int]()
    for number, (scenario, reaction) in enumerate(rows):
        first = not number or rows[number - 1].scenario is not scenario
        ranks = {row.plan: row.rank for row in reaction.ranking}
        for k, (name, plan) in enumerate(reaction.plans.items()):
            gain = reaction.value_of_recourse[name]
            cells.append([scenario.name if first and not k else "", "" if k else reaction.news, name,
                          with_interval(plan.executed), _mean(recourse_pct(reaction, name) if pct else gain),
                          str(ranks[name]), f"{100 * plan.reacted:.0f}"])
        if number == len(rows) - 1 or rows[number + 1].scenario is not scenario:
            ends.add(len(cells) - 1)
    return Sheet(title=f"If the team re-plans (policy {rows[0].reaction.policy})", rows=cells, ends=frozenset(ends),
                 columns=[Column(heading="scenario", words=True, above=True), Column(heading="news", words=True),
                          Column(heading="plan", words=True, above=True), Column(heading="executed [95 %]"),
                          Column(heading="adds [%]" if pct else "adds"), Column(heading="rank"),
                          Column(heading="orders\nchange [%]", last=1)])


def reaction_table(rows: list[Reacting]) -> Sheet:
    """VSS against news, what re-planning adds to each of the two plans, and the best plan."""
    pct = all(tell(own for own, _ in _figures(reaction)[:4 if reaction.best.over is None else 5])
              for _, reaction in rows)
    unit = "in per cent" if pct else "in incentive"
    cells, ends = list[list[str]](), set[int]()
    for number, (scenario, reaction) in enumerate(rows):
        vss, without, sto, det, lead = (own if pct else plain for own, plain in _figures(reaction))
        if not number or rows[number - 1].scenario is not scenario:
            cells.append([scenario.name, "none", _vss(reaction, without), *[""] * 5])
        told = reaction.best.over is not None
        cells.append(["", reaction.news, _vss(reaction, vss), _mean(sto), _mean(det),
                      _best(reaction), _mean(lead) if told else "", changed(reaction)])
        if number == len(rows) - 1 or rows[number + 1].scenario is not scenario:
            ends.add(len(cells) - 1)
    return Sheet(title=f"If the team re-plans (policy {rows[0].reaction.policy}), {unit}", rows=cells,
                 ends=frozenset(ends), columns=[
        Column(heading="scenario", words=True, above=True), Column(heading="news", words=True),
        Column(heading="VSS [95 %]"), Column(heading="adds to\nsto."), Column(heading="adds to\ndet."),
        Column(heading="best plan", words=True), Column(heading="lead", last=2),
        Column(heading="orders\nchange", last=1)])


def _figures(reaction: ReactionResult) -> list[tuple[Estimate | None, Estimate]]:
    """VSS with and without reaction, what it adds to the two plans, and the lead: in per cent, and in incentive."""
    gains, ahead = reaction.value_of_recourse, lead_of(reaction)
    return [(vss_pct(reaction), reaction.vss.executed), (without_pct(reaction), reaction.vss_without_reaction),
            *((recourse_pct(reaction, name), gains[name]) for name in ("stochastic", "deterministic")),
            (difference_pct(reaction, ahead), ahead)]


def _best(reaction: ReactionResult) -> str:
    """The best plan tried, where it leads distinguishably."""
    if reaction.best.over is None:
        return "all alike"
    return reaction.best.plan if leads(reaction) or reaction.best.ci95 is None else "undecided"


def _vss(reaction: ReactionResult, found: Estimate | None) -> str:
    return "same plan" if reaction.vss.same_plan else doubted(found)


def _mean(found: Estimate | None) -> str:
    return doubted(found, lambda shown: f"{shown.mean:.1f}")
