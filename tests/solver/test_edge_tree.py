"""The tree of the edge model: what it prunes holds no better plan, and it ends at the optimum that others prove."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import networkx
import numpy as np
import pytest

from sva_bench.generate.instances import random_instance
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.solver.edges import branching, tree
from sva_bench.solver.edges.box import Box
from sva_bench.solver.edges.max_flow import minimum_cuts
from sva_bench.solver.edges.program import EdgeProgram, Solved
from sva_bench.solver.edges.separation import violated_cuts
from sva_bench.solver.edges.tree import prove_by_tree
from sva_bench.solver.flow.branch_and_cut import prove_by_cuts
from sva_bench.solver.flow.undirected import UndirectedModel, serves
from sva_bench.solver.goal import Goal
from sva_bench.solver.highs import Simplex
from sva_bench.solver.knowledge import Cut, Progress, SolveLimits, grain_of, knowledge_of, trivial_bound, value_of
from sva_bench.solver.preprocess import scope_of
from sva_bench.solver.problem import Problem
from sva_bench.solver.routes.heuristic import VisitOrders
from sva_bench.solver.ties import FLOOR, availability_of, expected_of, incentives_of, sum_of
from sva_bench.solver.two_stage import plan_deterministic, plan_stochastic
from sva_bench.solver.units import ROUNDING, factor_of, in_own_units, most_of_a_visit
from tests.solver import oracle


def small(seed: int, most: int = 14, vehicles: int | None = None) -> Instance:
    """One to four vehicles, limits from short to loose and apart, ties, POIs of no use, stops that take time."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 5)) if vehicles is None else vehicles
    made = random_instance("A" if rng.random() < 0.7 else "C", pois=int(rng.integers(3, most + 1)), vehicles=count,
                           availability=0.75, seed=seed)
    share, own = float(rng.choice([0.35, 0.5, 0.7, 1.0, 1.3])), []
    stop = made.stop_s.copy()
    if rng.random() < 0.3:
        stop[list(made.pois)] = rng.choice([0.0, 2.0, 7.0])
    for vehicle in made.vehicles:
        incentives = vehicle.incentives
        if rng.random() < 0.5:
            incentives = np.where(incentives > 0, np.maximum(np.rint(incentives / 20), 1) * 10, 0.0)
        if rng.random() < 0.2:
            incentives = incentives * (rng.random(len(incentives)) < 0.7)
        limit = vehicle.mission_limit_s * share * float(rng.choice([1.0, 0.8]))
        own.append(replace(vehicle, incentives=incentives, mission_limit_s=limit, fuel_capacity_s=10 * limit))
    return in_own_units(replace(made, vehicles=tuple(own), stop_s=stop))[0]


def problem_of(instance: Instance, goal: Goal, start: VisitOrders | None = None) -> Problem:
    """A goal, and a plan to start from; by default all stay at the base."""
    start = start or tuple(() for _ in instance.vehicles)
    known, rewarded = knowledge_of(instance), goal.rewarded()
    scopes = tuple(scope_of(instance, v, rewarded[m]) for m, v in enumerate(instance.vehicles))
    assert serves(instance, scopes)
    goal = goal.within(np.array([scope.legs.any(axis=0) for scope in scopes]).reshape(goal.weights.shape))
    goal = goal.times(factor_of(goal))
    progress = Progress(orders=start, value=value_of(goal, known.legs_by_vehicle, start), bound=trivial_bound(goal),
                        grain=grain_of(goal), rounding=ROUNDING * most_of_a_visit(goal))
    return Problem(instance=instance, scopes=scopes, goal=goal, known=known, clock=SolveLimits().clock(), gap=1e-6,
                   progress=progress)


def by_highs(problem: Problem) -> None:
    prove_by_cuts(UndirectedModel(problem.instance, problem.scopes, problem.goal), problem)


def proved(prove: Callable[[Problem], None], instance: Instance, goal: Goal, start: VisitOrders | None) -> Progress:
    problem = problem_of(instance, goal, start)
    if not problem.progress.closed(problem.gap):
        prove(problem)
    assert problem.progress.closed(problem.gap)
    return problem.progress


