"""Gates, holds and the brake: where a robot has to stop for now, and for whom it waits. Compiled."""

from __future__ import annotations

import math

from numba import njit

from sva_bench.execution.shared.lanes import CELL_M
from sva_bench.execution.shared.state import (
    BRAKED,
    BRAKING,
    CAUSE,
    HOPS_S,
    LAST_S,
    LASTS,
    SINCE_S,
    WAIT_X,
    WAIT_Y,
    State,
)
from sva_bench.execution.shared.ways import Ways
from sva_bench.robot.follower import BEFORE_LINE_M, CONTROL_HZ, NO_LINE

_DT = 1.0 / CONTROL_HZ
_ONE_WAIT_S = 0.5  # driving between two waits for the same reason, up to which they are one
_FAR_M = 2.0  # beyond what a line has an influence on


@njit(cache=True)  # type: ignore[untyped-decorator]
def _blocker(ways: Ways, state: State, i: int) -> int:
    """For whom a robot's first closed cell is closed; -1 = all its cells are open. Moves ``open_to`` up to it."""
    row = ways.need_row[i]
    while state.open_to[i] < ways.cells[i]:
        for j in range(len(state.cell)):
            if state.cell[j] < ways.need[row + state.open_to[i], j] and not state.dropped[j]:
                return j
        state.open_to[i] += 1
    return -1


@njit(cache=True)  # type: ignore[untyped-decorator]
def gated(ways: Ways, state: State, i: int, cell: int) -> int:
    """For whom a robot must not enter a cell of its lane yet; -1 = it may."""
    j = _blocker(ways, state, i)
    return j if j >= 0 and state.open_to[i] <= cell else -1


@njit(cache=True)  # type: ignore[untyped-decorator]
def line_of(ways: Ways, state: State, i: int) -> tuple[float, int]:
    """Stop line of a robot for its follower, and what for.

    Returns:
        Arc length on its stretch, less the way for which commands are under way [m]; the robot, ``BRAKED``, or the hold
        (from -2 down).
    """
    if state.team[BRAKING]:
        return -math.inf, BRAKED
    line, leg, cause = NO_LINE, state.leg[i], _blocker(ways, state, i)
    if cause >= 0 and state.open_to[i] < ways.leg_cell[i, leg + 1]:
        line = (state.open_to[i] - ways.leg_cell[i, leg]) * CELL_M
    if state.hold[i] < state.hold_count[i]:
        # It stands where the hold is, not before it.
        held = state.holds[i, state.hold[i], 0] + BEFORE_LINE_M
        if held < line:
            line, cause = held, -2 - state.hold[i]
    if line == NO_LINE:
        return line, cause
    line -= ways.before_m[state.stretch[i]]
    if line - state.follow[i, 1] < _FAR_M:
        for k in range(state.queue.shape[1]):
            line -= state.queue[i, k, 0] * _DT
    return line, cause


@njit(cache=True)  # type: ignore[untyped-decorator]
def wait(state: State, i: int, cause: int, steps: int) -> None:
    """Note that a robot waits for some control steps."""
    driven_s = state.clock_s[i, HOPS_S] + state.steps[i] * _DT
    state.waited[i] += steps
    last = state.wait_count[i] - 1
    if last < 0 or state.waits[i, last, CAUSE] != cause or driven_s - state.waits[i, last, LAST_S] > _ONE_WAIT_S:
        last += 1
        state.wait_count[i] = last + 1
        entry = state.waits[i, last]
        entry[CAUSE], entry[SINCE_S], entry[LASTS] = cause, driven_s, 0.0
        entry[WAIT_X], entry[WAIT_Y] = state.pose[i, 0], state.pose[i, 1]
    state.waits[i, last, LASTS] += steps
    state.waits[i, last, LAST_S] = driven_s
