"""Gates, holds and the brake: where a robot has to stop for now, and for whom it waits. Compiled."""

from __future__ import annotations

import math

from numba import njit

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.execution.shared.lanes import CELL_M
from sva_bench.execution.shared.state import (
    BRAKED,
    CAUSE,
    LAST_S,
    LASTS,
    SINCE_S,
    WAIT_X,
    WAIT_Y,
    Records,
    Robot,
    Team,
)
from sva_bench.robot.follower import BEFORE_LINE_M, CONTROL_HZ, NO_LINE

_DT = 1.0 / CONTROL_HZ
_ONE_WAIT_S = 0.5  # driving between two waits for the same reason, up to which they are one
_FAR_M = 2.0  # beyond what a line has an influence on


@njit(cache=True)  # type: ignore[untyped-decorator]
def blocker(robots: Records, robot: Robot, need: IntArray) -> int:
    """For whom a robot's first closed cell is closed; -1 = all its cells are open. Moves ``open_to`` up to it."""
    while robot.open_to < robot.cells:
        row = robot.need_row + robot.open_to
        for j in range(len(robots)):
            if robots[j].cell < need[row, j] and not robots[j].dropped:
                return j
        robot.open_to += 1
    return -1


@njit(cache=True)  # type: ignore[untyped-decorator]
def line_of(robot: Robot, team: Team, before_m: float, cause: int, hold_m: float) -> tuple[float, int]:
    """Stop line of a robot for its follower, and what for.

    Args:
        robot, team: Their records.
        before_m: Way of its leg before its stretch [m].
        cause: For whom its first closed cell is closed, as of ``blocker``.
        hold_m: Where on its leg its next hold is [m]; ``NO_LINE`` = it has none.

    Returns:
        Arc length on its stretch, less the way for which commands are under way [m]; the robot, ``BRAKED``, or the hold
        (from -2 down).
    """
    if team.braking:
        return -math.inf, BRAKED
    line = NO_LINE
    if cause >= 0 and robot.open_to < robot.end_cell:
        line = (robot.open_to - robot.first_cell) * CELL_M
    if hold_m + BEFORE_LINE_M < line:  # it stands where the hold is, not before it
        line, cause = hold_m + BEFORE_LINE_M, -2 - robot.hold
    if line == NO_LINE:
        return line, cause
    line -= before_m
    if line - robot.follow[1] < _FAR_M:
        for k in range(robot.delay):
            line -= robot.queue[k, 0] * _DT
    return line, cause


@njit(cache=True)  # type: ignore[untyped-decorator]
def wait(robot: Robot, waits: FloatArray, cause: int, steps: int) -> None:
    """Note that a robot waits for some control steps.

    Args:
        robot: Its record.
        waits: Its waits, shape (waits, 6).
        cause: What for, as of ``line_of``.
        steps: For how long.
    """
    driven_s = robot.hops_s + robot.steps * _DT
    robot.waited += steps
    if cause >= 0:
        robot.asked += steps
    last = robot.wait_count - 1
    if last < 0 or waits[last, CAUSE] != cause or driven_s - waits[last, LAST_S] > _ONE_WAIT_S:
        last += 1
        robot.wait_count = last + 1
        waits[last, CAUSE], waits[last, SINCE_S], waits[last, LASTS] = cause, driven_s, 0.0
        waits[last, WAIT_X], waits[last, WAIT_Y] = robot.pose[0], robot.pose[1]
    waits[last, LASTS] += steps
    waits[last, LAST_S] = driven_s
