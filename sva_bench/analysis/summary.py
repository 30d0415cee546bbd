"""Trials made into results: what was promised, what was executed, and what the stochastic plan is worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sva_bench.analysis.catalogue import measured
from sva_bench.analysis.figures import difference_figure, end_figures, value_figure
from sva_bench.analysis.moments import Figure
from sva_bench.analysis.results import (
    MOST_AMOUNT,
    Estimate,
    Ledger,
    PerfectInformation,
    PlanFigures,
    PlanResult,
    Promise,
    ScenarioFacts,
    ScenarioSummary,
    Share,
    Vss,
    VssFigures,
)
from sva_bench.analysis.statistics import controlled, distribution, estimate
from sva_bench.analysis.unseen import UNHAPPY
from sva_bench.arrays import FloatArray
from sva_bench.choices import ENDS, End
from sva_bench.execution.execute import Executed
from sva_bench.mission.plan import Plan


@dataclass(frozen=True, eq=False, kw_only=True)
class Judged:
    """A plan with its closed-form value and its execution.

    Attributes:
        expected: Closed-form value under the failure process executed.
        executed: Its trials.
        feasible: Whether it keeps within fuel and limit.
    """

    expected: float
    executed: Executed
    feasible: bool = True

    @property
    def promise(self) -> Promise:
        """What is known of it before any trial."""
        return promise_of(self.executed.case.plan, self.expected)


@dataclass(frozen=True, eq=False, kw_only=True)
class ScenarioTrials:
    """All trials of one scenario.

    Attributes:
        stochastic, deterministic: Those of the two plans.
        worst: Those of the deterministic plan that ties and is worth least; ``None`` where none is worth less.
        informed: The planner that knows beforehand who is available, where it was asked for.
    """

    stochastic: Executed
    deterministic: Executed
    worst: Executed | None = None
    informed: Judged | None = None


def scenario_summary(facts: ScenarioFacts, trials: ScenarioTrials, *, noisy: bool) -> ScenarioSummary:
    """One scenario of ``run``."""
    s, d, informed = trials.stochastic, trials.deterministic, trials.informed
    results = {"stochastic": plan_result(facts.plans["stochastic"], s, noisy=noisy),
               "deterministic": plan_result(facts.plans["deterministic"], d, noisy=noisy)}
    beyond = difference_figure(s, d, noisy=noisy)
    found = vss_figures(facts, results, estimate(beyond))
    ends = [found.executed.mean, *([float(np.mean(totals(s) - totals(trials.worst)))] if trials.worst else [])]
    spread = None if facts.modelled_range is None else (min(ends) + 0.0, max(ends) + 0.0)
    if informed is not None:
        results[informed.executed.case.planner] = plan_result(informed.promise, informed.executed, noisy=noisy)
    return ScenarioSummary(
        name=facts.name, availability=facts.availability, plans=results,
        vss=Vss(**vars(found), executed_range=spread,
                executed_controlled=controlled(beyond, facts.plans["stochastic"].expected
                                               - facts.plans["deterministic"].expected)),
        # The plan for the mean is the stochastic plan itself, drive for drive.
        vss_mean_value=facts.vss_mean_value, vss_mean_value_executed=facts.vss_mean_value, ws=facts.ws,
        evpi=facts.evpi, value_of_process=facts.value_of_process,
        evpi_executed=None if informed is None else _beyond(informed.executed, s, noisy=noisy))


def vss_figures(facts: ScenarioFacts, plans: Mapping[str, PlanFigures], difference: Estimate) -> VssFigures:
    """The value of the stochastic solution.

    Args:
        facts: What is known of the scenario without trials.
        plans: What came of the stochastic and the deterministic plan.
        difference: What the first collected beyond the second.
    """
    s, d = plans["stochastic"], plans["deterministic"]
    modelled = s.expected - d.expected + 0.0
    return VssFigures(
        modelled=modelled, modelled_pct=_percent(modelled, s.expected), modelled_range=facts.modelled_range,
        executed=difference, executed_pct=_percent(difference.mean, s.executed.mean),
        distinguishable=difference.excludes_zero, same_plan=facts.same_plan,
        verdict=verdict_of(difference, "stochastic", "deterministic", same=facts.same_plan))


def _beyond(informed: Executed, stochastic: Executed, *, noisy: bool) -> PerfectInformation:
    """What knowing beforehand was worth, in the same trials."""
    found = estimate(difference_figure(informed, stochastic, noisy=noisy))
    return PerfectInformation(mean=found.mean, ci95=found.ci95, distinguishable=found.excludes_zero,
                              verdict=verdict_of(found, "informed", "stochastic"))


def verdict_of(difference: Estimate, a: str, b: str, *, same: bool = False) -> str:
    """Which of two plans is worth more, in words, if that can be told; ``same`` where they have the same routes."""
    if same:
        return "the same plan"
    if difference.ci95 is None:
        return "no interval"
    if not difference.excludes_zero:
        return "not distinguishable from zero"
    return f"{a if difference.mean > 0 else b} is worth more"


def plan_result(promise: Promise, run: Executed, *, noisy: bool) -> PlanResult:
    """What one plan promised and what came of it, single trials at hand."""
    figure = value_figure(run, noisy=noisy)
    counts: dict[End, int] = {end: int((run.end == k).sum()) for k, end in enumerate(ENDS)}
    shares = {name: {end: _share(found) for end, found in end_figures(run, k, noisy=noisy).items()
                     if (run.end[:, k] == ENDS.index(end)).any()} for k, name in enumerate(run.robots)}
    by_robot = {name: float(run.incentive[:, k].mean()) for k, name in enumerate(run.robots)}
    statistics = {key: estimate(found) for key, found in measured(run, noisy=noisy).items()}
    sums = plan_figures(promise, estimate(figure), by_robot, counts, charges(run) / len(run.end), statistics)
    return PlanResult(**vars(sums), executed_controlled=controlled(figure, promise.expected),
                      distribution=distribution(totals(run)), end_shares=shares)


def promise_of(plan: Plan, expected: float) -> Promise:
    """What is known of a plan before any trial.

    Args:
        plan: The plan.
        expected: Its closed-form value under the failure process executed.
    """
    return Promise(promised=expected if plan.value is None else plan.value, bound=plan.bound, status=plan.status,
                   expected=expected + 0.0)


def charges(run: Executed) -> FloatArray:
    """What each end in ``UNHAPPY`` cost in all trials together, shape (3,).

    A POI is charged to the end of the robot that planned it.
    """
    lost = run.planned_incentive - run.incentive
    return np.array([float(np.where(run.end == ENDS.index(end), lost, 0.0).sum()) for end in UNHAPPY])


def plan_figures(
    promise: Promise, executed: Estimate, by_robot: Mapping[str, float], ends: Mapping[End, int], charged: FloatArray,
    statistics: Mapping[str, Estimate],
) -> PlanFigures:
    """What one plan promised and what came of it, from sums over its trials.

    Args:
        promise: What was known before.
        executed: What it collected.
        by_robot: What each robot collected, on average.
        ends: How often missions ended which way.
        charged: What each end in ``UNHAPPY`` cost, on average, shape (3,).
        statistics: Those that are measured trial by trial, by their keys.
    """
    return PlanFigures(**vars(promise), executed=executed, by_robot=by_robot, statistics=statistics,
                       ends={end: count for end, count in ends.items() if count},
                       ledger=ledger(promise, charged, executed.mean))


def ledger(promise: Promise, charged: FloatArray, executed: float) -> Ledger:
    """How the promise became what was executed.

    A POI that was not credited is charged to the end of the robot that planned it. What robots lost that failed by
    draw, against what they were expected to lose, is ``draws``.
    """
    out_of_fuel, late, stuck = (-float(charged[UNHAPPY.index(end)]) + 0.0 for end in ("out_of_fuel", "late", "stuck"))
    assumption = promise.expected - promise.promised + 0.0
    draws = executed - promise.promised - assumption - (out_of_fuel + late + stuck) + 0.0
    return Ledger(promised=promise.promised, assumption=assumption, draws=draws, out_of_fuel=out_of_fuel, late=late,
                  stuck=stuck, executed=executed)


def totals(run: Executed) -> FloatArray:
    """What the robots collected together, shape (trials,)."""
    collected: FloatArray = run.incentive.sum(axis=1)
    return collected


def _share(figure: Figure) -> Share:
    found = estimate(figure)
    return Share(share=found.mean, ci95=None if found.ci95 is None else (
        min(max(found.ci95[0], 0.0), 1.0), min(max(found.ci95[1], 0.0), 1.0)))


def _percent(part: float, whole: float) -> float | None:
    """``None`` of nothing, or of so little that the percentage tells nothing."""
    percentage = 100.0 * part / whole + 0.0 if whole else np.inf
    return percentage if abs(percentage) <= MOST_AMOUNT else None
