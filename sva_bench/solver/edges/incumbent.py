"""The incumbent of the tree: plans from integer points and from the heuristic, and the value that counts as better."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.solver.edges.box import Box, Inspect
from sva_bench.solver.flow.undirected import UndirectedModel
from sva_bench.solver.knowledge import adopt, value_of, without_idle_stops
from sva_bench.solver.problem import Problem
from sva_bench.solver.routes.heuristic import VisitOrders
from sva_bench.solver.routes.refuelling import quickest_route

Guide = Callable[[BoolArray], VisitOrders | None]
"""A heuristic over the pairs (vehicle, POI) that are allowed, shape (M, n): a feasible plan, or none."""
GUIDING = 0.01
"""Share of a visit in a relaxation from which a heuristic may use it."""
_WITHIN = 0.99  # of the gap, for rounding
_EXACT = 1e-9  # relative; a bound that exceeds its own plan's value by less does so by rounding


@dataclass(eq=False, kw_only=True)
class Incumbent:
    """The best plan so far, and what is known of all better ones.

    Attributes:
        flow: The model.
        problem: The problem.
        size: Unit of the linear programs' objective.
        box: Bounds that hold for every better plan.
        guide: A heuristic for plans near a relaxation; ``None`` = none.
        inspect: Told of every pruning.
        roots: Bounds and reduced costs of the whole problem: they tighten the box as the incumbent gets better.
    """

    flow: UndirectedModel
    problem: Problem
    size: float
    box: Box
    guide: Guide | None = None
    inspect: Inspect | None = None
    roots: list[tuple[float, FloatArray]] = field(default_factory=list)

    @property
    def cutoff(self) -> float:
        """Value up to which points are of no interest: within the gap, or below the next possible value."""
        return self._enough() / self.size

    @property
    def columns(self) -> IntArray:
        """Columns that a better plan can have, and all visits, which cuts are written over."""
        return np.flatnonzero((self.box.upper > 0) | (self.flow.ends[:, 0] < 0))

    def _enough(self) -> float:
        progress = self.problem.progress
        return progress.value + progress.slack(_WITHIN * self.problem.gap)

    def tighten(self, bound: float) -> None:
        """Lower the bound on all plans, which is at least the cutoff."""
        self.problem.progress.tighten(max(bound * self.size, self._enough()))

    def pruned(self, box: Box, left: Box | None = None) -> None:
        """Tell of a pruning."""
        if self.inspect is not None:
            self.inspect(box, left)

    def narrow(self, bound: float, reduced: FloatArray) -> None:
        """Tighten the box by a relaxation of the whole problem."""
        after = self.box.above(self.cutoff, bound, reduced)
        self.pruned(self.box, after)
        self.box = after

    def _improved(self) -> None:
        for bound, reduced in self.roots:
            # The bound holds for the box of its time, so it holds for this smaller one.
            after = self.box.above(self.cutoff, bound, reduced)
            self.pruned(self.box, after)
            self.box = after

    def offer(self, values: FloatArray, bound: float) -> bool:
        """Take an integer point, connected with the base, as a plan; whether none of its node is better.

        Args:
            values: The point.
            bound: Upper bound on the node.
        """
        instance, goal, known = self.problem.instance, self.problem.goal, self.problem.known
        driven = tuple(self.flow.order(values, m) for m in range(len(instance.vehicles)))
        if not self._is_feasible(driven):
            return False  # by less than tolerances: its node is divided further
        before = self.problem.progress.value
        short = tuple(without_idle_stops(legs, order, goal.rewarded()[m]) for m, (legs, order) in
                      enumerate(zip(known.legs_by_vehicle, driven, strict=True)))
        adopt(self.problem.progress, goal, known, short)
        if goal.driving:  # without the triangle inequality a stop without reward may be a shortcut
            adopt(self.problem.progress, goal, known, driven)
        if self.problem.progress.value > before:
            self._improved()
        own = value_of(goal, known.legs_by_vehicle, driven) / self.size
        return bound - own <= _EXACT * max(abs(bound), abs(own)) and bool(
            self.problem.progress.value / self.size >= own - _EXACT * abs(own))

    def _is_feasible(self, orders: VisitOrders) -> bool:
        """Whether every vehicle has a route over its POIs."""
        return all(quickest_route(legs, order) is not None
                   for legs, order in zip(self.problem.known.legs_by_vehicle, orders, strict=True))

    def search(self, values: FloatArray, times: int) -> None:
        """Let the heuristic look for plans near a relaxation's optimum."""
        if self.guide is None:
            return
        visit = self.flow.visit
        allowed = (visit >= 0) & (values[visit] > GUIDING)
        before = self.problem.progress.value
        for _ in range(times):
            if self.problem.clock.is_over():
                return
            found = self.guide(allowed)
            if found is not None and self._is_feasible(found):  # a wrong incumbent would be a wrong proof
                adopt(self.problem.progress, self.problem.goal, self.problem.known, found)
        if self.problem.progress.value > before:
            self._improved()


def is_integer(values: FloatArray) -> bool:
    """Whether a point is integer but for rounding."""
    return bool((np.abs(values - np.rint(values)) < 1e-6).all())
