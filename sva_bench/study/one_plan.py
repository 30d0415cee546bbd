"""One plan of an instance, for a request."""

from __future__ import annotations

from dataclasses import replace

from sva_bench.mission.failures import MODEL
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Plan
from sva_bench.solver.risk import RiskMeasure
from sva_bench.solver.two_stage import SolveLimits, plan_averse, plan_deterministic, plan_stochastic
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
    stochastic = plan_stochastic(replace(instance, failure=MODEL), limits, method=request.method, cuts=cuts)
    return plan_deterministic(instance, stochastic, limits, method=request.method, cuts=cuts).plan
