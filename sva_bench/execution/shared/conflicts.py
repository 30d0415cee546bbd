"""Which cells of two robots can't be occupied at once, as runs of neighbouring cells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.execution.shared.lanes import CELL_M, Itinerary

STILL_M = 0.12
"""What the gap to a robot that stands for good is smaller by [m]: where it stands is known, and paths around it keep
0.12 m from its hull besides the clearance margin."""
_START_M = 0.1  # what the gap is smaller by between robots that stand nearer than it: their cells' lengths
_START_STILL_M = 0.03  # the same next to one that stands for good, whose cell has no length
_START_CELLS = 6  # cells in which they get clear of each other
_BLOCK = 16  # neighbouring cells that are looked at together


@dataclass(frozen=True, eq=False, kw_only=True)
class Strips:
    """The cells of all ways of all robots in one row: by robot, leg and way.

    Attributes:
        robot: Robot of each way, shape (ways,).
        first: Number of the first cell of each way, and of all; shape (ways + 1,).
        leg: Number of the first way of each leg of all robots, and of all; shape (legs + 1,).
        legs: Number of the first leg of each robot, and of all; a robot that stays has one leg of one cell; shape
            (robots + 1,).
        place_m: Place in the middle of each cell [m], shape (cells, 2).
        lasts_s: Shortest stay in each cell, the stop in a leg's last one included [s]; ``inf`` = it stays for good;
            shape (cells,).
    """

    robot: IntArray
    first: IntArray
    leg: IntArray
    legs: IntArray
    place_m: FloatArray
    lasts_s: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Runs:
    """For each cell the runs of cells of other robots that can't be occupied together with it.

    Attributes:
        start: Where the runs of each cell begin, and the end; shape (cells + 1,).
        way, low, high: Way that each run is part of, and the numbers of its first and last cell; shape (runs,).
    """

    start: IntArray
    way: NDArray[np.int32]
    low: NDArray[np.int32]
    high: NDArray[np.int32]


def strips_of(itineraries: Sequence[Itinerary]) -> Strips:
    """The cells of all ways in one row."""
    robot, first, leg, legs = [], [0], [0], [0]
    places, lasts = [], []
    for number, itinerary in enumerate(itineraries):
        for cuts, stop_s in zip(itinerary.legs, itinerary.stop_s, strict=True):
            for cut in cuts:
                robot.append(number)
                first.append(first[-1] + len(cut.place_m))
                places.append(cut.place_m)
                lasts.append(np.diff(cut.enter_s, append=cut.lasts_s + stop_s))
            leg.append(len(robot))
        if not itinerary.legs:
            robot.append(number)
            first.append(first[-1] + 1)
            places.append(np.array([itinerary.place_m]))
            lasts.append(np.array([math.inf]))
            leg.append(len(robot))
        legs.append(len(leg) - 1)
    return Strips(robot=np.array(robot), first=np.array(first), leg=np.array(leg), legs=np.array(legs),
                  place_m=np.concatenate(places), lasts_s=np.concatenate(lasts))


def runs_of(itineraries: Sequence[Itinerary], strips: Strips, gap_m: float) -> Runs:
    """The runs of each cell.

    Args:
        itineraries: What each robot has yet to drive.
        strips: Their cells.
        gap_m: Least gap between two hulls in the middle of their cells [m].
    """
    near, early = _gaps(itineraries, gap_m)
    first_leg = np.zeros(len(strips.robot), dtype=np.bool_)
    for leg in strips.legs[:-1].tolist():
        first_leg[strips.leg[leg]:strips.leg[leg + 1]] = True
    rows = _find_runs(strips.robot, strips.first, strips.place_m, first_leg, near, early)
    start, rows = _by_cell(rows, len(strips.place_m))
    return Runs(start=start, way=rows[:, 1], low=rows[:, 2], high=rows[:, 3])


def _gaps(itineraries: Sequence[Itinerary], gap_m: float) -> tuple[FloatArray, FloatArray]:
    """Distances below which two cells can't be occupied at once, and below which they can't at the start [m]."""
    radius = np.array([itinerary.radius_m for itinerary in itineraries])
    places = np.array([itinerary.place_m for itinerary in itineraries])
    still = np.array([not itinerary.legs for itinerary in itineraries])
    one_still = still[:, None] | still[None, :]
    apart = np.hypot(*(places[:, None] - places[None, :]).transpose(2, 0, 1))
    near: FloatArray = radius[:, None] + radius[None, :] + gap_m - STILL_M * one_still
    # Robots that stand as near as that already, since they had to brake, must only come no nearer than their hulls.
    bare = near - np.where(one_still, _START_STILL_M, _START_M)
    return near, np.where(apart < near + CELL_M, bare, near)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _circles(first: IntArray, place: FloatArray) -> tuple[IntArray, FloatArray]:
    """Circles about each ``_BLOCK`` cells of a way.

    Returns:
        Number of the first circle of each way, and of all, shape (ways + 1,); x, y, radius [m], shape (circles, 3).
    """
    begins = np.zeros(len(first), dtype=np.int64)
    for way in range(len(first) - 1):
        begins[way + 1] = begins[way] + (first[way + 1] - first[way] + _BLOCK - 1) // _BLOCK
    circles = np.empty((begins[-1], 3))
    for way in range(len(first) - 1):
        for k in range(begins[way + 1] - begins[way]):
            cells = place[first[way] + k * _BLOCK:min(first[way] + (k + 1) * _BLOCK, first[way + 1])]
            x, y, reach = cells[:, 0].mean(), cells[:, 1].mean(), 0.0
            for cell in range(len(cells)):
                reach = max(reach, math.hypot(cells[cell, 0] - x, cells[cell, 1] - y))
            circles[begins[way] + k, 0], circles[begins[way] + k, 1] = x, y
            circles[begins[way] + k, 2] = reach + 1e-9
    return begins, circles


@njit(cache=True)  # type: ignore[untyped-decorator]
def _find_runs(
    robot: IntArray, first: IntArray, place: FloatArray, first_leg: BoolArray, near: FloatArray, early: FloatArray,
) -> NDArray[np.int32]:
    """Cell, way, first and last cell of each run, in no order, shape (runs, 4); compiled in one loop over all pairs.

    For each cell of one way the cells of the other are searched, among those of blocks that are near enough; runs of
    the first way's cells about those of the other are found along with them.
    """
    rows, count = np.empty((65_536, 4), dtype=np.int32), 0
    begins, circles = _circles(first, place)
    longest = np.diff(first).max()
    close = np.empty(longest // _BLOCK + 1, dtype=np.int64)
    since, until = np.empty(longest, dtype=np.int64), np.empty(longest, dtype=np.int64)
    for mine in range(len(robot)):
        for other in range(mine + 1, len(robot)):
            i, j = robot[mine], robot[other]
            if i == j:
                continue
            begin, end, within = first[other], first[other + 1], near[i, j]
            usual, special = within * within, early[i, j] * early[i, j]
            from_rest = first_leg[mine] and first_leg[other] and special < usual
            until[:end - begin] = -2
            for block in range(begins[mine], begins[mine + 1]):
                found = 0
                for k in range(begins[other], begins[other + 1]):
                    dx, dy = circles[k, 0] - circles[block, 0], circles[k, 1] - circles[block, 1]
                    reach = circles[k, 2] + circles[block, 2] + within
                    if dx * dx + dy * dy <= reach * reach:
                        close[found] = k
                        found += 1
                if found == 0:
                    continue
                head = first[mine] + (block - begins[mine]) * _BLOCK
                for a in range(head, min(head + _BLOCK, first[mine + 1])):
                    if count + 2 * (end - begin) + 2 > len(rows):
                        more = np.empty((2 * len(rows) + 4 * longest, 4), dtype=np.int32)
                        more[:count] = rows[:count]
                        rows = more
                    x, y, low, high = place[a, 0], place[a, 1], -2, -2
                    starts = from_rest and a - first[mine] < _START_CELLS
                    for k in close[:found]:
                        dx, dy, reach = circles[k, 0] - x, circles[k, 1] - y, circles[k, 2] + within
                        if dx * dx + dy * dy > reach * reach:
                            continue
                        ahead = begin + (k - begins[other]) * _BLOCK
                        for b in range(ahead, min(ahead + _BLOCK, end)):
                            dx, dy, limit = place[b, 0] - x, place[b, 1] - y, usual
                            if starts and b - begin < _START_CELLS:
                                limit = special if a > first[mine] or b > begin else -1.0  # they stand there both
                            if dx * dx + dy * dy >= limit:
                                continue
                            if high != b - 1:
                                if low >= 0:
                                    rows[count, 0], rows[count, 1], rows[count, 2], rows[count, 3] = a, other, low, high
                                    count += 1
                                low = b
                            high = b
                            at = b - begin
                            if until[at] != a - 1:
                                if until[at] >= 0:
                                    rows[count, 0], rows[count, 1] = b, mine
                                    rows[count, 2], rows[count, 3] = since[at], until[at]
                                    count += 1
                                since[at] = a
                            until[at] = a
                    if low >= 0:
                        rows[count, 0], rows[count, 1], rows[count, 2], rows[count, 3] = a, other, low, high
                        count += 1
            if count + end - begin > len(rows):
                more = np.empty((2 * len(rows) + longest, 4), dtype=np.int32)
                more[:count] = rows[:count]
                rows = more
            for at in range(end - begin):
                if until[at] >= 0:
                    rows[count, 0], rows[count, 1] = begin + at, mine
                    rows[count, 2], rows[count, 3] = since[at], until[at]
                    count += 1
    return rows[:count]


@njit(cache=True)  # type: ignore[untyped-decorator]
def _by_cell(rows: NDArray[np.int32], cells: int) -> tuple[IntArray, NDArray[np.int32]]:
    """Where the runs of each cell begin, and the end, shape (cells + 1,); the runs in that order."""
    start = np.zeros(cells + 1, dtype=np.int64)
    for k in range(len(rows)):
        start[rows[k, 0] + 1] += 1
    for cell in range(cells):
        start[cell + 1] += start[cell]
    fill, ordered = start[:-1].copy(), np.empty_like(rows)
    for k in range(len(rows)):
        ordered[fill[rows[k, 0]]] = rows[k]
        fill[rows[k, 0]] += 1
    return start, ordered
