"""The solver against enumeration, with and without the heuristic that could hide a fault of the model."""

from __future__ import annotations

import pytest

from sva_bench.mission.certify import certify
from sva_bench.solver import expected
from sva_bench.solver.two_stage import (
    knowledge_of,
    plan_deterministic,
    plan_nominal,
    plan_stochastic,
    wait_and_see,
)
from tests.solver.oracle import random_instance, truth


def check(seed: int) -> None:
    instance = random_instance(seed)
    want = truth(instance)
    known = knowledge_of(instance)
    stochastic = plan_stochastic(instance, known=known)
    plans = plan_deterministic(instance, stochastic, known=known)
    assert stochastic.status == plans.plan.status == "optimal"
    assert stochastic.value == pytest.approx(want.stochastic, rel=1e-6, abs=1e-6)
    assert stochastic.bound == pytest.approx(want.stochastic, rel=1e-6, abs=1e-6)
    assert plans.plan.value == pytest.approx(want.nominal, rel=1e-6, abs=1e-6)
    assert plans.most == pytest.approx(want.most, rel=1e-6, abs=1e-6)
    assert plans.least == pytest.approx(want.least, rel=1e-6, abs=1e-6)
    certificate = certify(instance, plans.plan)
    assert certificate.reasons == ()
    assert certificate.expected == pytest.approx(want.most, rel=1e-6, abs=1e-6)
    assert sum(certificate.duration_s.values()) == pytest.approx(want.soonest, rel=1e-5, abs=1e-5)
    if want.most >= want.stochastic - 1e-6:
        assert plans.stochastic.routes == plans.plan.routes
    assert wait_and_see(instance, known=known) == pytest.approx(want.foresight, rel=1e-6, abs=1e-6)
    # The laws that textbooks promise.
    assert stochastic.value is not None
    assert plans.least <= plans.most <= stochastic.value + 1e-6 <= want.foresight + 2e-6
    assert plan_nominal(instance).value == plans.plan.value


@pytest.fixture
def no_heuristic(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave everything to the model."""
    monkeypatch.setattr(expected, "search", lambda roads, weights, start, **_: start)  # noqa: ARG005


@pytest.mark.parametrize("seed", range(20))
def test_plans_are_those_that_enumeration_finds(seed: int) -> None:
    check(seed)


@pytest.mark.usefixtures("no_heuristic")
@pytest.mark.parametrize("seed", range(100, 130))
def test_the_model_alone_finds_the_plans_that_enumeration_finds(seed: int) -> None:
    check(seed)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(200, 400))
def test_plans_are_those_that_enumeration_finds_on_many_instances(seed: int) -> None:
    check(seed)


@pytest.mark.long
@pytest.mark.usefixtures("no_heuristic")
@pytest.mark.parametrize("seed", range(400, 700))
def test_the_model_alone_finds_the_plans_that_enumeration_finds_on_many_instances(seed: int) -> None:
    check(seed)
