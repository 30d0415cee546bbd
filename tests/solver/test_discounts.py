"""Failures along the route and the cost of a lost robot: the solver against enumeration, and their laws."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from sva_bench.choices import FailureProcess
from sva_bench.generate.instances import random_instance as paper_instance
from sva_bench.mission.certify import certify
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.solver import searching
from sva_bench.solver.columns.graph import Graph, graph_of
from sva_bench.solver.columns.pricing import price
from sva_bench.solver.columns.subset_row import cut_duals_of
from sva_bench.solver.discounts import Discount, Discounts, greatest_survival
from sva_bench.solver.goal import Goal
from sva_bench.solver.knowledge import knowledge_of, value_of, without_losses
from sva_bench.solver.preprocess import scope_of
from sva_bench.solver.routes.fronts import leg_tables
from sva_bench.solver.routes.heuristic import Found, search
from sva_bench.solver.routes.refuelling import quickest_route, vehicle_legs
from sva_bench.solver.routes.ways import best_way
from sva_bench.solver.two_stage import plan_deterministic, plan_nominal, plan_stochastic
from tests.solver.oracle import discounted_optimum, random_instance

PROCESSES: tuple[FailureProcess, ...] = ("per_leg", "hazard")


def risky(seed: int, failure: FailureProcess, *, costs: bool = True) -> Instance:
    """A tiny instance whose robots fail along the route: never, now and then, soon or at once; some cost something."""
    instance, rng = random_instance(seed), np.random.default_rng((seed, 7))
    vehicles: list[Vehicle] = []
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
    assert certificate.expected == pytest.approx(plan.value, rel=1e-9, abs=1e-9)  # rounding of sums


@pytest.fixture
def no_heuristic(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave everything to the columns."""
    monkeypatch.setattr(searching, "search", lambda *given, **_: Found(orders=given[3], routes=()))


@pytest.mark.spread(15)
@pytest.mark.usefixtures("no_heuristic")
@pytest.mark.parametrize("costs", [False, True], ids=["free", "costly"])
@pytest.mark.parametrize("failure", PROCESSES)
@pytest.mark.parametrize("block", range(10))
def test_plans_for_failures_along_the_route_are_those_that_enumeration_finds(
    block: int, failure: FailureProcess, costs: bool,
) -> None:
    for seed in range(5000 + 10 * block, 5010 + 10 * block):
        check(seed, failure, costs=costs)


@pytest.mark.spread(20)
@pytest.mark.parametrize("failure", PROCESSES)
@pytest.mark.parametrize("seed", range(8000, 8030))
def test_with_the_heuristic_they_are_the_same(seed: int, failure: FailureProcess) -> None:
    check(seed, failure)


@pytest.mark.long
@pytest.mark.usefixtures("no_heuristic")
@pytest.mark.parametrize("costs", [False, True], ids=["free", "costly"])
@pytest.mark.parametrize("failure", PROCESSES)
@pytest.mark.parametrize("block", range(30))
def test_they_are_on_thousands_of_instances(block: int, failure: FailureProcess, costs: bool) -> None:
    for seed in range(10_000 + 50 * block, 10_050 + 50 * block):
        check(seed, failure, costs=costs)


def routes(graph: Graph, seen: frozenset[int], route: tuple[int, ...], time: float, fuel: float) -> Iterator[
        tuple[int, ...]]:
    """All elementary routes of a pricing graph; between two POIs, each station at most once."""
    here = route[-1]
    for j in range(len(graph.bit)):
        burnt, later = fuel + graph.fuel_s[here, j], time + graph.time_s[here, j]
        if not graph.legs[here, j] or j in seen or burnt > graph.capacity_s or later > graph.limit_s:
            continue
        if j == graph.base:
            yield (*route, j)
        elif graph.bit[j] >= 0:
            pois = frozenset(i for i in seen if graph.bit[i] >= 0) | {j}
            yield from routes(graph, pois, (*route, j), later, burnt)
        else:
            yield from routes(graph, seen | {j}, (*route, j), later, 0.0)


def reduced(graph: Graph, route: tuple[int, ...], vehicle: Vehicle, reward: np.ndarray, dual: np.ndarray) -> float:
    value, visits, driven, discount = -graph.discount.departure, 0, 0.0, graph.discount
    for i, j in itertools.pairwise(route):
        driven += float(vehicle.fuel_s[i, j])
        if graph.bit[j] >= 0:
            visits += 1
            value += discount.survival**visits * math.exp(-discount.rate * driven) * reward[j] - dual[j]
    return value + discount.home * discount.survival**visits * math.exp(-discount.rate * driven)


