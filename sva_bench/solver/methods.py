"""The registry of solution methods, one line each, and the rule by which ``auto`` chooses among them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from sva_bench import choices
from sva_bench.choices import Method
from sva_bench.errors import BadInput
from sva_bench.solver.columns.prove import prove_by_columns
from sva_bench.solver.edges.incumbent import Guide
from sva_bench.solver.edges.tree import prove_by_tree
from sva_bench.solver.flow.branch_and_cut import prove_by_cuts
from sva_bench.solver.flow.expected import DirectedModel
from sva_bench.solver.flow.lshaped import prove_by_lshaped
from sva_bench.solver.flow.recourse import EquivalentModel
from sva_bench.solver.flow.undirected import UndirectedModel, lacking, serves
from sva_bench.solver.problem import Problem
from sva_bench.solver.routes.long_routes import guided

LONG = {1: 2.0, 2: 2.0, 3: 2.2, 4: 2.2}
"""Mission limit, in longest legs, from which the edge model is faster than branch-and-price, by number of vehicles."""


@dataclass(frozen=True, kw_only=True)
class SolutionMethod:
    """A solution method.

    Attributes:
        name: Its name in options; ``choices.METHODS`` has its description.
        prove: Proves the plan of a problem's progress, or a better one, within the gap.
        second_stage: Whether it keeps the second stage explicitly, as in the paper.
        discounts: Whether it supports rewards that depend on the order of visits or on driving times.
        risk: Whether it supports measures of risk.
        lacking: What it requires and an instance lacks, whatever the goal.
    """

    name: Method
    prove: Callable[[Problem], None]
    second_stage: bool = False
    discounts: bool = False
    risk: bool = False
    lacking: Callable[[Problem], str] = lambda problem: ""  # noqa: ARG005

    @property
    def description(self) -> str:
        """What it is, in a few words."""
        return choices.METHODS[self.name]

    def refused(self, problem: Problem) -> str:
        """Why it doesn't support this problem; nothing where it does."""
        if problem.goal.discounts is not None and not self.discounts:
            return "failures may come along the route"
        if problem.goal.risk is not None and not self.risk:
            return "a measure of risk is asked for"
        return self.lacking(problem)


def _directed(problem: Problem) -> None:
    prove_by_cuts(DirectedModel(problem.instance, problem.scopes, problem.goal, problem.known.legs_by_vehicle), problem)


def _undirected(problem: Problem) -> None:
    prove_by_tree(problem, _guide(problem))


def _guide(problem: Problem) -> Guide | None:
    """The search over long routes near a node's relaxation; ``None`` for goals and tanks that it doesn't know."""
    goal, tables = problem.goal, problem.known.tables
    if goal.floors or goal.driving or (goal.weights < 0).any() or np.isfinite(tables.capacity_s).any():
        return None
    seeds = itertools.count()
    return lambda allowed: guided(tables, goal.weights, problem.progress.orders, allowed, seed=next(seeds),
                                  stop=lambda _: problem.clock.is_over())


def _edge_mip(problem: Problem) -> None:
    prove_by_cuts(UndirectedModel(problem.instance, problem.scopes, problem.goal), problem)


def _equivalent(problem: Problem, *, relaxed: bool = False) -> None:
    prove_by_cuts(EquivalentModel(problem.instance, problem.scopes, problem.goal, problem.known.legs_by_vehicle,
                                  problem.second_stage, relaxed=relaxed), problem)


def _relaxed(problem: Problem) -> None:
    _equivalent(problem, relaxed=True)


def _lacking_edges(problem: Problem) -> str:
    return lacking(problem.instance, problem.scopes)


_ALL = (
    SolutionMethod(name="expected", prove=_directed),
    SolutionMethod(name="dep", prove=_equivalent, second_stage=True),
    SolutionMethod(name="relaxed", prove=_relaxed, second_stage=True),
    SolutionMethod(name="lshaped", prove=prove_by_lshaped, second_stage=True),
    SolutionMethod(name="undirected", prove=_undirected, lacking=_lacking_edges),
    SolutionMethod(name="edge-mip", prove=_edge_mip, lacking=_lacking_edges),
    SolutionMethod(name="branch-and-price", prove=prove_by_columns, discounts=True, risk=True),
)
METHODS: Mapping[Method, SolutionMethod] = {method.name: method for method in _ALL}
"""The methods by name; ``auto`` is one of them, chosen by ``choice``."""


def keeps_second_stage(name: Method) -> bool:
    """Whether a method keeps the second stage explicitly; ``auto`` chooses none that does."""
    return name in METHODS and METHODS[name].second_stage


def serves_discounts(name: Method) -> bool:
    """Whether a method supports rewards that depend on the order of visits or on driving times; ``auto`` chooses one
    that does."""
    return name not in METHODS or METHODS[name].discounts


def method_for(name: Method, problem: Problem) -> SolutionMethod:
    """The method of that name, or the one that ``auto`` chooses.

    Raises:
        BadInput: If it doesn't support the problem.
    """
    method = METHODS[name if name in METHODS else choice(problem)]
    if why := method.refused(problem):
        raise BadInput(f"instance {problem.instance.name}: the method {method.name} ({method.description}) doesn't "
                       f"support it, for {why}; take the method auto")
    return method


def choice(problem: Problem) -> Method:
    """The method that ``auto`` chooses, by the measurements of ``benchmarks/solver``.

    Long routes without refuels, of few vehicles, over symmetric costs are solved by the edge model. Without a mission
    limit routes are too long for labels, and the directed model serves. All others go to branch-and-price, and
    failures along the route and measures of risk are supported by no other method.
    """
    instance, scopes, goal = problem.instance, problem.scopes, problem.goal
    if goal.discounts is not None or goal.risk is not None:
        return "branch-and-price"
    if not all(math.isfinite(v.mission_limit_s) for v in instance.vehicles):
        return "expected"
    # Of all legs of the instance: with a short limit, the legs of the scopes are short too.
    longest = max((float(v.leg_time_s[np.isfinite(v.leg_time_s)].max()) for v in instance.vehicles), default=0.0)
    shortest_limit = min((v.mission_limit_s for v in instance.vehicles), default=0.0)
    if len(scopes) in LONG and shortest_limit >= LONG[len(scopes)] * longest and serves(instance, scopes):
        return "undirected"
    return "branch-and-price"
