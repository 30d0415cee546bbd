from __future__ import annotations

import itertools
from pathlib import Path

import networkx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.execution.driving import DriveTask, drive_route
from sva_bench.robot.model import BUILT_IN
from sva_bench.travel.fuel import fuel_costs, repair_metric
from sva_bench.travel.roadmap import plan_paths
from sva_bench.travel.times import TravelTimes, plan_travel_times
from tests.oracles.distances import path_clearance
from tests.oracles.worlds import free_places, random_obstacles
from tests.worlds_for_tests import world_of

TURTLEBOT = BUILT_IN["turtlebot2"]


@st.composite
def time_matrices(draw: st.DrawFn) -> IntArray:
    n = draw(st.integers(1, 7))
    # Small numbers tie often, great ones test the way through doubles.
    most = draw(st.sampled_from([5, 1000, 10**9]))
    times = draw(arrays(np.int64, (n, n), elements=st.integers(1, most)))
    np.fill_diagonal(times, 0)
    return times


def times_of(time_ms: IntArray) -> TravelTimes:
    n = len(time_ms)
    return TravelTimes(sites=tuple(f"s{k}" for k in range(n)), model=TURTLEBOT, time_ms=time_ms,
                       paths=((None,) * n,) * n, headings_rad=(0.0,) * n, clearance_m=0.3)


def test_a_detour_replaces_a_dearer_direct_leg() -> None:
    # a -> b -> c costs 2 + 3 = 5 < 9; c -> b -> a costs 4 + 7 = 11 > 10; b -> a is direct.
    repaired, via = repair_metric(np.array([[0, 2, 9], [7, 0, 3], [10, 4, 0]]))
    assert_array_equal(repaired, [[0, 2, 5], [7, 0, 3], [10, 4, 0]])
    assert_array_equal(via, [[0, 1, 1], [0, 1, 2], [0, 1, 2]])


def test_a_chain_may_run_through_many_sites() -> None:
    # Only steps round the ring a -> b -> c -> d -> a are cheap: 1 each; all others cost 50.
    times = np.full((4, 4), 50)
    np.fill_diagonal(times, 0)
    for k in range(4):
        times[k, (k + 1) % 4] = 1
    costs = fuel_costs(times_of(times), 0.0)
    assert costs.chain("s1", "s0") == ("s1", "s2", "s3", "s0")
    assert_array_equal(costs.repaired_ms, [[0, 1, 2, 3], [3, 0, 1, 2], [2, 3, 0, 1], [1, 2, 3, 0]])


def test_a_tie_leaves_the_direct_leg() -> None:
    # 2 + 3 = 5: no reason to stop on the way.
    repaired, via = repair_metric(np.array([[0, 2, 5], [9, 0, 3], [9, 9, 0]]))
    assert repaired[0, 2] == 5
    assert via[0, 2] == 2


def test_a_single_site_needs_no_repair() -> None:
    repaired, via = repair_metric(np.zeros((1, 1), dtype=np.int64))
    assert_array_equal(repaired, [[0]])
    assert_array_equal(via, [[0]])


@given(time_matrices())
def test_repaired_times_obey_the_triangle_inequality_exactly(times: IntArray) -> None:
    repaired, _ = repair_metric(times)
    assert np.all(repaired[:, None, :] <= repaired[:, :, None] + repaired[None, :, :])


@given(time_matrices())
def test_repair_lowers_what_must_be_lowered_and_nothing_else(times: IntArray) -> None:
    repaired, _ = repair_metric(times)
    assert np.all(repaired <= times)
    again, direct = repair_metric(repaired)
    assert_array_equal(again, repaired)
    assert_array_equal(direct, np.tile(np.arange(len(times)), (len(times), 1)))


@given(time_matrices())
def test_no_greater_matrix_would_do(times: IntArray) -> None:
    # Any matrix below ``times`` that obeys the triangle inequality lies below every chain's sum, and so below the
    # cheapest: which is networkx' all-pairs Dijkstra, an algorithm and a program of its own.
    repaired, _ = repair_metric(times)
    graph = networkx.DiGraph()
    graph.add_nodes_from(range(len(times)))
    graph.add_weighted_edges_from((i, j, int(times[i, j])) for i, j in itertools.permutations(range(len(times)), 2))
    for i, lengths in networkx.all_pairs_dijkstra_path_length(graph):
        for j, length in lengths.items():
            assert repaired[i, j] == length


@given(time_matrices())
def test_a_chain_adds_up_to_its_cost_and_has_no_duplicates(times: IntArray) -> None:
    costs = fuel_costs(times_of(times), 0.0)
    sites = costs.times.sites
    for i, j in itertools.permutations(range(len(times)), 2):
        chain = [sites.index(site) for site in costs.chain(sites[i], sites[j])]
        assert (chain[0], chain[-1]) == (i, j)
        assert len(set(chain)) == len(chain)
        assert sum(times[a, b] for a, b in itertools.pairwise(chain)) == costs.repaired_ms[i, j]
        assert all(costs.repaired_ms[a, b] == times[a, b] for a, b in itertools.pairwise(chain))


