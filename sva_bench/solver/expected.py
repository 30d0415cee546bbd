"""The collapsed model proved by branch and cut: cuts at the root, branch and bound, more cuts."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.mission.instance import Instance
from sva_bench.solver.cuts import Cut, cut_rows, violated_by_fractions, violated_by_integers
from sva_bench.solver.formulation import Goal, Legs, LinearModel, columns_of, formulate
from sva_bench.solver.highs import Outcome, Relaxation, maximise
from sva_bench.solver.knowledge import Clock, Knowledge, Progress, adopt, drive, without_idle_stops
from sva_bench.solver.preprocess import Scope, scope_of
from sva_bench.solver.refuelling import quickest

_log = logging.getLogger(__name__)

ROOT_ROUNDS = 60
_STALL = 1e-4  # relative gain of the bound below which a round counts as idle
_IDLE_ROUNDS = 4


def prove_by_cuts(
    instance: Instance, goal: Goal, known: Knowledge, clock: Clock, gap: float, progress: Progress,
) -> None:
    """Prove the plan of ``progress``, or a better one, within the gap, by the directed model."""
    rewarded = goal.rewarded()
    scopes = [scope_of(instance, v, rewarded[m]) for m, v in enumerate(instance.vehicles)]
    model, legs = formulate(instance, scopes, goal)
    largest = float(np.abs(model.objective).max(initial=0.0))
    # Whole incentives stay whole: HiGHS then rounds its bounds.
    size = 1.0 if largest == 0 or 1 <= largest <= 1e4 else largest
    model = replace(model, objective=model.objective / size)
    began = clock.used_s()
    cuts = _root(instance, known, clock, gap, progress, model, legs, size)
    progress.seconds["root"] = clock.used_s() - began
    began = clock.used_s()
    _branch(instance, goal, known, clock, gap, progress, model, legs, scopes, size, cuts)
    progress.seconds["branch"] = clock.used_s() - began


def _root(
    instance: Instance, known: Knowledge, clock: Clock, gap: float, progress: Progress,
    model: LinearModel, legs: Legs, size: float,
) -> list[Cut]:
    """Tighten the relaxation by cuts; the ones that are tight in the end. Lowers the bound of ``progress``."""
    n = len(instance.sites)
    cuts = list(known.cuts)
    relaxation = Relaxation(model)
    relaxation.add(cut_rows(cuts, legs, n))
    present, idle, last = set(cuts), 0, math.inf
    activity: FloatArray = np.zeros(0)
    for _ in range(ROOT_ROUNDS):
        if clock.out() or progress.closed(gap):
            break
        relaxed = relaxation.solve(clock.left_s())
        progress.rounds += 1
        if relaxed.status == "infeasible":
            progress.bound = progress.value
            break
        if relaxed.values is None:
            break
        activity = relaxed.activity
        progress.tighten(relaxed.objective * size)
        idle = idle + 1 if last - relaxed.objective < _STALL * max(abs(relaxed.objective), 1e-9) else 0
        last = relaxed.objective
        new = [cut for cut in _separate(instance, legs, relaxed.values) if cut not in present]
        if not new or idle >= _IDLE_ROUNDS:
            break
        relaxation.add(cut_rows(new, legs, n))
        cuts += new
        present.update(new)
    slack = activity[len(model.rows.lower):]
    tight = [cut for cut, room in zip(cuts, slack, strict=False) if room < 1e-6]
    known.cuts.update(dict.fromkeys(tight))
    _log.debug("root: bound %.6g, value %.6g, %d of %d cuts kept", progress.bound, progress.value, len(tight),
               len(cuts))
    return tight


def _branch(
    instance: Instance, goal: Goal, known: Knowledge, clock: Clock, gap: float, progress: Progress,
    model: LinearModel, legs: Legs, scopes: Sequence[Scope], size: float, cuts: list[Cut],
) -> None:
    """Branch and bound, again with every cut that its solution breaks."""
    n = len(instance.sites)
    pois = frozenset(instance.pois)
    while not progress.closed(gap):
        if clock.out():
            progress.status = "time_limit"
            return
        progress.cuts = len(cuts)
        routes = [drive(road, order) for road, order in zip(known.roads, progress.orders, strict=True)]
        slack = max(gap / 2 * max(1.0, abs(progress.value)), 0.99 * progress.grain)  # below the grain there is no plan
        outcome = maximise(
            model, cut_rows(cuts, legs, n), gap=gap / 2, absolute_gap=slack / size,
            time_limit_s=clock.left_s(), start=columns_of(instance, legs, scopes, routes))
        progress.rounds += 1
        progress.nodes += outcome.nodes
        progress.tighten(progress.value if outcome.status == "infeasible" else outcome.bound * size)
        broken = _integers(instance, goal, known, legs, outcome, pois, progress)
        if outcome.status in ("time_limit", "interrupted"):
            progress.status = outcome.status
            return
        if not broken:
            return
        new = [replace(cut, vehicle=m) for cut in broken for m in range(len(instance.vehicles))]
        cuts = list(dict.fromkeys([*cuts, *new]))
        known.cuts.update(dict.fromkeys(new))
        _log.debug("branch: bound %.6g, value %.6g, %d cuts broken", progress.bound, progress.value, len(broken))


def _integers(
    instance: Instance, goal: Goal, known: Knowledge, legs: Legs, outcome: Outcome, pois: frozenset[int],
    progress: Progress,
) -> list[Cut]:
    """Take up an integer solution, as far as it hangs together with the base; the cuts that it breaks."""
    if outcome.values is None:
        return []
    broken: list[Cut] = []
    orders = []
    for m, road in enumerate(known.roads):
        visits = np.rint(legs.matrix(outcome.values, m, len(instance.sites)))
        broken += violated_by_integers(visits, m, instance.base, pois)
        order = tuple(j for j in euler_walk(visits, instance.base) if j in pois)
        if quickest(road, order) is None:
            raise RuntimeError(f"the solver's route of {instance.vehicles[m].name} breaks its fuel or limit")
        orders.append(without_idle_stops(road, order, goal.rewarded()[m]))
    adopt(progress, goal, known, tuple(orders))
    return broken


def _separate(instance: Instance, legs: Legs, values: FloatArray) -> list[Cut]:
    pois = frozenset(instance.pois)
    return [cut for m in range(len(instance.vehicles))
            for cut in violated_by_fractions(legs.matrix(values, m, len(instance.sites)), m, instance.base, pois)]


def euler_walk(visits: FloatArray, base: int) -> list[int]:
    """A walk from base to base that drives every leg as often as ``visits`` says, as far as legs join up with the base.

    Any such walk will do: a POI is entered and left once, so the stretches between refuels are the same in all.

    Args:
        visits: How often each leg is driven, shape (n, n); as often into a site as out of it.
        base: The base.

    Source:
        Hierholzer (1873).
    """
    left = visits.copy()
    stack, walk = [base], []
    while stack:
        onward = np.flatnonzero(left[stack[-1]] > 0.5)
        if len(onward):
            left[stack[-1], onward[0]] -= 1
            stack.append(int(onward[0]))
        else:
            walk.append(stack.pop())
    return walk[::-1]


