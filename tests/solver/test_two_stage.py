"""Both plans, their ties, limits and refusals."""

from __future__ import annotations

import itertools
import json
import logging
import math
import os
import signal
from dataclasses import replace
from pathlib import Path
from threading import Timer
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sva_bench.arrays import FloatArray
from sva_bench.choices import Method
from sva_bench.errors import BadInput
from sva_bench.mission.certify import certify
from sva_bench.mission.failures import JointState
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.mission.instance_file import read_instance
from sva_bench.mission.plan import Plan
from sva_bench.solver import searching
from sva_bench.solver.columns import column_generation
from sva_bench.solver.flow import branch_and_cut
from sva_bench.solver.flow.expected import euler_walk
from sva_bench.solver.highs import maximise
from sva_bench.solver.knowledge import SolveLimits
from sva_bench.solver.preprocess import is_metric, scope_of
from sva_bench.solver.program import MipResult
from sva_bench.solver.routes.heuristic import Found
from sva_bench.solver.routes.refuelling import quickest_route, vehicle_legs
from sva_bench.solver.two_stage import (
    knowledge_of,
    plan_deterministic,
    plan_nominal,
    plan_stochastic,
    wait_and_see,
)

INSTANCES = Path(__file__).parents[2] / "../shared/instances"


def vehicle(fuel: FloatArray, incentives: list[float], *, name: str = "a", capacity: float = math.inf,
            limit: float = math.inf, availability: float = 1.0) -> Vehicle:
    return Vehicle(name=name, fuel_capacity_s=capacity, mission_limit_s=limit, availability=availability,
                   incentives=np.array(incentives, dtype=float), fuel_s=fuel)


def instance_of(sites: str, stations: tuple[int, ...], *vehicles: Vehicle, base: int = 0,
                joint: tuple[JointState, ...] | None = None) -> Instance:
    names = tuple(sites.split())
    return Instance(name="by-hand", sites=names, base=base, stations=stations, stop_s=np.zeros(len(names)),
                    vehicles=vehicles, joint=joint)


def value_and_bound(plan: Plan) -> tuple[float, float]:
    assert plan.value is not None
    assert plan.bound is not None
    return plan.value, plan.bound


STATION_LEG_TWICE = np.array([[0, 5, 13, 18, 18], [18, 0, 8, 13, 13], [10, 10, 0, 5, 5], [7, 5, 13, 0, 18],
                              [5, 10, 18, 23, 0]], dtype=float)
# Two POIs, 10 s from the base and 10 s from each other; 30 s allow both to one robot, 20 s only one each.
TRIANGLE = np.array([[0, 10, 10], [10, 0, 10], [10, 10, 0]], dtype=float)


