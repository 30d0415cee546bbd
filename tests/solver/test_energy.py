"""Idle burn, charging that takes time, and a clock apart from fuel: the solver against enumeration, and their laws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sva_bench.choices import FailureProcess, Method
from sva_bench.mission.certify import certify
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.mission.plan import Plan
from sva_bench.mission.rest import Rest
from sva_bench.solver import searching
from sva_bench.solver.risk import RiskMeasure
from sva_bench.solver.routes.heuristic import Found
from sva_bench.solver.two_stage import (
    SolveLimits,
    knowledge_of,
    plan_averse,
    plan_deterministic,
    plan_nominal,
    plan_stochastic,
    wait_and_see,
)
from tests.oracles.energy import driven, greatest_value, with_energy
from tests.oracles.rest import TooMany
from tests.solver.oracle import discounted_optimum, random_instance, risk_optimum, truth
from tests.solver.test_discounts import risky
from tests.solver.test_rest import check as check_rest
from tests.solver.test_rest import random_rest

EXACT = SolveLimits(gap=1e-10)
METHODS: tuple[Method, ...] = ("auto", "branch-and-price", "expected", "dep", "relaxed", "lshaped")
PROCESSES: tuple[FailureProcess, ...] = ("mission", "per_leg", "hazard")


def by_hand(instance: Instance, plan: Plan) -> float:
    """Value of a plan, driven stop by stop; its fuel and clock are those of the certificate."""
    certificate, value = certify(instance, plan), 0.0
    assert certificate.reasons == ()
    for vehicle in instance.vehicles:
        route = tuple(instance.sites.index(site) for site in plan.route(vehicle.name))
        way = driven(instance, vehicle, route) if route else None
        assert (way is None) == (not route)
        value += way.value if way else 0.0
        assert certificate.duration_s[vehicle.name] == pytest.approx(way.clock_s if way else 0.0, abs=1e-9)
        assert certificate.fuel_s[vehicle.name] == pytest.approx(way.burnt_s if way else 0.0, abs=1e-9)
    assert certificate.expected == pytest.approx(value, rel=1e-9, abs=1e-9)
    return value


@pytest.fixture(params=[False, True], ids=["method alone", "with heuristic"])
def heuristic(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave everything to the method, or not."""
    if not request.param:
        monkeypatch.setattr(searching, "search", lambda *given, **_: Found(orders=given[3], routes=()))


def check(seed: int, method: Method) -> None:
    instance = with_energy(random_instance(seed), seed)
    want = truth(instance)
    plan = plan_stochastic(instance, EXACT, method=method)
    assert plan.status == "optimal"
    assert by_hand(instance, plan) == pytest.approx(want.stochastic, rel=1e-9, abs=1e-9)
    assert plan_nominal(instance, EXACT, method=method).value == pytest.approx(want.nominal, rel=1e-9, abs=1e-9)


def check_failing(seed: int, process: FailureProcess) -> None:
    instance = with_energy(risky(seed, process), seed)
    plan = plan_stochastic(instance, EXACT)
    assert plan.status == "optimal"
    assert by_hand(instance, plan) == pytest.approx(discounted_optimum(instance), rel=1e-9, abs=1e-9)


def check_ties(seed: int, method: Method) -> None:
    instance = with_energy(random_instance(seed), seed)
    want, known = truth(instance), knowledge_of(instance)
    plans = plan_deterministic(
        instance, plan_stochastic(instance, EXACT, known=known, method=method), EXACT, known=known, method=method)
    assert plans.most == pytest.approx(want.most, rel=1e-9, abs=1e-9)
    assert plans.least == pytest.approx(want.least, rel=1e-9, abs=1e-9)
    clocks = certify(instance, plans.plan).duration_s.values()
    assert sum(clocks) == pytest.approx(want.soonest, rel=1e-5, abs=1e-5)  # a floor gives way by 1e-8
    assert wait_and_see(instance, EXACT, known) == pytest.approx(want.foresight, rel=1e-9, abs=1e-9)
    for measure in (RiskMeasure(kind="cvar", beta=0.5), RiskMeasure(kind="excess", target=30.0)):
        averse = plan_averse(instance, measure, EXACT)
        assert averse.value == pytest.approx(risk_optimum(instance, measure), rel=1e-9, abs=1e-9)
        assert certify(instance, averse).reasons == ()


