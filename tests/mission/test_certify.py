"""Certificates, computed by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sva_bench.mission.certify import certify
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.mission.plan import Plan

# Sites base r1 p1 p2; p2 -> p1 has no way.
FUEL = np.array([[0, 5, 4, 7], [5, 0, 3, 3], [4, 3, 0, 6], [7, 3, math.inf, 0]])


def instance(capacity: float = 12, limit: float = 30, stop: float = 0.0) -> Instance:
    robots = tuple(
        Vehicle(name=name, fuel_capacity_s=capacity, mission_limit_s=limit, availability=p,
                incentives=np.array([0, 0, 10, 4.0]), fuel_s=FUEL)
        for name, p in (("a", 0.5), ("b", 1.0)))
    return Instance(name="tiny", sites=("base", "r1", "p1", "p2"), base=0, stations=(1,),
                    stop_s=np.array([0, stop, 0, stop]), vehicles=robots)


def route(*sites: str, **more: tuple[str, ...]) -> Plan:
    return Plan(routes={"a": sites, **more})


def test_the_value_of_a_feasible_plan_is_its_expected_value() -> None:
    # base -4-> p1 -3-> r1: 7 of 12; r1 -3-> p2 -7-> base: 10 of 12. 17 s in all.
    certificate = certify(instance(), route("base", "p1", "r1", "p2", "base"))
    assert certificate.feasible
    assert certificate.reasons == ()
    assert (certificate.expected, certificate.nominal) == (7.0, 14.0)  # p = 0.5
    assert certificate.fuel_s == certificate.duration_s == {"a": 17.0, "b": 0.0}
    assert certificate.as_dict() == {"format": "sva-bench/certificate@1", "feasible": True, "expected": 7.0,
                                     "reasons": []}
    assert "expected value 7, 14 if all" in repr(certificate)


def test_stops_take_time_but_burn_no_fuel() -> None:
    certificate = certify(instance(stop=5), route("base", "p1", "r1", "p2", "base"))
    assert (certificate.fuel_s["a"], certificate.duration_s["a"]) == (17.0, 27.0)
    assert not certify(instance(stop=5, limit=26), route("base", "p1", "r1", "p2", "base")).feasible


def test_under_per_leg_failure_the_order_counts() -> None:
    # s = 0.5: 0.5 x 10 + 0.25 x 4 = 6 for p1 first.
    per_leg = replace(instance(), failure="per_leg")
    assert certify(per_leg, route("base", "p1", "r1", "p2", "base")).expected == 6.0
    assert certify(per_leg, route("base", "p2", "r1", "p1", "base")).expected == 0.5 * 4 + 0.25 * 10


def test_a_plan_on_its_limit_is_feasible_and_one_just_over_it_is_not() -> None:
    plan = route("base", "p1", "r1", "p2", "base")
    assert certify(instance(capacity=10, limit=17), plan).feasible
    assert certify(instance(capacity=10 - 5e-7, limit=17 - 5e-7), plan).feasible  # within 1e-6 s
    assert not certify(instance(capacity=10 - 2e-6), plan).feasible
    assert not certify(instance(limit=17 - 2e-6), plan).feasible


@pytest.mark.parametrize(("plan", "reason"), [
    (route("base", "p1", "p2", "base"),
     "17.000 s of fuel burnt on arrival over 'p2' -> 'base'; the capacity is 12.000 s"),
    (route("base", "r1", "p2", "r1", "p2", "r1", "p1", "base"), "POI 'p2' is visited twice; name it once"),
    (route("base", "p1", "base", b=("base", "p1", "base")), "b: POI 'p1' is visited already, by 'a'"),
    (route("base", "p1", "base", "r1", "base"), "the base is an intermediate stop"),
    (route("r1", "p1", "base"), "must start and end at the base"),
    (route("base", "p1"), "must start and end at the base, 'base'"),
    (route("base"), "must start and end at the base"),
    (route("base", "r1", "r1", "base"), "'r1' follows itself"),
    (route("base", "r1", "p2", "p1", "base"), "there is no leg 'p2' -> 'p1'"),
    (route("base", "r1", "p1", "r1", "p1", "r1", "base"), "POI 'p1' is visited twice; name it once"),
])
def test_a_plan_that_breaks_a_rule_is_refused_with_the_reason(plan: Plan, reason: str) -> None:
    certificate = certify(instance(limit=100), plan)
    assert not certificate.feasible
    assert (certificate.expected, certificate.nominal) == (None, None)
    assert any(reason in found for found in certificate.reasons), certificate.reasons


@pytest.mark.parametrize("stops", [("p1", "p1"), ("p1", "r1", "p1"), ("p1", "p1", "p1"), ("p1", "r1", "p1", "p1")])
def test_a_duplicate_poi_in_a_route_gets_one_message(stops: tuple[str, ...]) -> None:
    certificate = certify(instance(capacity=100, limit=100), route("base", *stops, "base"))
    assert certificate.reasons == ("a: POI 'p1' is visited twice; name it once",)


def test_a_base_in_the_middle_gets_one_message() -> None:
    certificate = certify(instance(limit=100), route("base", "base", "p1", "base"))
    assert certificate.reasons == ("a: the base is an intermediate stop of the route; it is left and entered once",)


def test_a_mission_over_its_limit_is_refused() -> None:
    certificate = certify(instance(limit=16), route("base", "p1", "r1", "p2", "base"))
    assert certificate.reasons == ("a: the mission takes 17.000 s; the limit is 16.000 s",)


def test_a_station_may_be_visited_often() -> None:
    # r1 three times, each leg within 12 s: 5 + 3+3 + 3+3 + 5 = 22 s.
    certificate = certify(instance(), route("base", "r1", "p2", "r1", "p1", "r1", "base"))
    assert certificate.reasons == ()
    assert certificate.duration_s["a"] == 22.0


def test_wrong_claims_are_named_but_do_not_make_a_plan_infeasible() -> None:
    plan = replace(route("base", "p1", "base"), objective="stochastic", value=10.0, fuel_s={"a": 9.0})
    certificate = certify(instance(), plan)
    assert certificate.feasible
    assert certificate.reasons == ("the plan claims a value of 10; it is worth 5",
                                   "a: the plan claims 9.000 s of fuel; it burns 8.000 s")
    assert certify(instance(), replace(plan, objective="deterministic", fuel_s={"a": 8.0})).reasons == ()
