"""Summaries as tables on the terminal."""

from __future__ import annotations

from collections import Counter

from rich.console import Console
from rich.table import Table
from rich.text import Text

from sva_bench.analysis.catalogue import statistics
from sva_bench.analysis.plan_names import shown_name, shown_over
from sva_bench.analysis.reach import lost_robots
from sva_bench.analysis.results import GivenPlanResult
from sva_bench.analysis.scenarios import ComparedScenario
from sva_bench.analysis.summaries import AnySummary, ComparisonSummary, Summary
from sva_bench.cli.reaction_table import print_given_reactions, print_reactions
from sva_bench.cli.terminal import results
from sva_bench.files.printable import counted
from sva_bench.report.calibration_page import calibration_lines
from sva_bench.report.doubts import CONTRADICTED, contradictions, costless_ends, failed_physics, upset_by_noise
from sva_bench.report.interaction_section import INTERACTION_HEAD, interaction_table, interaction_told
from sva_bench.report.source_table import SOURCES_HEAD, source_rows, source_title
from sva_bench.report.wording import (
    ASSUMPTION_HEAD,
    answer,
    assumed,
    assumption_rows,
    cell,
    dependent_robots,
    ranked,
    remarks,
    vss_verdict,
)
from sva_bench.world.model import World

_ALWAYS_SHOWN = 3
"""Robots that have a column however narrow the terminal is."""


def print_summary(summary: AnySummary, *, wide: bool = False, world: World | None = None) -> None:
    """Print a summary as a table, and what it comes to; ``wide``: what noise and robots did to each plan, too."""
    console, travel = results(), summary.travel
    robots = list(summary.scenarios[0].availability)
    shown = _robots_that_fit(summary, console, robots)
    console.print(_plans_table(summary, shown))
    if len(shown) < len(robots):
        console.print(f"{counted(len(robots) - len(shown), 'robot')} of {len(robots)} left out of the table for want "
                      "of room; summary.json and report.html have all.", highlight=False)
    console.print(f"{counted(travel.pairs, 'travel time')}, {travel.triangle_violations_pct:.1f} % repaired, by up to "
                  f"{travel.max_excess_pct:.1f} %; {assumed(summary)}.", highlight=False)
    for said in dependent_robots(world, summary) if world else ():
        console.print(said, highlight=False, markup=False)
    _print_unhappy(summary, console)
    if told := interaction_told(summary.scenarios):
        console.print(told, highlight=False)
    if isinstance(summary, ComparisonSummary):
        for scenario in summary.scenarios:
            if scenario.comparisons:
                console.print(f"{scenario.name}: {ranked(scenario)}", highlight=False, markup=False)
    console.print(answer(summary), highlight=False)
    for said in contradictions(summary):
        console.print(f"{CONTRADICTED} {said}", highlight=False)
    for said in (*failed_physics(summary), *upset_by_noise(summary), *remarks(summary)):
        console.print(said, highlight=False)
    if isinstance(summary, ComparisonSummary):
        print_given_reactions(summary, console)
    else:
        for said in calibration_lines(summary):
            console.print(said, highlight=False, markup=False)
        print_reactions(summary, console)
        _print_assumptions(summary, console)
    if wide:
        _print_sources(summary, console)
        _print_interaction(summary, console)
    if not summary.reproducible:
        console.print("A solve met its limit: these plans may differ on another machine.", highlight=False)


def _robots_that_fit(summary: AnySummary, console: Console, robots: list[str]) -> list[str]:
    """The first robots that have room for a column each; a table that is too wide would lose the figures of all."""
    def fits(count: int) -> bool:
        wanted = _plans_table(summary, robots[:count]).columns
        widths = [max(Text(str(cell)).cell_len for cell in (column.header, *column.cells)) for column in wanted]
        return sum(widths) + 3 * len(widths) + 1 <= console.width

    # Few robots are shown as ever: their headings and intervals wrap where it is narrow.
    least = min(len(robots), _ALWAYS_SHOWN)
    return robots[:max(least, next((count for count in range(len(robots), 0, -1) if fits(count)), 0))]


