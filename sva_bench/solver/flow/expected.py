"""The collapsed model with a column for each leg: serves any costs. ``formulation.py`` has the mathematics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.mission.instance import Instance
from sva_bench.solver.flow.cuts import cut_rows
from sva_bench.solver.flow.formulation import columns_of, formulate
from sva_bench.solver.goal import Goal
from sva_bench.solver.knowledge import Cut, drive
from sva_bench.solver.preprocess import Scope
from sva_bench.solver.program import LinearModel, Rows
from sva_bench.solver.routes.heuristic import VisitOrders
from sva_bench.solver.routes.refuelling import Road


class DirectedModel:
    """The collapsed model of one goal, as ``branch_and_cut`` wants it."""

    def __init__(self, instance: Instance, scopes: Sequence[Scope], goal: Goal, roads: Sequence[Road]) -> None:
        self._instance, self._scopes, self._roads = instance, scopes, roads
        self.model: LinearModel
        self.model, self.legs = formulate(instance, scopes, goal)
        self._pois = frozenset(instance.pois)

    def rows(self, cuts: Sequence[Cut]) -> Rows:
        """The cuts as rows."""
        return cut_rows(cuts, self.legs, len(self._instance.sites))

    def visits(self, values: FloatArray, vehicle: int) -> FloatArray:
        """``y`` of a vehicle, shape (n, n)."""
        return self.legs.matrix(values, vehicle, len(self._instance.sites))

    def order(self, values: FloatArray, vehicle: int) -> tuple[int, ...]:
        """POIs of a vehicle's route."""
        walk = euler_walk(np.rint(self.visits(values, vehicle)), self._instance.base)
        return tuple(j for j in walk if j in self._pois)

    def point(self, orders: VisitOrders) -> FloatArray | None:
        """A plan as a point."""
        routes = [drive(road, order) for road, order in zip(self._roads, orders, strict=True)]
        return columns_of(self._instance, self.legs, self._scopes, routes)


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