def searched(instance: Instance, goal: Goal, start: VisitOrders | None, optimum: Progress) -> Progress:
    """The tree's result. No pruning on the way there may lose a known optimum while the incumbent is worse."""
    problem = problem_of(instance, goal, start)
    point = UndirectedModel(instance, problem.scopes, problem.goal).point(optimum.orders)
    assert point is not None
    seen: list[Box] = []

    def inspect(box: Box, left: Box | None) -> None:
        seen.append(box)
        if problem.progress.value + problem.progress.slack(problem.gap) < optimum.value and box.holds(point):
            assert left is not None, f"a node with the optimum was pruned, at {problem.progress.value}"
            assert left.holds(point), "a column of the optimum was fixed at another value"

    if not problem.progress.closed(problem.gap):
        prove_by_tree(problem, inspect=inspect)
        assert seen
    assert problem.progress.closed(problem.gap)
    return problem.progress


def check_all_goals(instance: Instance, driving: float) -> int:
    """Compare the tree with HiGHS's branch and bound on the goals of a comparison; the nodes that it took."""
    incentives, availability = incentives_of(instance), availability_of(instance)
    nodes = 0

    def both(goal: Goal, start: VisitOrders | None = None) -> VisitOrders:
        nonlocal nodes
        by_mip = proved(by_highs, instance, goal, start)
        found = searched(instance, goal, start, by_mip)
        assert found.value == pytest.approx(by_mip.value, rel=2e-6, abs=1e-6)
        if not goal.floors and any(by_mip.orders):  # from a plan that is nearly as good, more is pruned
            near = min((orders for orders in _without_one(by_mip.orders)), key=lambda orders: -value_of(
                goal, knowledge_of(instance).legs_by_vehicle, orders))
            assert searched(instance, goal, near, by_mip).value == pytest.approx(by_mip.value, rel=2e-6, abs=1e-6)
        nodes += found.nodes
        return found.orders

    both(Goal(weights=incentives * availability[:, None]))
    both(Goal(weights=incentives, driving=driving))
    nominal = both(Goal(weights=incentives))
    best = sum_of(incentives, nominal)
    floors = [(incentives, best - FLOOR * best)]
    spread = incentives * (availability - availability.min())[:, None]
    if spread.any():
        most = both(Goal(weights=spread, floors=tuple(floors)), nominal)
        both(Goal(weights=-spread, floors=tuple(floors)), nominal)
        floors.append((spread, sum_of(spread, most) * (1 - FLOOR)))
        nominal = most
    both(Goal(weights=np.zeros_like(incentives), floors=tuple(floors), driving=1.0), nominal)
    return nodes


def _without_one(orders: VisitOrders) -> Iterator[VisitOrders]:
    for m, order in enumerate(orders):
        for poi in order:
            yield (*orders[:m], tuple(j for j in order if j != poi), *orders[m + 1:])


@pytest.mark.spread(8)
@pytest.mark.parametrize("seed", range(24))
def test_no_pruned_node_holds_the_optimum_and_the_tree_finds_it(seed: int) -> None:
    check_all_goals(small(seed, most=10), driving=(0.05, 0.3, 1.0)[seed % 3])


@pytest.mark.long
@pytest.mark.parametrize("seed", range(100, 400))
def test_no_pruned_node_holds_the_optimum_of_many_instances(seed: int) -> None:
    check_all_goals(small(seed, most=20), driving=(0.05, 0.3, 1.0)[seed % 3])


def long_routes(pois: int = 25, vehicles: int = 2, seed: int = 0) -> tuple[Instance, Goal]:
    """An instance whose tree has some nodes, and its stochastic goal."""
    instance = in_own_units(random_instance("A", pois=pois, vehicles=vehicles, availability=0.75, seed=seed))[0]
    return instance, Goal(weights=incentives_of(instance) * availability_of(instance)[:, None])


