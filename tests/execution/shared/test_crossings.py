"""Groups of cells in conflict: the orders that they make, and how good these are, against exhaustive search."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.execution.shared.crossings import Crossings, foresee
from sva_bench.execution.shared.earliest import SPARE_S
from sva_bench.execution.shared.lanes import Itinerary, Order
from sva_bench.execution.shared.space_time import plan_order
from tests.execution.shared.crowds import GAP_M, itinerary
from tests.execution.shared.test_space_time import assert_cells_are_ordered_once, near_m, round_trips

Second = tuple[int, ...]


def small_crowd(seed: int) -> list[Itinerary]:
    """Two or three robots that drive to one or two random places before their berths and back."""
    rng = np.random.default_rng(seed)
    count, crowd = int(rng.integers(2, 4)), []
    for k in range(count):
        berth, places = (1.2 * k, 0.0), rng.uniform((0, 1.5), (1.2 * count, 4.0), (int(rng.integers(1, 3)), 2)).tolist()
        stops = [berth, *map(tuple, places), berth]
        crowd.append(itinerary(*(list(leg) for leg in pairwise(stops)), ready_s=float(rng.uniform(0, 5)),
                               stop_s=float(rng.uniform(0, 8))))
    return crowd


def pairs_in_conflict(order: Order, crowd: Sequence[Itinerary]) -> list[tuple[int, int, int, int]]:
    """Two robots and a cell of each, of all that can't be occupied at once."""
    found = []
    for i, mine in enumerate(order.lanes):
        for j in range(i + 1, len(order.lanes)):
            apart = np.hypot(*(mine.place_m[:, None] - order.lanes[j].place_m[None, :]).transpose(2, 0, 1))
            found += [(i, j, a, b) for a, b in np.argwhere(apart < near_m(crowd[i], crowd[j])).tolist()]
    return found


def side_by_side(pairs: Sequence[tuple[int, int, int, int]]) -> list[list[tuple[int, int, int, int]]]:
    """Pairs of cells in groups of neighbours, by flooding."""
    left, groups = set(pairs), []
    while left:
        group, edge = [], [left.pop()]
        while edge:
            i, j, a, b = edge.pop()
            group.append((i, j, a, b))
            for other in [(i, j, a + da, b + db) for da in (-1, 0, 1) for db in (-1, 0, 1)]:
                if other in left:
                    left.remove(other)
                    edge.append(other)
        groups.append(sorted(group))
    return sorted(groups)


def least_sum(stay_s: Sequence[FloatArray], ready_s: Sequence[float],
              groups: Sequence[Sequence[tuple[int, int, int, int]]], second: Second) -> float:
    """The sum of ends under an order, by moving every robot as soon as it may, a relaxation until nothing changes.

    Times only grow; beyond what all could take one after the other they grow for ever, in a circle.
    """
    enter = [ready + np.concatenate([[0.0], np.cumsum(stay)]) for ready, stay in zip(ready_s, stay_s, strict=True)]
    most = sum(float(stay.sum()) for stay in stay_s) + max(ready_s) + 100.0
    while True:
        changed = False
        for group, late in zip(groups, second, strict=True):
            for i, j, a, b in group:
                waits, cell, goes, beyond = (i, a, j, b + 1) if late == 0 else (j, b, i, a + 1)
                if cell == 0 or beyond == len(stay_s[goes]):  # it stands there at first, the other for good
                    return math.inf
                if enter[waits][cell] < enter[goes][beyond] + SPARE_S - 1e-9:
                    enter[waits][cell] = enter[goes][beyond] + SPARE_S
                    enter[waits][cell:] = np.maximum(enter[waits][cell:], enter[waits][cell] + np.concatenate(
                        [[0.0], np.cumsum(stay_s[waits][cell:])]))
                    changed = True
        total = sum(float(times[-1]) for times in enter)
        if max(float(times[-1]) for times in enter) > most:
            return math.inf
        if not changed:
            return total


def stays_of(crossings: Crossings) -> list[FloatArray]:
    return [crossings.stay_s[begin:end] for begin, end in pairwise(crossings.first.tolist())]


def foreseen(crossings: Crossings, ready_s: FloatArray, second: IntArray) -> float:
    """The same by the compiled code."""
    first = crossings.first
    return float(foresee(first, crossings.stay_s, crossings.needs(second), np.zeros(len(ready_s), dtype=np.int64),
                   ready_s + crossings.stay_s[first[:-1]], np.zeros(len(ready_s), dtype=np.bool_), SPARE_S,
                   np.full(len(crossings.stay_s), -math.inf)))