def _plans_table(summary: AnySummary, robots: list[str]) -> Table:
    scenarios, shown = summary.scenarios, statistics("terminal")
    compared, given = isinstance(summary, Summary), not isinstance(summary, Summary)  # given plans may lose robots
    table = Table(title=f"{summary.world}, seed {summary.seed}: {counted(summary.trials, 'trial')}, "
                        f"{counted(summary.rollouts, 'rollout')}, {summary.fidelity}", title_justify="left")
    for heading in ("scenario", "plan", *(("robots lost",) if given else ()),
                    *(f"{entry.heading} [95 %]" if entry.interval else entry.heading for entry in shown),
                    *robots, *(("VSS executed [95 %]", "VSS modelled", "EVPI") if compared else ())):
        table.add_column(heading, justify="left" if heading in ("scenario", "plan") else "right")
    for scenario in scenarios:
        for number, (name, plan) in enumerate(scenario.plans.items()):
            proof = "" if plan.status in ("optimal", None) else f" ({plan.status})"
            lost, worth = "", ["", "", ""]
            if isinstance(plan, GivenPlanResult):
                # How far a given plan was proved is not said: "feasible" would look as if the others weren't.
                proof, lost = "" if plan.feasible else " (infeasible)", lost_robots(plan)
            if not number and not isinstance(scenario, ComparedScenario):
                worth = [vss_verdict(scenario.vss), f"{scenario.vss.modelled:.1f}",
                         "" if scenario.evpi is None else f"{scenario.evpi:.1f}"]
            table.add_row(
                "" if number else scenario.name, shown_name(scenario, name) + proof, *((lost,) if given else ()),
                *(cell(entry, plan) for entry in shown), *(f"{plan.by_robot[robot]:.1f}" for robot in robots),
                *(worth if compared else ()), end_section=number == len(scenario.plans) - 1)
    return table


def _print_unhappy(summary: AnySummary, console: Console) -> None:
    """Say how many missions ended otherwise than home or by draw."""
    missions, unhappy = set[int](), []
    for name in summary.scenarios[0].plans:
        ends: Counter[str] = Counter()
        for scenario in summary.scenarios:
            ends.update(scenario.plans[name].ends)
        missions.add(ends.total())
        bad = [f"{ends[end]} {end.replace('_', ' ')}" for end in ("out_of_fuel", "late", "stuck") if ends[end]]
        if bad:
            unhappy.append(f"{shown_over(summary.scenarios, name)} {', '.join(bad)}")
    if unhappy:
        many = " or ".join(map(str, sorted(missions)))
        of_each = " of each plan" if len(summary.scenarios[0].plans) > 1 else ""
        console.print(f"Of {many} robot missions{of_each} ended otherwise than home or by draw: "
                      f"{'; '.join(unhappy)}.", highlight=False)
    for said in costless_ends(summary.scenarios):
        console.print(said, highlight=False, markup=False)


def _print_sources(summary: AnySummary, console: Console) -> None:
    if rows := source_rows(summary.scenarios):
        table = Table(title=source_title(rows), title_justify="left")
        for number, heading in enumerate(SOURCES_HEAD):
            table.add_column(heading, justify="left" if number < 3 else "right")
        for row in rows:
            table.add_row(*row)
        console.print(table)


def _print_interaction(summary: AnySummary, console: Console) -> None:
    if rows := interaction_table(summary.scenarios):
        table = Table(title="What robots did to each other, a mission", title_justify="left")
        for number, heading in enumerate(INTERACTION_HEAD):
            table.add_column(heading, justify="left" if number < 2 else "right")
        for row in rows:
            table.add_row(*row)
        console.print(table)


def _print_assumptions(summary: Summary, console: Console) -> None:
    if rows := assumption_rows(summary.scenarios):
        crossed = Table(title="Plans under the failures they were made for and under the others", title_justify="left")
        for number, heading in enumerate(ASSUMPTION_HEAD):
            crossed.add_column(heading, justify="left" if number < 4 else "right")
        for row in rows:
            crossed.add_row(*row)
        console.print(crossed)
