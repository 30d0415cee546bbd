"""Subset-row cuts in pricing, and routes listed whole, against routes listed by hand."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from sva_bench.generate.instances import random_instance
from sva_bench.mission.instance import Instance
from sva_bench.solver.columns import branch_and_price, column_generation
from sva_bench.solver.columns.enumeration import routes_above
from sva_bench.solver.columns.graph import graph_of
from sva_bench.solver.columns.master import Column
from sva_bench.solver.columns.pricing import price
from sva_bench.solver.columns.subset_row import Counter, SubsetRow, cut_duals_of, separate
from sva_bench.solver.preprocess import scope_of
from sva_bench.solver.two_stage import plan_stochastic
from tests.solver import oracle


def partial_routes(
    instance: Instance, route: tuple[int, ...] = (), fuel: float = 0.0, time: float = 0.0,
) -> Iterator[tuple[int, ...]]:
    """All routes of the first vehicle from base to base."""
    vehicle, route = instance.vehicles[0], route or (instance.base,)
    visited = frozenset(route) & set(instance.pois)
    for j, burnt, later in oracle.moves(instance, vehicle, route[-1], visited, fuel, time):
        if j == instance.base:
            yield (*route, j)
        else:
            yield from partial_routes(instance, (*route, j), burnt if j in instance.pois else 0.0, later)


def small(seed: int) -> Instance:
    """An instance whose first vehicle has not too many routes."""
    for again in range(100):
        instance = oracle.random_instance(seed + 1000 * again)
        if instance.vehicles and instance.vehicles[0].mission_limit_s < np.inf and len(instance.pois) >= 4 \
                and 20 < sum(1 for _ in itertools.islice(partial_routes(instance), 2000)) < 2000:
            return instance
    raise AssertionError("no instance will do")


@pytest.mark.spread(10)
@pytest.mark.parametrize("seed", range(25))
def test_the_best_route_under_cuts_is_the_one_that_listing_finds(seed: int) -> None:
    instance, rng = small(seed), np.random.default_rng(seed)
    n, pois = len(instance.sites), np.array(instance.pois)
    vehicle = instance.vehicles[0]
    graph = graph_of(instance, scope_of(instance, vehicle, np.isin(np.arange(n), pois)))
    reward, dual = np.zeros(n), np.zeros(n)
    reward[pois], dual[pois] = rng.uniform(1, 9, len(pois)), rng.uniform(0, 5, len(pois))
    cuts = []
    for k in range(5):
        chosen = tuple(sorted(int(j) for j in rng.choice(pois, 2 if k == 4 else 3, replace=False)))
        memory = frozenset(chosen) | {int(j) for j in np.flatnonzero(rng.random(n) < 0.5)}
        cuts.append(SubsetRow(pois=chosen, vehicle_class=0 if k == 4 else None, memory=memory))
    duals = rng.uniform(0, 6, len(cuts))
    # Detours just to forget a visit aren't examined: neither over a station that is of no use ...
    routes = [route for route in partial_routes(instance) if len(route) > 2
              and all(graph.legs[i, j] for i, j in itertools.pairwise(route))]
    if graph.metric:  # ... nor over a POI that costs more than it earns.
        routes = [route for route in routes if all(reward[j] > dual[j] for j in route if j in instance.pois)]
    counter, everything = Counter(cuts, n), np.full((n, 1), np.uint64(0xFFFFFFFFFFFFFFFF))
    worth = {route: sum(reward[j] - dual[j] for j in route) - duals @ counter.of(0, route) for route in routes}
    found = price(graph, reward, dual, 0.0, everything, threshold=0.0, compared=None, most_routes=5, most_labels=10**6,
                  cut_duals=cut_duals_of(cuts, duals, 0, n))
    assert found.complete
    assert found.best == pytest.approx(max([0.0, *worth.values()]), abs=1e-9)
    if found.routes:
        assert worth[found.routes[0]] == pytest.approx(found.best, abs=1e-9)
    # Quick runs, which compare few POIs, find routes that there are, worth what is said, and prove nothing.
    for compared in (0, *column_generation.LEVELS):
        quick = price(graph, reward, dual, 0.0, everything, threshold=0.0, compared=compared, most_routes=5,
                      most_labels=10**6, cut_duals=cut_duals_of(cuts, duals, 0, n))
        assert not quick.complete
        for route in quick.routes:
            assert 0.0 < worth[route] <= found.best + 1e-9
        if quick.routes:
            assert worth[quick.routes[0]] == pytest.approx(quick.best, abs=1e-9)


@pytest.mark.spread(10)
@pytest.mark.parametrize("seed", range(25))
def test_enumeration_finds_every_set_of_pois_above_the_threshold(seed: int) -> None:
    instance, rng = small(seed), np.random.default_rng(seed)
    n, pois = len(instance.sites), np.array(instance.pois)
    graph = graph_of(instance, scope_of(instance, instance.vehicles[0], np.isin(np.arange(n), pois)))
    reward, dual = np.zeros(n), np.zeros(n)
    reward[pois], dual[pois] = rng.uniform(1, 9, len(pois)), rng.uniform(0, 9, len(pois))
    cut_duals = cut_duals_of((), np.zeros(0), 0, n)
    worth = {frozenset(route) & set(pois.tolist()): sum(reward[j] - dual[j] for j in route)
             for route in partial_routes(instance)}
    best = max([0.0, *worth.values()])
    for loss in (1.0, 6.0, 100.0):
        found = routes_above(graph, reward, dual, 0.0, cut_duals, best=best, loss=loss)
        assert found is not None
        sets = [frozenset(route) & set(pois.tolist()) for route in found]
        assert len(sets) == len(set(sets))
        assert set(sets) == {visited for visited, value in worth.items() if visited and value > best - loss + 1e-9}


def test_a_cut_counts_a_route_that_takes_two_of_its_rows() -> None:
    cut = SubsetRow(pois=(1, 2, 3), vehicle_class=None, memory=frozenset({1, 2, 3}))
    of_vehicle = SubsetRow(pois=(1, 2), vehicle_class=7, memory=frozenset({1, 2}))
    counter = Counter((cut, of_vehicle), 6)
    # 1, 2: two of three POIs; for vehicle 7 the first of them is a second row.
    assert counter.of(0, (0, 1, 2, 0)).tolist() == [1, 1]
    assert counter.of(7, (0, 1, 2, 0)).tolist() == [1, 1]
    assert counter.of(7, (0, 1, 4, 0)).tolist() == [0, 1]
    assert counter.of(0, (0, 1, 4, 2, 0)).tolist() == [0, 0]  # forgotten at 4


def test_halves_of_three_routes_over_pairs_of_three_pois_are_cut_off() -> None:
    # Routes {1, 2}, {2, 3} and {1, 3}, half of each: 1.5 of them take two of the POIs, and only one may.
    routes = ((0, 1, 2, 0), (0, 2, 3, 0), (0, 1, 3, 0))
    used = [(0, Column(vehicle_class=0, route=route, visits=np.isin(np.arange(4), route[1:-1]).astype(float), value=1.0,
                       floors=np.zeros(0)), 0.5) for route in routes]
    (cut,) = separate(used, (), (), (1, 2, 3))
    assert cut.pois == (1, 2, 3)
    assert separate(used, (cut,), (), (1, 2, 3)) == (cut,)


@pytest.mark.parametrize("seed", range(3))
def test_cuts_and_enumeration_leave_the_plan_as_it_is(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    instance = random_instance("C", pois=22, vehicles=5, availability=0.75, seed=seed)
    # Shorter routes: where each takes two or three POIs relaxations are most fractional.
    limit = 0.75 * instance.vehicles[0].mission_limit_s
    instance = replace(instance, vehicles=tuple(replace(v, mission_limit_s=limit) for v in instance.vehicles))
    values, rounds = [], []
    for cutting, listed in ((99, -1.0), (0, -1.0), (99, 1.0), (0, 1.0)):
        monkeypatch.setattr(branch_and_price, "CUTTING", cutting)
        monkeypatch.setattr(column_generation, "ENUMERATED", listed)
        plan = plan_stochastic(instance)
        assert plan.status == "optimal"
        values.append(plan.value)
        rounds.append(plan.details["nodes"])
    assert values == pytest.approx([values[0]] * 4, rel=1e-9)
