"""What each source of noise did to each plan, largest first."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.plan_names import shown_name
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.report.page import heading, note, table

SOURCES_HEAD = ("scenario", "plan", "source", "value", "route times [s]")

Scenarios = Sequence[ScenarioSummary | ComparedScenario]


def source_rows(scenarios: Scenarios) -> list[list[str]]:
    """A row for each scenario, plan and source, the largest effect first; none without noise."""
    return [[scenario.name, shown_name(scenario, name), source, _signed(effect.incentive), _signed(effect.seconds)]
            for scenario in scenarios for name, plan in scenario.plans.items()
            for source, effect in sorted(plan.sources.items(), key=lambda item: (
                item[0] == "interplay", -abs(item[1].incentive), -abs(item[1].seconds)))]


def _signed(figure: float) -> str:
    return f"{round(figure, 1) + 0.0:+.1f}"


def source_section(scenarios: Scenarios) -> list[str]:
    """The section of the page."""
    rows = source_rows(scenarios)
    if not rows:
        return []
    return [heading("What each source of noise did"), note(_sentence(scenarios)),
            table(SOURCES_HEAD, rows, words=(0, 1, 2)),
            note("Value: with the source less without it, in the same trials and noise draws, by the noisy twin; of "
                 "contact, floors and payload, executed less by the twin. Interplay: what is due to no source by "
                 "itself. The values add up to executed less expected less draws. Route times: how much longer the "
                 "team's routes take, driven whole, waits included.")]


def _sentence(scenarios: Scenarios) -> str:
    """The source that costs most, of all plans."""
    costs = [(effect.incentive, source, shown_name(scenario, name), scenario.name) for scenario in scenarios
             for name, plan in scenario.plans.items() for source, effect in plan.sources.items()
             if source != "interplay"]
    if not costs or min(costs)[0] >= 0:
        return "No source of noise by itself costs any plan anything."
    cost, source, plan, scenario = min(costs)
    return f"By itself, {source} costs most: {-cost:.1f} of the {plan} plan in {scenario}."
