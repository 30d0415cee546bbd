"""Charts of teams that react."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.results import Estimate
from sva_bench.choices import NEWS
from sva_bench.palette import hex_of, plan_color
from sva_bench.report.canvas import Axes, chart
from sva_bench.report.charts import columns_of, legend_of, marker
from sva_bench.report.reaction_shares import recourse_pct, tell, vss_pct, without_pct
from sva_bench.report.reaction_wording import AnyReacting, Reacting

MOST_SCENARIOS = 8
"""Scenarios that a chart shows: as many as there are shapes of points."""
_GREYS = ("#000000", "#7a7a7a")
_WIDTH_IN = 4.8  # narrow, so that its letters stay legible on a phone


def vss_against_news(rows: Sequence[Reacting]) -> str:
    """Points with intervals: VSS without reaction, and by the kind of news from the worst to the best informed.

    In incentive where some base is too little for per cent.
    """
    policy = rows[0].reaction.policy
    heard = [news for news in NEWS if any(row.reaction.news == news for row in rows)]
    scenarios = _first(rows)
    pct = tell(share for row in rows if row.scenario.name in scenarios
               for share in (vss_pct(row.reaction), without_pct(row.reaction)))

    def draw(axes: Axes) -> None:
        axes.axhline(0, color="#444", linewidth=1)
        for number, name in enumerate(scenarios):
            found: dict[int, Estimate | None] = {}
            for _, reaction in (row for row in rows if row.scenario.name == name):
                found.setdefault(0, without_pct(reaction) if pct else reaction.vss_without_reaction)
                found[1 + heard.index(reaction.news)] = vss_pct(reaction) if pct else reaction.vss.executed
            known = {at: value for at, value in found.items() if value is not None}
            beside = 0.5 * ((number + 0.5) / len(scenarios) - 0.5)
            at = [position + beside for position in sorted(known)]
            # Colours are those of plans, so scenarios are black or grey, and differ in shape.
            _points(axes, at, [known[position] for position in sorted(known)], number, _GREYS[number % 2], name,
                    joined=True)
        axes.set_xticks(range(len(heard) + 1), ["no reaction", *heard])
        axes.set_xlim(-0.5, len(heard) + 0.5)
        axes.set_ylabel("VSS [% of the stochastic plan]" if pct else "VSS [incentive]")
        axes.set_title(f"VSS by news, policy {policy}")
        axes.grid(axis="y", color="#ddd")
        _legend(axes)

    unit = "per cent" if pct else "incentive"
    return chart(f"vss-by-news-{policy}", f"VSS in {unit} without reaction and by the kind of news, a line for each "
                 "scenario, with 95 % intervals", (_WIDTH_IN, 3.8), draw)


def recourse_by_plan(rows: Sequence[AnyReacting]) -> str:
    """Points with intervals: what reacting adds to each plan, a row for each scenario and kind of news.

    In incentive where some base is too little for per cent.
    """
    policy = rows[0].reaction.policy
    kept = [row for row in rows if row.scenario.name in _first(rows)]
    plans = list(dict.fromkeys(name for row in kept for name in row.reaction.plans))
    pct = tell(recourse_pct(reaction, name) for _, reaction in kept for name in reaction.plans)

    def draw(axes: Axes) -> None:
        axes.axvline(0, color="#444", linewidth=1)
        for number, plan in enumerate(plans):
            known = [(k, value) for k, row in enumerate(kept)
                     if plan in row.reaction.plans and (value := (recourse_pct(
                         row.reaction, plan) if pct else row.reaction.value_of_recourse[plan])) is not None]
            beside = 0.64 * ((number + 0.5) / len(plans) - 0.5)
            _points(axes, [k + beside for k, _ in known], [value for _, value in known], number,
                    hex_of(plan_color(plan, number)), plan, across=True)
        for k in range(1, len(kept)):
            if kept[k].scenario is not kept[k - 1].scenario:
                axes.axhline(k - 0.5, color="#bbb", linewidth=0.8)
        axes.set_yticks(range(len(kept)), [f"{row.scenario.name}, {row.reaction.news}" for row in kept])
        axes.set_ylim(len(kept) - 0.5, -0.5)
        axes.set_xlabel("value of recourse " + ("[% of the plan's value]" if pct else "[incentive]"))
        axes.set_title(f"What reacting adds, policy {policy}")
        axes.grid(axis="x", color="#ddd")
        _legend(axes)

    unit = "per cent of its value without reaction" if pct else "incentive"
    return chart(f"recourse-{policy}", f"Value of recourse of each plan in {unit}, by scenario and kind of news, with "
                 "95 % intervals", (_WIDTH_IN, 1.5 + 0.36 * len(kept)), draw)


def _first(rows: Sequence[AnyReacting]) -> list[str]:
    """The names of the scenarios that a chart shows."""
    return list(dict.fromkeys(row.scenario.name for row in rows))[:MOST_SCENARIOS]


def _points(axes: Axes, at: Sequence[float], found: Sequence[Estimate], number: int, colour: str, label: str, *,
            joined: bool = False, across: bool = False) -> None:
    """Points with intervals, upright or across."""
    shape = marker(number)
    for place, value in zip(at, found, strict=True):
        if value.ci95 is not None:
            ends = (value.ci95, (place, place)) if across else ((place, place), value.ci95)
            axes.plot(*ends, color=colour, linewidth=2.4, solid_capstyle="butt")
    means = [value.mean for value in found]
    axes.plot(*((means, at) if across else (at, means)), marker=shape, color=colour, markersize=6.5,
              markeredgecolor="black", markeredgewidth=0.6, linestyle=":" if joined else "none", linewidth=1.2,
              label=label)


def _legend(axes: Axes) -> None:
    handles, labels = legend_of(axes)
    axes.figure.legend(handles, labels, loc="outside lower center", ncols=columns_of(labels, axes, 4), frameon=False,
                       fontsize=9, handlelength=1.8)
