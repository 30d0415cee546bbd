"""Summaries in a few lines, and as a table of a notebook."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.calibration import Calibration
from sva_bench.analysis.plan_names import shown_name
from sva_bench.analysis.reaction_results import ComparedReaction, ReactionResult
from sva_bench.analysis.results import PlanFigures, ScenarioPlans, Share, VssFigures
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.files.notebook import notebook_table
from sva_bench.files.printable import counted

_HEAD = ("scenario", "plan", "promised", "expected", "executed [95 %]", "VSS executed [95 %]")
_MOST_LINES = 10


def headline(world: str, seed: int, trials: int, rollouts: int, fidelity: str) -> str:
    """What was executed."""
    return f"{world}, seed {seed}: {counted(trials, 'trial')}, {counted(rollouts, 'rollout')}, {fidelity}"


def lines_of(scenarios: Sequence[ScenarioPlans]) -> list[str]:
    """A line for each scenario: what each plan collected, and the VSS where there is one; one for each reaction."""
    lines = []
    for scenario in scenarios[:_MOST_LINES]:
        plans = ", ".join(f"{shown_name(scenario, name)} {_figure(plan.executed.mean, plan.executed.ci95)}"
                          for name, plan in scenario.plans.items())
        vss = _vss(scenario)
        lines.append(f"{scenario.name}: {plans}" + (f"; VSS {vss}" if vss else ""))
        lines += [f"  calibrated: {_calibrated(found)}"] if (found := _calibration(scenario)) else []
        lines += [f"  {reaction.name}: {_told(reaction)}" for reaction in _reactions(scenario)]
    more = len(scenarios) - _MOST_LINES
    return [*lines, f"and {more} more"] if more > 0 else lines


def table_of(title: str, scenarios: Sequence[ScenarioPlans]) -> str:
    """A row for each scenario and plan, and for each plan whose team reacts."""
    compared = any(isinstance(scenario, ComparedScenario) for scenario in scenarios)
    rows = []
    for scenario in scenarios:
        rows += [["" if number else scenario.name, shown_name(scenario, name), *_cells(plan),
                  *([] if compared else ["" if number else _vss(scenario)])]
                 for number, (name, plan) in enumerate(scenario.plans.items())]
        if found := _calibration(scenario):
            rows.append(["", _calibrated(found), *([""] * (len(_HEAD) - (3 if compared else 2)))])
        rows += [["", f"{name}, {reaction.name}", *_cells(plan), *(
            [] if isinstance(reaction, ComparedReaction) else ["" if number else _difference(reaction.vss)])]
                 for reaction in _reactions(scenario) for number, (name, plan) in enumerate(reaction.plans.items())]
    return notebook_table(title, _HEAD[:-1] if compared else _HEAD, rows)


def _cells(plan: PlanFigures) -> list[str]:
    return [f"{plan.promised:.1f}", f"{plan.expected:.1f}", _figure(plan.executed.mean, plan.executed.ci95)]


def _reactions(scenario: ScenarioPlans) -> tuple[ReactionResult | ComparedReaction, ...]:
    return scenario.reactions or () if isinstance(scenario, ScenarioSummary | ComparedScenario) else ()


def _calibration(scenario: ScenarioPlans) -> Calibration | None:
    return scenario.calibration if isinstance(scenario, ScenarioSummary) else None


def _calibrated(found: Calibration) -> str:
    """How often it goes wrong, beside the nominal plan."""
    missed = "" if found.reached else ", share not reached"
    return (f"{_percentage(found.bad)} of missions go wrong, of the nominal plan {_percentage(found.nominal.bad)}"
            f"{missed}")


def _percentage(found: Share) -> str:
    return _figure(100 * found.share, found.ci95 and (100 * found.ci95[0], 100 * found.ci95[1])) + " %"


def _told(reaction: ReactionResult | ComparedReaction) -> str:
    """The VSS and the best plan; of given plans, what each collected."""
    if isinstance(reaction, ComparedReaction):
        return ", ".join(f"{name} {_figure(plan.executed.mean, plan.executed.ci95)}"
                         for name, plan in reaction.plans.items())
    return f"VSS {_difference(reaction.vss)}; best plan tried: {reaction.best.plan}"


def _vss(scenario: ScenarioPlans) -> str:
    return _difference(scenario.vss) if isinstance(scenario, ScenarioSummary) else ""


def _difference(vss: VssFigures) -> str:
    return "0: the same plan" if vss.same_plan else _figure(vss.executed.mean, vss.executed.ci95)


def _figure(mean: float, interval: tuple[float, float] | None) -> str:
    return f"{mean:.1f}" if interval is None else f"{mean:.1f} [{interval[0]:.1f}, {interval[1]:.1f}]"