@pytest.mark.spread(8)
@pytest.mark.usefixtures("heuristic")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("block", range(2))
def test_plans_are_those_that_enumeration_finds(block: int, method: Method) -> None:
    for seed in range(5 * block, 5 * block + 5):
        check(seed, method)


@pytest.mark.usefixtures("heuristic")
@pytest.mark.parametrize("process", ["per_leg", "hazard"])
def test_so_are_those_for_failures_along_the_route(process: FailureProcess) -> None:
    for seed in range(20):
        check_failing(seed, process)


@pytest.mark.long
@pytest.mark.parametrize("method", ["auto", "expected"])
def test_so_are_ties_foresight_and_plans_under_a_measure_of_risk(method: Method) -> None:
    for seed in range(12):
        check_ties(seed, method)


@pytest.mark.parametrize("process", PROCESSES)
def test_the_oracle_that_drops_dominated_ways_finds_what_the_one_of_all_ways_does(process: FailureProcess) -> None:
    compared = 0
    for seed in range(60):
        instance = with_energy(replace(random_instance(seed), failure=process), seed)
        if len(instance.pois) <= 3 and all(v.availability > 0 for v in instance.vehicles):
            compared += 1
            want = truth(instance).stochastic if process == "mission" else discounted_optimum(instance)
            assert want == pytest.approx(greatest_value(instance), rel=1e-9, abs=1e-9)
    assert compared >= 10


def energetic_rest(seed: int, process: FailureProcess) -> Rest:
    rest = random_rest(seed, process)
    # Limits stay: of the vehicles afield some can come home in time, some can't.
    return replace(rest, instance=with_energy(rest.instance, seed))


@pytest.mark.parametrize("process", PROCESSES)
def test_the_rest_of_a_mission_is_planned_as_well_as_enumeration_does(process: FailureProcess) -> None:
    for seed in range(30):
        check_rest(energetic_rest(seed, process))


def fast(instance: Instance) -> Instance:
    """The same with charging so fast that it takes no time."""
    rates = np.full(len(instance.sites), np.inf)
    rates[list(instance.stations)] = 1e9
    return replace(instance, charge_rate=rates)


@pytest.mark.parametrize("process", PROCESSES)
def test_charging_without_end_no_idling_and_the_fuel_as_a_clock_are_as_without_the_keys(
    process: FailureProcess,
) -> None:
    for seed in range(12):
        plain = replace(random_instance(seed), failure=process)
        plan = plan_stochastic(plain, EXACT)
        told = replace(plain, vehicles=tuple(replace(v, time_s=v.fuel_s, idle_share=0.0) for v in plain.vehicles))
        assert plan_stochastic(told, EXACT).value == plan.value
        assert plan_stochastic(fast(plain), EXACT).value == pytest.approx(plan.value, rel=1e-9, abs=1e-9)


