"""The summary of a run: what was promised, what was executed, and what the stochastic plan is worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from sva_bench.analysis.figures import difference_figure, end_figures, value_figure
from sva_bench.analysis.moments import Figure
from sva_bench.analysis.statistics import Estimate, controlled, distribution, estimate
from sva_bench.analysis.unseen import UNHAPPY
from sva_bench.arrays import FloatArray
from sva_bench.choices import ENDS
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


@dataclass(frozen=True, eq=False, kw_only=True)
class ScenarioResult:
    """Everything about one scenario.

    Attributes:
        stochastic, deterministic: The two plans.
        modelled_range: Smallest and greatest modelled VSS over all deterministic plans that tie.
        worst: The deterministic plan that ties and is worth least; ``None`` where none is worth less.
        vss_mean_value: Birge's VSS, of the plan for the mean scenario; ``None`` under ``per_leg``.
        ws: Value of knowing beforehand who is available (wait and see); ``None`` if not computed.
        evpi: Expected value of perfect information; ``None`` if not computed.
        value_of_process: What planning for failures along the route is worth under them; ``None`` under ``mission``.
        informed: The planner that knows beforehand who is available, where it was asked for.
    """

    stochastic: Judged
    deterministic: Judged
    modelled_range: tuple[float, float] | None
    worst: Executed | None = None
    vss_mean_value: float | None
    ws: float | None
    evpi: float | None
    value_of_process: float | None
    informed: Judged | None = None


def scenario_summary(result: ScenarioResult, robots: Sequence[str], *, noisy: bool) -> dict[str, Any]:
    """One entry of ``scenarios`` in ``summary.json``."""
    s, d = result.stochastic, result.deterministic
    scenario = s.executed.case.scenario
    beyond = difference_figure(s.executed, d.executed, noisy=noisy)
    difference, sharper = estimate(beyond), controlled(beyond, s.expected - d.expected)
    ends = [difference.mean, *([float(np.mean(totals(s.executed) - totals(result.worst)))] if result.worst else [])]
    entry = scenario_entry(
        scenario.name, {name: scenario.availability[name] for name in robots},
        {judged.executed.case.planner: plan_summary(judged, robots, noisy=noisy)
         for judged in (s, d, result.informed) if judged is not None}, difference,
        {"modelled_range": None if result.modelled_range is None else [x + 0.0 for x in result.modelled_range],
         "vss_mean_value": result.vss_mean_value, "ws": result.ws, "evpi": result.evpi,
         "value_of_process": result.value_of_process,
         "same_plan": s.executed.case.plan.drives_like(d.executed.case.plan)},
        {"executed_range": None if result.modelled_range is None else [min(ends) + 0.0, max(ends) + 0.0],
         "executed_controlled": sharper.as_dict()})
    return entry if result.informed is None else entry | {"evpi_executed": _beyond(result.informed, s, noisy=noisy)}


def scenario_entry(
    name: str, availability: Mapping[str, float], plans: Mapping[str, Any], difference: Estimate,
    model: Mapping[str, Any], sharper: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """What the plans of a scenario come to.

    Args:
        name: The scenario's name.
        availability: Of each robot.
        plans: Entries of the stochastic and the deterministic plan, and of others that were executed beside them.
        difference: What the first collected beyond the second.
        model: What is known without trials: ``modelled_range``, ``vss_mean_value``, ``ws``, ``evpi``,
            ``value_of_process`` and ``same_plan``.
        sharper: More about the executed VSS, where single trials are at hand.
    """
    s, d = plans["stochastic"], plans["deterministic"]
    modelled = s["expected"] - d["expected"]
    same = bool(model.get("same_plan"))  # shards written before this was asked don't say
    return {
        "name": name,
        "availability": dict(availability),
        "plans": dict(plans),
        "vss": {
            "modelled": modelled + 0.0,
            "modelled_pct": _percent(modelled, s["expected"]),
            "modelled_range": model["modelled_range"],
            "executed": difference.as_dict(),
            "executed_pct": _percent(difference.mean, s["executed"]["mean"]),
            **(sharper or {}),
            "distinguishable": difference.distinguishable,
            "same_plan": same,
            "verdict": verdict_of(difference, "stochastic", "deterministic", same=same),
        },
        "vss_mean_value": model["vss_mean_value"],
        # The plan for the mean is the stochastic plan itself, drive for drive.
        "vss_mean_value_executed": model["vss_mean_value"],
        "ws": model["ws"],
        "evpi": model["evpi"],
        "value_of_process": model["value_of_process"],
    }


def _beyond(informed: Judged, stochastic: Judged, *, noisy: bool) -> dict[str, Any]:
    """What knowing beforehand was worth, in the same trials."""
    found = estimate(difference_figure(informed.executed, stochastic.executed, noisy=noisy))
    return {**found.as_dict(), "distinguishable": found.distinguishable,
            "verdict": verdict_of(found, "informed", "stochastic")}


def verdict_of(difference: Estimate, a: str, b: str, *, same: bool = False) -> str:
    """Which of two plans is worth more, in words, if that can be told; ``same`` where they have the same routes."""
    if same:
        return "the same plan"
    if difference.interval is None:
        return "no interval"
    if not difference.distinguishable:
        return "not distinguishable from zero"
    return f"{a if difference.mean > 0 else b} is worth more"


def comparison_summary(plans: Sequence[Judged], robots: Sequence[str], *, noisy: bool) -> dict[str, Any]:
    """One entry of ``scenarios`` where plans from anywhere were executed: every pair compared, trial by trial.

    A pair is distinguishable where the interval that is adjusted for the number of pairs leaves zero out.
    """
    scenario = plans[0].executed.case.scenario
    comparisons = []
    pairs = list(combinations(plans, 2))
    for a, b in pairs:
        beyond = difference_figure(a.executed, b.executed, noisy=noisy)
        difference, together = estimate(beyond), estimate(beyond, comparisons=len(pairs))
        names = a.executed.case.planner, b.executed.case.planner
        same = a.executed.case.plan.drives_like(b.executed.case.plan)
        comparisons.append({"a": names[0], "b": names[1], **difference.as_dict(),
                            "ci95_adjusted": together.as_dict()["ci95"], "distinguishable": together.distinguishable,
                            "same_plan": same, "verdict": verdict_of(together, *names, same=same)})
    return {
        "name": scenario.name,
        "availability": {name: scenario.availability[name] for name in robots},
        "plans": {judged.executed.case.planner: {
            "feasible": judged.feasible, "lost": lost(judged.executed), **plan_summary(judged, robots, noisy=noisy)}
            for judged in plans},
        "comparisons": comparisons,
        "ranking": ranking({p.executed.case.planner: float(np.mean(totals(p.executed))) for p in plans}, comparisons),
    }


def lost(run: Executed) -> int:
    """How many robot missions of all trials ended along the route: by failing, out of fuel or stuck."""
    along = (run.end == ENDS.index("failed")) & (run.stops_reached > 0)
    return int((along | (run.end == ENDS.index("out_of_fuel")) | (run.end == ENDS.index("stuck"))).sum())


def ranking(means: Mapping[str, float], comparisons: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Plans from best to worst; a plan's rank is one more than the number of plans that are distinguishably better."""
    better = dict.fromkeys(means, 0)
    for pair in comparisons:
        if pair["distinguishable"]:
            better[pair["b"] if pair["mean"] > 0 else pair["a"]] += 1
    return [{"rank": better[name] + 1, "plan": name, "mean": mean + 0.0}
            for name, mean in sorted(means.items(), key=lambda item: (better[item[0]], -item[1]))]


