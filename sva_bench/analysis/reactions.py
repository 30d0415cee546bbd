"""Statistics of teams that react: weighted histories or trials, paired between plans and policies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sva_bench.analysis.comparison import comparison_of, ranking
from sva_bench.analysis.figures import mean_taken
from sva_bench.analysis.meetings import interaction_summary
from sva_bench.analysis.moments import Bounds, Clusters, Figure, Moments, figure_of
from sva_bench.analysis.over_trials import percent, verdict_of
from sva_bench.analysis.reaction_results import (
    BestPlan,
    Candidate,
    ComparedReaction,
    DrivenWhole,
    Gain,
    ReactingPlan,
    ReactionLedger,
    ReactionResult,
)
from sva_bench.analysis.results import Distribution, Promise, VssFigures
from sva_bench.analysis.statistics import estimate, weighted_distribution
from sva_bench.analysis.unseen import EXECUTION_LOSSES
from sva_bench.choices import ENDS
from sva_bench.execution.executed import Executed
from sva_bench.execution.react import Reacted


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanReacted:
    """One plan whose team reacts.

    Attributes:
        promise: Its values before any trial; ``expected`` is that without reaction.
        reacted: What came of it.
        kept: What comes of it, by the same histories or trials, if nobody reacts.
        executed: Its trials without reaction, by which the noise draws that were not observed are judged.
        trials: Trials of the run.
    """

    promise: Promise
    reacted: Reacted
    kept: Reacted
    executed: Executed
    trials: int


def reaction_result(
    plans: Mapping[str, PlanReacted], candidates: Sequence[Candidate] = (), *, noisy: bool
) -> ReactionResult:
    """The results of one scenario under one policy and news.

    Args:
        plans: The plans by what they go by; ``stochastic`` and ``deterministic`` are among them.
        candidates: The plans that the anticipative one was chosen from.
        noisy: Whether noise draws differ.
    """
    some = next(iter(plans.values())).reacted
    ranked = _ranked(plans)
    best = plans[ranked[0]]
    results = {name: _plan(plan, noisy=noisy) for name, plan in plans.items()}

    def gain(other: str) -> Gain:
        found = estimate(_difference(best, plans[other], noisy=noisy))
        return Gain(mean=found.mean, ci95=found.ci95, pct=percent(found.mean, results[ranked[0]].executed.mean))

    return ReactionResult(
        policy=some.case.policy, news=some.case.news, histories="enumerated" if some.enumerated else "sampled",
        plans=results, vss=_vss(plans, results, noisy=noisy), vss_without_reaction=_vss_kept(plans, noisy=noisy),
        value_of_recourse={name: _recourse(plan, noisy=noisy) for name, plan in plans.items()},
        driven_whole=_whole(plans),
        vss_with_recourse=gain("deterministic"), anticipation=gain("stochastic"),
        best=_best(plans, ranked, noisy=noisy), candidates=tuple(candidates))


def _ranked(plans: Mapping[str, PlanReacted]) -> list[str]:
    """The plans from best to worst by modelled value, of equals the first.

    Where missions are sampled, the plan made for the reaction was chosen on others, and stays the best: a choice by the
    missions on which it is measured would flatter it.
    """
    made = plans.get("anticipative")
    chosen = None if made is None or made.reacted.enumerated else made.reacted.case.plan
    return sorted(plans, key=lambda name: (
        chosen is not None and not plans[name].reacted.case.plan.drives_like(chosen), -_modelled(plans[name].reacted)))


def compared_reaction(
    plans: Mapping[str, PlanReacted], candidates: Sequence[Candidate] = (), *, noisy: bool
) -> ComparedReaction:
    """The results of given plans under one policy and news; the arguments are those of ``reaction_result``."""
    some = next(iter(plans.values())).reacted
    results = {name: _plan(plan, noisy=noisy) for name, plan in plans.items()}
    pairs = list(combinations(plans, 2))
    comparisons = [comparison_of(
        _difference(plans[a], plans[b], noisy=noisy), (a, b), len(pairs),
        same=plans[a].reacted.case.plan.drives_like(plans[b].reacted.case.plan)) for a, b in pairs]
    return ComparedReaction(
        policy=some.case.policy, news=some.case.news, histories="enumerated" if some.enumerated else "sampled",
        plans=results, comparisons=tuple(comparisons),
        ranking=ranking({name: plan.executed.mean for name, plan in results.items()}, comparisons),
        value_of_recourse={name: _recourse(plan, noisy=noisy) for name, plan in plans.items()},
        driven_whole=_whole(plans), candidates=tuple(candidates))


def _plan(plan: PlanReacted, *, noisy: bool) -> ReactingPlan:
    run, promise = plan.reacted, plan.promise
    executed = estimate(_figure(run, None, _taken(plan, noisy=noisy), noisy=noisy))
    shares = {name: {end: share for k, end in enumerate(ENDS)
                     if (share := min(float(run.weight @ (run.end[:, number] == k)), 1.0)) > 0}
              for number, name in enumerate(run.robots)}
    return ReactingPlan(
        **vars(promise), modelled=_modelled(run), executed=executed, distribution=_distribution(run),
        by_robot={name: float(run.weight @ run.value[:, number]) + 0.0 for number, name in enumerate(run.robots)},
        ends={end: count for end in ENDS if (count := round(plan.trials * sum(
            own.get(end, 0.0) for own in shares.values())))},
        end_shares=shares, ledger=_ledger(plan, executed.mean), missions=len(run.weight),
        reacted=min(float(run.weight @ run.reacted), 1.0),
        doubled=float(run.weight @ run.doubled), interaction=interaction_summary(run.meetings, run.weight))


def _ledger(plan: PlanReacted, executed: float) -> ReactionLedger:
    """What each unhappy end cost, what failures drawn did, and the rest: what re-planning gained or lost."""
    run, promise = plan.reacted, plan.promise
    costs = np.zeros(len(run.robots)) if plan.executed.terms.loss_cost is None else plan.executed.terms.loss_cost
    charged = {end: -float(run.weight @ np.where(
        run.end == ENDS.index(end), run.left_over + run.lost * costs, 0.0).sum(axis=1)) + 0.0
        for end in EXECUTION_LOSSES}
    assumption = promise.expected - promise.promised + 0.0
    # Histories that are all there have no luck of the draw; closed form and enumeration agree but for rounding.
    draws = 0.0 if run.enumerated else _modelled(plan.kept) - promise.expected + 0.0
    reaction = executed - promise.promised - assumption - draws - sum(charged.values()) + 0.0
    return ReactionLedger(promised=promise.promised, assumption=assumption, reaction=reaction, draws=draws,
                          out_of_fuel=charged["out_of_fuel"], late=charged["late"], stuck=charged["stuck"],
                          executed=executed)


def _whole(plans: Mapping[str, PlanReacted]) -> DrivenWhole:
    checked = [plan.reacted.whole for plan in plans.values() if plan.reacted.whole is not None]
    return DrivenWhole(missions=len(checked), differing=checked.count(False))


def _vss(plans: Mapping[str, PlanReacted], results: Mapping[str, ReactingPlan], *, noisy: bool) -> VssFigures:
    s, d = results["stochastic"], results["deterministic"]
    found = estimate(_difference(plans["stochastic"], plans["deterministic"], noisy=noisy))
    same = plans["stochastic"].reacted.case.plan.drives_like(plans["deterministic"].reacted.case.plan)
    modelled = s.modelled - d.modelled + 0.0
    return VssFigures(
        modelled=modelled, modelled_pct=percent(modelled, s.modelled), modelled_range=None, executed=found,
        executed_pct=percent(found.mean, s.executed.mean), distinguishable=found.excludes_zero, same_plan=same,
        verdict=verdict_of(found, "stochastic", "deterministic", same=same))


def _vss_kept(plans: Mapping[str, PlanReacted], *, noisy: bool) -> Gain:
    """The VSS if nobody reacts, by the histories or trials of those who do."""
    s, d = plans["stochastic"], plans["deterministic"]
    found = estimate(_difference(s, d, noisy=noisy, kept=True))
    return Gain(mean=found.mean, ci95=found.ci95, pct=percent(found.mean, _mean(s.kept)))


def _recourse(plan: PlanReacted, *, noisy: bool) -> Gain:
    """What reacting adds to a plan, by the same histories or trials: exactly nothing if no orders change in any.

    A sample without such a mission doesn't show that there is none.
    """
    run = plan.reacted
    if not run.reacted.any() and (run.enumerated or run.case.news == "never"):
        return Gain(mean=0.0, ci95=(0.0, 0.0), pct=percent(0.0, _mean(plan.kept)))
    low, high = _taken(plan, noisy=noisy)
    found = estimate(_figure(run, plan.kept, (low - high, high - low), noisy=noisy))
    return Gain(mean=found.mean, ci95=found.ci95, pct=percent(found.mean, _mean(plan.kept)))


def _best(plans: Mapping[str, PlanReacted], ranked: Sequence[str], *, noisy: bool) -> BestPlan:
    first = plans[ranked[0]]
    others = [name for name in ranked[1:]
              if not plans[name].reacted.case.plan.drives_like(first.reacted.case.plan)]
    if not others:
        return BestPlan(plan=ranked[0], over=None, mean=0.0, ci95=None)
    found = estimate(_difference(first, plans[others[0]], noisy=noisy))
    return BestPlan(plan=ranked[0], over=others[0], mean=found.mean, ci95=found.ci95)


def _difference(a: PlanReacted, b: PlanReacted, *, noisy: bool, kept: bool = False) -> Figure:
    """Value of one plan less that of another, by the same histories or trials; ``kept``: if nobody reacts."""
    (least_a, most_a), (least_b, most_b) = _taken(a, noisy=noisy), _taken(b, noisy=noisy)
    same = a.reacted.case.plan.drives_like(b.reacted.case.plan)
    bounds = (0.0, 0.0) if same else (least_a - most_b, most_a - least_b)
    return _figure(a.kept if kept else a.reacted, b.kept if kept else b.reacted, bounds, noisy=noisy)


def _figure(a: Reacted, b: Reacted | None, taken_bounds: Bounds, *, noisy: bool) -> Figure:
    """Value of a team, or of one less that of another.

    Where histories are enumerated, the expectation over failures is known for each noise draw, and these are the
    sample; without noise nothing varies at all.
    """
    nominal = a.nominal if b is None else a.nominal - b.nominal
    value = a.value.sum(axis=1)
    if a.enumerated:
        draws = int(a.rollout.max()) + 1
        means = np.asarray(draws * np.bincount(a.rollout, weights=a.weight * value), dtype=np.float64)
        if b is not None:
            means = means - draws * np.bincount(b.rollout, weights=b.weight * b.value.sum(axis=1))
        if not noisy:
            mean = float(means[0])
            return Figure(drawn=Moments(count=2, mean=mean, squares=0.0), drawn_bounds=(mean, mean),
                          taken=Clusters(counts=np.zeros(0, dtype=np.int64), sums=np.zeros(0)), taken_bounds=(0.0, 0.0))
        sure = float(nominal)
        return Figure(drawn=Moments(count=draws, mean=sure, squares=0.0), drawn_bounds=(sure, sure),
                      taken=Clusters(counts=np.ones(draws, dtype=np.int64), sums=sure - means),
                      taken_bounds=taken_bounds)
    low, high = a.bounds
    bounds = (low, high) if b is None else (low - high, high - low)
    if b is not None:
        value = value - b.value.sum(axis=1)
    return figure_of(nominal, bounds, nominal - value, taken_bounds, a.rollout, noisy=noisy)


def _taken(plan: PlanReacted, *, noisy: bool) -> Bounds:
    """Bounds on the mean loss in a noise draw that was not observed: those of the plan without reaction."""
    return mean_taken(plan.executed, plan.executed.margins, noisy=noisy)


def _modelled(run: Reacted) -> float:
    return float(np.mean(run.nominal)) + 0.0


def _mean(run: Reacted) -> float:
    return float(run.weight @ run.value.sum(axis=1)) + 0.0


def _distribution(run: Reacted) -> Distribution:
    return weighted_distribution(run.value.sum(axis=1), run.weight)
