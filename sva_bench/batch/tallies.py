"""Trials counted and added up, so that ranges of them can be joined: all that a batch keeps of its rows in memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sva_bench.analysis.figures import difference_figure, value_figure
from sva_bench.analysis.moments import Figure, figure_from, joined
from sva_bench.analysis.statistics import estimate
from sva_bench.analysis.summary import charges, plan_entry, scenario_entry
from sva_bench.analysis.unseen import UNHAPPY
from sva_bench.arrays import FloatArray, IntArray
from sva_bench.choices import ENDS
from sva_bench.execution.execute import Executed


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanTally:
    """One plan's trials under one scenario, added up: incentive of the team and by robot, ends, and what they cost."""

    total: Figure
    by_robot: FloatArray
    ends: IntArray
    charged: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Tally:
    """Both plans' trials under one scenario, and what one collected beyond the other."""

    plans: Mapping[str, PlanTally]
    difference: Figure


def tally_of(stochastic: Executed, deterministic: Executed, *, noisy: bool) -> Tally:
    """Add up the trials of a scenario."""
    return Tally(
        plans={run.case.planner: PlanTally(
            total=value_figure(run, noisy=noisy), by_robot=run.incentive.sum(axis=0),
            ends=np.bincount(run.end.ravel(), minlength=len(ENDS)), charged=np.array(list(charges(run).values())))
            for run in (stochastic, deterministic)},
        difference=difference_figure(stochastic, deterministic, noisy=noisy))


def join(a: Tally, b: Tally) -> Tally:
    """Both ranges of trials together."""
    return Tally(difference=joined(a.difference, b.difference), plans={
        name: PlanTally(total=joined(plan.total, b.plans[name].total), by_robot=plan.by_robot + b.plans[name].by_robot,
                        ends=plan.ends + b.plans[name].ends, charged=plan.charged + b.plans[name].charged)
        for name, plan in a.plans.items()})


def tally_as_dict(tally: Tally) -> dict[str, Any]:
    """For a file."""
    return {"difference": tally.difference.as_dict(), "plans": {
        name: {"total": plan.total.as_dict(), "by_robot": plan.by_robot.tolist(), "ends": plan.ends.tolist(),
               "charged": plan.charged.tolist()} for name, plan in tally.plans.items()}}


def tally_from(data: Mapping[str, Any]) -> Tally:
    """The tally that such a file holds."""
    return Tally(difference=figure_from(data["difference"]), plans={
        name: PlanTally(total=figure_from(plan["total"]), by_robot=np.array(plan["by_robot"]),
                        ends=np.array(plan["ends"]), charged=np.array(plan["charged"]))
        for name, plan in data["plans"].items()})


def scenario_from(fact: Mapping[str, Any], tally: Tally, robots: Sequence[str]) -> dict[str, Any]:
    """An entry of ``scenarios`` in a summary, from what was known ahead and what came of the trials."""
    count = tally.difference.drawn.count
    plans = {name: plan_entry(
        fact["plans"][name], estimate(plan.total),
        {robot: float(earned) / count for robot, earned in zip(robots, plan.by_robot, strict=True)},
        {end: int(times) for end, times in zip(ENDS, plan.ends, strict=True)},
        {end: float(lost) / count for end, lost in zip(UNHAPPY, plan.charged, strict=True)})
        for name, plan in tally.plans.items()}
    return scenario_entry(fact["name"], fact["availability"], plans, estimate(tally.difference), fact)
