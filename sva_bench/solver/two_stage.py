"""The stochastic and the deterministic plan of a comparison, risk-averse plans, and the wait-and-see value."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import Cuts, Method, PlanObjective
from sva_bench.errors import BadInput
from sva_bench.mission.certify import certify
from sva_bench.mission.failures import MODEL, PlanningTerms, process_of
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Plan
from sva_bench.solver.discounts import Discounts
from sva_bench.solver.finished import above, certified, finished, orders_of, worst_of
from sva_bench.solver.flow.recourse import refuse_free_legs, refuse_seldom_available
from sva_bench.solver.goal import Goal
from sva_bench.solver.knowledge import (
    Clock,
    Knowledge,
    Solution,
    SolveLimits,
    Watched,
    knowledge_of,
    route_over,
    value_of,
)
from sva_bench.solver.methods import keeps_second_stage, serves_discounts
from sva_bench.solver.outcomes import outcomes_of, possible
from sva_bench.solver.preprocess import warn_of_unreachable
from sva_bench.solver.risk import Risk, RiskMeasure
from sva_bench.solver.routes.ways import value_on
from sva_bench.solver.solve import solve
from sva_bench.solver.ties import Ties, availability_of, expected_of, incentives_of, solve_unless_known, sum_of
from sva_bench.solver.units import in_own_units, in_unit

__all__ = [
    "DeterministicPlans",
    "Knowledge",
    "SolveLimits",
    "Watched",
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


@dataclass(frozen=True, eq=False, kw_only=True)
class DeterministicPlans:
    """The deterministic plan, and the range of expected value that its ties span.

    Attributes:
        plan: Of the plans with the greatest sum of incentives, the one of greatest expected value, then of least time.
        stochastic: The stochastic plan; with the same routes where both have the same expected value.
        least: Least expected value among the plans with that sum of incentives.
        most: Greatest expected value among them.
        worst: A plan of the least expected value; ``None`` where that is ``plan``'s.
        proved: Whether all of these are proved; the plan's own status is by the sum of incentives alone.
    """

    plan: Plan
    stochastic: Plan
    least: float
    most: float
    worst: Plan | None
    proved: bool


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
    most = float(incentives_of(own).max(axis=0, initial=0.0).sum())
    target = float(in_unit(np.array([measure.target]), unit)[0])
    in_own = replace(measure, target=min(target, most))
    clock = _watched(clock, limits, measure.kind, unit)
    solution = solve(own, _averse(own, in_own), known, clock, limits.gap,
                     beyond=measure.weight * (in_own.target - target))
    value = value_of(_averse(instance, measure), known.legs_by_vehicle, solution.orders)
    return finished(instance, measure.kind, solution.routes, value=value,
                   bound=value + unit * (solution.bound - solution.value), status=solution.status,
                   solutions=[solution], runtime_s=clock.used_s())


def _averse(instance: Instance, measure: RiskMeasure) -> Goal:
    """The goal of a measure of risk."""
    outcomes = outcomes_of(instance, possible(instance))
    weights = (1 - measure.weight) * availability_of(instance)[:, None] * outcomes.incentives
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
            known.orders[orders_of(instance, stochastic, known)] = None
        nominal = plan_nominal(instance, limits, known=known, method=method, cuts=cuts)
    elif nominal.value is None or nominal.bound is None or nominal.status is None:
        raise ValueError("the nominal plan must state its value, bound and status")
    nominal_orders, stochastic_orders = (orders_of(instance, plan, known) for plan in (nominal, stochastic))
    known.orders.update(dict.fromkeys((nominal_orders, stochastic_orders)))
    ties = Ties(in_own_units(instance)[0], nominal_orders, known, clock, limits.gap,
                 "auto" if keeps_second_stage(method) else method)
    most, least, quickest = ties.solutions(nominal.status == "interrupted")
    best = quickest or most
    orders = best.orders if best else nominal_orders
    routes = best.routes if best else tuple(
        route_over(own_legs, order) for own_legs, order in zip(known.legs_by_vehicle, orders, strict=True))
    expected, total = expected_of(instance, orders), sum_of(incentives_of(instance), orders)
    solutions = [s for s in (most, least, quickest) if s is not None]
    in_all = worst_of([nominal.status or "feasible", *(s.status for s in solutions)])
    plan = finished(
        instance, "deterministic", routes, value=total, bound=nominal.bound or total,
        status=in_all if in_all == "interrupted" else nominal.status or "feasible", solutions=solutions,
        runtime_s=clock.used_s())
    if stochastic.value is not None and expected >= stochastic.value - TIE * abs(stochastic.value):
        stochastic = certified(instance, replace(
            stochastic, routes=plan.routes, fuel_s=plan.fuel_s, value=expected,
            bound=None if stochastic.bound is None else above(stochastic.bound, expected)))
    lowest = min(expected, expected_of(instance, least.orders) if least else expected)
    worst = None
    if least and lowest < expected - TIE * abs(expected):
        total = sum_of(incentives_of(instance), least.orders)
        worst = finished(instance, "deterministic", least.routes, value=total,
                         bound=plan.bound or total, status=plan.status or "feasible", solutions=[least],
                        runtime_s=clock.used_s())
    return DeterministicPlans(plan=plan, stochastic=stochastic, most=expected, least=lowest, worst=worst,
                              proved=in_all == "optimal")


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
        total += probability * sum_of(incentives_of(instance) * available_vehicles[:, None], solution.orders)
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
        known.orders[orders_of(instance, incumbent, known)] = None
    own, unit = in_own_units(instance)
    if (discounts := discounts_of(terms)) is not None:
        goal = Goal(weights=incentives_of(own) * terms.share[:, None], discounts=replace(
            discounts, departure=in_unit(discounts.departure, unit), home=in_unit(discounts.home, unit)))
        solution = solve(own, goal, known, _watched(clock, limits, objective, unit), limits.gap, method)
        weights = incentives_of(instance) * terms.share[:, None]
        value = math.fsum(
            value_on(own_legs, route, {j: float(weights[m, j]) for j in solution.orders[m]}, discounts.of(m))
            for m, (own_legs, route) in enumerate(zip(known.legs_by_vehicle, solution.routes, strict=True)))
    else:
        unit *= float(terms.share.max(initial=0.0))
        clock = _watched(clock, limits, objective, unit)
        solution = _solve_expected(own, terms.share, known, clock, limits.gap, method, cuts)
        value = sum_of(incentives_of(instance) * terms.share[:, None], solution.orders)
    return finished(instance, objective, solution.routes, value=value,
                   bound=value + unit * (solution.bound - solution.value), status=solution.status,
                   solutions=[solution], runtime_s=clock.used_s())


def _watched(clock: Clock, limits: SolveLimits, objective: str, unit: float) -> Clock:
    """The clock of a solve that is watched, if it is to be, in the instance's own units."""
    watch = limits.watch
    return clock if watch is None else replace(clock, watch=lambda progress, factor: watch(
        Watched(objective=objective, _progress=progress, _unit=unit / factor)))


