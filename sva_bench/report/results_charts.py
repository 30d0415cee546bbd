"""Charts of results that need no plotting library: plans against each other, over trials and over maps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import accumulate

from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.palette import hex_of, plan_color
from sva_bench.report.main_tables import named
from sva_bench.report.rows_chart import Dot, Row, Span, Steps, rows_chart
from sva_bench.report.wording import per_cent, vss_verdict, with_interval
from sva_bench.storage.trial_counts import TrialCounts

AnyScenario = ScenarioSummary | ComparedScenario

MOST_DOTS = 24
"""Different values of trials that are shown one by one; more are shown as an empirical distribution."""
_MOST_STEPS = 240  # of an empirical distribution: more can't be told apart
_LETTER = 0.02  # of the width of a chart: room that a letter of a share below a dot takes
_UNITS = "[world file's units]"


def plans_compared(scenarios: Sequence[AnyScenario]) -> str:
    """Points with intervals: the value of each plan, scenario by scenario (Figure 8 of the paper)."""
    rows = []
    for scenario in scenarios:
        for number, (name, plan) in enumerate(scenario.plans.items()):
            colour, told = hex_of(plan_color(name, number)), with_interval(plan.executed)
            spans = [] if plan.executed.ci95 is None else [
                Span(low=plan.executed.ci95[0], high=plan.executed.ci95[1], said=f"95 % interval: {told}",
                     colour=colour)]
            rows.append(Row(label=named(scenario, name), told=told, group=scenario.name, marks=[
                *spans, Dot(at=plan.executed.mean, said=f"mean: {told}", colour=colour)]))
    return rows_chart("Mean executed value of each plan in each scenario, with 95 % intervals", f"value {_UNITS}", rows)


def differences(scenarios: Sequence[ScenarioSummary]) -> str:
    """Points with intervals on a line of zero: the VSS, plain, variance-reduced and modelled."""
    rows = []
    for scenario in scenarios:
        found, reduced = scenario.vss.executed, scenario.vss.executed_controlled
        marks: list[Dot | Span] = []
        for each, colour, thin, what in ((found, "var(--ink)", False, "plain"),
                                         (reduced, "var(--edge)", True, "variance-reduced")):
            told = f"{what}: {with_interval(each)}"
            if each.ci95 is not None:
                marks.append(Span(low=each.ci95[0], high=each.ci95[1], said=told, colour=colour, thin=thin))
            marks.append(Dot(at=each.mean, said=told, colour=colour, radius=3.5,
                             shape="hollow" if thin else "round"))
        marks.append(Dot(at=scenario.vss.modelled, said=f"modelled: {scenario.vss.modelled:.1f}", shape="tick",
                         colour="var(--soft)"))
        rows.append(Row(label=scenario.name, told=vss_verdict(scenario.vss), marks=marks))
    return rows_chart("Value of the stochastic solution in each scenario: plain, variance-reduced and modelled",
                      f"VSS {_UNITS}", rows, zero=True)


def distributions(scenarios: Sequence[AnyScenario], counts: TrialCounts) -> str:
    """What single trials are worth: a dot for each value where they take few, else their empirical distribution."""
    rows = []
    spreads = [plan.distribution for scenario in scenarios for plan in scenario.plans.values()]
    letter = _LETTER * (max(each.greatest for each in spreads) - min(each.least for each in spreads))
    for scenario in scenarios:
        for number, (name, plan) in enumerate(scenario.plans.items()):
            colour, spread = hex_of(plan_color(name, number)), plan.distribution
            mean = Dot(at=plan.executed.mean, said=f"mean: {plan.executed.mean:.1f}", shape="tick")
            worst = Dot(at=spread.cvar10, said=f"mean of the worst tenth: {spread.cvar10:.1f}", shape="down")
            known = counts.values.get((scenario.name, name), ())
            rows.append(Row(
                label=named(scenario, name), group=scenario.name,
                told=f"mean {plan.executed.mean:.1f}, worst tenth {spread.cvar10:.1f}",
                marks=[*_of_trials(known, colour, letter), mean, worst] if known else [
                    Span(low=spread.q05, high=spread.q95, said="5 to 95 % of trials", colour=colour), mean, worst]))
    return rows_chart("What single trials are worth, by scenario and plan", f"value of a trial {_UNITS}", rows)


def _of_trials(known: Sequence[tuple[float, int]], colour: str, letter: float) -> list[Dot | Span | Steps]:
    trials = sum(count for _, count in known)
    if len(known) > MOST_DOTS:
        reached = [count / trials for count in accumulate(count for _, count in known)]
        step = -(-len(known) // _MOST_STEPS)
        kept = [*range(0, len(known) - 1, step), len(known) - 1]
        return [Steps(values=[known[k][0] for k in kept], shares=[reached[k] for k in kept], colour=colour,
                      said="share of trials that are worth at most this")]
    said = {value: per_cent(100 * count / trials) for value, count in known}
    labelled = _with_room(known, said, letter)
    return [Dot(at=value, said=f"{value:g}: {said[value]} of trials", colour=colour,
                radius=max(8.0 * math.sqrt(count / trials), 1.5), below=said[value] if value in labelled else "")
            for value, count in known]


def _with_room(known: Sequence[tuple[float, int]], said: Mapping[float, str], letter: float) -> set[float]:
    """Values below which there is room for their share, the most frequent first; between two a letter stays free."""
    kept: set[float] = set()
    for value, _ in sorted(known, key=lambda item: -item[1]):
        if all(abs(value - other) >= letter * (1 + (len(said[value]) + len(said[other])) / 2) for other in kept):
            kept.add(value)
    return kept


def over_maps(groups: Mapping[str, Mapping[str, Sequence[float]]], unit: str) -> str:
    """A dot for each map, and their mean: rows of variants, grouped by scenario."""
    rows = []
    for scenario, variants in groups.items():
        for variant, values in variants.items():
            mean = sum(values) / len(values)
            rows.append(Row(
                label=variant or f"{len(values)} map{'s' if len(values) > 1 else ''}", group=scenario,
                told=f"mean {mean:.1f}", marks=[
                    *(Dot(at=value, said=f"a map: {value:.1f}", radius=4.0, colour="var(--edge)") for value in values),
                    Dot(at=mean, said=f"mean: {mean:.1f}", shape="tick")]))
    return rows_chart("VSS over maps, by scenario", unit, rows, zero=True)