@pytest.mark.spread(30)
@pytest.mark.parametrize("seed", range(150))
def test_the_best_discounted_route_is_the_one_that_listing_finds(seed: int) -> None:
    instance, rng = random_instance(100 + seed), np.random.default_rng(seed)
    n, pois = len(instance.sites), np.array(instance.pois)
    stop = float(rng.choice([0.0, 1.0, 6.0]))  # long ones too: time then says little of the driving time
    vehicle = replace(instance.vehicles[0], mission_limit_s=float(rng.choice([25.0, 45.0])) + stop * len(pois))
    instance = replace(instance, stop_s=stop * (instance.stop_s >= 0) * (np.arange(n) != instance.base))
    home = float(rng.choice([0.0, 3.0, 30.0]))
    discount = Discount(survival=float(rng.choice([0.6, 0.95, 1.0])), rate=float(rng.choice([0.0, 0.02, 0.1])),
                        home=home, departure=home * float(rng.uniform(1.0, 1.2)))
    graph = graph_of(instance, scope_of(instance, vehicle, np.isin(np.arange(n), pois)), discount)
    reward, dual = np.zeros(n), np.zeros(n)
    reward[pois], dual[pois] = rng.uniform(1, 40, len(pois)), rng.uniform(0, 6, len(pois)) * rng.integers(0, 2)
    everything = np.full((n, 1), np.uint64(0xFFFFFFFFFFFFFFFF))
    worth = [reduced(graph, route, vehicle, reward, dual)
             for route in routes(graph, frozenset(), (graph.base,), 0.0, 0.0) if len(route) > 2]
    found = price(graph, reward, dual, 0.0, everything, threshold=0.0, compared=None, most_routes=5, most_labels=10**6,
                  cut_duals=cut_duals_of((), np.zeros(0), 0, n))
    assert found.complete
    assert found.best == pytest.approx(max([0.0, *worth]), abs=1e-8)
    for route in found.routes[:1]:
        assert reduced(graph, route, vehicle, reward, dual) == pytest.approx(found.best, abs=1e-8)


def walks(graph: Graph, memory: np.ndarray, mask: int, route: tuple[int, ...], time: float) -> Iterator[
        tuple[int, ...]]:
    """All ng-routes of a pricing graph without stations, and without fuel."""
    for j in range(len(graph.bit)):
        later = time + graph.time_s[route[-1], j]
        if graph.legs[route[-1], j] and later <= graph.limit_s:
            if j == graph.base:
                yield (*route, j)
            elif not mask >> int(graph.bit[j]) & 1:
                left = mask & int(memory[j, 0]) | 1 << int(graph.bit[j])
                yield from walks(graph, memory, left, (*route, j), later)


@pytest.mark.parametrize("seed", range(120))
def test_labels_that_forget_visits_find_the_best_route_that_may_repeat_them(seed: int) -> None:
    # With few memories a label that has paid more duals can be the better one: only if the site is likely reached.
    rng, n = np.random.default_rng((seed, 3)), 5
    at = rng.uniform(0, 10, (n, 2))
    fuel = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1)) * rng.uniform(1, 1.3, (n, n)) + 1.0
    np.fill_diagonal(fuel, 0.0)
    reward, dual = np.append(0.0, rng.uniform(5, 40, n - 1)), np.append(0.0, rng.uniform(0, 8, n - 1))
    vehicle = Vehicle(name="a", fuel_capacity_s=math.inf, mission_limit_s=32.0, availability=1.0, incentives=reward,
                      fuel_s=fuel)
    instance = Instance(name="x", sites=("b", "p", "q", "r", "s"), base=0, stations=(), stop_s=np.zeros(n),
                        vehicles=(vehicle,))
    home = float(rng.choice([0.0, 30.0]))
    discount = Discount(survival=float(rng.choice([0.7, 1.0])), rate=float(rng.choice([0.02, 0.08])), home=home,
                        departure=home)
    graph = graph_of(instance, scope_of(instance, vehicle, reward > 0), discount)
    memory = np.zeros((n, 1), dtype=np.uint64)
    memory[1:, 0] = [np.uint64(1 << k | int(rng.integers(16)) & int(rng.integers(16))) for k in range(n - 1)]
    usable = [j for j in range(n) if j == 0 or not graph.metric or graph.arrival[j] * reward[j] > dual[j]]
    worth = {route: reduced(graph, route, vehicle, reward, dual) for route in walks(graph, memory, 0, (0,), 0.0)
             if set(route) <= set(usable)}
    # Bounds on the rest of a route leave out those that go from a POI to another and straight back.
    plain = [value for route, value in worth.items() if all(i != j for i, j in zip(route, route[2:], strict=False))]
    found = price(graph, reward, dual, 0.0, memory, threshold=0.0, compared=None, most_routes=5, most_labels=10**6,
                  cut_duals=cut_duals_of((), np.zeros(0), 0, n))
    assert found.complete
    assert max([0.0, *plain]) - 1e-8 <= found.best <= max([0.0, *worth.values()]) + 1e-8