@pytest.mark.long
@pytest.mark.parametrize("iterations", [1, 3])
def test_a_probe_that_is_stopped_early_proves_nothing(iterations: int, monkeypatch: pytest.MonkeyPatch) -> None:
    instance, goal = long_routes()
    by_mip = proved(by_highs, instance, goal, None)
    monkeypatch.setattr(branching, "_ITERATIONS", iterations)
    assert searched(instance, goal, None, by_mip).value == pytest.approx(by_mip.value, rel=2e-6)


@pytest.mark.spread(1)
@pytest.mark.parametrize("seed", range(3))
def test_purges_at_every_node_leave_the_optimum(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # Bases of nodes are then of other programs than the one at hand.
    instance, goal = long_routes(20, seed=seed)
    by_mip = proved(by_highs, instance, goal, None)
    monkeypatch.setattr(tree, "_SPARE_CUTS", 0.02)
    assert searched(instance, goal, None, by_mip).value == pytest.approx(by_mip.value, rel=2e-6)


@pytest.mark.parametrize("lie", ["infeasible", "cutoff"])
@pytest.mark.parametrize("often", [1, 3])
def test_what_highs_says_without_proof_prunes_nothing(
    lie: str, often: int, monkeypatch: pytest.MonkeyPatch,
) -> None:
    # HiGHS claims now and then that a program is infeasible, or at its bound, when it is not.
    instance, goal = long_routes(12)
    by_mip = proved(by_highs, instance, goal, None)
    real, calls = Simplex.solve, [0]

    def lying(self: Simplex, time_limit_s: float, *, cutoff: float = -math.inf, iterations: int | None = None) -> str:
        ended = real(self, time_limit_s, cutoff=cutoff, iterations=iterations)
        calls[0] += math.isfinite(cutoff)
        return lie if ended == "optimal" and math.isfinite(cutoff) and calls[0] % often == 0 else ended

    monkeypatch.setattr(Simplex, "solve", lying)
    assert searched(instance, goal, None, by_mip).value == pytest.approx(by_mip.value, rel=2e-6)


def test_where_highs_never_gets_clear_every_point_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    # To the right and back takes 8, to the left and back 10: the limit lets one of them, or the near one alone.
    instance = line(4.0, -5.0, limit=10.0)
    goal = Goal(weights=incentives_of(instance) * np.array([0.0, 1.0, 2.0]))
    by_mip = proved(by_highs, instance, goal, None)
    nothing = np.zeros(0)
    monkeypatch.setattr(tree.Tree, "_solve", lambda self, box: Solved(  # noqa: ARG005
        status="unclear", bound=np.inf, values=nothing, reduced=nothing))
    assert searched(instance, goal, None, by_mip).value == by_mip.value > 0


@pytest.mark.spread(10)
@pytest.mark.parametrize("seed", range(40))
def test_the_tree_ends_at_the_optimum_of_brute_force(seed: int) -> None:
    instance = small(seed, most=6, vehicles=2)
    truth, stochastic = oracle.truth(instance), plan_stochastic(instance, method="undirected")
    assert stochastic.value == pytest.approx(truth.stochastic, rel=1e-6, abs=1e-9)
    plans = plan_deterministic(instance, stochastic, method="undirected")
    assert plans.plan.value == pytest.approx(truth.nominal, rel=1e-6, abs=1e-9)
    assert (plans.most, plans.least) == pytest.approx((truth.most, truth.least), rel=1e-6, abs=1e-9)


def line(*places: float, limit: float, vehicles: int = 1) -> Instance:
    """A base at 0 and POIs on a line, worth 10 each."""
    at = np.array([0.0, *places])
    cost = np.abs(at[:, None] - at[None])
    robot = Vehicle(name="v0", fuel_capacity_s=1e3, mission_limit_s=limit, incentives=np.array([0.0] + [10.0] * len(
        places)), fuel_s=cost, availability=0.5)
    return Instance(name="line", sites=("base", *(f"p{k}" for k in range(len(places)))), base=0, stations=(),
                    stop_s=np.zeros(len(at)), vehicles=tuple(replace(robot, name=f"v{m}") for m in range(vehicles)))


def test_a_route_may_have_one_poi_and_a_vehicle_may_stay_at_home() -> None:
    # To the right and back takes 8, to the left and back 10, both 18; a third vehicle has nothing to do.
    instance = line(4.0, -5.0, limit=10.0, vehicles=3)
    goal = Goal(weights=incentives_of(instance))
    found = searched(instance, goal, None, proved(by_highs, instance, goal, None))
    assert sorted(found.orders) == [(), (1,), (2,)]
    assert expected_of(instance, found.orders) == 10.0


def test_cuts_enclose_what_the_base_is_not_connected_with() -> None:
    # Triangles 0 1 2 and 3 4 5 with the base in the first: sites 3 to 5 demand 2 and get nothing.
    ends = np.array([[0, 1], [1, 2], [0, 2], [3, 4], [4, 5], [3, 5]])
    sets, across = minimum_cuts(6, ends, np.ones(6), 0, np.array([0.0, 2.0, 2.0, 2.0, 2.0, 2.0]))
    assert {tuple(np.flatnonzero(inside).tolist()) for inside in sets} == {(3, 4, 5)}
    assert across.tolist() == [0.0] * len(sets)


@pytest.mark.parametrize("seed", range(30))
def test_every_poi_whose_maximum_flow_falls_short_is_in_a_cut(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 12))
    graph = networkx.gnp_random_graph(n, 0.5, seed=seed)
    for _, _, edge in graph.edges(data=True):
        edge["capacity"] = float(rng.choice([0.25, 0.5, 0.75, 1.0]))
    demand = rng.uniform(0, 2, n)
    ends = np.array(graph.edges, dtype=np.int64).reshape(-1, 2)
    capacity = np.array([edge["capacity"] for _, _, edge in graph.edges(data=True)], dtype=np.float64)
    sets, across = minimum_cuts(n, ends, capacity, 0, demand)
    short = {j for j in range(1, n) if networkx.maximum_flow_value(graph, 0, j) < demand[j] - 1e-9}
    for inside, flow in zip(sets, across, strict=True):
        assert not inside[0]
        assert flow == pytest.approx(capacity[inside[ends[:, 0]] != inside[ends[:, 1]]].sum())
        assert any(inside[j] and demand[j] > flow for j in short)
    assert short == {j for inside, flow in zip(sets, across, strict=True) for j in short
                     if inside[j] and flow < demand[j]}


