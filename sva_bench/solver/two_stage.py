"""The stochastic and the deterministic plan of a comparison, risk-averse plans, and the wait-and-see value."""

from __future__ import annotations

import itertools
import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import Cuts, Method, PlanObjective, Status
from sva_bench.errors import BadInput
from sva_bench.mission.certify import certify
from sva_bench.mission.failures import MODEL, PlanningTerms, process_of
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Plan
from sva_bench.solver.flow.recourse import refuse_free_legs, refuse_seldom_available
from sva_bench.solver.goal import Goal
from sva_bench.solver.knowledge import Clock, Knowledge, Solution, SolveLimits, knowledge_of, value_of
from sva_bench.solver.methods import keeps_second_stage, serves_discounts
from sva_bench.solver.outcomes import outcomes_of, possible
from sva_bench.solver.preprocess import warn_of_unreachable
from sva_bench.solver.risk import Risk, RiskMeasure
from sva_bench.solver.routes.heuristic import VisitOrders
from sva_bench.solver.routes.heuristic import value_of as rewards
from sva_bench.solver.routes.refuelling import quickest_route
from sva_bench.solver.solve import solve
from sva_bench.solver.units import in_own_units, in_unit

__all__ = [
    "DeterministicPlans",
    "Knowledge",
    "SolveLimits",
    "knowledge_of",
    "plan_averse",
    "plan_deterministic",
    "plan_nominal",
    "plan_stochastic",
    "wait_and_see",
]

_log = logging.getLogger(__name__)

TIE = 1e-6
"""Relative difference up to which two values are equal."""
MOST_SUBSETS = 16
"""Outcomes up to which the value of perfect information is computed by default."""
_FLOOR = 1e-8  # relative; keeps a known optimum feasible when its value becomes a constraint
_ROUNDING = 1e-12  # relative; of sums of incentives, and of availabilities that are the same
_STATUSES: tuple[Status, ...] = get_args(Status)  # best first


@dataclass(frozen=True, eq=False, kw_only=True)
class DeterministicPlans:
    """The deterministic plan, and the range of expected value that its ties span.

    Attributes:
        plan: Of the plans with the greatest sum of incentives, the one of greatest expected value, then of least time.
        stochastic: The stochastic plan; with the same routes where both have the same expected value.
        least: Least expected value among the plans with that sum of incentives.
        most: Greatest expected value among them.
        worst: A plan of the least expected value; ``None`` where that is ``plan``'s.
    """

    plan: Plan
    stochastic: Plan
    least: float
    most: float
    worst: Plan | None


def plan_stochastic(
    instance: Instance, limits: SolveLimits | None = None, incumbent: Plan | None = None,
    known: Knowledge | None = None, method: Method = "auto", cuts: Cuts = "single",
) -> Plan:
    """The plan of greatest expected value under the instance's failure process.

    Args:
        instance: The instance.
        limits: When to stop.
        incumbent: A feasible plan to start from.
        known: What solves of the same instance with other availabilities found.
        method: The solution method.
        cuts: Kind of optimality cuts of the method ``lshaped``.

    Raises:
        BadInput: If the incumbent is infeasible, or the method doesn't support the instance.
    """
    process = process_of(instance.failure)
    if not process.collapses and not serves_discounts(method):
        raise BadInput(f"instance {instance.name}: {method} plans under {MODEL}, the instance fails {process.how}; "
                       f"take the method auto, or set its failure to {MODEL}")
    terms = process.terms([vehicle.reliability for vehicle in instance.vehicles])
    return _plan(instance, "stochastic", terms, limits, incumbent, known, method, cuts)


def plan_averse(
    instance: Instance, measure: RiskMeasure, limits: SolveLimits | None = None, known: Knowledge | None = None,
) -> Plan:
    """The plan that maximises a measure of risk; failures are those of ``mission``.

    Raises:
        BadInput: If the instance fails per leg, or too many outcomes are possible.
    """
    process = process_of(instance.failure)
    if not process.collapses:
        raise BadInput(f"instance {instance.name}: measures of risk are over the outcomes of {MODEL}, the instance "
                       f"fails {process.how}; set its failure to {MODEL}")
    limits = limits or SolveLimits()
    known = known or knowledge_of(instance)
    known.check(instance)
    clock = limits.clock()
    warn_of_unreachable(instance)
    own, unit = in_own_units(instance)
    # A target beyond all incentives together adds a constant to every plan's shortfall, and would drown the rest.
    most = float(_incentives(own).max(axis=0, initial=0.0).sum())
    in_own = replace(measure, target=min(in_unit(measure.target, unit), most))
    solution = solve(own, _averse(own, in_own), known, clock, limits.gap)
    value = value_of(_averse(instance, measure), known.legs_by_vehicle, solution.orders)
    return _finish(instance, measure.kind, solution.orders, known, value=value,
                   bound=value + unit * (solution.bound - solution.value), status=solution.status,
                   solutions=[solution], runtime_s=clock.used_s())


