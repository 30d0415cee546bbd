"""What each source of noise, and other robots, did to each plan, largest first."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from sva_bench.analysis.plan_names import shown_name
from sva_bench.analysis.results import PlanResult, SourceEffect
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.choices import MET_NAMES, SourceName
from sva_bench.report.page import heading, note, table
from sva_bench.report.told_columns import NOTHING, difference, told_columns
from sva_bench.report.wording import listed

SOURCES_HEAD = ("scenario", "plan", "source", "value", "route times [s]")

_MOST_NAMED = 3
_OF_OTHERS = ("Waits, detours and collisions are what other robots did: with them less each one alone from its berth, "
              "by the twin. Detours: what legs that led another way than the shortest took longer. Waits: the rest, "
              "for robots on their ways, at stations and where one stands for good.")

Scenarios = Sequence[ScenarioSummary | ComparedScenario]


def source_rows(scenarios: Scenarios) -> list[list[str]]:
    """A row for each scenario, plan and source; none without noise.

    The sources of a scenario stand in the same order under each plan: by their effects on all of them, largest first.
    """
    return [[scenario.name, shown_name(scenario, name), source, _signed(plan.sources[source].incentive),
             _signed(plan.sources[source].seconds)]
            for scenario in scenarios for order in [_largest_first(scenario.plans.values())]
            for name, plan in scenario.plans.items() for source in order if source in plan.sources]


def _largest_first(plans: Iterable[PlanResult]) -> list[SourceName]:
    """Sources by their effects over plans, as a sum of sizes: what helps one plan and harms another is no small one."""
    sizes: dict[SourceName, tuple[float, float]] = {}
    for plan in plans:
        for source, effect in plan.sources.items():
            incentive, seconds = sizes.get(source, (0.0, 0.0))
            sizes[source] = incentive + abs(effect.incentive), seconds + abs(effect.seconds)
    return sorted(sizes, key=lambda source: (source == "interplay", *(-size for size in sizes[source])))


def _signed(figure: float) -> str:
    return f"{round(figure, 1) + 0.0:+.1f}"


def source_title(rows: Sequence[Sequence[str]]) -> str:
    """What the table of these rows is called."""
    return "What noise and other robots did" if _met(rows) else "What each source of noise did"


def _met(rows: Sequence[Sequence[str]]) -> bool:
    return any(row[2] in MET_NAMES for row in rows)


def source_section(scenarios: Scenarios) -> list[str]:
    """The section of the page: a column for each source, of those that did anything."""
    rows = source_rows(scenarios)
    if not rows:
        return []
    value, seconds = (_pivoted(scenarios, read) for read in (lambda effect: effect.incentive,
                                                            lambda effect: effect.seconds))
    tables = [table(head, cells, sections=[s.name for s in scenarios for plan in s.plans.values() if plan.sources],
                    caption=caption) for (head, cells), caption in (
        (value, "Value: with the source less without it"), (seconds, "Route times [s]: how much longer routes take"))
        if len(head) > 1]
    if not tables:
        return [heading(source_title(rows)), note(costliest(scenarios))]
    return [heading(source_title(rows)), note(costliest(scenarios)), *tables,
            *([note(_OF_OTHERS)] if _met(rows) else []),
            note(f"{NOTHING}: nothing, to the digit shown; sources of nothing else are left out. Value: in the same "
                 "trials and noise draws, by the noisy twin; of contact, floors and payload, executed less by the "
                 "twin. Interplay: what is due to no source by itself. The values add up to executed less expected "
                 "less draws. Route times: of the team's routes, driven whole, waits included.")]


def _pivoted(scenarios: Scenarios, read: Callable[[SourceEffect], float]) -> tuple[list[str], list[list[str]]]:
    """Headings and cells: a row for each scenario and plan, a column for each source that did anything to one."""
    order = _largest_first([plan for scenario in scenarios for plan in scenario.plans.values()])
    rows = [[shown_name(scenario, name), *(
        difference(read(plan.sources[source])) if source in plan.sources else "" for source in order)]
        for scenario in scenarios for name, plan in scenario.plans.items() if plan.sources]
    return told_columns(["plan", *order], rows, (0,))


def costliest(scenarios: Scenarios) -> str:
    """The source that costs most, of all plans; of those that are equal as printed, each."""
    costs = [(effect.incentive, source, f"the {shown_name(scenario, name)} plan in {scenario.name}")
             for scenario in scenarios for name, plan in scenario.plans.items()
             for source, effect in plan.sources.items() if source != "interplay"]
    most = _signed(min((cost for cost, _, _ in costs), default=0.0))
    if not most.startswith("-"):
        noise = not any(source in MET_NAMES for _, source, _ in costs)
        return f"No source {'of noise ' if noise else ''}by itself costs any plan anything."
    where: dict[str, list[str]] = {}
    for cost, source, plan in costs:
        if _signed(cost) == most:
            where.setdefault(source, []).append(plan)
    if len(where) == 1:
        ((alone, plans),) = where.items()
        alone_costs = f"themselves, {alone} cost" if alone in MET_NAMES else f"itself, {alone} costs"
        return f"By {alone_costs} most: {most[1:]} of {_listed(plans)}."
    if len({tuple(plans) for plans in where.values()}) == 1:
        plans = next(iter(where.values()))
        return f"By themselves, {listed(list(where))} cost most, as much as each other: {most[1:]} of {_listed(plans)}."
    told = listed([f"{source} ({_listed(plans)})" for source, plans in where.items()])
    return f"By themselves, {told} cost most, as much as each other: {most[1:]}."


def _listed(plans: list[str]) -> str:
    left = len(plans) - _MOST_NAMED
    return listed(plans if left <= 0 else [*plans[:_MOST_NAMED], f"{left} more"])
