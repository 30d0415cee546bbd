"""Plans of robots that share a world, against exhaustive search and by their laws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise, permutations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.execution.shared.conflicts import STILL_M
from sva_bench.execution.shared.earliest import SPARE_S
from sva_bench.execution.shared.lanes import Itinerary, Order
from sva_bench.execution.shared.space_time import plan_order
from sva_bench.robot.model import BUILT_IN
from tests.execution.shared.crowds import GAP_M, MODEL, itinerary, made_up, standing

Block = tuple[float, float]
Stay = tuple[tuple[float, float], float, float]
"""Place of a cell, and when it is entered and left."""


def near_m(one: Itinerary, other: Itinerary) -> float:
    """Distance below which two cells can't be occupied at once."""
    return one.radius_m + other.radius_m + GAP_M - (0.0 if one.legs and other.legs else STILL_M)


# --- Exhaustive search. A plan may be shifted to the left until each robot enters each cell as soon as it has been in
# the one before for long enough, or as soon as the cell becomes free: all such plans are tried.


def exhaustive_end(mine: Itinerary, others: Sequence[tuple[Itinerary, list[Stay]]]) -> tuple[float, list[Stay]]:
    """The earliest end of a robot among the stays of others, and its own stays."""
    best: tuple[float, list[Stay]] = (math.inf, [])

    def blocks_of(place: tuple[float, float]) -> list[Block]:
        return [(enter - SPARE_S, leave + SPARE_S) for other, stays in others for at, enter, leave in stays
                if math.dist(place, at) < near_m(mine, other)]

    def extend(leg: int, way: int, cell: int, enter: float, stays: list[Stay]) -> None:
        nonlocal best
        cut = mine.legs[leg][way]
        last = cell == len(cut.place_m) - 1
        lasts = (cut.lasts_s + mine.stop_s[leg] if last else cut.enter_s[cell + 1]) - cut.enter_s[cell]
        place = tuple(cut.place_m[cell].tolist())
        since = -math.inf if leg == cell == 0 else enter
        free = min([begin for begin, end in blocks_of(place) if end > since], default=math.inf)
        if free < enter + lasts:
            return
        if last and leg == len(mine.legs) - 1:
            if free == math.inf and enter + lasts < best[0]:
                best = (enter + lasts, [*stays, (place, since, math.inf)])
            return
        onward = [(leg, way, cell + 1)] if not last else [(leg + 1, k, 0) for k in range(len(mine.legs[leg + 1]))]
        for next_leg, next_way, next_cell in onward:
            there = tuple(mine.legs[next_leg][next_way].place_m[next_cell].tolist())
            for time in sorted({enter + lasts, *(end for _, end in blocks_of(there) if end > enter + lasts)}):
                if time <= free:
                    extend(next_leg, next_way, next_cell, time, [*stays, (place, since, time)])

    for way in range(len(mine.legs[0])):
        extend(0, way, 0, mine.ready_s, [])
    return best


def exhaustive_sum(crowd: Sequence[Itinerary]) -> float:
    """The least sum of ends over all orders of priority; ``inf`` if none has a plan."""
    still = [(robot, [(robot.place_m, -math.inf, math.inf)]) for robot in crowd if not robot.legs]
    least = math.inf
    for order in permutations([robot for robot in crowd if robot.legs]):
        planned, total = list(still), 0.0
        for robot in order:
            end, stays = exhaustive_end(robot, planned)
            total += end
            planned.append((robot, stays))
        least = min(least, total)
    return least


def random_crowd(seed: int) -> list[Itinerary]:
    """Two robots on a grid of a few places half a metre apart, and now and then one that stands there."""
    rng = np.random.default_rng(seed)

    def walk() -> list[tuple[float, float]]:
        at, places = rng.integers(0, 4, 2), []
        for _ in range(int(rng.integers(2, 5))):
            places.append((float(at[0]) * 0.5, float(at[1]) * 0.5))
            at = np.clip(at + rng.integers(-1, 2, 2), 0, 3)
        return places

    crowd = []
    for k in range(2):
        legs = []
        for _ in range(int(rng.integers(1, 3))):
            ways = [walk() for _ in range(int(rng.integers(1, 3)))]
            legs.append(tuple(made_up(way, rng.uniform(0.2, 3.0, len(way)).tolist()) for way in ways))
        # Where they stand is far from all that: nearness at the start is for tests of its own.
        crowd.append(Itinerary(radius_m=0.177, legs=tuple(legs), stop_s=tuple(rng.uniform(0, 3, len(legs)).tolist()),
                               ready_s=float(rng.uniform(0, 5)), place_m=(50.0 * k, 50.0)))
    if rng.random() < 0.3:
        crowd.append(standing(float(rng.integers(0, 4)) * 0.5, float(rng.integers(0, 4)) * 0.5))
    return crowd


