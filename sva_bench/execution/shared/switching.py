"""An order that may switch: who waits for one that is late passes before it, where that is safe and saves time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.execution.shared.crossings import Crossings, foresee, set_needs
from sva_bench.execution.shared.flips import TOGETHER, turn
from sva_bench.execution.shared.lanes import CELL_M

ASK_S = 1.0
"""Time that a robot has waited for others when it asks, and asks again, whether it may go first [s]."""
_SAVES_S = 1.0  # what a switch must save of the team's time: less is within what is foreseen wrongly


class Standing(NamedTuple):
    """Where a robot is on its lane.

    Attributes:
        cell: Its cell.
        free_s: When nothing holds it there any more but its way and gates [s].
        drives: Whether it is on a leg; else it stands at a stop.
        stops_m: How far it drives yet if it brakes [m].
    """

    cell: int
    free_s: float
    drives: bool
    stops_m: float


class Switching:
    """The order of a team in motion.

    A group of cells is given to the other of two robots only while neither is in it, the one that was to be first can
    still brake before it, and under the new order all come to the ends of their lanes.

    Args:
        crossings: The groups, with the planned order.
        robots: Numbers of the robots that have it, in their team.
    """

    def __init__(self, crossings: Crossings, robots: Sequence[int]) -> None:
        self._crossings, self._robots = crossings, tuple(robots)
        self._second, self._needs = crossings.second.copy(), crossings.needs(crossings.second)
        self._foreseen = np.full(len(crossings.stay_s), -math.inf)

    def ask(self, robot: int, standing: Callable[[int], Standing], down: Sequence[bool]) -> tuple[int, ...]:
        """Let a robot that waits at its gate pass first where that is safe and saves time.

        Args:
            robot: Its number.
            standing: Where a robot of the team is.
            down: Whether each robot of the team stands for good.

        Returns:
            The robots whose gates are others now: none, or the two.
        """
        if robot not in self._robots:
            return ()
        lanes, mine = self._crossings, self._robots.index(robot)
        where = [standing(number) for number in self._robots]
        # One that is home stands in the last cell of a lane that it had before.
        at = np.minimum([own.cell for own in where], np.diff(lanes.first) - 1)
        committed = at + np.array([own.drives + math.ceil(own.stops_m / CELL_M) for own in where])
        stay_s = lanes.stay_s[lanes.first[:-1] + at]
        free_s = np.array([own.free_s + own.drives * stay for own, stay in zip(where, stay_s.tolist(), strict=True)])
        other = _switch(mine, lanes.first, lanes.stay_s, lanes.pair, lanes.start, lanes.waits, lanes.cell, lanes.beyond,
                        lanes.begins, self._second, self._needs, at, committed, free_s,
                        np.array([down[number] for number in self._robots]), self._foreseen)
        return () if other < 0 else (robot, self._robots[other])

    def needs(self, robot: int, team: int) -> list[IntArray]:
        """What a robot needs of each of a team of so many, as of ``Order``."""
        lanes, mine = self._crossings, self._robots.index(robot)
        rows = self._needs[lanes.first[mine]:lanes.first[mine + 1]]
        nothing = np.zeros(len(rows), dtype=np.int64)
        place = {number: k for k, number in enumerate(self._robots)}
        return [rows[:, place[number]] if number in place else nothing for number in range(team)]


@njit(cache=True)  # type: ignore[untyped-decorator]
def _switch(
    mine: int, first: IntArray, stay_s: FloatArray, pair: IntArray, start: IntArray, waits: IntArray, cell: IntArray,
    beyond: IntArray, begins: IntArray, second: IntArray, needs: IntArray, at: IntArray, committed: IntArray,
    free_s: FloatArray, gone: BoolArray, enter_s: FloatArray,
) -> int:
    """Give a robot the groups that it waits for, if that pays: of whom, or -1. Changes ``second`` and ``needs``.

    Args:
        mine: The robot.
        first, stay_s, pair, start, waits, cell, beyond, begins: ``Crossings``.
        second: Which of the pair passes each group second, shape (groups,).
        needs, at, free_s, gone, enter_s: As of ``foresee``.
        committed: The cell before which each robot can't stop any more, shape (robots,).
    """
    closed = first[mine] + at[mine] + 1
    while closed < first[mine + 1]:
        shut = False
        for j in range(len(at)):
            shut = shut or (not gone[j] and needs[closed, j] > at[j])
        if shut:
            break
        closed += 1
    if closed == first[mine + 1]:
        return -1
    best = foresee(first, stay_s, needs, at, free_s, gone, 0.0, enter_s) - _SAVES_S
    best_group, best_count, kept = -1, 0, second.copy()
    for group in range(len(pair)):
        if pair[group, second[group]] != mine:
            continue
        other, binds = pair[group, 1 - second[group]], False
        if gone[other] or needs[closed, other] <= at[other]:
            continue
        for row in range(start[group], start[group + 1]):
            binds = binds or (waits[row] == second[group] and first[mine] + cell[row] == closed
                              and beyond[row] > at[other])
        if not binds:
            continue
        for count in range(1, TOGETHER + 2):
            if not turn(group, count, pair, begins, committed, second):
                second[:] = kept
                break
            set_needs(group, first, pair, start, waits, cell, beyond, second, needs)
            found = foresee(first, stay_s, needs, at, free_s, gone, 0.0, enter_s)
            if found < best:
                best, best_group, best_count = found, group, count
            second[:] = kept
        set_needs(group, first, pair, start, waits, cell, beyond, second, needs)
    if best_group < 0:
        return -1
    other = pair[best_group, 1 - second[best_group]]
    turn(best_group, best_count, pair, begins, committed, second)
    set_needs(best_group, first, pair, start, waits, cell, beyond, second, needs)
    return int(other)
