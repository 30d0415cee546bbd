"""The heuristic in front of a proof, and beside a long one."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.arrays import FloatArray
from sva_bench.solver.goal import Goal
from sva_bench.solver.knowledge import adopt
from sva_bench.solver.problem import Problem
from sva_bench.solver.routes.heuristic import search
from sva_bench.solver.routes.packing import Route


def searched(problem: Problem, *, seed: int = 0) -> Sequence[Route]:
    """Improve the incumbent by the heuristic; the good routes that it found, each with its vehicle.

    Args:
        problem: The problem.
        seed: Seed of its random choices.
    """
    goal, progress, clock = problem.goal, problem.progress, problem.clock
    if (goal.floors and not goal.risk) or goal.driving or bool((goal.weights < 0).any()):
        return ()
    started_s = clock.used_s()
    found = search(
        problem.known.tables, _weights(goal), goal.discounts, progress.orders, seed=seed, starts=problem.starts,
        stop=lambda value: clock.is_over() or (
            goal.risk is None and progress.bound - value <= problem.gap * abs(value)),
        offer=lambda orders: adopt(progress, goal, problem.known, orders))
    adopt(progress, goal, problem.known, found.orders)
    progress.seconds["heuristic"] = progress.seconds.get("heuristic", 0.0) + clock.used_s() - started_s
    return found.routes


def _weights(goal: Goal) -> FloatArray:
    """Weights that the heuristic maximises, shape (M, n): a measure of risk is replaced by its expected incentive."""
    if goal.risk is None:
        return goal.weights
    outcomes = goal.risk.outcomes
    return goal.weights + goal.risk.measure.weight * outcomes.incentives * (
        outcomes.probability @ outcomes.available)[:, None]