def test_plans_are_as_good_as_those_of_exhaustive_search() -> None:
    infeasible = delayed = 0
    for seed in range(300):
        crowd = random_crowd(seed)
        least, order = exhaustive_sum(crowd), plan_order(crowd, GAP_M)
        if order is None:
            assert least == math.inf, f"crowd {seed}"
            infeasible += 1
            continue
        found = sum(float(end) for end, robot in zip(order.ends_s, crowd, strict=True) if robot.legs)
        assert found == pytest.approx(least, abs=1e-5), f"crowd {seed}"
        alone = sum(exhaustive_end(robot, [])[0] for robot in crowd if robot.legs)
        delayed += found > alone + 0.1
    # Else the comparison would be of nothing.
    assert infeasible > 30
    assert delayed > 30


# --- Laws.


def assert_cells_are_ordered_once(order: Order, crowd: Sequence[Itinerary]) -> int:
    """Check each pair of cells that can't be occupied at once; how many there are."""
    pairs = 0
    for i, mine in enumerate(order.lanes):
        for j in range(i):
            other = order.lanes[j]
            apart = np.hypot(*(mine.place_m[:, None] - other.place_m[None, :]).transpose(2, 0, 1))
            for a, b in np.argwhere(apart < near_m(crowd[i], crowd[j])).tolist():
                pairs += 1
                # One waits until the other has entered the cell after.
                assert (order.needs[i][j][a] > b) != (order.needs[j][i][b] > a), f"{i}: {a}, {j}: {b}"
            assert (np.diff(order.needs[i][j]) >= 0).all()
            assert (np.diff(order.needs[j][i]) >= 0).all()
            assert order.needs[i][j][-1] < len(other.enter_s)
    return pairs


def drive_late(order: Order, crowd: Sequence[Itinerary], seed: int) -> None:
    """Drive all cells, each in a time of its own: nobody may come too near, and everybody must arrive."""
    rng = np.random.default_rng(seed)
    count = len(order.lanes)
    at, leaves = np.zeros(count, dtype=np.int64), np.full(count, 0.0)
    last = np.array([len(lane.enter_s) - 1 for lane in order.lanes])
    clock = 0.0
    while (at < last).any():
        ready = [i for i in range(count) if at[i] < last[i]
                 and all(at[j] >= order.needs[i][j][at[i] + 1] for j in range(count))]
        assert ready, f"deadlock at {at.tolist()} of {last.tolist()}"
        first = min(ready, key=lambda i: max(float(leaves[i]), clock))
        clock = max(float(leaves[first]), clock)
        at[first] += 1
        leaves[first] = clock + 0.2 * float(rng.uniform(0.5, 1.2)) * float(rng.choice([1, 1, 1, 20]))
        for other in range(count):
            apart = math.dist(order.lanes[first].place_m[at[first]], order.lanes[other].place_m[at[other]])
            assert other == first or apart >= near_m(crowd[first], crowd[other]), f"{first} and {other} meet"


def assert_safe(crowd: Sequence[Itinerary]) -> Order:
    """The order of a crowd, which must have one, and keeps robots apart however late they are."""
    order = plan_order(crowd, GAP_M)
    assert order is not None
    assert_cells_are_ordered_once(order, crowd)
    for seed in range(5):
        drive_late(order, crowd, seed)
    return order


def round_trips(seed: int, count: int) -> list[Itinerary]:
    """Robots in a row of berths that drive to random places in a small field and back."""
    rng = np.random.default_rng(seed)
    crowd = []
    for k in range(count):
        berth, places = (1.2 * k, 0.0), rng.uniform((0.0, 1.5), (1.2 * count, 5.0), (3, 2)).tolist()
        stops = [berth, *map(tuple, places), berth]
        crowd.append(itinerary(*(list(leg) for leg in pairwise(stops)),
                               ready_s=float(rng.uniform(0, 10))))
    return crowd