@pytest.mark.parametrize("vehicles", [1, 3])
def test_the_bound_from_the_duals_is_the_optimum_and_the_reduced_costs_are_those_of_highs(vehicles: int) -> None:
    # However a cut is written: over the edges within its set, across its border or outside.
    instance, goal = long_routes(12, vehicles)
    problem = problem_of(instance, goal)
    flow = UndirectedModel(instance, problem.scopes, problem.goal, linked=False)
    pois = flow.visit[0][flow.visit[0] >= 0]
    cuts = [Cut(vehicle=m, inside=tuple(range(first, last)), poi=first) for m in range(vehicles)
            for first in range(len(instance.sites) - 2) for last in (first + 2, len(instance.sites))
            if first in instance.pois and flow.visit[m, first] >= 0 and instance.base not in range(first, last)]
    assert len(pois)
    program = EdgeProgram(flow, flow.model.objective, np.arange(len(flow.model.objective)), cuts)
    solved = program.solve(math.inf)
    assert solved.status == "optimal"
    assert solved.bound == pytest.approx(float(solved.values @ flow.model.objective), rel=1e-9)
    half = EdgeProgram(flow, flow.model.objective, np.flatnonzero(
        (flow.ends[:, 0] < 0) | (np.arange(len(flow.model.objective)) % 2 == 0)), cuts)
    assert half.solve(math.inf).bound >= solved.bound - 1e-6  # it bounds the columns that are left out too
    half.add_columns(np.setdiff1d(np.arange(len(flow.model.objective)), half.columns))
    assert half.solve(math.inf).bound == pytest.approx(solved.bound, rel=1e-9)
    for cut in cuts:
        inside = np.array(cut.inside)
        outside = np.setdiff1d(np.arange(len(instance.sites)), inside)
        across = flow.edge[cut.vehicle][np.ix_(inside, outside)]
        driven = solved.values[across[across >= 0]].sum()
        assert driven >= 2 * solved.values[flow.visit[cut.vehicle, cut.poi]] - 1e-6