def _averse(instance: Instance, measure: RiskMeasure) -> Goal:
    """The goal of a measure of risk."""
    outcomes = outcomes_of(instance, possible(instance))
    weights = (1 - measure.weight) * _availability(instance)[:, None] * outcomes.incentives
    if measure.weight == 0:
        return Goal(weights=weights)
    risk = Risk(measure=measure, outcomes=outcomes)
    return Goal(weights=weights, risk=risk, floors=risk.floors())


def plan_nominal(
    instance: Instance, limits: SolveLimits | None = None, incumbent: Plan | None = None,
    known: Knowledge | None = None, method: Method = "auto", cuts: Cuts = "single",
) -> Plan:
    """A plan of greatest sum of incentives, every vehicle available; ties are broken arbitrarily.

    It doesn't depend on availabilities, so all scenarios share it.
    """
    terms = PlanningTerms(share=np.ones(len(instance.vehicles)))
    return _plan(replace(instance, failure=MODEL), "deterministic", terms, limits, incumbent, known, method, cuts)


def plan_deterministic(
    instance: Instance, stochastic: Plan, limits: SolveLimits | None = None, nominal: Plan | None = None,
    known: Knowledge | None = None, method: Method = "auto", cuts: Cuts = "single",
) -> DeterministicPlans:
    """The deterministic plan, ties broken by greatest expected value, and the range of expected value of its ties.

    Args:
        instance: The instance; its failure process is taken as ``mission``.
        stochastic: Its stochastic plan.
        limits: When to stop; the time limit is for all solves together.
        nominal: ``plan_nominal`` of the instance, which scenarios may share.
        known: What solves of the same instance with other availabilities found.
        method: The solution method.
        cuts: Kind of optimality cuts of the method ``lshaped``.

    Source:
        ``docs/model.md``, section "Ties".
    """
    instance = replace(instance, failure=MODEL)
    limits = limits or SolveLimits()
    known = known or knowledge_of(instance)
    known.check(instance)
    clock = limits.clock()
    if nominal is None:
        if stochastic.status == "interrupted":  # the only plan known: the nominal solve ends at once too
            known.orders[_orders(instance, stochastic, known)] = None
        nominal = plan_nominal(instance, limits, known=known, method=method, cuts=cuts)
    elif nominal.value is None or nominal.bound is None or nominal.status is None:
        raise ValueError("the nominal plan must state its value, bound and status")
    nominal_orders, stochastic_orders = (_orders(instance, plan, known) for plan in (nominal, stochastic))
    known.orders.update(dict.fromkeys((nominal_orders, stochastic_orders)))
    ties = _Ties(in_own_units(instance)[0], nominal_orders, known, clock, limits.gap,
                 "auto" if keeps_second_stage(method) else method)
    most, least, quickest = ties.solutions(nominal.status == "interrupted")
    best = quickest or most
    orders = best.orders if best else nominal_orders
    expected, total = _expected(instance, orders), _sum(_incentives(instance), orders)
    solutions = [s for s in (most, least, quickest) if s is not None]
    plan = _finish(
        instance, "deterministic", orders, known, value=total, bound=nominal.bound or total,
        status=_worst([nominal.status or "feasible", *(s.status for s in solutions)]), solutions=solutions,
        runtime_s=clock.used_s())
    if stochastic.value is not None and expected >= stochastic.value - TIE * abs(stochastic.value):
        stochastic = _certified(instance, replace(
            stochastic, routes=plan.routes, fuel_s=plan.fuel_s, value=expected,
            bound=None if stochastic.bound is None else _above(stochastic.bound, expected)))
    lowest = min(expected, _expected(instance, least.orders) if least else expected)
    worst = None
    if least and lowest < expected - TIE * abs(expected):
        total = _sum(_incentives(instance), least.orders)
        worst = _finish(instance, "deterministic", least.orders, known, value=total,
                        bound=plan.bound or total, status=plan.status or "feasible", solutions=[least],
                        runtime_s=clock.used_s())
    return DeterministicPlans(plan=plan, stochastic=stochastic, most=expected, least=lowest, worst=worst)


