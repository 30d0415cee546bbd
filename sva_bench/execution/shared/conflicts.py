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
_FAR_M = 1.0  # a way that is farther than this beyond the gap is not looked at again for as long as it must be


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
    steps = np.hypot(*np.diff(strips.place_m, axis=0, append=strips.place_m[-1:]).T)
    ways = len(strips.robot)
    step = np.array([max(steps[strips.first[k]:strips.first[k + 1] - 1].max(initial=0.0), CELL_M) * (1 + 1e-9)
                     for k in range(ways)])
    near, early = _gaps(itineraries, gap_m)
    first_leg = np.zeros(ways, dtype=np.bool_)
    for number in range(len(itineraries)):
        first_leg[strips.leg[strips.legs[number]]:strips.leg[strips.legs[number] + 1]] = True
    found = _find_runs(strips.robot, strips.first, strips.place_m, step, first_leg, near, early)
    cell, way, low, high = np.ascontiguousarray(found.T)
    order = np.argsort(cell, kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=len(strips.place_m)))])
    return Runs(start=start, way=way[order], low=low[order], high=high[order])


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
def _noted(rows: NDArray[np.int32], count: int, cell: int, way: int, low: int, high: int) -> NDArray[np.int32]:
    """The rows with one more."""
    if count == len(rows):
        more = np.empty((2 * len(rows), rows.shape[1]), dtype=np.int32)
        more[:len(rows)] = rows
        rows = more
    rows[count, 0], rows[count, 1], rows[count, 2], rows[count, 3] = cell, way, low, high
    return rows


@njit(cache=True)  # type: ignore[untyped-decorator]
def _first_within(place: FloatArray, x: float, y: float, begin: int, end: int, step: float, within: float) -> int:
    """The first of some cells of a way that is nearer to a point; ``end`` if none is."""
    b = begin
    while b < end:
        distance = math.hypot(place[b, 0] - x, place[b, 1] - y)
        if distance < within:
            return b
        b += max(int((distance - within) / step), 1)
    return end


@njit(cache=True)  # type: ignore[untyped-decorator]
def _find_runs(
    robot: IntArray, first: IntArray, place: FloatArray, step: FloatArray, first_leg: BoolArray, near: FloatArray,
    early: FloatArray,
) -> NDArray[np.int32]:
    """Cell, way, first and last cell of each run, shape (runs, 4).

    Neighbouring cells of a way are at most ``step`` apart: at a distance from it that differs from the one asked for
    by d, the next d / step cells need not be looked at.
    """
    rows, count = np.empty((4096, 4), dtype=np.int32), 0
    for mine in range(len(robot)):
        for other in range(len(robot)):
            i, j = robot[mine], robot[other]
            if i == j:
                continue
            begin, end = first[other], first[other + 1]
            from_rest = first_leg[mine] and first_leg[other] and early[i, j] < near[i, j]
            a = first[mine]
            while a < first[mine + 1]:
                x, y = place[a, 0], place[a, 1]
                b = _first_within(place, x, y, begin, end, step[other], near[i, j] + _FAR_M)
                if b == end:
                    a += max(int(_FAR_M / step[mine]), 1)
                    continue
                starts = from_rest and a - first[mine] < _START_CELLS
                low = -1
                while b < end:
                    distance = math.hypot(place[b, 0] - x, place[b, 1] - y)
                    slow = starts and b - begin < _START_CELLS
                    within = early[i, j] if slow else near[i, j]
                    if distance < within and not (slow and a == first[mine] and b == begin):
                        low = b if low < 0 else low
                    elif low >= 0:
                        rows = _noted(rows, count, a, other, low, b - 1)
                        count, low = count + 1, -1
                    b += 1 if slow else max(int(abs(distance - within) / step[other]), 1)
                if low >= 0:
                    rows = _noted(rows, count, a, other, low, end - 1)
                    count += 1
                a += 1
    return rows[:count]
