"""Tallies: sums over trials, which can be joined over ranges; a batch keeps nothing else of its rows in memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.analysis.calibration import Calibration
from sva_bench.analysis.catalogue import measured
from sva_bench.analysis.figures import difference_figure, value_figure
from sva_bench.analysis.meetings import MetTally, met_tally
from sva_bench.analysis.moments import Clusters, Figure, Moments, joined
from sva_bench.analysis.over_trials import charges, plan_figures, vss_figures
from sva_bench.analysis.reaction_results import ReactionResult
from sva_bench.analysis.results import PlanFigures, ScenarioFacts
from sva_bench.analysis.scenarios import UnitScenario
from sva_bench.analysis.statistics import estimate
from sva_bench.arrays import FloatArray, IntArray
from sva_bench.batch.schema import StoredFigure, StoredMet, StoredPlan, StoredTally
from sva_bench.choices import ENDS, OwnPlan
from sva_bench.execution.executed import Executed


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanTally:
    """Sums over one plan's trials under one scenario.

    Attributes:
        total: Value of the team.
        by_robot: Value of each robot in all trials, shape (robots,).
        ends: Number of robot missions with each end, shape (5,).
        charged: Value lost to each end in ``EXECUTION_LOSSES`` in all trials, shape (3,).
        statistics: The measured statistics, by key.
        met: What robots did to each other; ``None`` where they do not meet.
    """

    total: Figure
    by_robot: FloatArray
    ends: IntArray
    charged: FloatArray
    statistics: Mapping[str, Figure]
    met: MetTally | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Tally:
    """Sums over the trials of a scenario's own plans, and over the differences of the first two."""

    plans: Mapping[OwnPlan, PlanTally]
    difference: Figure


def tally_of(runs: Mapping[OwnPlan, Executed], *, noisy: bool) -> Tally:
    """Add up the trials of a scenario's own plans."""
    def added_up(run: Executed) -> PlanTally:
        return PlanTally(total=value_figure(run, noisy=noisy), by_robot=run.value.sum(axis=0),
                         ends=np.bincount(run.end.ravel(), minlength=len(ENDS)), charged=charges(run),
                         statistics=measured(run, noisy=noisy), met=met_tally(run.meetings))

    return Tally(plans={name: added_up(run) for name, run in runs.items()},
                 difference=difference_figure(runs["stochastic"], runs["deterministic"], noisy=noisy))


def join(a: Tally, b: Tally) -> Tally:
    """The tally of two ranges of trials."""
    return Tally(difference=joined(a.difference, b.difference),
                 plans={name: _join(plan, b.plans[name]) for name, plan in a.plans.items()})


def _join(a: PlanTally, b: PlanTally) -> PlanTally:
    met = None if a.met is None or b.met is None else a.met + b.met
    return PlanTally(total=joined(a.total, b.total), by_robot=a.by_robot + b.by_robot, ends=a.ends + b.ends, met=met,
                     charged=a.charged + b.charged, statistics={
                         key: joined(figure, b.statistics[key]) for key, figure in a.statistics.items()
                         if key in b.statistics})


def scenario_of(
    facts: ScenarioFacts, tally: Tally, robots: Sequence[str], reactions: tuple[ReactionResult, ...] | None,
    calibration: Calibration | None,
) -> UnitScenario:
    """The results of a scenario, from its modelled values and its tally, with those of reactions and calibration."""
    count = tally.difference.drawn.count
    plans: dict[str, PlanFigures] = {name: plan_figures(
        facts.plans[name], estimate(plan.total),
        {robot: float(earned) / count for robot, earned in zip(robots, plan.by_robot, strict=True)},
        {end: int(times) for end, times in zip(ENDS, plan.ends, strict=True)}, plan.charged / count,
        {key: estimate(figure) for key, figure in plan.statistics.items()},
        None if plan.met is None else plan.met.means) for name, plan in tally.plans.items()}
    return UnitScenario(
        name=facts.name, availability=facts.availability, plans=plans,
        vss=vss_figures(facts, plans, estimate(tally.difference)), vss_mean_value=facts.vss_mean_value,
        vss_mean_value_executed=facts.vss_mean_value, ws=facts.ws, evpi=facts.evpi,
        value_of_process=facts.value_of_process, reactions=reactions, calibration=calibration)


def stored_tally(tally: Tally) -> StoredTally:
    """As stored in a shard."""
    return StoredTally(difference=stored_figure(tally.difference), plans={
        name: StoredPlan(
            total=stored_figure(plan.total), by_robot=tuple(plan.by_robot.tolist()), ends=tuple(plan.ends.tolist()),
            charged=tuple(plan.charged.tolist()), met=None if plan.met is None else StoredMet(**vars(plan.met)),
            statistics={key: stored_figure(figure) for key, figure in plan.statistics.items()})
        for name, plan in tally.plans.items()})


def tally_from(stored: StoredTally) -> Tally:
    """The tally stored in a shard."""
    return Tally(difference=figure_from(stored.difference), plans={
        name: PlanTally(total=figure_from(plan.total), by_robot=np.array(plan.by_robot),
                        ends=np.array(plan.ends), charged=np.array(plan.charged),
                        met=None if plan.met is None else MetTally(**vars(plan.met)),
                        statistics={key: figure_from(figure) for key, figure in plan.statistics.items()})
        for name, plan in stored.plans.items()})


def stored_figure(figure: Figure) -> StoredFigure:
    """As stored in a shard."""
    return StoredFigure(
        count=figure.drawn.count, mean=figure.drawn.mean, squares=figure.drawn.squares,
        drawn_bounds=figure.drawn_bounds, taken_bounds=figure.taken_bounds,
        counts=tuple(figure.taken.counts.tolist()), sums=tuple(figure.taken.sums.tolist()), certain=figure.certain)


def figure_from(stored: StoredFigure) -> Figure:
    """The figure stored in a shard."""
    return Figure(
        drawn=Moments(count=stored.count, mean=stored.mean, squares=stored.squares),
        drawn_bounds=stored.drawn_bounds, taken_bounds=stored.taken_bounds, certain=stored.certain,
        taken=Clusters(counts=np.array(stored.counts, dtype=np.int64), sums=np.array(stored.sums, dtype=np.float64)))