@pytest.mark.parametrize("heuristic", [True, False])
def test_an_optimal_route_may_drive_the_same_station_leg_twice(
        heuristic: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    # base r1 r2 p1 r1 r2 p2 base: 5 + 8 | 5 + 5 | 8 | 5 + 5 s between refuels, F = 10: worth 20; once only: 10.
    if not heuristic:
        monkeypatch.setattr(searching, "search", lambda *given, **_: Found(orders=given[3], routes=()))
    instance = instance_of("base r1 r2 p1 p2", (1, 2),
                           vehicle(STATION_LEG_TWICE, [0, 0, 0, 10, 10], capacity=10, limit=60))
    plan = plan_stochastic(instance)
    assert (plan.status, plan.value, plan.bound) == ("optimal", 20.0, 20.0)
    assert plan.routes["a"] == ("base", "r1", "r2", "p1", "r1", "r2", "p2", "base")
    assert plan.fuel_s["a"] == 41.0


def test_the_unreliable_robot_gets_what_the_reliable_one_can_spare() -> None:
    # One POI each. Sums: a1 + b2 = 10 + 8 = 18, a2 + b1 = 9 + 10 = 19. Expected with p_b = 0.5: 14 and 14;
    # with p_b = 0.25: 12 and 11.5.
    a, b = vehicle(TRIANGLE, [0, 10, 9], limit=20), vehicle(TRIANGLE, [0, 10, 8], name="b", limit=20)
    instance = instance_of("base p1 p2", (), a, replace(b, availability=0.25))
    stochastic = plan_stochastic(instance)
    assert stochastic.routes == {"a": ("base", "p1", "base"), "b": ("base", "p2", "base")}
    assert stochastic.value == 12.0
    plans = plan_deterministic(instance, stochastic)
    assert plans.plan.routes == {"a": ("base", "p2", "base"), "b": ("base", "p1", "base")}
    assert (plans.plan.value, plans.most, plans.least) == (19.0, 11.5, 11.5)
    assert plans.stochastic is stochastic
    # Wait and see: 0.25 x 19 + 0.75 x 10 = 12.25.
    assert wait_and_see(instance) == pytest.approx(12.25)


def test_ties_go_to_the_greatest_expected_value_and_then_to_the_least_time() -> None:
    # Both POIs are worth 10 to both; b can be had with a alone (30 s) or one each (40 s): every such plan sums to 20.
    # Expected, p_b = 0.5: a takes both 20, one each 15, b both 10.
    robots = [vehicle(TRIANGLE, [0, 10, 10], name=n, limit=30, availability=p) for n, p in (("a", 1.0), ("b", 0.5))]
    instance = instance_of("base p1 p2", (), *robots)
    plans = plan_deterministic(instance, plan_stochastic(instance))
    assert (plans.plan.value, plans.most, plans.least) == (20.0, 20.0, 10.0)
    assert plans.plan.routes["b"] == ()
    assert plans.stochastic.routes == plans.plan.routes  # worth the same: executed difference exactly zero
    sure = instance.with_availability({"b": 1.0})
    plans = plan_deterministic(sure, plan_stochastic(sure))
    assert sum(plans.plan.fuel_s.values()) == 30.0  # one robot for both, not one each
    assert plans.least == plans.most == 20.0


def test_scenarios_share_the_nominal_plan_and_what_is_known() -> None:
    robots = [vehicle(TRIANGLE, [0, 10, 9], name=n, limit=20) for n in ("a", "b")]
    first = instance_of("base p1 p2", (), *robots)
    known = knowledge_of(first)
    nominal = plan_nominal(first, known=known)
    for p in (1.0, 0.75, 0.25, 0.0):
        instance = first.with_availability({"b": p})
        plans = plan_deterministic(instance, plan_stochastic(instance, known=known), nominal=nominal, known=known)
        assert plans.plan.value == nominal.value == 19.0
        assert plans.most == pytest.approx(10 + 9 * p)
        assert plans.least == pytest.approx(9 + 10 * p)
    other = instance_of("base p1 p2", (), robots[0])
    with pytest.raises(ValueError, match="differ in more than their availabilities"):
        plan_nominal(other, known=known)


def test_the_same_instance_gives_the_same_plan() -> None:
    robots = [vehicle(STATION_LEG_TWICE, [0, 0, 0, 10, 10], name=n, capacity=10, limit=60) for n in ("a", "b")]
    instance = instance_of("base r1 r2 p1 p2", (1, 2), *robots)
    first, second = plan_stochastic(instance), plan_stochastic(instance)
    assert replace(first, runtime_s=None).__dict__ == replace(second, runtime_s=None).__dict__


@pytest.mark.parametrize(("sites", "stations", "vehicles"), [
    ("base", (), [vehicle(np.zeros((1, 1)), [0])]),
    ("base r1", (1,), [vehicle(np.array([[0.0, 1], [1, 0]]), [0, 0], capacity=5)]),
    ("base p1 p2", (), []),
    ("base p1 p2", (), [vehicle(TRIANGLE, [0, 0, 0])]),
    ("base p1 p2", (), [vehicle(TRIANGLE, [0, 5, 5], capacity=0)]),
    ("base p1 p2", (), [vehicle(TRIANGLE, [0, 5, 5], limit=0)]),
    ("base p1 p2", (), [vehicle(TRIANGLE, [0, 5, 5], availability=0)]),
])
def test_a_robot_that_can_earn_nothing_stays_home(
        sites: str, stations: tuple[int, ...], vehicles: list[Vehicle]) -> None:
    instance = instance_of(sites, stations, *vehicles)
    plan = plan_stochastic(instance)
    assert (plan.status, plan.value, plan.bound) == ("optimal", 0.0, 0.0)
    assert all(route == () for route in plan.routes.values())
    assert plan_deterministic(instance, plan).plan.status == "optimal"
    assert wait_and_see(instance) == 0.0


def test_a_poi_without_reward_is_visited_only_as_a_shortcut() -> None:
    # p1 is worth nothing. The way over it to p2, 1 + 1, beats the direct one, 50, which is over the limit of 30.
    fuel = np.array([[0, 1, 50], [9, 0, 1], [9, 9, 0]], dtype=float)
    plan = plan_stochastic(instance_of("base p1 p2", (), vehicle(fuel, [0, 0, 5], limit=30)))
    assert plan.routes["a"] == ("base", "p1", "p2", "base")
    plan = plan_stochastic(instance_of("base p1 p2", (), vehicle(fuel, [0, 0, 5], limit=60)))
    assert plan.routes["a"] == ("base", "p2", "base")


def test_legs_that_cost_nothing_close_no_subtour(monkeypatch: pytest.MonkeyPatch) -> None:
    # p1 and p2 lie in one spot, far from the base: a loop between them is free, but no robot gets there.
    monkeypatch.setattr(searching, "search", lambda *given, **_: Found(orders=given[3], routes=()))
    fuel = np.array([[0, 20, 20, 1], [20, 0, 0, 20], [20, 0, 0, 20], [1, 20, 20, 0]], dtype=float)
    for capacity in (30.0, 40.0):
        instance = instance_of("base p1 p2 p3", (), vehicle(fuel, [0, 5, 5, 1], capacity=capacity, limit=50))
        plan = plan_stochastic(instance)
        assert plan.value == (1.0 if capacity == 30 else 10.0)


def test_an_unreachable_poi_is_left_out_with_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    fuel = TRIANGLE.copy()
    fuel[:, 2] = [math.inf, math.inf, 0]
    with caplog.at_level(logging.WARNING):
        plan = plan_stochastic(instance_of("base p1 p2", (), vehicle(fuel, [0, 5, 7])))
    assert plan.value == 5.0
    assert [record.getMessage() for record in caplog.records] == \
        ["instance by-hand: POI p2 cannot be reached and left again; it is left out of the plan"]


def test_correlated_failures_count_for_foresight_but_not_for_the_plan() -> None:
    robots = [vehicle(TRIANGLE, [0, 10, 9], name=n, limit=20, availability=0.5) for n in ("a", "b")]
    joint = (JointState(probability=0.5, available=frozenset({"a"})),
             JointState(probability=0.5, available=frozenset({"b"})))
    stacked, disjoint = instance_of("base p1 p2", (), *robots, joint=joint), instance_of("base p1 p2", (), *robots)
    assert plan_stochastic(stacked).value == plan_stochastic(disjoint).value == 9.5
    assert wait_and_see(stacked) == pytest.approx(10.0)  # always exactly one robot, and it takes the better POI
    assert wait_and_see(disjoint) == pytest.approx(0.25 * 19 + 0.5 * 10)


def test_wait_and_see_over_many_outcomes_is_computed_only_on_request() -> None:
    robots = [vehicle(TRIANGLE, [0, 10, 9], name=f"a{k}", limit=20, availability=0.5) for k in range(5)]
    instance = instance_of("base p1 p2", (), *robots)
    assert wait_and_see(instance) is None
    # At least two robots 26/32, one 5/32: 19 x 26/32 + 10 x 5/32 = 17.
    assert wait_and_see(instance, force=True) == pytest.approx(17.0)


def test_under_failures_along_the_route_what_earns_most_comes_first() -> None:
    # The first POI is reached with 1/2, the second with 1/4: 8/2 + 4/4 = 5, the other way round 4/2 + 8/4 = 4.
    instance = replace(instance_of("base p1 p2", (), vehicle(TRIANGLE, [0, 4, 8], availability=0.5)), failure="per_leg")
    plan = plan_stochastic(instance)
    assert plan.routes["a"] == ("base", "p2", "p1", "base")
    assert plan.value == pytest.approx(5.0)


def test_the_collapsed_model_refuses_failures_along_the_route() -> None:
    instance = replace(instance_of("base p1 p2", (), vehicle(TRIANGLE, [0, 5, 5])), failure="per_leg")
    with pytest.raises(BadInput, match="plans under mission"):
        plan_stochastic(instance, method="expected")


def test_a_plan_to_start_from_must_be_feasible() -> None:
    instance = instance_of("base p1 p2", (), vehicle(TRIANGLE, [0, 5, 5], limit=20))
    assert plan_stochastic(instance, incumbent=Plan(routes={"a": ("base", "p2", "base")})).value == 5.0
    with pytest.raises(BadInput, match="the limit is 20"):
        plan_stochastic(instance, incumbent=Plan(routes={"a": ("base", "p1", "p2", "base")}))


def scattered(pois: int) -> Instance:
    """A mission that takes seconds: fuel for a third of it, directed costs."""
    rng = np.random.default_rng(4)
    at = np.concatenate([[[50, 50], [25, 25], [75, 75], [25, 75], [75, 25]], rng.uniform(0, 100, size=(pois, 2))])
    fuel = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    robots = []
    for name, p in (("a", 1.0), ("b", 0.75)):
        incentives = np.concatenate([np.zeros(5), rng.uniform(0, 100, size=pois)])
        robots.append(vehicle(fuel, incentives.tolist(), name=name, capacity=90, limit=220, availability=p))
    return instance_of(" ".join(["base", "r1", "r2", "r3", "r4", *(f"p{k}" for k in range(pois))]), (1, 2, 3, 4),
                       *robots)


@pytest.mark.parametrize("limit_s", [0.0, 0.05, 0.6])
def test_out_of_time_the_best_plan_so_far_comes_with_a_valid_bound(limit_s: float) -> None:
    instance = scattered(25)
    plan = plan_stochastic(instance, SolveLimits(time_limit_s=limit_s))
    assert plan.status == "time_limit"
    assert certify(instance, plan).reasons == ()
    value, bound = value_and_bound(plan)
    assert 0 < value < bound
    assert bound <= sum(max(v.incentives[j] * v.availability for v in instance.vehicles) for j in instance.pois) + 1e-6
    plans = plan_deterministic(instance, plan, SolveLimits(time_limit_s=limit_s))
    assert plans.plan.status == "time_limit"
    value, bound = value_and_bound(plans.plan)
    assert value <= bound
    assert plans.least <= plans.most
    assert wait_and_see(instance, SolveLimits(time_limit_s=limit_s)) is None


def test_a_solve_stops_at_a_wide_gap() -> None:
    plan = plan_stochastic(scattered(25), SolveLimits(gap=5.0))
    assert plan.status == "optimal"
    value, bound = value_and_bound(plan)
    assert bound - value <= 5.0 * value


@pytest.mark.parametrize(("where", "what", "method"), [
    (searching, "search", "auto"), (column_generation, "best_routes", "auto"),
    (branch_and_cut, "maximise", "expected")])
def test_ctrl_c_keeps_the_best_plan_so_far(
    where: ModuleType, what: str, method: Method, monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(where, what, interrupt)
    instance = scattered(12)
    plan = plan_stochastic(instance, method=method)
    assert plan.status == "interrupted"
    assert certify(instance, plan).reasons == ()
    value, bound = value_and_bound(plan)
    assert value <= bound < math.inf
    assert what == "search" or value > 0


def test_ctrl_c_during_branch_and_bound_ends_it_with_what_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*arguments: Any, **options: Any) -> MipResult:
        Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        return maximise(*arguments, **options)

    monkeypatch.setattr(branch_and_cut, "maximise", interrupted)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    instance = scattered(25)
    try:
        plan = plan_stochastic(instance, method="expected")
    finally:
        signal.signal(signal.SIGINT, handler)
    assert plan.status == "interrupted"
    assert certify(instance, plan).reasons == ()
    value, bound = value_and_bound(plan)
    assert value < bound < math.inf


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    plan_stochastic(scattered(5))
    assert capfd.readouterr() == ("", "")


def test_refuelling_in_a_given_order_is_exact() -> None:
    # 10 s of fuel: base p1 p2 base is 4 + 6 + 4; by the station between p1 and p2, 4 + 3 | 3 + 4, it goes.
    fuel = np.array([[0, 5, 4, 4], [5, 0, 3, 3], [4, 3, 0, 6], [4, 3, 6, 0]], dtype=float)
    instance = instance_of("base r1 p1 p2", (1,), vehicle(fuel, [0, 0, 1, 1], capacity=10, limit=14))
    own_legs = vehicle_legs(instance, instance.vehicles[0])
    assert quickest_route(own_legs, (2, 3)) == (14.0, (0, 2, 1, 3, 0))
    assert quickest_route(own_legs, ()) == (0.0, ())
    short = instance_of("base r1 p1 p2", (1,), vehicle(fuel, [0, 0, 1, 1], capacity=10, limit=13.9))
    assert quickest_route(vehicle_legs(short, short.vehicles[0]), (2, 3)) is None


def test_an_euler_walk_drives_every_leg_that_is_connected_with_the_base() -> None:
    visits = np.zeros((6, 6))
    for i, j in itertools.pairwise([0, 1, 2, 3, 1, 2, 4, 0]):
        visits[i, j] += 1
    walk = euler_walk(visits, 0)
    assert walk[0] == walk[-1] == 0
    again = np.zeros((6, 6))
    for i, j in itertools.pairwise(walk):
        again[i, j] += 1
    assert_array_equal(again, visits)


def test_the_triangle_test_ignores_detours_over_the_base() -> None:
    # Start and end differ: 1 -> base -> 2 seems to cost 2, but no route passes the base.
    cost = np.array([[0, 1, 1], [1, 0, 9], [1, 9, 0]], dtype=float)
    assert is_metric(cost, 0)
    assert not is_metric(cost, 2)


def test_only_legs_that_some_plan_can_use_are_kept() -> None:
    # Limit 25: base p1 base is 20, base p1 p2 base is 30.
    instance = instance_of("base p1 p2", (), vehicle(TRIANGLE, [0, 5, 5], limit=25))
    legs = scope_of(instance, instance.vehicles[0], np.array([False, True, True])).legs
    assert_array_equal(legs, [[False, True, True], [True, False, False], [True, False, False]])
    none = scope_of(instance, instance.vehicles[0], np.zeros(3, dtype=np.bool_)).legs
    assert not none.any()


@pytest.mark.parametrize("name", [
    "A-n10-m2-p25-s0", "A-n10-m2-p25-s1", "A-n10-m2-p75-s0", "A-n10-m2-p75-s1", "B-n10-m2-p75-s1",
    "tsiligirides_problem_2_budget_15", "tsiligirides_problem_2_budget_20", "p1.2.b", "p1.2.c", "p1.2.d", "p1.3.c",
])
def test_published_instances_reach_their_known_optimum(name: str) -> None:
    if not INSTANCES.is_dir():
        pytest.skip("the published instances are not part of the project")
    optimum = json.loads((INSTANCES / "optima.json").read_text(encoding="utf-8"))[name]
    plan = plan_stochastic(read_instance(INSTANCES / f"{name}.json"))
    assert plan.status == "optimal"
    assert plan.value == pytest.approx(optimum["best"], rel=1e-6)
