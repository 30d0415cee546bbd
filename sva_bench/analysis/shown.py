"""Summaries in a few lines, and as a table of a notebook."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.results import ScenarioPlans
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.files.notebook import notebook_table
from sva_bench.files.printable import counted

_HEAD = ("scenario", "plan", "promised", "expected", "executed [95 %]", "VSS executed [95 %]")
_MOST_LINES = 10


def headline(world: str, seed: int, trials: int, rollouts: int, fidelity: str) -> str:
    """What was executed."""
    return f"{world}, seed {seed}: {counted(trials, 'trial')}, {counted(rollouts, 'rollout')}, {fidelity}"


def lines_of(scenarios: Sequence[ScenarioPlans]) -> list[str]:
    """A line for each scenario: what each plan collected, and the VSS where there is one."""
    lines = []
    for scenario in scenarios[:_MOST_LINES]:
        plans = ", ".join(f"{name} {_figure(plan.executed.mean, plan.executed.ci95)}"
                          for name, plan in scenario.plans.items())
        vss = _vss(scenario)
        lines.append(f"{scenario.name}: {plans}" + (f"; VSS {vss}" if vss else ""))
    more = len(scenarios) - _MOST_LINES
    return [*lines, f"and {more} more"] if more > 0 else lines


def table_of(title: str, scenarios: Sequence[ScenarioPlans]) -> str:
    """A row for each scenario and plan."""
    compared = any(isinstance(scenario, ComparedScenario) for scenario in scenarios)
    rows = [
        ["" if number else scenario.name, name, f"{plan.promised:.1f}", f"{plan.expected:.1f}",
         _figure(plan.executed.mean, plan.executed.ci95), *([] if compared else ["" if number else _vss(scenario)])]
        for scenario in scenarios for number, (name, plan) in enumerate(scenario.plans.items())]
    return notebook_table(title, _HEAD[:-1] if compared else _HEAD, rows)


def _vss(scenario: ScenarioPlans) -> str:
    if not isinstance(scenario, ScenarioSummary):
        return ""
    vss = scenario.vss
    return "0: the same plan" if vss.same_plan else _figure(vss.executed.mean, vss.executed.ci95)


def _figure(mean: float, interval: tuple[float, float] | None) -> str:
    return f"{mean:.1f}" if interval is None else f"{mean:.1f} [{interval[0]:.1f}, {interval[1]:.1f}]"