def test_the_best_way_refuels_after_the_richest_poi_though_that_takes_longer() -> None:
    # base, station, p1, p2. The quickest way, base r p1 p2 base, takes 1 + 3 + 2 + 4 = 10 s and is at p1 after 4 s;
    # base p1 r p2 base takes 3.5 + 5 + 3.5 + 4 = 16 s and is there after 3.5 s. Without a refuel 9.5 s exceed 9 s.
    fuel = np.array([[0, 1, 3.5, 4.5], [9, 0, 3, 3.5], [9, 5, 0, 2], [4, 9, 9, 0]])
    vehicle = Vehicle(name="a", fuel_capacity_s=9.0, mission_limit_s=20.0, availability=1.0, fuel_s=fuel,
                      incentives=np.array([0.0, 0.0, 100.0, 1.0]))
    instance = Instance(name="x", sites=("b", "r", "p1", "p2"), base=0, stations=(1,), stop_s=np.zeros(4),
                        vehicles=(vehicle,), failure="hazard")
    legs = vehicle_legs(instance, vehicle)
    quickest = quickest_route(legs, (2, 3))
    assert quickest is not None
    assert quickest.route == (0, 1, 2, 3, 0)
    found = best_way(legs, (2, 3), (100.0, 1.0), Discount(rate=1.0))
    assert found is not None
    assert found.route == (0, 2, 1, 3, 0)
    assert found.value == pytest.approx(100 * math.exp(-3.5) + math.exp(-12))
    calm = best_way(legs, (2, 3), (100.0, 1.0), Discount(rate=1e-6, home=1e9, departure=1e9))
    assert calm is not None
    assert calm.route == quickest.route  # what counts is the way home


def test_a_robot_that_costs_more_than_it_can_earn_stays() -> None:
    # One POI, 10 s there and back each: with MTBF 20 s, 100 exp(-0.5) = 60.7 earned, c (1 - exp(-1)) = 0.632 c lost.
    fuel = np.array([[0.0, 10.0], [10.0, 0.0]])
    for cost, route in ((95.0, ("b", "p", "b")), (97.0, ())):
        vehicle = Vehicle(name="a", fuel_capacity_s=math.inf, mission_limit_s=50.0, availability=1.0, mtbf_s=20.0,
                          incentives=np.array([0.0, 100.0]), fuel_s=fuel, loss_cost=cost)
        instance = Instance(name="x", sites=("b", "p"), base=0, stations=(), stop_s=np.zeros(2), vehicles=(vehicle,),
                            failure="hazard")
        plan = plan_stochastic(instance)
        assert plan.route("a") == route
        assert plan.value == pytest.approx(max(100 * math.exp(-0.5) - cost * (1 - math.exp(-1)), 0.0))


@pytest.mark.parametrize("failure", PROCESSES)
@pytest.mark.parametrize("factor", [1e-7, 3.0, 1e8])
def test_plans_do_not_depend_on_the_unit_of_incentives_and_costs(failure: FailureProcess, factor: float) -> None:
    for seed in range(300, 310):
        instance = risky(seed, failure)
        scaled = replace(instance, vehicles=tuple(
            replace(v, incentives=v.incentives * factor, loss_cost=v.loss_cost * factor) for v in instance.vehicles))
        plan, other = plan_stochastic(instance), plan_stochastic(scaled)
        assert other.routes == plan.routes
        assert other.value == pytest.approx(factor * (plan.value or 0.0), rel=1e-9)


