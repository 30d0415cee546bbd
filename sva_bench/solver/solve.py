"""A goal solved: the best known plan, a heuristic, and a proof by the method that suits."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import Cuts
from sva_bench.interrupts import deferring_ctrl_c, hearing_ctrl_c
from sva_bench.mission.instance import Instance
from sva_bench.solver.columns.branch_and_price import BranchAndPrice
from sva_bench.solver.columns.column_generation import ColumnGeneration
from sva_bench.solver.flow.branch_and_cut import FlowModel, prove_by_cuts
from sva_bench.solver.flow.expected import DirectedModel
from sva_bench.solver.flow.lshaped import prove_by_duals
from sva_bench.solver.flow.recourse import EquivalentModel
from sva_bench.solver.flow.undirected import UndirectedModel, serves
from sva_bench.solver.knowledge import (
    Clock,
    Knowledge,
    Progress,
    Solution,
    adopt,
    best_known,
    drive,
    grain_of,
    trivial_bound,
    value_of,
)
from sva_bench.solver.outcomes import Outcomes
from sva_bench.solver.preprocess import Scope, scope_of
from sva_bench.solver.program import Goal
from sva_bench.solver.routes.heuristic import Orders, search, shorten
from sva_bench.solver.routes.packing import Route
from sva_bench.solver.units import ROUNDING, factor_of, most_of_a_visit

Method = Literal["auto", "expected", "dep", "relaxed", "lshaped", "undirected", "branch-and-price"]
TWO_STAGE: tuple[Method, ...] = ("dep", "relaxed", "lshaped")
"""Methods that keep the second stage as the paper has it."""

_log = logging.getLogger(__name__)

LONG = {1: 2.0, 2: 2.0, 3: 2.6, 4: 2.6}
"""Mission limit in longest legs from which the edge model proves sooner than columns do, by number of vehicles."""
_WITHIN = 0.99  # of the gap, for rounding


def solve(
    instance: Instance, goal: Goal, known: Knowledge, clock: Clock, gap: float, method: Method = "auto",
    recourse: Outcomes | None = None, cuts: Cuts = "single",
) -> Solution:
    """The best plan for a goal, with a proof unless time runs out or Ctrl-C is pressed.

    Args:
        instance: The instance.
        goal: What to maximise.
        known: What earlier solves found; this one adds to it.
        clock: Time left.
        gap: Gap at which the plan counts as optimal.
        method: How to prove it: ``auto`` chooses; ``expected`` is the collapsed model by branch and cut; ``dep``,
            ``relaxed`` and ``lshaped`` keep the second stage.
        recourse: The second stage, for those that keep it.
        cuts: Optimality cuts of ``lshaped``.

    Raises:
        ValueError: If the goal has floors and no known plan reaches them.
    """
    with deferring_ctrl_c():
        return _solve(instance, goal, known, clock, gap, method, recourse, cuts)


def _solve(
    instance: Instance, goal: Goal, known: Knowledge, clock: Clock, gap: float, method: Method,
    recourse: Outcomes | None, cuts: Cuts,
) -> Solution:
    start = best_known(goal, known)
    if start is None:
        raise ValueError("no known plan reaches the floors of the goal")
    rewarded = goal.rewarded()
    scopes = [scope_of(instance, v, rewarded[m]) for m, v in enumerate(instance.vehicles)]
    goal = goal.within(np.array([scope.legs.any(axis=0) for scope in scopes]).reshape(goal.weights.shape))
    constant = 0.0
    if goal.risk is not None:
        goal = goal.essential()
        constant = 0.0 if goal.risk is None else goal.risk.constant
    factor = factor_of(goal)
    goal = goal.times(factor)
    progress = Progress(orders=start, value=value_of(goal, known.roads, start), bound=trivial_bound(goal),
                        grain=grain_of(goal), rounding=ROUNDING * most_of_a_visit(goal), constant=factor * constant)
    if method == "auto":
        method = choice(instance, scopes, goal)
    try:
        with hearing_ctrl_c():
            _search_and_prove(instance, scopes, goal, known, clock, gap, method,
                              None if recourse is None else recourse.times(factor), cuts, progress)
    except KeyboardInterrupt:
        progress.status = "interrupted"
    if progress.bound - progress.value <= progress.rounding:
        progress.bound = progress.value
    if progress.closed(gap):
        progress.status = "optimal"
    orders = progress.orders
    if not goal.driving and goal.survival is None and progress.status != "interrupted":
        orders = shorten(known.tables, orders)
    known.orders[orders] = None
    return Solution(
        routes=tuple(drive(road, order) for road, order in zip(known.roads, orders, strict=True)), orders=orders,
        value=progress.value / factor, bound=progress.bound / factor, status=progress.status, nodes=progress.nodes,
        cuts=progress.cuts, optimality_cuts=progress.optimality_cuts, rounds=progress.rounds, seconds=progress.seconds,
        method=method)


def _search_and_prove(
    instance: Instance, scopes: Sequence[Scope], goal: Goal, known: Knowledge, clock: Clock, gap: float,
    method: Method, recourse: Outcomes | None, cuts: Cuts, progress: Progress,
) -> None:
    """Find a good plan, and prove it or a better one, as far as time allows."""
    routes: Sequence[Route] = ()
    if (not goal.floors or goal.risk) and not goal.driving and bool((goal.weights >= 0).all()):
        began = clock.used_s()
        found = search(
            known.tables, _searched(goal), goal.chances(), progress.orders,
            stop=lambda value: clock.out() or (
                goal.risk is None and progress.bound - value <= gap * abs(value)),
            offer=lambda orders: adopt(progress, goal, known, orders))
        adopt(progress, goal, known, found.orders)
        routes = found.routes
        progress.seconds["heuristic"] = clock.used_s() - began
    if progress.closed(gap):
        return
    if method == "branch-and-price":
        _prove_by_columns(instance, scopes, goal, known, clock, gap, progress, routes)
    elif method == "lshaped" and recourse is not None:
        prove_by_duals(instance, scopes, goal, recourse, cuts, known, clock, gap, progress)
    else:
        prove_by_cuts(_model(instance, scopes, goal, known, method, recourse), instance, goal, known, clock, gap,
                      progress)


def _searched(goal: Goal) -> FloatArray:
    """What the heuristic maximises: the goal, or in place of a measure of risk what it takes the mean of."""
    if goal.risk is None:
        return goal.weights
    outcomes = goal.risk.outcomes
    return goal.weights + goal.risk.measure.weight * outcomes.incentives * (
        outcomes.probability @ outcomes.available)[:, None]


def _model(
    instance: Instance, scopes: Sequence[Scope], goal: Goal, known: Knowledge, method: Method,
    recourse: Outcomes | None,
) -> FlowModel:
    if method == "undirected":
        return UndirectedModel(instance, scopes, goal)
    if method == "expected":
        return DirectedModel(instance, scopes, goal, known.roads)
    if recourse is None:
        raise ValueError(f"the method {method} needs a second stage")
    return EquivalentModel(instance, scopes, goal, known.roads, recourse, relaxed=method == "relaxed")


def choice(instance: Instance, scopes: Sequence[Scope], goal: Goal) -> Method:
    """The rule that chooses, by what was measured in ``benchmarks/solver``.

    Long routes that never refuel, by few vehicles, over symmetric costs want the edge model. Where a mission limit is
    missing routes are too long for labels, and the directed model takes over. All else wants routes as columns, and
    failures along the route and measures of risk leave no other choice.
    """
    if goal.survival is not None or goal.risk is not None:
        return "branch-and-price"
    if not all(math.isfinite(v.mission_limit_s) for v in instance.vehicles):
        return "expected"
    # Of all legs: those that a short limit leaves are short themselves.
    longest = max((float(v.fuel_s[np.isfinite(v.fuel_s)].max()) for v in instance.vehicles), default=0.0)
    shortest_limit = min((v.mission_limit_s for v in instance.vehicles), default=0.0)
    if len(scopes) in LONG and shortest_limit >= LONG[len(scopes)] * longest and serves(instance, scopes):
        return "undirected"
    return "branch-and-price"


def _prove_by_columns(
    instance: Instance, scopes: Sequence[Scope], goal: Goal, known: Knowledge, clock: Clock, gap: float,
    progress: Progress, routes: Sequence[Route],
) -> None:
    """Prove the plan of ``progress``, or a better one, within the gap, by branch-and-price."""
    began = clock.used_s()

    def cutoff() -> float:
        """Bounds up to here hold nothing better: too close, or below the next value that a plan can have."""
        return progress.value + progress.slack(_WITHIN * gap)

    def offer(orders: Orders) -> None:
        adopt(progress, goal, known, orders)

    generation = ColumnGeneration(instance=instance, goal=goal, scopes=scopes, survival=goal.chances(), cutoff=cutoff,
                                  out=clock.out, left_s=clock.left_s)
    for m, order in (*enumerate(progress.orders), *routes):
        generation.add_route(m, drive(known.roads[m], order))
    search_tree = BranchAndPrice(generation=generation, offer=offer, left_s=clock.left_s, tell=progress.tighten)
    try:
        if search_tree.run():
            progress.tighten(cutoff())
        elif clock.out():
            progress.status = "time_limit"
    finally:
        progress.nodes, progress.rounds = search_tree.nodes, generation.priced
        progress.seconds["columns"] = clock.used_s() - began
        _log.debug("columns: %d nodes, %d columns, %s", search_tree.nodes, len(generation.pool), generation.calls)
