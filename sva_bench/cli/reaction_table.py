"""What reacting is worth, on the terminal."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from sva_bench.analysis.results import VssFigures
from sva_bench.analysis.summaries import Summary
from sva_bench.report.reaction_wording import (
    DOUBTED,
    Reacting,
    changed,
    doubles,
    doubted,
    lead_pct,
    reacting,
    reaction_answers,
    reaction_assumptions,
    recourse_pct,
    vss_pct,
)
from sva_bench.report.wording import listed

_MOST_NAMED = 6


def print_reactions(summary: Summary, console: Console) -> None:
    """Print what planning for failures is worth to a team that re-plans; nothing where none does."""
    rows = reacting(summary)
    if not rows:
        return
    for policy in dict.fromkeys(row.reaction.policy for row in rows):
        console.print(reaction_table([row for row in rows if row.reaction.policy == policy]))
    console.print("Adds: value of recourse of the stochastic and the deterministic plan, in per cent of its value "
                  "without reaction. Lead: of the best plan tried over the next. Orders change: in so many missions. "
                  f"{DOUBTED}: not distinguishable from zero.", highlight=False)
    for said in (*map(str, reaction_answers(summary)), *reaction_assumptions(summary)):
        console.print(said, highlight=False)
    if twice := doubles(rows):
        more = [f"{len(twice) - _MOST_NAMED} more in report.html"] if len(twice) > _MOST_NAMED else []
        console.print(f"POIs visited by two robots: {listed([*twice[:_MOST_NAMED], *more])}.", highlight=False)


def reaction_table(rows: list[Reacting]) -> Table:
    """VSS against news, what re-planning adds to each of the two plans, and the best plan."""
    table = Table(title=f"If the team re-plans (policy {rows[0].reaction.policy}), in per cent", title_justify="left")
    for heading in ("scenario", "news", "VSS [95 %]", "adds to\nsto.", "adds to\ndet.", "best plan", "lead",
                    "orders\nchange"):
        words = heading in ("scenario", "news", "best plan")
        table.add_column(heading, justify="left" if words else "right", no_wrap=True)
    for number, (scenario, reaction) in enumerate(rows):
        first = not number or rows[number - 1].scenario is not scenario
        if first:
            table.add_row(scenario.name, "none", _vss(scenario.vss, scenario.stochastic.executed.mean), *[""] * 5)
        told = reaction.best.over is not None
        table.add_row(
            "", reaction.news, _vss(reaction.vss, reaction.plans["stochastic"].executed.mean),
            *(doubted(recourse_pct(reaction, name), lambda found: f"{found.mean:.1f}")
              for name in ("stochastic", "deterministic")),
            reaction.best.plan if told else "all alike",
            doubted(lead_pct(reaction), lambda found: f"{found.mean:.1f}") if told else "", changed(reaction),
            end_section=number == len(rows) - 1 or rows[number + 1].scenario is not scenario)
    return table


def _vss(vss: VssFigures, stochastic: float) -> str:
    return "same plan" if vss.same_plan else doubted(vss_pct(vss, stochastic))
