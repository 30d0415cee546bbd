"""The search over long routes, where fuel can't bind: plans keep all rules, and the same seed gives the same plan."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sva_bench.arrays import FloatArray
from sva_bench.generate.instances import random_instance as paper_instance
from sva_bench.mission.certify import certify
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.mission.plan import Plan
from sva_bench.solver.preprocess import has_no_shortcuts, shortest_paths
from sva_bench.solver.routes import long_routes
from sva_bench.solver.routes.annealing import anneal
from sva_bench.solver.routes.fronts import leg_tables
from sva_bench.solver.routes.heuristic import search
from sva_bench.solver.routes.long_routes import guided, search_long, serves, tours_of
from sva_bench.solver.routes.plans import VisitOrders
from sva_bench.solver.routes.tours import improve_tour, tour_time
from tests.solver.oracle import random_instance, truth

seeds = st.integers(0, 10**6)


def unfuelled(seed: int) -> Instance:
    """A tiny instance with endless tanks: one-way legs, stops, several limits, a base that stands anywhere."""
    instance = random_instance(seed)
    return replace(instance, vehicles=tuple(replace(v, fuel_capacity_s=math.inf) for v in instance.vehicles))


def weights_of(instance: Instance) -> FloatArray:
    return np.array([v.incentives * v.availability for v in instance.vehicles])


def none(instance: Instance) -> VisitOrders:
    return tuple(() for _ in instance.vehicles)


def worth(weights: FloatArray, orders: VisitOrders) -> float:
    return math.fsum(weights[m, j] for m, order in enumerate(orders) for j in order)


def found(instance: Instance, seed: int = 0, starts: int = 2) -> VisitOrders:
    return search_long(leg_tables(instance), weights_of(instance), none(instance), seed=seed, starts=starts)[0]


def assert_keeps_all_rules(instance: Instance, orders: VisitOrders) -> None:
    base = instance.sites[instance.base]
    routes = {v.name: (base, *(instance.sites[j] for j in order), base) if order else ()
              for v, order in zip(instance.vehicles, orders, strict=True)}
    certificate = certify(instance, Plan(routes=routes))
    assert certificate.reasons == ()
    assert certificate.expected == pytest.approx(worth(weights_of(instance), orders))


@settings(max_examples=60, derandomize=True, deadline=None)
@given(seeds)
def test_every_plan_keeps_all_rules_and_none_beats_the_optimum(seed: int) -> None:
    instance = unfuelled(seed)
    orders = found(instance)
    assert_keeps_all_rules(instance, orders)
    assert worth(weights_of(instance), orders) <= truth(instance).stochastic + 1e-9


def test_on_tiny_instances_without_shortcuts_it_finds_the_optimum() -> None:
    # With them a stop that earns nothing may pay, which the search never makes.
    plain = [instance for instance in map(unfuelled, range(90))
             if all(has_no_shortcuts(v, instance.base) for v in instance.vehicles)]
    assert len(plain) > 30
    for instance in plain:
        assert worth(weights_of(instance), found(instance)) == pytest.approx(truth(instance).stochastic), instance.name


@settings(max_examples=15, derandomize=True, deadline=None)
@given(seeds, st.integers(0, 3))
def test_the_same_seed_gives_the_same_plan(seed: int, search_seed: int) -> None:
    instance = unfuelled(seed)
    assert found(instance, search_seed) == found(instance, search_seed)


@pytest.mark.parametrize("directed", [False, True])
def test_large_plans_keep_all_rules_and_are_the_same_again(directed: bool) -> None:
    instance = paper_instance("A", pois=40, vehicles=4, availability=0.75, seed=3, directed=directed)
    orders = search(leg_tables(instance), weights_of(instance), None, none(instance), starts=1).orders
    assert_keeps_all_rules(instance, orders)
    assert orders == search(leg_tables(instance), weights_of(instance), None, none(instance), starts=1).orders


@settings(max_examples=30, derandomize=True, deadline=None)
@given(seeds, st.floats(0.0, 1.0))
def test_only_allowed_pairs_are_visited(seed: int, share: float) -> None:
    instance = unfuelled(seed)
    weights = weights_of(instance)
    allowed = np.random.default_rng(seed).random(weights.shape) < share
    orders = guided(leg_tables(instance), weights, none(instance), allowed, seed=0, onward=False, rounds=300)
    assert all(allowed[m, j] for m, order in enumerate(orders) for j in order)
    assert_keeps_all_rules(instance, orders)


@settings(max_examples=30, derandomize=True, deadline=None)
@given(seeds)
def test_a_guided_search_is_never_worse_than_its_start(seed: int) -> None:
    instance = unfuelled(seed)
    weights, start = weights_of(instance), found(instance, starts=1)
    orders = guided(leg_tables(instance), weights, start, np.zeros(weights.shape, dtype=np.bool_), seed=0, rounds=300)
    assert_keeps_all_rules(instance, orders)
    assert worth(weights, orders) >= worth(weights, start)


def test_pairs_of_the_optimum_lead_to_it() -> None:
    # All pairs but those of a good plan are barred at first: that plan, or a better one, is found again.
    instance = paper_instance("A", pois=30, vehicles=4, availability=0.75, seed=1)
    weights, tables = weights_of(instance), leg_tables(instance)
    good = search_long(tables, weights, none(instance), seed=0, starts=3)[0]
    allowed = np.zeros(weights.shape, dtype=np.bool_)
    for m, order in enumerate(good):
        allowed[m, list(order)] = True
    again = guided(tables, weights, none(instance), allowed, seed=7, onward=False)
    assert worth(weights, again) == pytest.approx(worth(weights, good))


def test_every_better_plan_is_offered_and_a_stop_ends_the_search() -> None:
    instance = paper_instance("A", pois=40, vehicles=2, availability=0.75, seed=0)
    weights, offers = weights_of(instance), list[float]()

    def offer(orders: VisitOrders) -> None:
        assert_keeps_all_rules(instance, orders)
        offers.append(worth(weights, orders))

    orders, routes = search_long(leg_tables(instance), weights, none(instance), seed=0, starts=2, offer=offer)
    assert offers == sorted(set(offers))
    assert offers[-1] == worth(weights, orders)
    assert routes
    offers.clear()
    search_long(leg_tables(instance), weights, none(instance), seed=0, starts=5, stop=lambda _: True, offer=offer)
    assert len(offers) == 1


@settings(max_examples=60, derandomize=True, deadline=None)
@given(seeds, st.integers(0, 12), st.booleans())
def test_local_search_keeps_the_visits_and_never_lengthens_a_route(seed: int, length: int, symmetric: bool) -> None:
    rng = np.random.default_rng(seed)
    time = rng.uniform(1, 9, size=(13, 13))
    if symmetric:
        time = time + time.T
    order = rng.permutation(12)[:length] + 1
    better, unknown = order.copy(), np.full(13, -1)
    improve_tour(better, length, time, time.T.copy(), symmetric, unknown, unknown, np.zeros(14, np.bool_),
                 np.zeros(14, np.int64), np.zeros(13, np.int64))
    assert sorted(better) == sorted(order)
    assert tour_time(better, length, time) <= tour_time(order, length, time) + 1e-9


def test_local_search_uncrosses_a_route() -> None:
    # Corners of a square with side 1, the base at one of them: 1 + 1.41 + 1 + 1.41 becomes 4.
    at = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    time = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    order, unknown = np.array([1, 3, 2]), np.full(4, -1)
    assert improve_tour(order, 3, time, time.T.copy(), True, unknown, unknown, np.zeros(5, np.bool_),
                        np.zeros(5, np.int64), np.zeros(4, np.int64))
    assert tour_time(order, 3, time) == pytest.approx(4.0)


def test_stops_count_half_before_and_half_after_a_poi_and_times_stay_symmetric() -> None:
    # base -3- p1 -4- p2 -5- base, with stops of 2 s and 6 s: 20 s in all.
    legs = np.array([[0, 3, 5], [3, 0, 4], [5, 4, 0]], dtype=float)
    robot = Vehicle(name="a", fuel_capacity_s=math.inf, mission_limit_s=20.0, availability=1.0,
                    incentives=np.array([0, 1, 1.0]), fuel_s=legs)
    instance = Instance(name="stops", sites=("base", "p1", "p2"), base=0, stations=(), stop_s=np.array([0, 2.0, 6.0]),
                        vehicles=(robot,))
    tours = tours_of(leg_tables(instance), weights_of(instance))
    assert tours.symmetric
    assert tour_time(np.array([1, 2]), 2, tours.time_s[0]) == pytest.approx(20.0)
    assert set(found(instance)[0]) == {1, 2}
    shorter = replace(instance, vehicles=(replace(robot, mission_limit_s=19.9),))
    assert len(found(shorter)[0]) == 1


def test_idle_vehicles_and_empty_instances_stay_at_the_base() -> None:
    instance = paper_instance("A", pois=12, vehicles=3, availability=0.0, seed=0)  # the second earns nothing
    orders = found(instance)
    assert_keeps_all_rules(instance, orders)
    assert orders[1] == ()
    nobody = replace(instance, vehicles=tuple(replace(v, availability=0.0) for v in instance.vehicles))
    assert found(nobody) == ((), (), ())


def test_it_refuses_fuel_that_can_bind_and_pairs_of_another_shape() -> None:
    tight = paper_instance("B", pois=8, vehicles=2, availability=0.75, seed=0)
    assert not serves(leg_tables(tight))
    with pytest.raises(ValueError, match="tanks that last"):
        found(tight)
    loose = paper_instance("A", pois=8, vehicles=2, availability=0.75, seed=0)
    weights = weights_of(loose)
    with pytest.raises(ValueError, match="shape of the weights"):
        guided(leg_tables(loose), weights, none(loose), np.ones((2, 3), dtype=np.bool_), seed=0)
    weights[0, -1] = math.nan
    with pytest.raises(ValueError, match="NaN"):
        search_long(leg_tables(loose), weights, none(loose), seed=0, starts=1)


def test_a_missing_leg_is_never_driven() -> None:
    rng = np.random.default_rng(5)
    legs = rng.uniform(5, 20, size=(25, 25))
    legs = shortest_paths(legs + legs.T, -1)
    legs[rng.random(legs.shape) < 0.3] = math.inf
    np.fill_diagonal(legs, 0.0)
    robots = tuple(Vehicle(name=name, fuel_capacity_s=math.inf, mission_limit_s=150.0, availability=1.0,
                           incentives=np.concatenate([[0.0], rng.uniform(1, 9, 24)]), fuel_s=legs) for name in "ab")
    instance = Instance(name="one-way", sites=("base", *(f"p{k}" for k in range(24))), base=0, stations=(),
                        stop_s=np.zeros(25), vehicles=robots)
    orders = found(instance)
    assert any(orders)
    assert_keeps_all_rules(instance, orders)


def test_few_sites_take_few_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    ends = []

    def noted(rng: np.random.Generator, begin: int, end: int, *rest: object) -> int:
        ends.append(end)
        return int(anneal(rng, begin, end, *rest))

    monkeypatch.setattr(long_routes, "anneal", noted)
    found(paper_instance("A", pois=11, vehicles=2, availability=0.75, seed=0), starts=1)
    assert max(ends) == 1 + long_routes.ROUNDS * 12 // 60


@pytest.mark.long
def test_crossing_the_plans_of_the_starts_never_loses_value_and_pays_on_most_large_instances(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    better = 0
    for seed in range(4):
        instance = paper_instance("A", pois=60, vehicles=2, availability=0.75, seed=seed)
        weights = weights_of(instance)
        crossed = worth(weights, found(instance, starts=3))
        with monkeypatch.context() as patch:
            patch.setattr(long_routes, "CROSSINGS", 0)
            alone = worth(weights, found(instance, starts=3))
        assert crossed >= alone - 1e-9  # the starts are the same
        better += crossed > alone + 1e-9
    assert better >= 2


def test_crossing_begins_over_pairs_of_the_best_plans_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    instance = paper_instance("A", pois=40, vehicles=2, availability=0.75, seed=0)
    weights, masks, real = weights_of(instance), list[np.ndarray](), long_routes._Run.anneal

    def noted(self: long_routes._Run, rng: np.random.Generator, start: VisitOrders, rounds: int, heat: float,
              allowed: np.ndarray) -> VisitOrders:
        masks.append(allowed)
        return real(self, rng, start, rounds, heat, allowed)

    monkeypatch.setattr(long_routes._Run, "anneal", noted)
    found(instance, starts=4)
    every = int((weights > 0).sum())
    pairs = [int(mask.sum()) for mask in masks]
    assert pairs[:4] == [every] * 4
    assert len(pairs) == 4 + 2 * 4 * long_routes.CROSSINGS
    assert all(0 < near < every for near in pairs[4::2])
    assert pairs[5::2] == [every] * (4 * long_routes.CROSSINGS)
