"""Trials counted and added up, so that ranges of them can be joined: all that a batch keeps of its rows in memory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student_t

from sva_bench.analysis.statistics import CONFIDENCE, Estimate
from sva_bench.analysis.summary import UNHAPPY, charges, plan_entry, scenario_entry, totals
from sva_bench.arrays import FloatArray, IntArray
from sva_bench.execution.execute import Executed
from sva_bench.execution.outcome import ENDS


@dataclass(frozen=True, eq=False, kw_only=True)
class Moments:
    """A sample's count, mean and squares about it; by noise draw too, where draws differ.

    Attributes:
        count: Number of trials.
        mean: Their mean.
        squares: Sum of the squares about the mean.
        counts, sums: Trials and their sum for each noise draw, shape (rollouts,); empty without noise.
    """

    count: int
    mean: float
    squares: float
    counts: IntArray
    sums: FloatArray

    def as_dict(self) -> dict[str, Any]:
        """For a file."""
        return {"count": self.count, "mean": self.mean, "squares": self.squares, "counts": self.counts.tolist(),
                "sums": self.sums.tolist()}


def moments_of(values: FloatArray, rollout: IntArray, rollouts: int) -> Moments:
    """Moments of trials.

    Args:
        values: One figure per trial, shape (trials,).
        rollout: Noise draw of each trial, shape (trials,).
        rollouts: Number of noise draws; 0 = there is no noise.
    """
    mean = float(np.mean(values))
    kept = slice(None) if rollouts else slice(0)
    return Moments(
        count=len(values), mean=mean, squares=float(np.sum((values - mean) ** 2)),
        counts=np.bincount(rollout, minlength=rollouts)[kept],
        sums=np.bincount(rollout, weights=values, minlength=rollouts)[kept].astype(np.float64))


def _moments_from(data: Mapping[str, Any]) -> Moments:
    return Moments(count=data["count"], mean=data["mean"], squares=data["squares"],
                   counts=np.array(data["counts"], dtype=np.int64), sums=np.array(data["sums"], dtype=np.float64))


def joined(a: Moments, b: Moments) -> Moments:
    """Moments of both samples together.

    Source:
        Chan, Golub & LeVeque (1979), Updating Formulae and a Pairwise Algorithm for Computing Sample Variances.
    """
    count, step = a.count + b.count, b.mean - a.mean
    return Moments(count=count, mean=a.mean + step * b.count / count, counts=a.counts + b.counts, sums=a.sums + b.sums,
                   squares=a.squares + b.squares + step**2 * a.count * b.count / count)


def estimate_of(moments: Moments) -> Estimate:
    """Mean with its interval, as ``analysis.statistics.estimate`` gives it from the trials themselves."""
    count, mean = moments.count, moments.mean
    if len(moments.counts):
        drawn = moments.counts > 0
        clusters = int(drawn.sum())
        about = (moments.sums - moments.counts * mean)[drawn]
        squares = float(about @ about)
    else:
        clusters, squares = count, moments.squares
    if clusters < 2:
        return Estimate(mean=mean, interval=None)
    half = float(student_t.ppf(0.5 + CONFIDENCE / 2, clusters - 1)) * math.sqrt(
        clusters / (clusters - 1) * squares / count**2)
    return Estimate(mean=mean, interval=(mean - half, mean + half))


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanTally:
    """One plan's trials under one scenario, added up: incentive of the team and by robot, ends, and what they cost."""

    total: Moments
    by_robot: FloatArray
    ends: IntArray
    charged: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Tally:
    """Both plans' trials under one scenario, and what one collected beyond the other."""

    plans: Mapping[str, PlanTally]
    difference: Moments


def tally_of(stochastic: Executed, deterministic: Executed, rollouts: int) -> Tally:
    """Add up the trials of a scenario; ``rollouts`` is 0 where there is no noise."""
    return Tally(
        plans={run.case.planner: PlanTally(
            total=moments_of(totals(run), run.rollout, rollouts), by_robot=run.incentive.sum(axis=0),
            ends=np.bincount(run.end.ravel(), minlength=len(ENDS)), charged=np.array(list(charges(run).values())))
            for run in (stochastic, deterministic)},
        difference=moments_of(totals(stochastic) - totals(deterministic), stochastic.rollout, rollouts))


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
    return Tally(difference=_moments_from(data["difference"]), plans={
        name: PlanTally(total=_moments_from(plan["total"]), by_robot=np.array(plan["by_robot"]),
                        ends=np.array(plan["ends"]), charged=np.array(plan["charged"]))
        for name, plan in data["plans"].items()})


def scenario_from(fact: Mapping[str, Any], tally: Tally, robots: Sequence[str]) -> dict[str, Any]:
    """An entry of ``scenarios`` in a summary, from what was known ahead and what came of the trials."""
    count = tally.difference.count
    plans = {name: plan_entry(
        fact["plans"][name], estimate_of(plan.total),
        {robot: float(earned) / count for robot, earned in zip(robots, plan.by_robot, strict=True)},
        {end: int(times) for end, times in zip(ENDS, plan.ends, strict=True)},
        {end: float(lost) / count for end, lost in zip(UNHAPPY, plan.charged, strict=True)})
        for name, plan in tally.plans.items()}
    return scenario_entry(fact["name"], fact["availability"], plans, estimate_of(tally.difference), fact)