@pytest.mark.parametrize("times", [
    np.array([[0, 1, 2], [1, 0, 2]]), np.array([[0, -1], [1, 0]]), np.array([[0, 0], [1, 0]])])
def test_what_is_no_matrix_of_positive_times_is_refused(times: IntArray) -> None:
    with pytest.raises(ValueError, match="square matrix of positive times"):
        repair_metric(times)


def test_the_share_of_changed_pairs_and_the_greatest_excess_by_hand() -> None:
    # Of six pairs one changes: 9 becomes 5, an excess of 4 / 5 = 80 %.
    costs = fuel_costs(times_of(np.array([[0, 2, 9], [7, 0, 3], [10, 4, 0]])), 0.02)
    assert costs.pairs == 6
    assert costs.changed_pct == pytest.approx(100 / 6)
    assert costs.max_excess_pct == pytest.approx(80)
    assert costs.cost_s[0, 2] == pytest.approx(0.0051)  # 5 ms x 1.02
    alone = fuel_costs(times_of(np.zeros((1, 1), dtype=np.int64)), 0.0)
    assert (alone.pairs, alone.changed_pct, alone.max_excess_pct) == (0, 0, 0)


@given(time_matrices(), st.floats(0, 1))
def test_planning_costs_keep_the_triangle_inequality_to_the_feasibility_tolerance(times: IntArray, margin: float
                                                                                  ) -> None:
    cost: FloatArray = fuel_costs(times_of(times), margin).cost_s
    assert np.all(cost[:, None, :] <= cost[:, :, None] + cost[None, :, :] + 1e-6)


def test_a_noisy_planner_breaks_the_triangle_inequality_and_its_chains_are_drivable(tmp_path: Path) -> None:
    world = world_of(tmp_path, """\
format: sva-bench/world@1
name: cluttered
map:
  shapes:
    bounds_m: [0, 0, 8, 8]
    obstacles:
      - {box: [2.0, 2.4], size_m: [1.4, 0.5], yaw_deg: 40}
      - {box: [5.6, 2.2], size_m: [0.6, 1.8], yaw_deg: -15}
      - {box: [2.4, 5.6], size_m: [0.8, 1.6], yaw_deg: 20}
      - {box: [5.8, 5.6], size_m: [1.6, 0.6], yaw_deg: 70}
      - {cylinder: [4.0, 4.0], radius_m: 0.6}
      - {cylinder: [4.0, 6.9], radius_m: 0.3}
sites:
  base: {at_m: [0.7, 0.7]}
  pois: {a: {at_m: [7.2, 0.8]}, b: {at_m: [7.2, 7.2]}, c: {at_m: [0.8, 7.2]}, d: {at_m: [4.0, 5.4]},
         e: {at_m: [4.0, 2.4]}, f: {at_m: [0.8, 4.0]}, g: {at_m: [7.2, 4.0]}, h: {at_m: [3.6, 0.7]}}
robots: {uv1: {model: turtlebot2, incentives: {}}}
""")
    times = plan_travel_times(world, TURTLEBOT, "rrtconnect")
    costs = fuel_costs(times, 0.0)
    # 37 % were measured over many worlds; the roadmap's share is a few per cent.
    assert costs.changed_pct > 10
    assert costs.changed_pct > 2 * fuel_costs(plan_travel_times(world, TURTLEBOT), 0.0).changed_pct
    chains = [(costs.chain(a, b), costs.repaired_ms[times.sites.index(a), times.sites.index(b)] / 1000)
              for a, b in itertools.permutations(times.sites, 2)]
    repaired = sorted((c for c in chains if len(c[0]) > 2), key=lambda c: -len(c[0]))
    assert repaired
    for chain, planned_s in repaired[:4]:
        start = next(site for site in world.sites if site.name == chain[0])
        task = DriveTask(
            obstacles=world.obstacles, model=TURTLEBOT, start=(start.x_m, start.y_m, start.heading_rad),
            legs=(tuple(times.course(a, b) for a, b in itertools.pairwise(chain)),),
            fidelity="physics", traced=False)
        driven = drive_route(task)
        assert not driven.stuck
        assert_allclose(driven.leg_s, [planned_s], rtol=0.01)  # the error that the planning margin covers


def test_most_paths_of_a_noisy_planner_are_longer_than_the_roadmaps() -> None:
    obstacles = random_obstacles(2)
    points = free_places(obstacles, 2, 8, 0.297)
    noisy, good = (plan_paths(obstacles, points, 0.297, planner=planner) for planner in ("rrtconnect", "prmstar"))

    def total(paths: list[list[FloatArray | None]]) -> float:
        return sum(float(np.hypot(*np.diff(path, axis=0).T).sum()) for row in paths for path in row
                   if path is not None)

    assert total(noisy) > 1.02 * total(good)
    assert all(path_clearance(obstacles, path) >= 0.297 - 1e-6 for row in noisy for path in row if path is not None)
