"""Summaries as tables on the terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from rich.console import Console

from sva_bench.analysis.catalogue import statistics
from sva_bench.analysis.plan_names import shown_name, shown_over
from sva_bench.analysis.reach import lost_robots, unused_told
from sva_bench.analysis.results import GivenPlanResult
from sva_bench.analysis.scenarios import ComparedScenario
from sva_bench.analysis.summaries import AnySummary, ComparisonSummary, Summary
from sva_bench.choices import FailureProcess
from sva_bench.cli.reaction_table import print_given_reactions, print_reactions
from sva_bench.cli.sheets import Column, Sheet, fitted, print_sheet
from sva_bench.cli.terminal import results
from sva_bench.files.printable import counted
from sva_bench.report.calibration_page import calibration_lines
from sva_bench.report.doubts import CONTRADICTED, contradictions, costless_ends, failed_physics, upset_by_noise
from sva_bench.report.interaction_section import INTERACTION_HEAD, interaction_table, interaction_told
from sva_bench.report.source_table import SOURCES_HEAD, source_rows, source_title
from sva_bench.report.wording import (
    ASSUMPTION_HEAD,
    DOUBTED_TOLD,
    answer,
    assumption_rows,
    cell,
    dependent_robots,
    doubts_told,
    ranked,
    remarks,
    vss_verdict,
)
from sva_bench.world.model import World

_MOST_ROBOTS = 6
"""Robots that have a row in each scenario where there is no room for a column each."""


def print_summary(
    summary: AnySummary, *, sources: bool = False, wide: bool = False, world: World | None = None,
    unused: Sequence[str] = (),
) -> None:
    """Print a summary as a table, and what it comes to.

    Args:
        summary: The summary.
        sources: Whether to say what noise and robots did to each plan, too.
        wide: Whether to show all columns, however wide that is.
        world: Its world, if at hand.
        unused: Robots that every plan leaves at home.
    """
    console, travel = results(), summary.travel
    robots = list(summary.scenarios[0].availability)
    _print_plans(summary, robots, console, wide=wide)
    if doubts_told(summary.scenarios):
        console.print(DOUBTED_TOLD, highlight=False)
    if isinstance(summary, ComparisonSummary):
        console.print("Robots lost: of so many robot missions, those that left the base and never came back; one that "
                      "fails at the base is not lost.", highlight=False)
    console.print(f"{counted(travel.pairs, 'travel time')}, {travel.triangle_violations_pct:.1f} % repaired, by up to "
                  f"{travel.max_excess_pct:.1f} %. {processes_told(summary)}", highlight=False)
    for said in dependent_robots(world, summary) if world else ():
        console.print(said, highlight=False, markup=False)
    for said in unused_told(unused, summary):
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
        print_given_reactions(summary, console, wide=wide)
    else:
        for said in calibration_lines(summary):
            console.print(said, highlight=False, markup=False)
        print_reactions(summary, console, wide=wide)
        _print_assumptions(summary, console, wide=wide)
    if sources:
        _print_sources(summary, console, wide=wide)
        _print_interaction(summary, console, wide=wide)
    if not summary.reproducible:
        console.print("A solve met its limit: these plans may differ on another machine.", highlight=False)


_FAIL: Mapping[FailureProcess, str] = {
    "mission": "for a whole mission", "per_leg": "before each POI", "hazard": "at any time while driving"}


def processes_told(summary: AnySummary) -> str:
    """When robots fail, as plans expect it and in execution; what given plans expect is not known."""
    planned, executed = summary.failure.plan, summary.failure.execute
    if isinstance(summary, ComparisonSummary):
        return f"Robots may fail {_FAIL[executed]}."
    if planned == executed:
        return f"Robots may fail {_FAIL[executed]}, as plans expect it."
    return f"Plans expect that robots may fail {_FAIL[planned]}; in execution they may fail {_FAIL[executed]}."


def _print_plans(summary: AnySummary, robots: Sequence[str], console: Console, *, wide: bool) -> None:
    """Print the table of plans; robots that find no room in it have a table of their own."""
    beside = _plans_sheet(summary, robots)
    if wide or not fitted(beside, console.width)[1]:
        print_sheet(beside, console, wide=wide)
        return
    print_sheet(_plans_sheet(summary, []), console)
    print_sheet(_robots_sheet(summary, robots[:_MOST_ROBOTS]), console)
    if len(robots) > _MOST_ROBOTS:
        console.print(f"{counted(len(robots) - _MOST_ROBOTS, 'robot')} of {len(robots)} left out of the table for want "
                      "of room; --wide, summary.json and report.html have all.", highlight=False)


def _plans_sheet(summary: AnySummary, robots: Sequence[str]) -> Sheet:
    scenarios, shown = summary.scenarios, statistics("terminal")
    compared, given = isinstance(summary, Summary), not isinstance(summary, Summary)  # given plans may lose robots
    rows, ends = list[list[str]](), set[int]()
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
            rows.append(["" if number else scenario.name, shown_name(scenario, name) + proof,
                         *([lost] if given else []), *(cell(entry, plan) for entry in shown),
                         *(f"{plan.by_robot[robot]:.1f}" for robot in robots), *(worth if compared else [])])
        ends.add(len(rows) - 1)
    spare = {"promised": 1, "expected": 2}
    return Sheet(rows=rows, ends=frozenset(ends), title=f"{summary.world}, seed {summary.seed}: "
                 f"{counted(summary.trials, 'trial')}, {counted(summary.rollouts, 'rollout')}, {summary.fidelity}",
                 columns=[Column(heading="scenario", words=True, above=True),
                          Column(heading="plan", words=True, above=True),
                          *([Column(heading="robots lost")] if given else []),
                          *(Column(heading=f"{entry.heading} [95 %]" if entry.interval else entry.heading,
                                   last=spare.get(entry.key, 0)) for entry in shown),
                          *(Column(heading=robot, last=5) for robot in robots),
                          *([Column(heading="VSS executed [95 %]"), Column(heading="VSS modelled", last=3),
                             Column(heading="EVPI", last=4)] if compared else [])])


def _robots_sheet(summary: AnySummary, robots: Sequence[str]) -> Sheet:
    """What each robot collects in each plan, a row a robot: names may be long."""
    plans = list(summary.scenarios[0].plans)
    rows = [["" if number else scenario.name, robot,
             *(f"{scenario.plans[name].by_robot[robot]:.1f}" if name in scenario.plans else "" for name in plans)]
            for scenario in summary.scenarios for number, robot in enumerate(robots)]
    return Sheet(title="Value by robot", rows=rows, columns=[
        Column(heading="scenario", words=True, above=True), Column(heading="robot", words=True, above=True),
        *(Column(heading=shown_over(summary.scenarios, name)) for name in plans)])


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


def _print_sources(summary: AnySummary, console: Console, *, wide: bool) -> None:
    if rows := source_rows(summary.scenarios):
        print_sheet(_named(source_title(rows), SOURCES_HEAD, rows, 3), console, wide=wide, apart=True)


def _print_interaction(summary: AnySummary, console: Console, *, wide: bool) -> None:
    if rows := interaction_table(summary.scenarios):
        print_sheet(_named("What robots did to each other, a mission", INTERACTION_HEAD, rows, 2), console, wide=wide,
                    apart=True)


def _print_assumptions(summary: Summary, console: Console, *, wide: bool) -> None:
    if rows := assumption_rows(summary.scenarios):
        print_sheet(_named("Plans under the failures they were made for and under the others", ASSUMPTION_HEAD, rows,
                           4), console, wide=wide, apart=True)


def _named(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], words: int) -> Sheet:
    """A table whose first columns are of words; scenario and plan are said once."""
    said = [["" if k and column < 2 and row[:column + 1] == rows[k - 1][:column + 1] else text
             for column, text in enumerate(row)] for k, row in enumerate(rows)]
    return Sheet(title=title, rows=said, columns=[
        Column(heading=heading, words=k < words, above=k < 2) for k, heading in enumerate(head)])
