"""Where the lanes of a team cross: groups of cells in conflict, each of which one of two robots passes first.

Two pairs of cells in conflict that lie side by side are passed in one order: who has left a cell before the other
enters one in conflict with it is before the other in the neighbouring cells too. So an order of a team is one choice
for each group, and what every robot must wait for follows from the choices.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sva_bench.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Crossings:
    """The groups of a team, and how long its robots take.

    Attributes:
        first: Number of each robot's first cell, all lanes one behind the other, and of all; shape (robots + 1,).
        stay_s: Shortest stay in each cell, stops included [s]; ``inf`` = for good; shape (cells,).
        pair: The two robots of each group, the lower number first, groups sorted by it; shape (groups, 2).
        start: First row of each group, and the end; shape (groups + 1,).
        waits: Which of the pair waits in each row, 0 or 1, if it passes the group second; shape (rows,).
        cell: The cell of its lane that it may not enter, shape (rows,),
        beyond: before the other has entered this one of its own, shape (rows,).
        second: Which of the pair passes each group second, as planned: 0 or 1; shape (groups,).
    """

    first: IntArray
    stay_s: FloatArray
    pair: IntArray
    start: IntArray
    waits: IntArray
    cell: IntArray
    beyond: IntArray
    second: IntArray

    def __len__(self) -> int:
        """Number of groups."""
        return len(self.pair)

    @cached_property
    def begins(self) -> IntArray:
        """First cell of each group in the lane of either robot, shape (groups, 2)."""
        begins = np.full((len(self), 2), np.iinfo(np.int64).max)
        group = np.repeat(np.arange(len(self)), np.diff(self.start))
        np.minimum.at(begins, (group, self.waits), self.cell)
        return begins

    def needs(self, second: IntArray) -> IntArray:
        """The cell that each robot must have entered before a cell may be entered, shape (cells, robots).

        Args:
            second: Which of the pair passes each group second, shape (groups,).
        """
        needs = np.zeros((len(self.stay_s), len(self.first) - 1), dtype=np.int64)
        for group in np.flatnonzero(np.r_[True, (np.diff(self.pair, axis=0) != 0).any(axis=1)][:len(self)]).tolist():
            set_needs(group, self.first, self.pair, self.start, self.waits, self.cell, self.beyond, second, needs)
        return needs

    def by_lane(self, needs: IntArray) -> tuple[tuple[IntArray, ...], ...]:
        """``needs`` as of ``Order``."""
        return tuple(tuple(np.ascontiguousarray(needs[begin:end].T)) for begin, end in zip(
            self.first[:-1], self.first[1:], strict=True))


@njit(cache=True)  # type: ignore[untyped-decorator]
def set_needs(
    group: int, first: IntArray, pair: IntArray, start: IntArray, waits: IntArray, cell: IntArray, beyond: IntArray,
    second: IntArray, needs: IntArray,
) -> None:
    """Fill in what the two robots of a group need of each other.

    Args:
        group: One of their groups.
        first, pair, start, waits, cell, beyond: ``Crossings``.
        second: Which of the pair passes each group second.
        needs: Shape (cells, robots); changed in place.
    """
    i, j = pair[group, 0], pair[group, 1]
    needs[first[i]:first[i + 1], j] = 0
    needs[first[j]:first[j + 1], i] = 0
    while group > 0 and pair[group - 1, 0] == i and pair[group - 1, 1] == j:
        group -= 1
    while group < len(pair) and pair[group, 0] == i and pair[group, 1] == j:
        mine, other = (i, j) if second[group] == 0 else (j, i)
        for row in range(start[group], start[group + 1]):
            if waits[row] == second[group]:
                at = first[mine] + cell[row]
                needs[at, other] = max(needs[at, other], beyond[row])
        group += 1
    for at in range(first[i] + 1, first[i + 1]):
        needs[at, j] = max(needs[at, j], needs[at - 1, j])
    for at in range(first[j] + 1, first[j + 1]):
        needs[at, i] = max(needs[at, i], needs[at - 1, i])


@njit(cache=True)  # type: ignore[untyped-decorator]
def foresee(
    first: IntArray, stay_s: FloatArray, needs: IntArray, at: IntArray, free_s: FloatArray, gone: BoolArray,
    spare_s: float, enter_s: FloatArray,
) -> float:
    """When robots enter their cells if each drives as soon as it may.

    What a gate waits for is progress of others alone, so it makes no difference who is moved first: if anybody can come
    to the end of its lane at all, it does here.

    Args:
        first, stay_s: ``Crossings``.
        needs: What each cell needs, shape (cells, robots).
        at: The cell that each robot is in, shape (robots,).
        free_s: When each may leave it at the earliest [s].
        gone: Robots that nobody waits for, and which don't move.
        spare_s: From when one robot leaves a cell until another enters one in conflict with it [s].
        enter_s: When each cell ahead is entered [s], shape (cells,); filled in, ``inf`` beyond a circle.

    Returns:
        The sum of when robots' last stays end [s]; ``inf`` if some robots wait for each other in a circle.
    """
    robots = len(first) - 1
    here, clock, moved = at.copy(), free_s.copy(), True
    for i in range(robots):
        enter_s[first[i] + at[i] + 1:first[i + 1]] = math.inf
    while moved:
        moved = False
        for i in range(robots):
            if gone[i]:
                continue
            while first[i] + here[i] + 1 < first[i + 1]:
                ahead, time, shut = first[i] + here[i] + 1, clock[i], False
                for j in range(robots):
                    if gone[j] or needs[ahead, j] <= at[j]:
                        continue
                    if needs[ahead, j] > here[j]:
                        shut = True
                        break
                    time = max(time, enter_s[first[j] + needs[ahead, j]] + spare_s)
                if shut:
                    break
                enter_s[ahead], clock[i] = time, time + stay_s[ahead]
                here[i] += 1
                moved = True
    total = 0.0
    for i in range(robots):
        if not gone[i] and stay_s[first[i + 1] - 1] < math.inf:
            total += clock[i] if here[i] == first[i + 1] - first[i] - 1 else math.inf
    return total


def crossings_of(
    cells: Sequence[IntArray], robot_of: IntArray, lasts_s: FloatArray, start: IntArray, way: NDArray[np.int32],
    low: NDArray[np.int32], high: NDArray[np.int32], chosen: BoolArray, enter_s: FloatArray,
) -> Crossings:
    """The groups of the lanes of a plan.

    Args:
        cells: Cells of each robot's lane, by their numbers among all ways.
        robot_of: Robot of each way.
        lasts_s: Shortest stay in each cell of all ways [s].
        start, way, low, high: ``Runs``.
        chosen: Which ways are driven.
        enter_s: When each cell is entered as planned [s].
    """
    number = np.zeros(len(lasts_s), dtype=np.int64)
    for mine in cells:
        number[mine] = np.arange(len(mine))
    rows = np.concatenate([np.empty((0, 6), dtype=np.int64), *(
        _runs_with_later(robot, mine, number, robot_of, start, way, low, high, chosen, enter_s)
        for robot, mine in enumerate(cells))])
    rows = rows[np.lexsort((rows[:, 3], rows[:, 2], rows[:, 1], rows[:, 0]))]
    group = _grouped(rows)
    pair, begins, waits, cell, beyond, second = _rows_of(rows, group)
    return Crossings(first=np.cumsum([0, *(len(mine) for mine in cells)]), stay_s=lasts_s[np.concatenate(cells)],
                     pair=pair, start=begins, waits=waits, cell=cell, beyond=beyond, second=second)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _runs_with_later(
    robot: int, mine: IntArray, number: IntArray, robot_of: IntArray, start: IntArray, way: NDArray[np.int32],
    low: NDArray[np.int32], high: NDArray[np.int32], chosen: BoolArray, enter_s: FloatArray,
) -> IntArray:
    """Runs of robots of higher numbers: both robots, cell, first and last cell, who is second; shape (runs, 6)."""
    count = 0
    for a in mine:
        count += start[a + 1] - start[a]
    rows, count = np.empty((count, 6), dtype=np.int64), 0
    for a in mine:
        for run in range(start[a], start[a + 1]):
            if chosen[way[run]] and robot_of[way[run]] > robot:
                rows[count, 0], rows[count, 1], rows[count, 2] = robot, robot_of[way[run]], number[a]
                rows[count, 3], rows[count, 4] = number[low[run]], number[high[run]]
                # A run lies wholly before this robot's stay in the cell, or wholly after it.
                rows[count, 5] = 0 if enter_s[low[run]] < enter_s[a] else 1
                count += 1
    return rows[:count]


@njit(cache=True)  # type: ignore[untyped-decorator]
def _grouped(rows: IntArray) -> IntArray:
    """The group of each run, numbered in the order of their first runs: runs side by side are of one."""
    root = np.arange(len(rows))
    since = 0
    for k in range(len(rows)):
        while rows[since, 0] != rows[k, 0] or rows[since, 1] != rows[k, 1] or rows[since, 2] < rows[k, 2] - 1:
            since += 1
        for other in range(since, k):
            if rows[other, 3] <= rows[k, 4] + 1 and rows[k, 3] <= rows[other, 4] + 1:
                low, high = other, k
                while root[low] != low:
                    low = root[low]
                while root[high] != high:
                    high = root[high]
                root[max(low, high)] = min(low, high)
    group, count = np.empty(len(rows), dtype=np.int64), 0
    for k in range(len(rows)):
        if root[k] == k:
            group[k] = count
            count += 1
        else:
            group[k] = group[root[k]]  # of a run before it
    return group


@njit(cache=True)  # type: ignore[untyped-decorator]
def _rows_of(rows: IntArray, group: IntArray) -> tuple[IntArray, IntArray, IntArray, IntArray, IntArray, IntArray]:
    """The arrays of ``Crossings`` from ``pair`` on."""
    groups = 0 if len(group) == 0 else group.max() + 1
    pair, second = np.empty((groups, 2), dtype=np.int64), np.empty(groups, dtype=np.int64)
    least, most = np.full(groups, 2**62), np.full(groups, -1)
    begins = np.zeros(groups + 1, dtype=np.int64)
    for k in range(len(rows)):
        g = group[k]
        pair[g, 0], pair[g, 1], second[g] = rows[k, 0], rows[k, 1], rows[k, 5]
        least[g], most[g] = min(least[g], rows[k, 3]), max(most[g], rows[k, 4])
        begins[g + 1] += 1
    for g in range(groups):
        begins[g + 1] += begins[g] + most[g] - least[g] + 1
    fill = begins[:-1].copy()
    waits, cell = np.empty(begins[-1], dtype=np.int64), np.empty(begins[-1], dtype=np.int64)
    beyond = np.zeros(begins[-1], dtype=np.int64)
    for g in range(groups):
        for b in range(least[g], most[g] + 1):
            waits[fill[g]], cell[fill[g]] = 1, b
            fill[g] += 1
    for k in range(len(rows)):
        g = group[k]
        waits[fill[g]], cell[fill[g]], beyond[fill[g]] = 0, rows[k, 2], rows[k, 4] + 1
        fill[g] += 1
        for b in range(rows[k, 3], rows[k, 4] + 1):
            row = begins[g] + b - least[g]
            beyond[row] = max(beyond[row], rows[k, 2] + 1)
    return pair, begins, waits, cell, beyond, second
