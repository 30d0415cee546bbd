"""Failures along the route and the cost of a lost robot: the solver against enumeration, and their laws."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sva_bench.choices import FailureProcess
from sva_bench.mission.certify import certify
from sva_bench.mission.instance import Instance
from sva_bench.solver import solve as solving
from sva_bench.solver.routes.heuristic import Found
from sva_bench.solver.two_stage import plan_stochastic
from tests.solver.oracle import discounted_optimum, random_instance

PROCESSES: tuple[FailureProcess, ...] = ("per_leg", "hazard")


def risky(seed: int, failure: FailureProcess, *, costs: bool = True) -> Instance:
    """A tiny instance whose robots fail along the route: never, now and then, soon or at once; some cost something."""
    instance, rng = random_instance(seed), np.random.default_rng((seed, 7))
    vehicles = []
    for vehicle in (*instance.vehicles, *instance.vehicles[:int(rng.integers(0, 2))]):
        mtbf = (None, 0.0, 15.0, 60.0, 600.0, math.inf)[int(rng.choice(6, p=[0.3, 0.05, 0.2, 0.25, 0.1, 0.1]))]
        cost = float(rng.choice([0.0, 1.0, 15.0, 40.0, 5000.0], p=[0.3, 0.2, 0.2, 0.2, 0.1])) if costs else 0.0
        vehicles.append(replace(
            vehicle, name=f"v{len(vehicles)}", mtbf_s=mtbf, loss_cost=cost,
            availability=float(rng.choice([0.0, 0.5, 0.8, 0.95, 1.0], p=[0.05, 0.3, 0.3, 0.25, 0.1]))))
    return replace(instance, vehicles=tuple(vehicles), failure=failure)


def check(seed: int, failure: FailureProcess, *, costs: bool = True) -> None:
    instance = risky(seed, failure, costs=costs)
    plan = plan_stochastic(instance)
    best = discounted_optimum(instance)
    assert plan.status == "optimal"
    assert plan.value == pytest.approx(best, rel=1e-6, abs=1e-6)
    assert plan.bound == pytest.approx(best, rel=2e-6, abs=2e-6)
    certificate = certify(instance, plan)
    assert certificate.reasons == ()
    assert certificate.expected == pytest.approx(plan.value, rel=1e-9, abs=1e-9)


@pytest.fixture
def no_heuristic(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave everything to the columns."""
    monkeypatch.setattr(solving, "search", lambda *given, **_: Found(orders=given[3], routes=()))


@pytest.mark.usefixtures("no_heuristic")
@pytest.mark.parametrize("costs", [False, True], ids=["free", "costly"])
@pytest.mark.parametrize("failure", PROCESSES)
@pytest.mark.parametrize("block", range(10))
def test_plans_for_failures_along_the_route_are_those_that_enumeration_finds(
    block: int, failure: FailureProcess, costs: bool,
) -> None:
    for seed in range(5000 + 10 * block, 5010 + 10 * block):
        check(seed, failure, costs=costs)
