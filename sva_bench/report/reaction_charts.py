"""Charts of teams that react."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.results import Estimate
from sva_bench.choices import NEWS
from sva_bench.palette import hex_of, plan_color
from sva_bench.report.panels import Axes, Panel, Point, panels
from sva_bench.report.reaction_shares import recourse_pct, tell, vss_pct, without_pct
from sva_bench.report.reaction_wording import AnyReacting, Reacting
from sva_bench.report.wording import with_interval


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


def recourse_by_plan(rows: Sequence[AnyReacting], caption: str) -> str:
    """Points with intervals: what reacting adds to each plan by the kind of news, a small chart for each scenario.

    In incentive where some base is too little for per cent.
    """
    heard = [news for news in NEWS if any(row.reaction.news == news for row in rows)]
    plans = list(dict.fromkeys(name for row in rows for name in row.reaction.plans))
    pct = tell(recourse_pct(reaction, name) for _, reaction in rows for name in reaction.plans)
    colours = {name: hex_of(plan_color(name, number)) for number, name in enumerate(plans)}
    shown: dict[str, list[Point]] = {}
    for scenario, reaction in rows:
        for number, name in enumerate(reaction.plans):
            gain = recourse_pct(reaction, name) if pct else reaction.value_of_recourse[name]
            if gain is not None:
                aside = _APART * (number - (len(reaction.plans) - 1) / 2)
                shown.setdefault(scenario.name, []).append(Point(
                    x=heard.index(reaction.news) + aside, y=gain.mean, interval=gain.ci95, colour=colours[name],
                    shape=_SHAPES[number % len(_SHAPES)],
                    said=f"{name}, {reaction.news} news: {with_interval(gain)}"))
    unit = "per cent of its value without reaction" if pct else "incentive"
    said = f"{caption} In {unit}."
    axes = Axes(x="news", zero=True, places=[(float(at), word) for at, word in enumerate(heard)],
                ends=(-0.5, len(heard) - 0.5),
                legend=[(colours[name], _SHAPES[number % len(_SHAPES)], name) for number, name in enumerate(plans)])
    return panels(f"Value of recourse of each plan in {unit}, by scenario and kind of news, with 95 % intervals", axes,
                  [Panel(title=scenario, points=points) for scenario, points in shown.items()],
                  said)


_APART = 0.14  # of plans under one kind of news
_SHAPES = ("round", "square", "up")
