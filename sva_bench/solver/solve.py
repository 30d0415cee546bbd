"""One solve: the best known plan, a heuristic, and a proof by the chosen method."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import Cuts, Method
from sva_bench.interrupts import deferring_ctrl_c, hearing_ctrl_c
from sva_bench.mission.instance import Instance
from sva_bench.solver.discounts import greatest_survival, leg_survival
from sva_bench.solver.goal import Goal
from sva_bench.solver.knowledge import (
    Clock,
    Knowledge,
    Progress,
    Solution,
    best_known,
    grain_of,
    routes_of,
    trivial_bound,
    value_of,
)
from sva_bench.solver.methods import method_for
from sva_bench.solver.outcomes import Outcomes
from sva_bench.solver.preprocess import Scope, scope_of
from sva_bench.solver.problem import Problem
from sva_bench.solver.routes.heuristic import STARTS, shorten
from sva_bench.solver.searching import searched
from sva_bench.solver.units import ROUNDING, factor_of, most_of_a_visit

_log = logging.getLogger(__name__)


def solve(
    instance: Instance, goal: Goal, known: Knowledge, clock: Clock, gap: float, method: Method = "auto",
    recourse: Outcomes | None = None, cuts: Cuts = "single", starts: int = STARTS, beyond: float = 0.0,
) -> Solution:
    """The best plan for a goal, with a proof unless time runs out or Ctrl-C is pressed.

    Args:
        instance: The instance.
        goal: What to maximise.
        known: What earlier solves found; this one adds to it.
        clock: Time left.
        gap: Gap at which the plan counts as optimal.
        method: How to prove it.
        recourse: The second stage, for the methods that keep it.
        cuts: Kind of optimality cuts of ``lshaped``.
        starts: Starts of the heuristic; with discounts one does.
        beyond: What every plan's value has besides the goal's; a gap is relative to the smaller of the values with it
            and without.

    Raises:
        BadInput: If the method doesn't support the instance or the goal.
        ValueError: If the goal has floors and no known plan reaches them.
    """
    with deferring_ctrl_c():
        return _solve(instance, goal, known, clock, gap, method, recourse, cuts, starts, beyond)


def _solve(
    instance: Instance, goal: Goal, known: Knowledge, clock: Clock, gap: float, method: Method,
    recourse: Outcomes | None, cuts: Cuts, starts: int, beyond: float,
) -> Solution:
    start = best_known(goal, known)
    if start is None:
        raise ValueError("no known plan reaches the floors of the goal")
    rewarded = goal.rewarded()
    scopes = tuple(scope_of(instance, v, rewarded[m]) for m, v in enumerate(instance.vehicles))
    reach = np.array([scope.legs.any(axis=0) for scope in scopes]).reshape(goal.weights.shape)
    goal = goal.within(reach, None if goal.discounts is None else _arrival(instance, goal, scopes))
    constants: tuple[float, ...] = (0.0,)
    if goal.risk is not None:
        value, goal = value_of(goal, known.legs_by_vehicle, start), goal.essential()
        left_out = value - value_of(goal, known.legs_by_vehicle, start)
        constants = left_out, left_out + beyond
    factor = factor_of(goal)
    goal = goal.times(factor)
    progress = Progress(orders=start, value=value_of(goal, known.legs_by_vehicle, start), bound=trivial_bound(goal),
                        grain=grain_of(goal), rounding=ROUNDING * most_of_a_visit(goal),
                        constants=tuple(factor * constant for constant in constants))
    problem = Problem(instance=instance, scopes=scopes, goal=goal, known=known, clock=clock, gap=gap, progress=progress,
                      recourse=None if recourse is None else recourse.times(factor), cuts=cuts,
                      starts=starts if goal.discounts is None else 1)  # columns find it sooner than further starts
    used = method_for(method, problem)
    if clock.watch is not None:
        clock.watch(progress, factor)
    try:
        with hearing_ctrl_c():
            routes = searched(problem)
            if not progress.closed(gap):
                used.prove(replace(problem, routes=routes))
    except KeyboardInterrupt:
        progress.status = "interrupted"
    if progress.bound - progress.value <= progress.rounding:
        progress.bound = progress.value
    if progress.closed(gap):
        progress.status = "optimal"
    orders = progress.orders
    if not goal.driving and goal.discounts is None and progress.status != "interrupted":
        orders = shorten(known.tables, orders)
    known.orders[orders] = None
    return Solution(
        routes=routes_of(goal, known.legs_by_vehicle, orders), orders=orders,
        value=progress.value / factor, bound=progress.bound / factor, status=progress.status, nodes=progress.nodes,
        cuts=progress.cuts, optimality_cuts=progress.optimality_cuts, rounds=progress.rounds, seconds=progress.seconds,
        method=used.name)


def _arrival(instance: Instance, goal: Goal, scopes: Sequence[Scope]) -> FloatArray:
    """Greatest probability of vehicle m to get to site j, shape (M, n)."""
    pois = np.isin(np.arange(len(instance.sites)), instance.pois)
    return np.array([
        greatest_survival(leg_survival(np.where(scope.legs, scope.driven_s, np.inf), pois, goal.discount(m)),
                          instance.base)
        for m, scope in enumerate(scopes)]).reshape(goal.weights.shape)