@pytest.mark.parametrize("seed", range(6))
def test_cells_are_ordered_once_and_nobody_meets_or_waits_for_good_however_late(seed: int) -> None:
    crowd = round_trips(seed, 2 + seed)
    order = assert_safe(crowd)
    assert assert_cells_are_ordered_once(order, crowd) > 0


def test_planned_stays_in_cells_that_exclude_each_other_are_apart_in_time() -> None:
    crowd = round_trips(11, 4)
    order = plan_order(crowd, GAP_M)
    assert order is not None
    stays = [(np.r_[-np.inf, lane.enter_s[1:]], np.r_[lane.enter_s[1:], np.inf]) for lane in order.lanes]
    for i in range(4):
        for j in range(i):
            mine, other = order.lanes[i].place_m, order.lanes[j].place_m
            near = np.hypot(*(mine[:, None] - other[None, :]).transpose(2, 0, 1)) < near_m(crowd[i], crowd[j])
            gap = np.maximum(stays[i][0][:, None] - stays[j][1][None, :], stays[j][0][None, :] - stays[i][1][:, None])
            assert (gap[near] >= SPARE_S - 1e-9).all()


def test_a_robot_alone_enters_its_cells_as_the_twin_does() -> None:
    alone = itinerary([(0, 0), (3, 0), (3, 3)], [(3, 3), (0, 0)], ready_s=5.0)
    order = plan_order([alone], GAP_M)
    assert order is not None
    lane, (out, back) = order.lanes[0], (alone.legs[0][0], alone.legs[1][0])
    expected = np.concatenate([5.0 + out.enter_s, 5.0 + out.lasts_s + 2.0 + back.enter_s])
    assert_allclose(lane.enter_s, expected, rtol=0, atol=1e-9)
    assert_array_equal(lane.first_cell, [0, len(out.enter_s), len(expected)])
    assert order.ends_s[0] == pytest.approx(5.0 + out.lasts_s + 2.0 + back.lasts_s + 2.0)
    assert not order.needs[0][0].any()


def test_robots_that_never_meet_drive_as_each_alone() -> None:
    one, other = itinerary([(0, 0), (3, 0)], [(3, 0), (0, 0)]), itinerary([(0, 5), (3, 5)], [(3, 5), (0, 5)])
    both, alone = plan_order([one, other], GAP_M), plan_order([one], GAP_M)
    assert both is not None
    assert alone is not None
    assert_array_equal(both.lanes[0].enter_s, alone.lanes[0].enter_s)
    assert not both.needs[0][1].any()
    assert not both.needs[1][0].any()


def test_the_same_crowd_has_the_same_order() -> None:
    one, other = (plan_order(round_trips(3, 6), GAP_M) for _ in range(2))
    assert one is not None
    assert other is not None
    assert_array_equal(one.ends_s, other.ends_s)
    for mine, same in zip(one.lanes, other.lanes, strict=True):
        assert_array_equal(mine.enter_s, same.enter_s)
    for row, same_row in zip(one.needs, other.needs, strict=True):
        for need, same_need in zip(row, same_row, strict=True):
            assert_array_equal(need, same_need)


# --- Fixtures.


def test_two_in_a_corridor_go_one_after_the_other() -> None:
    left = itinerary([(0, 0), (6, 0)], [(6, 0), (0, 0)])
    right = itinerary([(10, 0), (4, 0)], [(10 - 6, 0), (10, 0)])
    alone = plan_order([left], GAP_M)
    order = assert_safe([left, right])
    assert alone is not None
    # Whoever goes second waits where the other one turns back, before its way overlaps: 2 m before its own turn.
    assert min(order.ends_s) == pytest.approx(float(alone.ends_s[0]))
    assert max(order.ends_s) > float(alone.ends_s[0]) + 5


def test_nobody_can_swap_places_in_a_corridor_without_another_way() -> None:
    assert plan_order([itinerary([(0, 0), (6, 0)]), itinerary([(6, 0), (0, 0)])], GAP_M) is None


def test_two_swap_places_in_a_corridor_if_one_has_another_way() -> None:
    around = [[(0, 0), (6, 0)], [(0, 0), (0, 3), (6, 3), (6, 0)]]
    order = assert_safe([itinerary(around), itinerary([(6, 0), (0, 0)])])
    assert order.lanes[0].cuts[0].place_m[:, 1].max() > 2.5