@pytest.mark.spread(1)
@pytest.mark.parametrize("factor", [0.25, 60.0])
def test_another_unit_of_time_changes_no_value(factor: float) -> None:
    for seed in range(12):
        instance = with_energy(random_instance(seed), seed)
        vehicles = tuple(replace(
            v, fuel_s=v.fuel_s * factor, time_s=None if v.time_s is None else v.time_s * factor,
            fuel_capacity_s=v.fuel_capacity_s * factor, mission_limit_s=v.mission_limit_s * factor)
            for v in instance.vehicles)
        scaled = replace(instance, stop_s=instance.stop_s * factor, vehicles=vehicles)
        assert plan_stochastic(scaled, EXACT).value == plan_stochastic(instance, EXACT).value
        # A clock that runs twice as fast: charging then takes twice as long.
        twice = replace(instance, stop_s=instance.stop_s * 2, vehicles=tuple(replace(
            v, time_s=v.leg_time_s * 2, idle_share=v.idle_share / 2, mission_limit_s=v.mission_limit_s * 2)
            for v in instance.vehicles), charge_rate=None if instance.charge_rate is None else instance.charge_rate / 2)
        assert plan_stochastic(twice, EXACT).value == plan_stochastic(instance, EXACT).value


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("limit_s", "value"), [(27.0, 10.0), (26.9, 0.0)])
def test_a_stop_at_a_station_takes_the_longer_the_emptier_the_tank(
    method: Method, limit_s: float, value: float,
) -> None:
    # base -4- p -3- r -5- base on a tank of 9: p's stop of 2 s burns 1, so r is reached with 8 burnt, and charging at
    # a rate of 1 takes 8 s on top of its 5 s: 4 + 2 + 3 + 5 + 8 + 5 = 27 s. The way p -9- base is too long.
    cost = np.array([[0.0, 5, 4], [5, 0, 3], [9, 3, 0]])
    vehicle = Vehicle(name="v", fuel_capacity_s=9.0, mission_limit_s=limit_s, availability=1.0, fuel_s=cost,
                      incentives=np.array([0.0, 0, 10]), idle_share=0.5)
    instance = Instance(name="charging", sites=("base", "r", "p"), base=0, stations=(1,), vehicles=(vehicle,),
                        stop_s=np.array([0.0, 5, 2]), charge_rate=np.array([np.inf, 1, np.inf]))
    plan = plan_stochastic(instance, method=method)
    assert plan.value == value
    if value:
        assert plan.routes["v"] == ("base", "p", "r", "base")
        assert plan.fuel_s["v"] == 13.0  # 4 + 1 + 3 + 5
        assert certify(instance, plan).duration_s["v"] == 27.0


def test_what_is_known_of_an_instance_holds_for_none_with_other_energy() -> None:
    instance = random_instance(1)
    known = knowledge_of(instance)
    for other in (with_energy(instance, 1), fast(instance), replace(instance, vehicles=tuple(
            replace(v, idle_share=0.5) for v in instance.vehicles))):
        with pytest.raises(ValueError, match="differ in more than their availabilities"):
            known.check(other)


@pytest.mark.long
@pytest.mark.usefixtures("heuristic")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("block", range(30))
def test_plans_are_those_that_enumeration_finds_on_thousands_of_instances(block: int, method: Method) -> None:
    for seed in range(10_000 + 20 * block, 10_020 + 20 * block):
        check(seed, method)


@pytest.mark.long
@pytest.mark.usefixtures("heuristic")
@pytest.mark.parametrize("process", ["per_leg", "hazard"])
@pytest.mark.parametrize("block", range(30))
def test_so_are_those_for_failures_along_the_route_on_thousands(block: int, process: FailureProcess) -> None:
    for seed in range(20_000 + 30 * block, 20_030 + 30 * block):
        check_failing(seed, process)


@pytest.mark.long
@pytest.mark.parametrize("method", ["auto", "expected"])
@pytest.mark.parametrize("block", range(20))
def test_so_are_ties_and_measures_of_risk_on_many_instances(block: int, method: Method) -> None:
    for seed in range(30_000 + 20 * block, 30_020 + 20 * block):
        check_ties(seed, method)


@pytest.mark.long
@pytest.mark.parametrize("process", PROCESSES)
@pytest.mark.parametrize("block", range(20))
def test_the_rest_of_a_mission_is_planned_as_well_on_many_teams(block: int, process: FailureProcess) -> None:
    passed_over = 0
    for seed in range(40_000 + 30 * block, 40_030 + 30 * block):
        try:
            check_rest(energetic_rest(seed, process))
        except TooMany:  # more states than enumeration goes through
            passed_over += 1
    assert passed_over <= 3