def test_every_cut_that_is_found_is_violated() -> None:
    instance, goal = long_routes(20)
    problem = problem_of(instance, goal)
    flow = UndirectedModel(instance, problem.scopes, problem.goal, linked=False)
    solved = EdgeProgram(flow, flow.model.objective, np.arange(len(flow.model.objective)), ()).solve(math.inf)
    cuts = violated_cuts(flow, solved.values, tolerance=0.01)
    assert cuts
    for cut in cuts:
        inside = np.array(cut.inside)
        across = flow.edge[cut.vehicle][np.ix_(inside, np.setdiff1d(np.arange(len(instance.sites)), inside))]
        assert cut.poi in inside
        assert solved.values[across[across >= 0]].sum() / 2 < solved.values[flow.visit[cut.vehicle, cut.poi]] - 0.01


def test_reduced_costs_fix_what_no_better_plan_has() -> None:
    # All are worth 10 at most, and more than 5 are wanted: 4.9 may be lost, 5.1 may not, and of 2.6 a step one step.
    box = Box(lower=np.zeros(4, np.int8), upper=np.array([1, 1, 2, 2], np.int8))
    left = box.above(5.0, 10.0, np.array([-4.9, -5.1, -2.6, 2.6]))
    assert (left.lower.tolist(), left.upper.tolist()) == ([0, 0, 0, 1], [1, 0, 1, 2])


def test_the_heuristic_is_asked_near_relaxations_and_its_plan_is_taken() -> None:
    instance, goal = long_routes(20)
    best = proved(by_highs, instance, goal, None)
    asked: list[np.ndarray] = []

    def guide(allowed: np.ndarray) -> VisitOrders:
        asked.append(allowed)
        return best.orders

    problem = problem_of(instance, goal)
    prove_by_tree(problem, guide)
    assert problem.progress.value == pytest.approx(best.value, rel=1e-9)
    assert asked
    assert all(allowed.shape == goal.weights.shape and 0 < allowed.sum() < allowed.size for allowed in asked)


def test_a_plan_of_the_heuristic_that_no_vehicle_can_drive_is_not_believed() -> None:
    instance, goal = long_routes(20)
    best = proved(by_highs, instance, goal, None)
    problem = problem_of(instance, goal)
    prove_by_tree(problem, lambda allowed: (instance.pois, *[()] * (len(allowed) - 1)))
    assert problem.progress.value == pytest.approx(best.value, rel=1e-9)


def test_the_time_limit_of_a_solve_is_not_used_up_by_those_before_it() -> None:
    instance, goal = long_routes(60)
    problem = problem_of(instance, goal)
    model = UndirectedModel(instance, problem.scopes, problem.goal, linked=False).model
    simplex, spent = Simplex(model), time.monotonic()
    while time.monotonic() < spent + 2.0:  # each takes some hundredths of a second
        simplex.forget()
        assert simplex.solve(1.0) == "optimal"


def test_a_time_limit_keeps_the_plan_and_a_bound() -> None:
    instance = random_instance("A", pois=60, vehicles=4, availability=0.75, seed=1)
    for _ in range(2):  # the first may spend its time on compilation
        plan = plan_stochastic(instance, SolveLimits(time_limit_s=2.0), method="undirected")
    assert plan.status == "time_limit"
    assert plan.value is not None
    assert plan.bound is not None
    assert plan.value < plan.bound < 1.2 * plan.value