def test_all_pass_one_door() -> None:
    crowd = [itinerary([(0, 1.2 * k), (4, 0), (6, 0), (10, 1.2 * k)], [(10, 1.2 * k), (6, 0), (4, 0), (0, 1.2 * k)])
             for k in range(-2, 3)]
    assert_safe(crowd)


def test_a_station_in_a_dead_end_serves_one_after_the_other() -> None:
    crowd = [itinerary([(0, 1.2 * k), (3, 0), (6, 0)], [(6, 0), (3, 0), (0, 1.2 * k)], stop_s=10.0) for k in range(3)]
    order = assert_safe(crowd)
    alone = plan_order(crowd[:1], GAP_M)
    assert alone is not None
    assert max(order.ends_s) > float(alone.ends_s[0]) + 20  # two stops of the others


def test_stops_inside_a_corridor_let_nobody_by() -> None:
    crowd = [itinerary([(0, 1.2 * k), (2, 0), (4 + k, 0)], [(4 + k, 0), (2, 0), (0, 1.2 * k)], stop_s=5.0)
             for k in range(4)]
    assert_safe(crowd)


def test_robots_of_different_sizes_keep_their_own_distances() -> None:
    large, small = BUILT_IN["husky"], BUILT_IN["turtlebot3_burger"]
    crowd = [itinerary([(0, 0), (8, 0)], [(8, 0), (0, 0)], model=large),
             itinerary([(4, -3), (4, 3)], [(4, 3), (4, -3)], model=small),
             itinerary([(5, -3), (5, 3)], [(5, 3), (5, -3)], model=MODEL)]
    order = assert_safe(crowd)
    # 0.105 + 0.177 + 0.2 = 0.482 m: small ones 1 m apart don't wait for each other.
    assert not order.needs[1][2].any()
    assert order.needs[1][0].any() or order.needs[0][1].any()


def test_robots_go_round_one_that_stands_for_good_or_not_at_all() -> None:
    ahead, round_it = [(0.0, 0.0), (6.0, 0.0)], [(0.0, 0.0), (3.0, 1.0), (6.0, 0.0)]
    assert plan_order([itinerary(ahead), standing(3.0, 0.0)], GAP_M) is None
    order = plan_order([itinerary([ahead, round_it]), standing(3.0, 0.0)], GAP_M)
    assert order is not None
    assert order.lanes[0].cuts[0].place_m[:, 1].max() > 0.5
    assert_array_equal(order.lanes[1].place_m, [[3.0, 0.0]])
    assert order.ends_s[1] == 0.0


def test_a_robot_holds_its_first_cell_before_it_is_ready() -> None:
    # One stands in the way until it is ready at 60 s; the other must wait for it though it could pass at once.
    waits, first = itinerary([(0, 0), (6, 0)]), itinerary([(3, 0), (3, 3)], ready_s=60.0)
    order = assert_safe([waits, first])
    assert order.ends_s[0] > 60
    assert order.needs[0][1].max() > 0
    assert not order.needs[1][0].any()


def test_of_many_orders_the_only_one_that_has_a_plan_is_found() -> None:
    # In a row, each ready a minute after the one behind it: the foremost must be planned first, and so on.
    places = [3, 0, 6, 2, 5, 1, 4]
    crowd = [itinerary([(1.2 * k, 0), (20 + 1.2 * k, 0)], ready_s=60.0 * k) for k in places]
    order = assert_safe(crowd)
    for i in range(7):
        assert [order.needs[i][j].any() for j in range(7)] == [place > places[i] for place in places]


def test_robots_that_had_to_brake_near_each_other_get_clear() -> None:
    # 0.48 m apart where cells are 0.554 m: each is within the other's reach from the beginning.
    apart = [itinerary([(0, 0), (-4, 0)]), itinerary([(0.48, 0), (4, 0)])]
    order = plan_order(apart, GAP_M)
    assert order is not None
    alone = [plan_order([robot], GAP_M) for robot in apart]
    assert_allclose(order.ends_s, [float(found.ends_s[0]) for found in alone if found is not None])
    follow = plan_order([itinerary([(0, 0), (4, 0)]), itinerary([(0.48, 0), (4, 3)])], GAP_M)
    assert follow is not None
    assert follow.needs[0][1].max() > 0


def test_legs_without_ways_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one way"):
        Itinerary(radius_m=0.2, legs=((),), stop_s=(0.0,), ready_s=0.0, place_m=(0.0, 0.0))