def wait_and_see(
    instance: Instance, limits: SolveLimits | None = None, known: Knowledge | None = None, *, force: bool = False,
) -> float | None:
    """The wait-and-see value ``WS``: the expected value of the perfect-information plans, one for each outcome.

    Args:
        instance: The instance; its failure process is taken as ``mission``.
        limits: When to stop; the time limit is for all solves together.
        known: What solves of the same instance with other availabilities found.
        force: Solve however many outcomes there are.

    Returns:
        The value; ``None`` if there are more than ``MOST_SUBSETS`` outcomes, or one has no proof.
    """
    limits = limits or SolveLimits()
    known = known or knowledge_of(instance)
    known.check(instance)
    outcomes = possible(instance)
    if len(outcomes) > MOST_SUBSETS and not force:
        return None
    clock, total, (own, _) = limits.clock(), 0.0, in_own_units(instance)
    for available, probability in outcomes.items():
        available_vehicles = np.array([v.name in available for v in instance.vehicles], dtype=np.float64)
        solution = _solve_expected(own, available_vehicles, known, clock, limits.gap)
        if solution.status == "interrupted":
            raise KeyboardInterrupt
        if solution.status != "optimal":
            _log.warning("instance %s: no proof for the outcome in which %s are available; the value of perfect "
                         "information is unknown", instance.name, ", ".join(sorted(available)) or "no vehicles")
            return None
        total += probability * _sum(_incentives(instance) * available_vehicles[:, None], solution.orders)
    return total


def _plan(
    instance: Instance, objective: PlanObjective, terms: PlanningTerms, limits: SolveLimits | None,
    incumbent: Plan | None, known: Knowledge | None, method: Method, cuts: Cuts,
) -> Plan:
    limits = limits or SolveLimits()
    known = known or knowledge_of(instance)
    known.check(instance)
    clock = limits.clock()
    warn_of_unreachable(instance)
    if incumbent is not None:
        reasons = certify(instance, replace(incumbent, value=None, fuel_s={})).reasons
        if reasons:
            raise BadInput(f"instance {instance.name}: the plan to start from is infeasible: {reasons[0]}")
        known.orders[_orders(instance, incumbent, known)] = None
    own, unit = in_own_units(instance)
    if terms.survival is not None:
        goal = Goal(weights=_incentives(own) * terms.share[:, None], survival=terms.survival)
        solution = solve(own, goal, known, clock, limits.gap, method)
        value = rewards(_incentives(instance) * terms.share[:, None], terms.survival, solution.orders)
    else:
        solution = _solve_expected(own, terms.share, known, clock, limits.gap, method, cuts)
        value = _sum(_incentives(instance) * terms.share[:, None], solution.orders)
        unit *= float(terms.share.max(initial=0.0))
    return _finish(instance, objective, solution.orders, known, value=value,
                   bound=value + unit * (solution.bound - solution.value), status=solution.status,
                   solutions=[solution], runtime_s=clock.used_s())


def _solve_expected(
    instance: Instance, availability: FloatArray, known: Knowledge, clock: Clock, gap: float, method: Method = "auto",
    cuts: Cuts = "single",
) -> Solution:
    """The plan of greatest ``sum p e y``, with ``p`` scaled to a maximum of 1."""
    scale = float(availability.max(initial=0.0))
    shares = availability / scale if scale > 0 else availability
    goal = Goal(weights=_incentives(instance) * shares[:, None])
    if keeps_second_stage(method):
        certain = bool((availability == 1).all())
        sets = {frozenset(v.name for v in instance.vehicles): 1.0} if certain else possible(instance)
        refuse_free_legs(instance)
        refuse_seldom_available(instance, scale)
        return solve(instance, goal, known, clock, gap, method, outcomes_of(instance, sets, scale or 1.0), cuts)
    return _solve_unless_known(("greatest", tuple(shares.tolist()), gap), instance, goal, known, clock, gap, method)


def _solve_unless_known(
    key: tuple[object, ...], instance: Instance, goal: Goal, known: Knowledge, clock: Clock,
    gap: float, method: Method,
) -> Solution:
    """Solve, unless a proved solution of the same goal is known."""
    if key in known.solutions:
        return known.solutions[key]
    solution = solve(instance, goal, known, clock, gap, method)
    if solution.status == "optimal":
        known.solutions[key] = solution
    _log.debug("%s: %s, %.9g of %.9g, %d nodes, %s", key[0], solution.status, solution.value, solution.bound,
               solution.nodes, {phase: round(s, 3) for phase, s in solution.seconds.items()})
    return solution


