"""Methods: each proves the same plan where it accepts the problem, and is refused where it doesn't."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest

from sva_bench.choices import FailureProcess, Method
from sva_bench.errors import BadInput
from sva_bench.generate.instances import random_instance
from sva_bench.mission.instance import Instance
from sva_bench.solver.methods import METHODS
from sva_bench.solver.risk import RiskMeasure
from sva_bench.solver.two_stage import plan_averse, plan_deterministic, plan_stochastic

every_method = pytest.mark.parametrize("method", METHODS)
OPEN_FIELD = random_instance("A", pois=7, vehicles=2, availability=0.75, seed=4)
REFUELLING = random_instance("B", pois=6, vehicles=2, availability=0.75, seed=4)


@every_method
def test_a_method_proves_the_plan_that_auto_proves(method: Method) -> None:
    # Symmetric costs, one filling for the mission: every method accepts that.
    plan, known = (plan_stochastic(OPEN_FIELD, method=name) for name in (method, "auto"))
    assert (plan.method, plan.status) == (method, "optimal")
    assert plan.value == pytest.approx(known.value, rel=1e-6)
    tied, known_tied = (plan_deterministic(OPEN_FIELD, known, method=name).plan for name in (method, "auto"))
    assert tied.value == pytest.approx(known_tied.value, rel=1e-6)


@every_method
def test_every_method_has_a_description(method: Method) -> None:
    assert METHODS[method].name == method
    assert METHODS[method].description


@every_method
@pytest.mark.parametrize(("failure", "how"), [("per_leg", "per leg"), ("hazard", "after exponential lifetimes")])
def test_failures_along_the_route_go_to_the_methods_that_serve_them(
    method: Method, failure: FailureProcess, how: str,
) -> None:
    instance = replace(OPEN_FIELD, failure=failure)
    if METHODS[method].discounts:
        assert plan_stochastic(instance, method=method).value == pytest.approx(plan_stochastic(instance).value)
    else:
        with pytest.raises(BadInput, match=f"{method} plans under mission, the instance fails {how}"):
            plan_stochastic(instance, method=method)


@pytest.mark.parametrize("method", ["undirected", "edge-mip"])
@pytest.mark.parametrize(("instance", "why"), [
    (REFUELLING, "fuel may run short, or a vehicle refuel"),
    (random_instance("A", pois=5, vehicles=2, availability=0.5, seed=0, directed=True), "time than the way back"),
    (replace(OPEN_FIELD, vehicles=tuple(replace(v, mission_limit_s=math.inf) for v in OPEN_FIELD.vehicles)),
     "a vehicle has no mission limit")], ids=["refuelling", "directed", "no limit"])
def test_the_edge_model_refuses_what_it_does_not_serve_and_says_why(
    method: Method, instance: Instance, why: str,
) -> None:
    with pytest.raises(BadInput, match=rf"the method {method} \(.*\) doesn't support it, for .*{why}; take the "):
        plan_stochastic(instance, method=method)


@pytest.mark.parametrize("instance", [OPEN_FIELD, REFUELLING, replace(OPEN_FIELD, failure="per_leg")],
                         ids=["open field", "refuelling", "per leg"])
def test_auto_chooses_one_of_them(instance: Instance) -> None:
    assert plan_stochastic(instance).method in list(METHODS)


def test_auto_proves_measures_of_risk_by_a_method_that_serves_them() -> None:
    method = plan_averse(OPEN_FIELD, RiskMeasure(kind="cvar", weight=0.5)).method
    assert METHODS[method].risk  # type: ignore[index]


def test_the_documentation_names_every_method() -> None:
    text = (Path(__file__).parents[2] / "docs" / "model.md").read_text(encoding="utf-8")
    for method in get_args(Method):
        assert f"`{method}`" in text