def plan_summary(judged: Judged, robots: Sequence[str], *, noisy: bool) -> dict[str, Any]:
    """What one plan promised and what came of it."""
    run = judged.executed
    figure = value_figure(run, noisy=noisy)
    counts: dict[str, int] = {end: int((run.end == k).sum()) for k, end in enumerate(ENDS)}
    sharper = {
        "executed_controlled": controlled(figure, judged.expected).as_dict(),
        "distribution": distribution(totals(run)),
        "end_shares": {name: {end: _share(figure) for end, figure in end_figures(run, k, noisy=noisy).items()
                              if (run.end[:, k] == ENDS.index(end)).any()} for k, name in enumerate(robots)},
    }
    return plan_entry(promise_of(run.case.plan, judged.expected), estimate(figure),
                      {name: float(run.incentive[:, k].mean()) for k, name in enumerate(robots)}, counts,
                      {end: lost / len(run.end) for end, lost in charges(run).items()}, sharper)


def promise_of(plan: Plan, expected: float) -> dict[str, Any]:
    """What is known of a plan before any trial.

    Args:
        plan: The plan.
        expected: Its closed-form value under the failure process executed.
    """
    return {"promised": expected if plan.value is None else plan.value, "bound": plan.bound, "status": plan.status,
            "expected": expected + 0.0}


def charges(run: Executed) -> dict[str, float]:
    """What each unhappy end cost in all trials together; a POI is charged to the end of the robot that planned it."""
    lost = run.planned_incentive - run.incentive
    return {end: float(np.where(run.end == ENDS.index(end), lost, 0.0).sum()) for end in UNHAPPY}


def plan_entry(
    promise: Mapping[str, Any], executed: Estimate, by_robot: Mapping[str, float], ends: Mapping[str, int],
    charged: Mapping[str, float], sharper: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """What one plan promised and what came of it.

    Args:
        promise: As ``promise_of`` gives it.
        executed: What it collected.
        by_robot: What each robot collected, on average.
        ends: How often missions ended which way.
        charged: What each unhappy end cost, on average.
        sharper: More about it, where single trials are at hand.
    """
    return {
        **promise,
        "executed": executed.as_dict(),
        **(sharper or {}),
        "by_robot": dict(by_robot),
        "ends": {end: count for end, count in ends.items() if count},
        "ledger": _ledger(promise, charged, executed.mean),
    }


def ledger(judged: Judged, executed: float) -> dict[str, float]:
    """How the promise became what was executed; the entries between the two add up to their difference.

    A POI that was not credited is charged to the end of the robot that planned it. What robots lost that failed by
    draw, against what they were expected to lose, is ``draws``.
    """
    run = judged.executed
    return _ledger(promise_of(run.case.plan, judged.expected),
                   {end: lost / len(run.end) for end, lost in charges(run).items()}, executed)


def _ledger(promise: Mapping[str, Any], charged: Mapping[str, float], executed: float) -> dict[str, float]:
    promised = promise["promised"]
    costs: dict[str, float] = {end: -charged[end] + 0.0 for end in UNHAPPY}
    assumption = promise["expected"] - promised
    draws = executed - promised - assumption - sum(costs.values())
    return {"promised": promised, "assumption": assumption + 0.0, "draws": draws + 0.0, **costs, "executed": executed}


def totals(run: Executed) -> FloatArray:
    """What the robots collected together, shape (trials,)."""
    collected: FloatArray = run.incentive.sum(axis=1)
    return collected


def _share(figure: Figure) -> dict[str, Any]:
    found = estimate(figure)
    interval = None if found.interval is None else [min(max(x, 0.0), 1.0) for x in found.interval]
    return {"share": found.mean, "ci95": interval}


def _percent(part: float, whole: float) -> float | None:
    return 100.0 * part / whole + 0.0 if whole else None