class _Ties:
    """The plans that share the greatest sum of incentives.

    Among them ``sum p e y`` is, but for a constant, ``sum (p - least p) e y``: in that form, the ties of two vehicles
    are the same in all scenarios.
    """

    def __init__(self, instance: Instance, nominal: VisitOrders, known: Knowledge, clock: Clock, gap: float,
                 method: Method) -> None:
        self._instance, self._known, self._clock, self._gap = instance, known, clock, gap
        self._method: Method = method
        self._incentives, availability = _incentives(instance), _availability(instance)
        best = _sum(self._incentives, nominal)
        self._floor = best - _FLOOR * abs(best)
        spread = availability - availability.min(initial=1.0)
        self._equal = float(spread.max(initial=0.0)) <= _ROUNDING * float(availability.max(initial=0.0))
        self._shares = np.zeros(len(spread)) if self._equal else spread / spread.max()

    def solutions(self, interrupted: bool) -> tuple[Solution | None, Solution | None, Solution | None]:
        """The tied plans of most and least expected value, and the quickest of the former; ``None`` = not solved."""
        weights = self._incentives * self._shares[:, None]
        most = least = None
        if not self._equal and not interrupted:
            most = self._solve("most", Goal(weights=weights, floors=((self._incentives, self._floor),)))
            interrupted = most.status == "interrupted"
        if not self._equal and not interrupted:
            least = self._solve("least", Goal(weights=-weights, floors=((self._incentives, self._floor),)))
            interrupted = least.status == "interrupted"
        if interrupted:
            return most, least, None
        floors = [(self._incentives, self._floor)]
        if most is not None:
            floors.append((weights, most.value - _FLOOR * abs(most.value)))
        quickest = self._solve("soonest", Goal(weights=np.zeros_like(weights), floors=tuple(floors), driving=1.0))
        return most, least, quickest

    def _solve(self, what: str, goal: Goal) -> Solution:
        key = (what, tuple(self._shares.tolist()), self._gap, *(floor for _, floor in goal.floors))
        return _solve_unless_known(key, self._instance, goal, self._known, self._clock, self._gap, self._method)


def _finish(
    instance: Instance, objective: PlanObjective, orders: VisitOrders, known: Knowledge, *, value: float, bound: float,
    status: Status, solutions: Sequence[Solution], runtime_s: float,
) -> Plan:
    routes, fuel = {}, {}
    for vehicle, own_legs, order in zip(instance.vehicles, known.legs_by_vehicle, orders, strict=True):
        timed = quickest_route(own_legs, order)
        if timed is None:
            raise RuntimeError(f"no feasible route of {vehicle.name} visits {order}")
        routes[vehicle.name] = tuple(instance.sites[i] for i in timed.route)
        fuel[vehicle.name] = float(sum(vehicle.fuel_s[i, j] for i, j in itertools.pairwise(timed.route)))
    counted = {"nodes": sum(s.nodes for s in solutions), "cuts": max((s.cuts for s in solutions), default=0),
               "rounds": sum(s.rounds for s in solutions)}
    if any(s.optimality_cuts for s in solutions):
        counted["optimality_cuts"] = sum(s.optimality_cuts for s in solutions)
    method = solutions[0].method if solutions else "expected"
    return _certified(instance, Plan(
        routes=routes, instance=instance.name, objective=objective, method=method, status=status, value=value + 0.0,
        bound=_above(bound, value) + 0.0, fuel_s=fuel, runtime_s=runtime_s, seed=0, details=counted))


def _certified(instance: Instance, plan: Plan) -> Plan:
    """The plan, after an independent check.

    Raises:
        RuntimeError: If the check fails, which is a defect of the solver.
    """
    certificate = certify(instance, plan)
    if certificate.reasons:
        raise RuntimeError(f"the solver made a plan that fails its check: {'; '.join(certificate.reasons)}")
    return plan


def _orders(instance: Instance, plan: Plan, known: Knowledge) -> VisitOrders:
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


def _incentives(instance: Instance) -> FloatArray:
    return np.array([v.incentives for v in instance.vehicles]).reshape(len(instance.vehicles), len(instance.sites))


def _availability(instance: Instance) -> FloatArray:
    return np.array([v.availability for v in instance.vehicles], dtype=np.float64)


def _sum(weights: FloatArray, orders: VisitOrders) -> float:
    return math.fsum(weights[m, j] for m, order in enumerate(orders) for j in order)


def _expected(instance: Instance, orders: VisitOrders) -> float:
    return _sum(_incentives(instance) * _availability(instance)[:, None], orders)


def _above(bound: float, value: float) -> float:
    """The bound; the value where the two differ by rounding alone."""
    return value if bound - value <= _ROUNDING * abs(value) else bound


def _worst(statuses: Sequence[Status]) -> Status:
    return max(statuses, key=_STATUSES.index)
