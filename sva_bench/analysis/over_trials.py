"""Results from trials: promised and executed values of plans, and the value of the stochastic solution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sva_bench.analysis.catalogue import measured
from sva_bench.analysis.figures import bad_figure, difference_figure, end_figures, value_figure
from sva_bench.analysis.meetings import interaction_summary
from sva_bench.analysis.moments import Figure
from sva_bench.analysis.results import (
    MOST_AMOUNT,
    Estimate,
    InteractionSummary,
    Ledger,
    PerfectInformation,
    PlanFigures,
    PlanResult,
    Promise,
    ScenarioFacts,
    Share,
    Vss,
    VssFigures,
)
from sva_bench.analysis.scenarios import ScenarioSummary
from sva_bench.analysis.statistics import controlled, distribution, estimate
from sva_bench.analysis.unseen import EXECUTION_LOSSES
from sva_bench.arrays import FloatArray
from sva_bench.choices import ENDS, End
from sva_bench.execution.executed import Executed
from sva_bench.mission.plan import Plan


@dataclass(frozen=True, eq=False, kw_only=True)
class Judged:
    """A plan with its closed-form value and its execution.

    Attributes:
        expected: Closed-form value under the failure process executed.
        executed: Its trials.
        feasible: Whether it keeps fuel capacities and mission limits.
    """

    expected: float
    executed: Executed
    feasible: bool = True

    @property
    def promise(self) -> Promise:
        """Its values before any trial."""
        return promise_of(self.executed.case.plan, self.expected)


@dataclass(frozen=True, eq=False, kw_only=True)
class ScenarioTrials:
    """All trials of one scenario.

    Attributes:
        stochastic, deterministic: Those of the two plans.
        calibrated: Those of the calibrated plan, where there is one.
        worst: Those of the tied deterministic plan of least expected value; ``None`` where no tie has less.
        informed: The perfect-information plans, with ``--informed``.
    """

    stochastic: Executed
    deterministic: Executed
    calibrated: Executed | None = None
    worst: Executed | None = None
    informed: Judged | None = None


def scenario_summary(facts: ScenarioFacts, trials: ScenarioTrials, *, noisy: bool) -> ScenarioSummary:
    """The summary of one scenario of ``run``.

    Args:
        facts: Its modelled values.
        trials: Its trials.
        noisy: Whether noise draws differ.
    """
    s, d, informed = trials.stochastic, trials.deterministic, trials.informed
    results = {"stochastic": plan_result(facts.plans["stochastic"], s, noisy=noisy),
               "deterministic": plan_result(facts.plans["deterministic"], d, noisy=noisy)}
    if trials.calibrated is not None:
        results["calibrated"] = plan_result(facts.plans["calibrated"], trials.calibrated, noisy=noisy)
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
        # The plan for the mean scenario is the stochastic plan itself.
        vss_mean_value=facts.vss_mean_value, vss_mean_value_executed=facts.vss_mean_value, ws=facts.ws,
        evpi=facts.evpi, value_of_process=facts.value_of_process,
        evpi_executed=None if informed is None else _beyond(informed.executed, s, noisy=noisy))


def vss_figures(facts: ScenarioFacts, plans: Mapping[str, PlanFigures], difference: Estimate) -> VssFigures:
    """The value of the stochastic solution.

    Args:
        facts: Modelled values of the scenario.
        plans: Results of the stochastic and the deterministic plan.
        difference: Executed difference in value between the two.
    """
    s, d = plans["stochastic"], plans["deterministic"]
    modelled = s.expected - d.expected + 0.0
    return VssFigures(
        modelled=modelled, modelled_pct=percent(modelled, s.expected), modelled_range=facts.modelled_range,
        executed=difference, executed_pct=percent(difference.mean, s.executed.mean),
        distinguishable=difference.excludes_zero, same_plan=facts.same_plan,
        verdict=verdict_of(difference, "stochastic", "deterministic", same=facts.same_plan))


def _beyond(informed: Executed, stochastic: Executed, *, noisy: bool) -> PerfectInformation:
    """The executed EVPI, in the same trials."""
    found = estimate(difference_figure(informed, stochastic, noisy=noisy))
    return PerfectInformation(mean=found.mean, ci95=found.ci95, distinguishable=found.excludes_zero,
                              verdict=verdict_of(found, "informed", "stochastic"))


def verdict_of(difference: Estimate, a: str, b: str, *, same: bool = False) -> str:
    """Which of two plans has the greater value, in words; ``same`` where they have the same routes."""
    if same:
        return "the same plan"
    if difference.ci95 is None:
        return "no interval"
    if not difference.excludes_zero:
        return "not distinguishable from zero"
    return f"{a if difference.mean > 0 else b} is worth more"


def plan_result(promise: Promise, run: Executed, *, noisy: bool) -> PlanResult:
    """The results of one plan from its single trials."""
    figure = value_figure(run, noisy=noisy)
    counts: dict[End, int] = {end: int((run.end == k).sum()) for k, end in enumerate(ENDS)}
    shares = {name: {end: _share(found) for end, found in end_figures(run, k, noisy=noisy).items()
                     if (run.end[:, k] == ENDS.index(end)).any()} for k, name in enumerate(run.robots)}
    by_robot = {name: float(run.value[:, k].mean()) for k, name in enumerate(run.robots)}
    statistics = {key: estimate(found) for key, found in measured(run, noisy=noisy).items()}
    sums = plan_figures(promise, estimate(figure), by_robot, counts, charges(run) / len(run.end), statistics,
                        interaction_summary(run.meetings))
    return PlanResult(**vars(sums), executed_controlled=controlled(figure, promise.expected),
                      distribution=distribution(totals(run)), end_shares=shares,
                      bad=_share(bad_figure(run, noisy=noisy)))


def promise_of(plan: Plan, expected: float) -> Promise:
    """The values of a plan before any trial.

    Args:
        plan: The plan.
        expected: Its closed-form value under the failure process executed.
    """
    return Promise(promised=expected if plan.value is None else plan.value, bound=plan.bound, status=plan.status,
                   expected=expected + 0.0)


def charges(run: Executed) -> FloatArray:
    """Value lost to each end in ``EXECUTION_LOSSES`` in all trials together, shape (3,).

    A POI is charged to the end of the robot whose route it is on, and the cost of a lost robot to its own.
    """
    lost = run.planned_incentive - run.value
    return np.array([float(np.where(run.end == ENDS.index(end), lost, 0.0).sum()) for end in EXECUTION_LOSSES])


def plan_figures(
    promise: Promise, executed: Estimate, by_robot: Mapping[str, float], ends: Mapping[End, int], charged: FloatArray,
    statistics: Mapping[str, Estimate], interaction: InteractionSummary | None = None,
) -> PlanFigures:
    """The results of one plan from sums over its trials.

    Args:
        promise: Its values before any trial.
        executed: Mean value of the team.
        by_robot: Mean value of each robot.
        ends: Number of robot missions with each end.
        charged: Mean value lost to each end in ``EXECUTION_LOSSES``, shape (3,).
        statistics: The measured statistics, by key.
        interaction: What robots did to each other; ``None`` where they do not meet.
    """
    return PlanFigures(**vars(promise), executed=executed, by_robot=by_robot, statistics=statistics,
                       interaction=interaction,
                       ends={end: count for end, count in ends.items() if count},
                       ledger=ledger(promise, charged, executed.mean))


def ledger(promise: Promise, charged: FloatArray, executed: float) -> Ledger:
    """The decomposition of executed less promised value.

    A POI that was not collected is charged to the end of the robot whose route it is on. What robots lost to failures
    drawn, less its expectation, is ``draws``.
    """
    out_of_fuel, late, stuck = (
        -float(charged[EXECUTION_LOSSES.index(end)]) + 0.0 for end in ("out_of_fuel", "late", "stuck"))
    assumption = promise.expected - promise.promised + 0.0
    draws = executed - promise.promised - assumption - (out_of_fuel + late + stuck) + 0.0
    return Ledger(promised=promise.promised, assumption=assumption, draws=draws, out_of_fuel=out_of_fuel, late=late,
                  stuck=stuck, executed=executed)


def totals(run: Executed) -> FloatArray:
    """Value of the team in each trial, shape (trials,)."""
    value: FloatArray = run.value.sum(axis=1)
    return value


def _share(figure: Figure) -> Share:
    found = estimate(figure)
    return Share(share=found.mean, ci95=found.ci95)


def percent(part: float, whole: float) -> float | None:
    """A percentage; ``None`` of 0, or beyond ``MOST_AMOUNT``."""
    percentage = 100.0 * part / whole + 0.0 if whole > 0 else np.inf
    return percentage if abs(percentage) <= MOST_AMOUNT else None
