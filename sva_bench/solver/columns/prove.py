"""The proof of a plan by branch-and-price."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from sva_bench.solver.columns.branch_and_price import BranchAndPrice
from sva_bench.solver.columns.column_generation import ColumnGeneration
from sva_bench.solver.knowledge import adopt, route_over, routes_of
from sva_bench.solver.problem import Problem
from sva_bench.solver.routes.heuristic import VisitOrders
from sva_bench.solver.routes.packing import Route
from sva_bench.solver.searching import searched

_log = logging.getLogger(__name__)

_WITHIN = 0.99  # of the gap, for rounding


def prove_by_columns(problem: Problem) -> None:
    """Prove the plan of ``problem.progress``, or a better one, within the gap, by branch-and-price."""
    began = problem.clock.used_s()

    def cutoff() -> float:
        """A node with a bound up to this has no better plan: within the gap, or below the next possible value."""
        return problem.progress.value + problem.progress.slack(_WITHIN * problem.gap)

    def offer(orders: VisitOrders) -> None:
        adopt(problem.progress, problem.goal, problem.known, orders)

    generation = ColumnGeneration(instance=problem.instance, goal=problem.goal, scopes=problem.scopes,
                                  cutoff=cutoff, is_over=problem.clock.is_over,
                                  left_s=problem.clock.left_s)

    def add(routes: Sequence[Route]) -> None:
        legs_by_vehicle = problem.known.legs_by_vehicle
        for m, route in enumerate(routes_of(problem.goal, legs_by_vehicle, problem.progress.orders)):
            generation.add_route(m, route)
        for m, order in routes:
            generation.add_route(m, route_over(legs_by_vehicle[m], order))

    def search_again(seed: int) -> None:
        add(searched(problem, seed=seed))

    add(problem.routes)
    search_tree = BranchAndPrice(generation=generation, offer=offer, search_again=search_again,
                                 left_s=problem.clock.left_s, report_bound=problem.progress.tighten)
    try:
        if search_tree.run():
            problem.progress.tighten(cutoff())
        elif problem.clock.is_over():
            problem.progress.status = "time_limit"
    finally:
        problem.progress.nodes, problem.progress.rounds = search_tree.nodes, generation.priced
        problem.progress.seconds["columns"] = problem.clock.used_s() - began
        _log.debug("columns: %d nodes, %d columns, %s", search_tree.nodes, len(generation.pool), generation.calls)