def test_groups_are_the_pairs_of_cells_in_conflict_that_lie_side_by_side() -> None:
    for seed in range(8):
        crowd = small_crowd(seed)
        order = plan_order(crowd, GAP_M)
        assert order is not None
        lanes, groups = order.crossings, []
        for k in range(len(lanes)):
            rows = range(lanes.start[k], lanes.start[k + 1])
            # Cells of the first robot with the last of the second's beyond them, and the other way round.
            last_of = [sorted({(int(lanes.cell[r]), int(lanes.beyond[r])) for r in rows if lanes.waits[r] == side})
                       for side in (0, 1)]
            groups.append((*lanes.pair[k].tolist(), *last_of))
        expected = []
        for group in side_by_side(pairs_in_conflict(order, crowd)):
            last: tuple[dict[int, int], dict[int, int]] = ({}, {})
            i, j, _, _ = group[0]
            for _, _, a, b in group:
                last[0][a], last[1][b] = max(last[0].get(a, 0), b + 1), max(last[1].get(b, 0), a + 1)
            expected.append((i, j, sorted(last[0].items()), sorted(last[1].items())))
        # A cell may have several runs of the other's cells: it waits for the last of them.
        known = [(i, j, sorted(dict(first).items()), second) for i, j, first, second in groups]
        assert sorted(known) == sorted(expected), f"crowd {seed}"


def test_no_robots_wait_longer_than_in_the_best_of_all_orders_by_more_than_a_twentieth() -> None:
    waits = missed = 0
    for seed in range(50):
        crowd = small_crowd(seed)
        order = plan_order(crowd, GAP_M)
        if order is None or len(order.crossings) > 6:
            continue
        ready_s, stay_s = [robot.ready_s for robot in crowd], stays_of(order.crossings)
        groups = side_by_side(pairs_in_conflict(order, crowd))
        best = min(least_sum(stay_s, ready_s, groups, second) for second in product((0, 1), repeat=len(groups)))
        alone = sum(ready + float(stay.sum()) for ready, stay in zip(ready_s, stay_s, strict=True))
        assert float(order.ends_s.sum()) - alone <= 1.05 * (best - alone) + 1e-6, f"crowd {seed}"
        waits += best > alone + 0.1
        missed += not math.isfinite(best)
    assert waits > 25
    assert missed == 0


def test_where_not_all_orders_are_gone_through_the_best_is_hardly_ever_missed(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sva_bench.execution.shared.flips._THROUGH", 0)
    waited = best_s = 0.0
    for seed in range(1000, 1100):
        crowd = small_crowd(seed)
        order = plan_order(crowd, GAP_M)
        if order is None or len(order.crossings) > 9:
            continue
        lanes, ready_s = order.crossings, np.array([robot.ready_s for robot in crowd])
        alone = float(ready_s.sum() + lanes.stay_s.sum())
        found = foreseen(lanes, ready_s, lanes.second)
        assert found == pytest.approx(float(order.ends_s.sum()), abs=1e-6)
        possible = [np.array(second) for second in product((0, 1), repeat=len(lanes))
                    if all(lanes.begins[k, late] > 0 for k, late in enumerate(second))]
        waited, best_s = waited + found - alone, best_s + min(foreseen(lanes, ready_s, s) for s in possible) - alone
    assert best_s > 100
    assert waited <= 1.01 * best_s  # 1.0009 of 500 crowds


@pytest.mark.parametrize("seed", range(4))
def test_robots_enter_as_an_improved_order_says_and_every_pair_of_cells_is_ordered_once(seed: int) -> None:
    crowd = round_trips(seed, 3 + seed)
    order = plan_order(crowd, GAP_M)
    assert order is not None
    lanes = order.crossings
    assert assert_cells_are_ordered_once(order, crowd) > 0
    needs = lanes.by_lane(lanes.needs(lanes.second))
    for mine, known in zip(needs, order.needs, strict=True):
        assert_array_equal(np.array(mine), np.array(known))
    # Nobody is planned to be earlier than its gates allow.
    assert foreseen(lanes, np.array([robot.ready_s for robot in crowd]), lanes.second) <= order.ends_s.sum() + 1e-6


def test_robots_that_wait_for_each_other_in_a_circle_are_foreseen() -> None:
    # Head-on on one line to places beside it, then back: who is first on the first part must be on the second.
    crowd = [itinerary([(0, 0), (6, 0), (6, 3)], [(6, 3), (6, 0), (0, 0)]),
             itinerary([(6.5, -2), (6, 0), (1, 0), (1, 3)], [(1, 3), (1, 0), (6, 0), (6.5, -2)])]
    order = plan_order(crowd, GAP_M)
    assert order is not None
    lanes, ready_s = order.crossings, np.zeros(2)
    ends = [foreseen(lanes, ready_s, np.array(second)) for second in product((0, 1), repeat=len(lanes))]
    assert min(ends) == pytest.approx(float(order.ends_s.sum()), abs=1e-6)
    assert math.inf in ends