@pytest.mark.parametrize("seed", range(400, 412))
def test_where_nothing_fails_the_processes_agree(seed: int) -> None:
    instance = replace(random_instance(seed), failure="mission")
    certain = instance.with_availability({v.name: 1.0 for v in instance.vehicles})
    best = plan_stochastic(certain).value
    costly = replace(certain, vehicles=tuple(replace(v, loss_cost=7.0) for v in certain.vehicles))
    for failure in PROCESSES:
        assert plan_stochastic(replace(costly, failure=failure)).value == pytest.approx(best, rel=1e-9)
    nearly = costly.with_availability({v.name: 1 - 1e-9 for v in costly.vehicles})
    # At most ten visits or 60 s of driving, each less likely by a share of 1e-9, and a loss of 7 per robot.
    assert plan_stochastic(replace(nearly, failure="hazard")).value == pytest.approx(best, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("seed", range(500, 506))
def test_failures_of_whole_missions_and_deterministic_plans_ignore_the_cost_of_a_loss(seed: int) -> None:
    instance = random_instance(seed)
    costly = replace(instance, vehicles=tuple(replace(v, loss_cost=1e3, mtbf_s=1.0) for v in instance.vehicles))
    plan, other = plan_stochastic(instance), plan_stochastic(costly)
    assert (other.routes, other.value) == (plan.routes, plan.value)
    for failure in PROCESSES:
        nominal = plan_nominal(replace(costly, failure=failure))
        assert (nominal.routes, nominal.value) == (plan_nominal(instance).routes, plan_nominal(instance).value)
        found = plan_deterministic(replace(costly, failure=failure), other).plan
        assert (found.routes, found.value) == (plan_deterministic(instance, plan).plan.routes, nominal.value)


@pytest.mark.parametrize("seed", range(600, 640))
def test_the_heuristic_never_claims_more_than_the_optimum(seed: int) -> None:
    instance = risky(seed, "hazard")
    best, known = discounted_optimum(instance), knowledge_of(instance)
    mtbf = [v.mtbf_s if v.mtbf_s is not None else 1 / _rate(v) if _rate(v) else math.inf for v in instance.vehicles]
    costs = np.array([v.loss_cost for v in instance.vehicles])
    discounts = Discounts(survival=np.ones(len(mtbf)), departure=costs, home=costs,
                          rate=np.array([1 / x if x > 0 else math.inf for x in mtbf]))
    goal = Goal(weights=np.array([v.incentives for v in instance.vehicles]), discounts=discounts)
    orders = search(leg_tables(instance), goal.weights, discounts, tuple(() for _ in mtbf), starts=1).orders
    assert value_of(goal, known.legs_by_vehicle, orders) <= best + 1e-9
    stayed = without_losses(goal, known.legs_by_vehicle, orders)
    assert 0 <= value_of(goal, known.legs_by_vehicle, stayed) <= best + 1e-9


def _rate(vehicle: Vehicle) -> float:
    if vehicle.availability in (0.0, 1.0):
        return 0.0 if vehicle.availability else math.inf
    return -math.log(vehicle.availability) / vehicle.mission_limit_s


def test_the_safest_way_to_a_site_may_lead_by_others() -> None:
    # To site 2 directly 0.5, by site 1 0.9 * 0.8 = 0.72; home from 1: 0.9 * 0.9 = 0.81, from 2: 0.72 * 1 = 0.72.
    legs = np.array([[0.0, 0.9, 0.5], [0.9, 0.0, 0.8], [1.0, 0.1, 0.0]])
    assert greatest_survival(legs, 0).tolist() == pytest.approx([0.81, 0.9, 0.72])


def test_a_goal_with_discounts_has_nothing_else() -> None:
    one = np.ones(1)
    discounts = Discounts(survival=one, rate=one, departure=one, home=one)
    with pytest.raises(ValueError, match="nothing else"):
        Goal(weights=np.ones((1, 3)), discounts=discounts, driving=1.0)
    with pytest.raises(ValueError, match="aren't negative"):
        Goal(weights=-np.ones((1, 3)), discounts=discounts)
    with pytest.raises(ValueError, match="can't be negative"):
        replace(discounts, departure=-one)


@pytest.mark.parametrize("failure", PROCESSES)
def test_larger_plans_are_worth_what_the_check_says(failure: FailureProcess) -> None:
    made = paper_instance("B", pois=16, vehicles=3, availability=0.9, seed=5, directed=True)
    instance = replace(made, failure=failure, vehicles=tuple(
        replace(v, availability=0.9, loss_cost=60.0, mtbf_s=v.mission_limit_s) for v in made.vehicles))
    plan = plan_stochastic(instance)
    assert plan.status == "optimal"
    assert certify(instance, plan).expected == pytest.approx(plan.value, rel=1e-9)
