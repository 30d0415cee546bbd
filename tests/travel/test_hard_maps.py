"""Maps full of corners: the work is bounded, and what is connected is joined."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hard_maps import FAMILY, write_world
from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.geometry.buckets import clearance_checker, keeps_clear
from sva_bench.geometry.cells import Cells, cover
from sva_bench.travel import tangents as tangents_module
from sva_bench.travel.lattice import lattice_paths
from sva_bench.travel.roadmap import plan_paths
from sva_bench.travel.samples import arc_points
from sva_bench.travel.tangents import tangents
from sva_bench.world.load import load_world
from tests.geometry.test_cells import cells_of, obstacles_of
from tests.oracles.distances import path_clearance
from tests.oracles.worlds import random_obstacles
from tests.travel.test_maps import places_on
from tests.travel.test_roadmap import length_of

CLEARANCE_M = 0.297


def hatched(cells: int) -> BoolArray:
    """Lines at 45 degrees with doors."""
    y, x = np.mgrid[:cells, :cells]
    lines: BoolArray = ((x + y) % 24 < 4) & ((x - y + 37 * ((x + y) // 24)) % 120 > 30)
    return lines


def every_tangent(checker: FloatArray, arcs: FloatArray) -> set[tuple[int, int]]:
    """All pairs, one by one, as the definition has it."""
    found = set()
    for i in range(len(arcs)):
        for j in range(i):
            way = arcs[j, :2] - arcs[i, :2]
            touches = True
            for k in (i, j):
                out = arcs[k, :2] - arcs[k, 2:4]
                if not np.isnan(out[0]):
                    touches &= bool((out @ way / np.hypot(*out)) ** 2 <= arcs[k, 4] ** 2 * (way @ way))
            if touches and keeps_clear(checker, *arcs[i, :2], *arcs[j, :2]):
                found.add((j, i))
    return found


@pytest.mark.parametrize("few", [2000, 10])
def test_the_tangents_of_few_points_are_all_that_there_are(few: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tangents_module, "_FEW", few)  # 10: in rings
    for seed in (2, 3):
        obstacles = random_obstacles(seed)
        arcs = arc_points(obstacles, CLEARANCE_M, 3)
        alone = np.column_stack([arcs[:5, :2] + 1e-6, np.full((5, 2), np.nan), np.zeros(5)])
        arcs = np.concatenate([alone, arcs])
        checker = clearance_checker(obstacles, CLEARANCE_M)
        pairs = tangents(checker, arcs)
        found = [(min(a, b), max(a, b)) for a, b in pairs.tolist()]
        assert len(set(found)) == len(found)
        assert set(found) == every_tangent(checker, arcs)


def test_the_search_for_tangents_stops_when_the_work_is_done_and_keeps_the_short_ones(
    monkeypatch: pytest.MonkeyPatch
) -> None:
    obstacles = obstacles_of(cells_of(hatched(160), 0.05))
    arcs = arc_points(obstacles, CLEARANCE_M, 6)
    checker = clearance_checker(obstacles, CLEARANCE_M)
    monkeypatch.setattr(tangents_module, "_FEW", 10)
    every = tangents(checker, arcs)
    monkeypatch.setattr(tangents_module, "_MOST_WORK", 100_000)
    monkeypatch.setattr(tangents_module, "_AT_A_TIME", 10_000)
    some = tangents(checker, arcs)
    assert 0 < len(some) < len(every)
    assert set(map(tuple, some.tolist())) <= set(map(tuple, every.tolist()))

    def longest(pairs: IntArray) -> float:
        return float(np.hypot(*(arcs[pairs[:, 0], :2] - arcs[pairs[:, 1], :2]).T).max())

    assert longest(some) < longest(every)


@pytest.mark.spread(1)
@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_lattice_paths_keep_the_clearance_and_find_every_passage(yaw: float) -> None:
    # Squares of 6 cells, shifted from row to row: the gaps between them, of 10 cells, lie askew.
    y, x = np.mgrid[:120, :120]
    occupied = ((x + (y // 16) % 2 * 8) % 16 < 6) & (y % 16 < 6)
    cells = cells_of(occupied, 0.05, (3.0, -2.0, yaw))
    obstacles = obstacles_of(cells)
    clearance = 0.249  # of half the gaps, a millimetre less
    points = places_on(cells, 8, 0, clearance)
    paths = lattice_paths(obstacles, clearance_checker(obstacles, clearance), clearance, points, range(1, len(points)))
    for k, way in enumerate(paths, start=1):
        assert way is not None
        np.testing.assert_allclose(way[[0, -1]], points[[0, k]])
        assert path_clearance(obstacles, way) >= clearance - 1e-6


def test_no_path_leads_through_a_wall() -> None:
    occupied = np.zeros((40, 40), dtype=np.bool_)
    occupied[:, 20] = True
    cells = cells_of(occupied, 0.1)
    points = np.array([[1.0, 1.0], [1.0, 3.0], [3.0, 1.0]])
    paths = lattice_paths(obstacles_of(cells), clearance_checker(obstacles_of(cells), 0.3), 0.3, points, [1, 2])
    assert paths[0] is not None
    assert paths[1] is None


def test_lattice_paths_lead_round_cylinders_that_stand_on_a_map() -> None:
    obstacles = obstacles_of(cells_of(np.zeros((60, 60), dtype=np.bool_), 0.1))
    obstacles = replace(obstacles, cylinders=np.array([[3.0, 3.0, 1.0], [3.0, 0.5, 0.3], [3.0, 5.5, 0.2]]))
    points = np.array([[1.0, 3.0], [5.0, 3.0]])
    path = lattice_paths(obstacles, clearance_checker(obstacles, 0.3), 0.3, points, [1])[0]
    assert path is not None
    assert path_clearance(obstacles, path) >= 0.3 - 1e-6


def test_a_crowd_of_corners_is_joined_by_the_lattice(monkeypatch: pytest.MonkeyPatch) -> None:
    cells = cells_of(hatched(160), 0.05)
    obstacles = obstacles_of(cells)
    points = places_on(cells, 4, 1)
    usual = plan_paths(obstacles, points, CLEARANCE_M)
    monkeypatch.setattr("sva_bench.travel.roadmap._CROWD", 100)
    monkeypatch.setattr(tangents_module, "_FEW", 10)
    monkeypatch.setattr(tangents_module, "_MOST_WORK", 150_000)
    hurried = plan_paths(obstacles, points, CLEARANCE_M)
    for i, row in enumerate(usual):
        for j, path in enumerate(row):
            other = hurried[i][j]
            assert (path is None) == (other is None)
            if path is not None and other is not None:
                checker = clearance_checker(obstacles, CLEARANCE_M, 1e-6)
                assert all(keeps_clear(checker, *a, *b) for a, b in pairwise(other.tolist()))
                # A hundredth of the work that is allowed leaves few tangents; still no way is much longer.
                assert length_of(other) <= 1.25 * length_of(path)


@pytest.mark.parametrize("make", [pytest.param(make, id=name) for name, make in FAMILY.items()])
@pytest.mark.long
def test_every_hard_map_is_planned_on(make: Callable[[], tuple[BoolArray, float]], tmp_path: Path) -> None:
    occupied, cell_m = make()
    try:
        cover(occupied)
    except ValueError:
        pytest.skip("more boxes than are accepted")
    path = write_world(tmp_path, occupied, cell_m)
    if path is None:
        pytest.skip("no room for sites")
    world = load_world(path)
    points = np.array([(site.x_m, site.y_m) for site in world.sites])[:6]
    assert isinstance(world.obstacles.cells, Cells)
    paths = plan_paths(world.obstacles, points, 0.207)
    assert all(path is not None for i, row in enumerate(paths) for j, path in enumerate(row) if i != j)
