"""One plan for a request: its limit and its runtime are those of the whole."""

from __future__ import annotations

import time

import pytest

from sva_bench.generate.instances import random_instance
from sva_bench.solver.two_stage import SolveLimits, plan_deterministic, plan_nominal, plan_stochastic
from sva_bench.study.one_plan import make_plan
from sva_bench.study.plan_request import PlanRequest

DETERMINISTIC = PlanRequest(objective="deterministic")


@pytest.mark.long
def test_the_time_limit_is_for_all_solves_of_a_deterministic_plan() -> None:
    instance = random_instance("A", pois=60, vehicles=2, availability=0.75, seed=1, directed=True)
    limit_s = 3.0
    for compiling, limits in ((random_instance("A", pois=12, vehicles=2, availability=0.75, seed=1, directed=True),
                               SolveLimits()), (instance, SolveLimits(time_limit_s=limit_s))):
        make_plan(compiling, DETERMINISTIC, limits)
    began = time.monotonic()
    plan = make_plan(instance, DETERMINISTIC, SolveLimits(time_limit_s=limit_s))
    took_s = time.monotonic() - began
    assert plan.status == "time_limit"
    assert took_s < 1.7 * limit_s  # each solve had the limit to itself: twice as long
    assert plan.runtime_s == pytest.approx(took_s, abs=0.1)


def test_a_sum_that_is_proved_is_optimal_though_ties_are_open() -> None:
    instance = random_instance("A", pois=12, vehicles=2, availability=0.75, seed=0)
    stochastic, nominal = plan_stochastic(instance), plan_nominal(instance)
    proved = plan_deterministic(instance, stochastic, nominal=nominal)
    assert (proved.plan.status, proved.proved) == ("optimal", True)
    cut_off = plan_deterministic(instance, stochastic, SolveLimits(time_limit_s=0.0), nominal=nominal)
    assert (cut_off.plan.status, cut_off.proved) == ("optimal", False)
