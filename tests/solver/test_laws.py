"""Laws that hold whatever the instance, for plans by the method that chooses itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sva_bench.mission.certify import certify
from sva_bench.mission.failures import route_value
from sva_bench.mission.instance import Instance
from sva_bench.solver.risk import RiskMeasure
from sva_bench.solver.two_stage import plan_averse, plan_nominal, plan_stochastic
from tests.solver.oracle import random_instance

seeds = st.integers(0, 10**6)
few = settings(max_examples=12, derandomize=True)  # each example solves two instances


def best(instance: Instance) -> float:
    plan = plan_stochastic(instance)
    assert plan.status == "optimal"
    assert plan.value is not None
    return plan.value


@few
@given(seeds, st.floats(1.0, 2.0), st.sampled_from(["availability", "fuel_capacity_s", "mission_limit_s"]))
def test_more_of_anything_never_lowers_the_optimum(seed: int, factor: float, what: str) -> None:
    instance = random_instance(seed)
    grown = {"availability": 1.0, "fuel_capacity_s": 1.0, "mission_limit_s": 1.0, what: factor}
    more = replace(instance, vehicles=tuple(replace(
        v, availability=min(1.0, v.availability * grown["availability"]),
        fuel_capacity_s=v.fuel_capacity_s * grown["fuel_capacity_s"],
        mission_limit_s=v.mission_limit_s * grown["mission_limit_s"]) for v in instance.vehicles))
    assert best(more) >= best(instance) - 1e-6


@few
@given(seeds, st.floats(0.01, 100.0))
def test_scaled_incentives_scale_the_optimum(seed: int, factor: float) -> None:
    instance = random_instance(seed)
    scaled = replace(instance, vehicles=tuple(replace(v, incentives=v.incentives * factor) for v in instance.vehicles))
    assert best(scaled) == pytest.approx(factor * best(instance), rel=3e-6, abs=3e-6)


@few
@given(seeds)
def test_the_order_of_sites_changes_nothing(seed: int) -> None:
    instance = random_instance(seed)
    order = np.random.default_rng(seed).permutation(len(instance.sites))
    place = np.argsort(order)
    turned = replace(
        instance, sites=tuple(instance.sites[k] for k in order), base=int(place[instance.base]),
        stations=tuple(int(place[r]) for r in instance.stations), stop_s=instance.stop_s[order],
        vehicles=tuple(replace(v, incentives=v.incentives[order], fuel_s=v.fuel_s[np.ix_(order, order)])
                       for v in instance.vehicles))
    assert best(turned) == pytest.approx(best(instance), rel=2e-6, abs=2e-6)


@few
@given(seeds)
def test_without_weight_a_measure_of_risk_changes_nothing(seed: int) -> None:
    instance = random_instance(seed)
    plan = plan_averse(instance, RiskMeasure(kind="cvar", weight=0.0))
    assert plan.value == pytest.approx(best(instance), rel=2e-6, abs=2e-6)


@few
@given(seeds, st.sampled_from([1.0, 1.5, 1e6, 1e20, 1e300]), st.sampled_from([0.3, 1.0]))
def test_a_target_out_of_reach_gives_the_stochastic_plan_however_large_it_is(
        seed: int, factor: float, weight: float) -> None:
    # Then the shortfall is the target less the incentive in every outcome: (1 - l) E - l (T - E) = E - l T.
    instance = random_instance(seed)
    target = factor * float(np.max([v.incentives for v in instance.vehicles], axis=0).sum())
    plan = plan_averse(instance, RiskMeasure(kind="excess", weight=weight, target=target))
    worth = certify(instance, plan).expected
    assert worth is not None
    assert plan.value is not None
    assert plan.bound is not None
    assert worth == pytest.approx(best(instance), rel=1e-6)
    assert plan.status == "optimal"
    assert plan.value == pytest.approx(worth - weight * target, rel=1e-12)
    # And the gap is one of the incentive that can be earned.
    assert plan.value <= plan.bound <= plan.value + 1e-6 * worth + 1e-12 * weight * target


@few
@given(seeds)
def test_vehicles_that_survive_every_leg_earn_as_if_nothing_failed(seed: int) -> None:
    instance = random_instance(seed)
    sure = replace(instance, failure="per_leg",
                   vehicles=tuple(replace(v, availability=1.0) for v in instance.vehicles))
    assert best(sure) == pytest.approx(plan_nominal(instance).value or 0.0, rel=2e-6, abs=2e-6)


@few
@given(seeds)
def test_failures_along_the_route_cost_no_more_than_the_order_that_ignores_them(seed: int) -> None:
    instance = random_instance(seed)
    careless = plan_stochastic(instance)
    along = 0.0
    for v in instance.vehicles:
        sites = [instance.sites.index(name) for name in careless.route(v.name)]
        along += route_value([float(v.incentives[j]) for j in sites if j in instance.pois], v.availability, "per_leg")
    assert best(replace(instance, failure="per_leg")) >= along - 1e-6
