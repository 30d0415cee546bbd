"""The collapsed model with a column for each leg: serves any costs. ``formulation.py`` has the mathematics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.mission.instance import Instance
from sva_bench.solver.flow.cuts import cut_rows
from sva_bench.solver.flow.formulation import columns_of, formulate
from sva_bench.solver.goal import Goal
from sva_bench.solver.knowledge import Cut, route_over
from sva_bench.solver.preprocess import Scope
from sva_bench.solver.program import LinearModel, Rows
from sva_bench.solver.routes.heuristic import VisitOrders
from sva_bench.solver.routes.refuelling import VehicleLegs


class DirectedModel:
    """The collapsed model of one goal: a ``FlowModel`` of ``branch_and_cut``."""

    def __init__(
        self, instance: Instance, scopes: Sequence[Scope], goal: Goal, legs_by_vehicle: Sequence[VehicleLegs],
    ) -> None:
        self._instance, self._scopes, self._legs_by_vehicle = instance, scopes, legs_by_vehicle
        self.model: LinearModel
        self.model, self.legs = formulate(instance, scopes, goal)
        self._pois = frozenset(instance.pois)

    def rows(self, cuts: Sequence[Cut]) -> Rows:
        """The connectivity cuts as rows over the model's columns."""
        return cut_rows(cuts, self.legs, len(self._instance.sites))

    def visits(self, values: FloatArray, vehicle: int) -> FloatArray:
        """How often a vehicle drives each leg, ``y``, shape (n, n)."""
        return self.legs.matrix(values, vehicle, len(self._instance.sites))

    def order(self, values: FloatArray, vehicle: int) -> tuple[int, ...]:
        """POIs of a vehicle's route, in order of visit."""
        walk = euler_walk(np.rint(self.visits(values, vehicle)), self._instance.base)
        return tuple(j for j in walk if j in self._pois)

    def point(self, orders: VisitOrders) -> FloatArray | None:
        """A plan as a point of the model; ``None`` where it uses a leg that the model leaves out."""
        routes = [route_over(own_legs, order) for own_legs, order in zip(self._legs_by_vehicle, orders, strict=True)]
        return columns_of(self._instance, self.legs, self._scopes, routes)


def euler_walk(visits: FloatArray, base: int) -> list[int]:
    """An Eulerian walk from base to base over the legs of the base's component.

    Any of them serves: a POI is entered and left once, so the partial routes between refuels are the same in all.

    Args:
        visits: How often each leg is driven, shape (n, n); balanced: into each site as often as out of it.
        base: The base.

    Source:
        Hierholzer (1873), "Ueber die Moeglichkeit, einen Linienzug ohne Wiederholung zu umfahren".
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