def discounts_of(terms: PlanningTerms) -> Discounts | None:
    """The discounts of planning terms, costs in the instance's own unit; ``None`` where the terms are none."""
    if terms.survival is None and terms.rate is None and terms.loss_cost is None:
        return None
    vehicles = len(terms.share)
    cost = np.zeros(vehicles) if terms.loss_cost is None else terms.loss_cost
    return Discounts(
        survival=np.ones(vehicles) if terms.survival is None else terms.survival,
        rate=np.zeros(vehicles) if terms.rate is None else terms.rate, departure=cost, home=cost)


def _solve_expected(
    instance: Instance, availability: FloatArray, known: Knowledge, clock: Clock, gap: float, method: Method = "auto",
    cuts: Cuts = "single",
) -> Solution:
    """The plan of greatest ``sum p e y``, with ``p`` scaled to a maximum of 1."""
    scale = float(availability.max(initial=0.0))
    shares = availability / scale if scale > 0 else availability
    goal = Goal(weights=incentives_of(instance) * shares[:, None])
    if keeps_second_stage(method):
        certain = bool((availability == 1).all())
        sets = {frozenset(v.name for v in instance.vehicles): 1.0} if certain else possible(instance)
        refuse_free_legs(instance)
        refuse_seldom_available(instance, scale)
        return solve(instance, goal, known, clock, gap, method, outcomes_of(instance, sets, scale or 1.0), cuts)
    return solve_unless_known(("greatest", tuple(shares.tolist()), gap), instance, goal, known, clock, gap, method)
