"""A goal solved: the best known plan, a heuristic, and a proof by the method that suits."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from typing import Literal

from sva_bench.mission.instance import Instance
from sva_bench.solver.branch_and_price import BranchAndPrice
from sva_bench.solver.expected import prove_by_cuts
from sva_bench.solver.formulation import Goal
from sva_bench.solver.heuristic import Orders, search, shorten
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
from sva_bench.solver.packing import Route
from sva_bench.solver.preprocess import scope_of

Method = Literal["auto", "expected"]

_log = logging.getLogger(__name__)

STARTS, ROUNDS = 2, 750  # of the heuristic, when a proof is to follow
_WITHIN = 0.99  # of the gap, for rounding


def solve(
    instance: Instance, goal: Goal, known: Knowledge, clock: Clock, gap: float, method: Method = "auto",
) -> Solution:
    """The best plan for a goal, with a proof unless time runs out or Ctrl-C is pressed.

    Args:
        instance: The instance.
        goal: What to maximise.
        known: What earlier solves found; this one adds to it.
        clock: Time left.
        gap: Gap at which the plan counts as optimal.
        method: ``expected``, the collapsed model by branch and cut, or ``auto``.

    Raises:
        ValueError: If the goal has floors and no known plan reaches them.
    """
    known.check(instance)
    start = best_known(goal, known)
    if start is None:
        raise ValueError("no known plan reaches the floors of the goal")
    progress = Progress(orders=start, value=value_of(goal, known.roads, start), bound=trivial_bound(goal),
                        grain=grain_of(goal))
    routes: Sequence[Route] = ()
    columns = method == "auto" and prefers_columns(instance, goal)
    try:
        if not goal.floors and not goal.driving and bool((goal.weights >= 0).all()):
            began = clock.used_s()
            found = search(
                known.tables, goal.weights, goal.chances(), start, starts=STARTS, rounds=ROUNDS,
                stop=lambda value: clock.out() or progress.bound - value <= gap * max(1.0, value))
            adopt(progress, goal, known, found.orders)
            routes = found.routes
            progress.seconds["heuristic"] = clock.used_s() - began
        if not progress.closed(gap):
            if columns:
                _prove_by_columns(instance, goal, known, clock, gap, progress, routes)
            else:
                prove_by_cuts(instance, goal, known, clock, gap, progress)
    except KeyboardInterrupt:
        progress.status = "interrupted"
    progress.bound = max(progress.bound, progress.value)
    if progress.closed(gap):
        progress.status = "optimal"
    orders = progress.orders
    if not goal.driving and goal.survival is None and progress.status != "interrupted":
        orders = shorten(known.tables, orders)
    known.orders[orders] = None
    return Solution(
        routes=tuple(drive(road, order) for road, order in zip(known.roads, orders, strict=True)), orders=orders,
        value=progress.value, bound=progress.bound, status=progress.status, nodes=progress.nodes, cuts=progress.cuts,
        rounds=progress.rounds, seconds=progress.seconds,
        method="branch-and-price" if columns else "expected")


def prefers_columns(instance: Instance, goal: Goal) -> bool:
    """The rule that chooses: routes as columns, unless a mission limit is missing, which makes routes long."""
    return goal.survival is not None or all(math.isfinite(v.mission_limit_s) for v in instance.vehicles)


def _prove_by_columns(
    instance: Instance, goal: Goal, known: Knowledge, clock: Clock, gap: float, progress: Progress,
    routes: Sequence[Route],
) -> None:
    """Prove the plan of ``progress``, or a better one, within the gap, by branch-and-price."""
    began = clock.used_s()
    rewarded = goal.rewarded()
    scopes = [scope_of(instance, v, rewarded[m]) for m, v in enumerate(instance.vehicles)]

    def cutoff() -> float:
        """Bounds up to here hold nothing better: too close, or below the next value that a plan can have."""
        slack = max(_WITHIN * gap * max(1.0, abs(progress.value)), (1 - 1e-5) * progress.grain)
        return progress.value + slack

    def offer(orders: Orders) -> None:
        adopt(progress, goal, known, orders)

    search_tree = BranchAndPrice(instance=instance, goal=goal, scopes=scopes, survival=goal.chances(), offer=offer,
                                 cutoff=cutoff, out=clock.out, tell=progress.tighten)
    for m, order in (*enumerate(progress.orders), *routes):
        search_tree.add_route(m, drive(known.roads[m], order))
    try:
        if search_tree.run():
            progress.tighten(cutoff())
        elif clock.out():
            progress.status = "time_limit"
    finally:
        progress.nodes, progress.rounds = search_tree.nodes, search_tree.priced
        progress.seconds["columns"] = clock.used_s() - began
        _log.debug("columns: %d nodes, %d columns, %s", search_tree.nodes, len(search_tree.pool), search_tree.calls)
