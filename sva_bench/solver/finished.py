"""Plans from solutions: routes by name, and the independent check."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import get_args

from sva_bench.choices import PlanObjective, Status
from sva_bench.mission.certify import certify
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Plan
from sva_bench.solver.knowledge import Knowledge, Routes, Solution
from sva_bench.solver.preprocess import burnt_by_legs
from sva_bench.solver.routes.heuristic import VisitOrders
from sva_bench.solver.routes.refuelling import quickest_route
from sva_bench.solver.ties import ROUNDING

_STATUSES: tuple[Status, ...] = get_args(Status)  # best first


def finished(
    instance: Instance, objective: PlanObjective, routes: Routes, *, value: float, bound: float, status: Status,
    solutions: Sequence[Solution], runtime_s: float,
) -> Plan:
    """The plan of these routes, after an independent check.

    Args:
        instance: The instance.
        objective: What was maximised.
        routes: Sites of each vehicle's route.
        value: Its value.
        bound: Upper bound on it.
        status: How the solves ended.
        solutions: The solves, for their counters.
        runtime_s: Time of all of them [s].

    Raises:
        RuntimeError: If the check fails, which is a defect of the solver.
    """
    named, fuel = {}, {}
    for vehicle, route in zip(instance.vehicles, routes, strict=True):
        named[vehicle.name] = tuple(instance.sites[i] for i in route)
        burnt = burnt_by_legs(instance, vehicle)
        fuel[vehicle.name] = float(sum(burnt[i, j] for i, j in itertools.pairwise(route)))
    counted = {"nodes": sum(s.nodes for s in solutions), "cuts": max((s.cuts for s in solutions), default=0),
               "rounds": sum(s.rounds for s in solutions)}
    if any(s.optimality_cuts for s in solutions):
        counted["optimality_cuts"] = sum(s.optimality_cuts for s in solutions)
    method = solutions[0].method if solutions else "expected"
    return certified(instance, Plan(
        routes=named, instance=instance.name, objective=objective, method=method, status=status, value=value + 0.0,
        bound=above(bound, value) + 0.0, fuel_s=fuel, runtime_s=runtime_s, seed=0, details=counted))


def certified(instance: Instance, plan: Plan) -> Plan:
    """The plan, after an independent check.

    Raises:
        RuntimeError: If the check fails, which is a defect of the solver.
    """
    certificate = certify(instance, plan)
    if certificate.reasons:
        raise RuntimeError(f"the solver made a plan that fails its check: {'; '.join(certificate.reasons)}")
    return plan


def orders_of(instance: Instance, plan: Plan, known: Knowledge) -> VisitOrders:
    """The POIs of a feasible plan's routes, in order.

    Raises:
        ValueError: If a route is infeasible.
    """
    pois = set(instance.pois)
    orders = tuple(tuple(j for j in map(instance.sites.index, plan.route(v.name)) if j in pois)
                   for v in instance.vehicles)
    for own_legs, order, vehicle in zip(known.legs_by_vehicle, orders, instance.vehicles, strict=True):
        if quickest_route(own_legs, order) is None:
            raise ValueError(f"the plan's route of {vehicle.name} is infeasible")
    return orders


def above(bound: float, value: float) -> float:
    """The bound; the value where the two differ by rounding alone."""
    return value if bound - value <= ROUNDING * abs(value) else bound


def worst_of(statuses: Sequence[Status]) -> Status:
    """The status that says least."""
    return max(statuses, key=_STATUSES.index)
