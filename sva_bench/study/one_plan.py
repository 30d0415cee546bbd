"""One plan of an instance, for a request."""

from __future__ import annotations

from dataclasses import replace

from sva_bench.mission.failures import MODEL
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Plan
from sva_bench.solver.risk import RiskMeasure
from sva_bench.solver.two_stage import (
    SolveLimits,
    knowledge_of,
    plan_averse,
    plan_deterministic,
    plan_nominal,
    plan_stochastic,
)
from sva_bench.study.plan_request import PlanRequest


def make_plan(instance: Instance, request: PlanRequest, limits: SolveLimits) -> Plan:
    """The plan that is asked for; on Ctrl-C, where it is heard, the best until then (``interrupted``)."""
    cuts = request.cuts or "single"
    if request.risk is not None:
        told = {"weight": request.weight, "beta": request.beta, "target": request.target}
        return plan_averse(instance, RiskMeasure(
            kind=request.risk, **{name: value for name, value in told.items() if value is not None}), limits)
    if request.objective == "stochastic":
        return plan_stochastic(instance, limits, method=request.method, cuts=cuts)
    return _deterministic(instance, request, limits)


def _deterministic(instance: Instance, request: PlanRequest, limits: SolveLimits) -> Plan:
    """The deterministic plan; the time limit is for all of its solves together.

    What is asked for comes first: the stochastic plan, from which the search among ties starts, gets what time is left.
    """
    clock, instance, cuts = limits.clock(), replace(instance, failure=MODEL), request.cuts or "single"
    known = knowledge_of(instance)

    def left() -> SolveLimits:
        return limits if limits.time_limit_s is None else replace(limits, time_limit_s=clock.left_s())

    nominal = plan_nominal(instance, left(), known=known, method=request.method, cuts=cuts)
    stochastic = plan_stochastic(instance, left(), known=known, method=request.method, cuts=cuts)
    plan = plan_deterministic(
        instance, stochastic, left(), nominal=nominal, known=known, method=request.method, cuts=cuts).plan
    return replace(plan, runtime_s=clock.used_s())
