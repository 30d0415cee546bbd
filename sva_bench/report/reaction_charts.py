"""Charts of teams that react."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.results import Estimate
from sva_bench.choices import NEWS
from sva_bench.palette import hex_of, plan_color
from sva_bench.report.panels import Axes, Panel, Point, panels
from sva_bench.report.reaction_shares import recourse_pct, tell, vss_pct, without_pct
from sva_bench.report.reaction_wording import AnyReacting, Reacting
from sva_bench.report.rows_chart import Dot, Row, Span, rows_chart
from sva_bench.report.wording import with_interval

MOST_SCENARIOS = 8
"""Scenarios that a chart of rows shows."""


def vss_against_news(rows: Sequence[Reacting], caption: str) -> str:
    """Points with intervals: VSS without reaction, and by the kind of news from the worst to the best informed.

    In incentive where some base is too little for per cent.
    """
    heard = [news for news in NEWS if any(row.reaction.news == news for row in rows)]
    pct = tell(share for row in rows for share in (vss_pct(row.reaction), without_pct(row.reaction)))
    shown = []
    for scenario in dict.fromkeys(row.scenario.name for row in rows):
        found: dict[int, Estimate | None] = {}
        for _, reaction in (row for row in rows if row.scenario.name == scenario):
            found.setdefault(0, without_pct(reaction) if pct else reaction.vss_without_reaction)
            found[1 + heard.index(reaction.news)] = vss_pct(reaction) if pct else reaction.vss.executed
        points = [Point(x=float(at), y=value.mean, interval=value.ci95, shape="round" if at else "hollow",
                        said=f"{['no reaction', *heard][at]}: {with_interval(value)}")
                  for at, value in sorted(found.items()) if value is not None]
        shown.append(Panel(title=scenario, points=points))
    unit = "per cent" if pct else "incentive"
    axes = Axes(x="VSS [% of the stochastic plan] by news" if pct else "VSS [incentive] by news", zero=True,
                joined=True, places=[(float(at), word) for at, word in enumerate(["none", *heard])])
    return panels(f"VSS in {unit} without reaction and by the kind of news, with 95 % intervals", axes, shown, caption)


def recourse_by_plan(rows: Sequence[AnyReacting]) -> str:
    """Points with intervals: what reacting adds to each plan, a row for each scenario, kind of news and plan.

    In incentive where some base is too little for per cent.
    """
    first = list(dict.fromkeys(row.scenario.name for row in rows))[:MOST_SCENARIOS]
    kept = [row for row in rows if row.scenario.name in first]
    pct = tell(recourse_pct(reaction, name) for _, reaction in kept for name in reaction.plans)
    several = len({row.reaction.news for row in kept}) > 1
    shown = []
    for scenario, reaction in kept:
        for number, name in enumerate(reaction.plans):
            gain = recourse_pct(reaction, name) if pct else reaction.value_of_recourse[name]
            if gain is None:
                continue
            colour, told = hex_of(plan_color(name, number)), with_interval(gain)
            spans = [] if gain.ci95 is None else [
                Span(low=gain.ci95[0], high=gain.ci95[1], said=f"95 % interval: {told}", colour=colour)]
            shown.append(Row(label=f"{name}, {reaction.news} news" if several else name, told=told,
                             group=scenario.name, marks=[*spans, Dot(at=gain.mean, said=f"mean: {told}",
                                                                     colour=colour)]))
    unit = "per cent of its value without reaction" if pct else "incentive"
    return rows_chart(f"Value of recourse of each plan in {unit}, by scenario and kind of news, with 95 % intervals",
                      "value of recourse " + ("[% of the plan's value without]" if pct else "[incentive]"), shown,
                      zero=True)
