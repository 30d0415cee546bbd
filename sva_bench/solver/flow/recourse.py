"""The second stage as in the paper: what is lost when vehicles fail, as columns of its own in every outcome.

In an outcome the recourse ``v[i,j]`` of legs out of POI i obeys ``sum_j f_ij v_ij = (1 - alpha_m) sum_j f_ij y_ij`` and
``0 <= v <= y``: constraints (14), (15a) and (11a) with the fuel flow substituted. Fuel costs must be positive: a leg of
cost 0 would keep its reward when its vehicle fails.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.errors import BadInput
from sva_bench.mission.instance import Instance
from sva_bench.solver.flow.expected import DirectedModel
from sva_bench.solver.goal import Goal
from sva_bench.solver.outcomes import Outcomes
from sva_bench.solver.preprocess import Scope
from sva_bench.solver.program import LinearModel, RowBuilder, Rows
from sva_bench.solver.routes.heuristic import VisitOrders
from sva_bench.solver.routes.refuelling import VehicleLegs

LEAST_AVAILABILITY = 1e-4
"""Least availability of the most available vehicle: below it the second stage cancels nearly all of the first."""


def refuse_free_legs(instance: Instance) -> None:
    """Refuse an instance with a leg of cost 0.

    Raises:
        BadInput: If it has one.
    """
    for vehicle in instance.vehicles:
        free = np.argwhere((vehicle.fuel_s <= 0) & ~np.eye(len(instance.sites), dtype=np.bool_))
        if len(free):
            i, j = (instance.sites[k] for k in free[0])
            raise BadInput(f"instance {instance.name}: {vehicle.name} drives {i} -> {j} at no cost, and the paper's "
                           "second stage needs costs above 0; use the method auto or expected")


def refuse_seldom_available(instance: Instance, availability: float) -> None:
    """Refuse an instance whose vehicles are hardly ever available.

    The value of a plan is then the small difference of two large sums, and HiGHS's tolerances exceed it.

    Args:
        instance: The instance.
        availability: The greatest availability of its vehicles.

    Raises:
        BadInput: If it is above 0, but less than ``LEAST_AVAILABILITY``.
    """
    if 0 < availability < LEAST_AVAILABILITY:
        raise BadInput(f"instance {instance.name}: no vehicle's availability is above {availability:g}, and the "
                       f"paper's second stage is exact from {LEAST_AVAILABILITY:g}; use the method auto or expected")


class EquivalentModel(DirectedModel):
    """The deterministic equivalent: both stages in one program, the second one integer or relaxed."""

    def __init__(
        self, instance: Instance, scopes: Sequence[Scope], goal: Goal, legs_by_vehicle: Sequence[VehicleLegs],
        recourse: Outcomes, *, relaxed: bool,
    ) -> None:
        super().__init__(instance, scopes, replace(goal, weights=recourse.incentives), legs_by_vehicle)
        legs, first = self.legs, self.model
        self._lost = 1.0 - recourse.available[:, legs.vehicle]  # shape (outcomes, legs)
        count, start = len(legs.vehicle), len(first.objective)
        build = RowBuilder()
        for outcome in range(len(recourse.probability)):
            v = start + outcome * count
            for k in range(count):
                build.add([v + k, k], [1.0, -1.0], -np.inf, 0.0)
            for lost, used in legs_out_of_pois(self, instance, scopes):
                share = float(self._lost[outcome, used[0]])
                build.add([*(v + used), *used], [*lost, *(-share * lost)], 0.0, 0.0)
            for refuelled in np.flatnonzero(~self.out_of_poi(instance)):  # (11a)
                share = float(self._lost[outcome, refuelled])
                build.add([v + int(refuelled), int(refuelled)], [1.0, -share], 0.0, 0.0)
        earned = recourse.incentives[legs.vehicle, legs.destination]
        second = np.concatenate([-p * earned for p in recourse.probability]) if count else np.zeros(0)
        outcomes = len(recourse.probability)
        self.model = LinearModel(
            objective=np.concatenate([first.objective, second]),
            upper=np.concatenate([first.upper, np.tile(first.upper[:count], outcomes)]),
            integer=np.concatenate([first.integer, np.full(outcomes * count, not relaxed)]),
            rows=stacked(first.rows, build.rows()), aggregates=first.aggregates)

    def out_of_poi(self, instance: Instance) -> BoolArray:
        """Which legs leave a POI, shape (legs,)."""
        leaving: BoolArray = np.isin(self.legs.origin, instance.pois)
        return leaving

    def point(self, orders: VisitOrders) -> FloatArray | None:
        """A plan as a point, with its only feasible recourse ``v = (1 - alpha) y``."""
        first = super().point(orders)
        if first is None:
            return None
        driven = first[:len(self.legs.vehicle)]
        return np.concatenate([first, (self._lost * driven).ravel()])


def legs_out_of_pois(
    model: DirectedModel, instance: Instance, scopes: Sequence[Scope],
) -> list[tuple[FloatArray, IntArray]]:
    """Driving time [s] and column numbers of the legs out of each POI, for each vehicle and POI that has any."""
    legs, found = model.legs, []
    for m, scope in enumerate(scopes):
        for i in instance.pois:
            used = np.flatnonzero((legs.vehicle == m) & (legs.origin == i))
            if len(used):
                found.append((scope.driven_s[i, legs.destination[used]], used))
    return found


def stacked(one: Rows, other: Rows) -> Rows:
    """The rows of both, those of the first on top."""
    return Rows(
        lower=np.concatenate([one.lower, other.lower]), upper=np.concatenate([one.upper, other.upper]),
        start=np.concatenate([one.start, one.start[-1] + other.start[1:]]),
        column=np.concatenate([one.column, other.column]), value=np.concatenate([one.value, other.value]))
