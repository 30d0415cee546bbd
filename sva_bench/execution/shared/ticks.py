"""One control step of a team, compiled: commands to all, and a look at what came of them.

The kinematic twin and physics run the same code and differ in what moves the robots between the two.
"""

from __future__ import annotations

import math

from numba import njit

from sva_bench.arrays import FloatArray
from sva_bench.execution.following import STUCK_DRIVING, STUCK_STEPS, is_stuck
from sva_bench.execution.shared.gates import gated, line_of, wait
from sva_bench.execution.shared.lanes import cell_at
from sva_bench.execution.shared.state import (
    BRAKED,
    BRAKING,
    CAUSE,
    CHECKED,
    DRAINS,
    DRIVES,
    DRIVING_S,
    FUEL_S,
    HOPS_S,
    IDLE,
    NOW,
    READY,
    READY_S,
    STANDS,
    TRACED,
    Figures,
    State,
)
from sva_bench.execution.shared.ways import ENDS_LEG, GOES_ON, Ways
from sva_bench.robot.disturbance import error_at
from sva_bench.robot.follower import ARRIVED, CONTROL_HZ, DRIVE, braked, control, wrap
from sva_bench.robot.twin import advance, delayed

GO, EVENT, TOUCH, REST, NOBODY, DEADLOCK, FULL = 0, 1, 2, 3, 4, 5, 6
"""Why compiled code comes back: not at all; something happened to a robot, to a pair; all rest that brake; nobody has
anything to do; robots wait for each other; waits or poses need more room."""
HAS_ARRIVED, HAS_ENDED, IS_STUCK = 1, 2, 3
"""What happens to a robot."""

_DT = 1.0 / CONTROL_HZ
_SAME_S = 1e-9  # rounding of clocks
_KEPT_STEPS = 3  # from one kept pose to the next: 20 Hz
_FREE_M = 0.01  # between hulls that touched, from which on they may touch again


@njit(cache=True)  # type: ignore[untyped-decorator]
def command_all(ways: Ways, figures: Figures, state: State, parts: FloatArray) -> int:
    """Give each robot its command of this control step, and pass over time in which nobody moves.

    Args:
        ways, figures, state: The team; ``state`` is changed in place.
        parts: Room for ``error_at``.

    Returns:
        ``GO`` if the robots are to be moved, else why not.
    """
    n, team = len(state.doing), state.team
    while True:
        happened, busy, still = False, False, True
        for i in range(n):
            if state.wait_count[i] > state.waits.shape[1] - 4 or (
                    team[TRACED] and state.pose_count[i] >= state.poses.shape[1] - 1):
                return FULL
        for i in range(n):
            if not state.commanded[i]:
                _command(ways, figures, state, parts, i)
                state.commanded[i] = state.event[i] == 0
            happened = happened or state.event[i] != 0
            busy = busy or state.doing[i] != STANDS
            still = still and state.at_rest[i]
        if happened:
            return EVENT
        if not busy:
            return NOBODY
        if not still:
            return GO
        if team[BRAKING]:
            return REST
        steps = _steps_to_wait(state)
        if steps < 0:
            return DEADLOCK
        _pass_over(state, steps)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _command(ways: Ways, figures: Figures, state: State, parts: FloatArray, i: int) -> None:
    """Set a robot's wheels for this control step, or say that its leg is over."""
    state.wheels[i, 0] = state.wheels[i, 1] = 0.0
    state.at_rest[i] = True
    if state.doing[i] == STANDS:
        return
    if state.doing[i] == READY:
        clock_s = state.clock_s[i]
        if clock_s[READY_S] > state.team[NOW] * _DT + _SAME_S:
            return
        cause = gated(ways, state, i, ways.leg_cell[i, state.leg[i]])
        if state.team[BRAKING] or cause >= 0:
            if not _spent(state, i):
                wait(state, i, BRAKED if state.team[BRAKING] else cause, 1)
            return
        state.doing[i] = DRIVES
        state.cell[i] = ways.leg_cell[i, state.leg[i]]
    if state.doing[i] == DRAINS:
        if state.drained[i] < figures.delay[i]:
            _drain(figures, state, i)
            return
        state.doing[i] = DRIVES
        if _hop_over(ways, state, i):
            return
    _drive(ways, figures, state, parts, i)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _drive(ways: Ways, figures: Figures, state: State, parts: FloatArray, i: int) -> None:
    """Command a robot on its way, over the ends of stretches, which take no time."""
    x, y, yaw = state.pose[i, 0], state.pose[i, 1], state.pose[i, 2]
    if figures.waves.shape[2] > 0:
        ex, ey, eyaw = error_at(figures.waves[i], parts, x, y)
        x, y, yaw = x + ex, y + ey, yaw + eyaw
    follow, limits = state.follow[i], figures.limits[i]
    while True:
        k = state.stretch[i]
        if state.taken[i] >= ways.patience[k]:
            stop(state, i, IS_STUCK)
            return
        first, end = ways.vertex[k], ways.vertex[k + 1]
        line, cause = line_of(ways, state, i)
        if state.team[BRAKING] and follow[0] != DRIVE:
            braked(limits, follow, _DT)
        else:
            control(ways.path[first:end], ways.arc[first:end], ways.heading[k], limits, follow, x, y, yaw, _DT, line)
        _enter(ways, state, i, ways.before_m[k] + follow[1])
        if follow[0] == ARRIVED:
            if ways.ends[k] == ENDS_LEG and state.hold[i] < state.hold_count[i]:
                follow[4] = 1.0
                cause = -2 - state.hold[i]
            else:
                if ways.ends[k] != GOES_ON and figures.delay[i] > 0:
                    state.doing[i], state.drained[i] = DRAINS, 0
                    _drain(figures, state, i)
                    return
                if ways.ends[k] == GOES_ON:
                    _next_stretch(state, i)
                elif _hop_over(ways, state, i):
                    return
                continue
        if _spent(state, i):
            return
        if follow[4] == 1.0:
            if cause <= -2 and follow[2] == 0.0:
                if state.hold_left[i] < 0:
                    state.hold_left[i] = int(state.holds[i, state.hold[i], 1])
                if state.hold_left[i] == 0:
                    state.hold[i], state.hold_left[i] = state.hold[i] + 1, -1
                    continue
                state.hold_left[i] -= 1
            wait(state, i, cause, 1)
        else:
            state.taken[i] += 1
            state.steps[i] += 1
            state.checked[i, 2] += follow[0] == DRIVE
        break
    _obey(figures, state, i, follow[2], follow[3], follow[4] == 1.0)
    if state.team[CHECKED] and follow[4] == 0.0 and state.taken[i] % STUCK_STEPS == 0:
        _check(state, i, yaw)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _drain(figures: Figures, state: State, i: int) -> None:
    """Let a robot at a stop obey one of the commands that are still under way."""
    if not _spent(state, i):
        state.drained[i] += 1
        state.steps[i] += 1
        _obey(figures, state, i, 0.0, 0.0, False)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _obey(figures: Figures, state: State, i: int, speed: float, rate: float, held: bool) -> None:
    """Set a robot's wheels to the command that is due, and put one behind those under way."""
    delay, rests = figures.delay[i], held and speed == 0.0 and rate == 0.0
    if delay > 0:
        speed, rate = delayed(state.queue[i, :delay], speed, rate)
        for k in range(delay):
            rests = rests and state.queue[i, k, 0] == 0.0 and state.queue[i, k, 1] == 0.0
    state.at_rest[i] = rests and speed == 0.0 and rate == 0.0
    turning = 0.5 * figures.track[i] * rate
    state.wheels[i, 0], state.wheels[i, 1] = speed - turning, speed + turning


@njit(cache=True)  # type: ignore[untyped-decorator]
def _spent(state: State, i: int) -> bool:
    """Stop a robot for good if its driving time or its fuel is used up; whether it is."""
    clock_s = state.clock_s[i]
    driven_s = clock_s[HOPS_S] + state.steps[i] * _DT
    if driven_s >= clock_s[DRIVING_S] or driven_s + clock_s[IDLE] * state.waited[i] * _DT >= clock_s[FUEL_S]:
        stop(state, i, HAS_ENDED)
        return True
    return False


@njit(cache=True)  # type: ignore[untyped-decorator]
def stop(state: State, i: int, event: int) -> None:
    """Let a robot stand where it is."""
    state.doing[i], state.event[i], state.at_rest[i] = STANDS, event, True
    state.queue[i] = 0.0
    state.wheels[i] = 0.0
    state.follow[i, 2] = state.follow[i, 3] = 0.0


@njit(cache=True)  # type: ignore[untyped-decorator]
def _hop_over(ways: Ways, state: State, i: int) -> bool:
    """End a robot's hop; whether its leg is over with it."""
    clock_s = state.clock_s[i]
    clock_s[HOPS_S] += state.steps[i] * _DT
    state.steps[i] = 0
    if ways.ends[state.stretch[i]] != ENDS_LEG:
        _next_stretch(state, i)
        return False
    state.cell[i] = ways.leg_cell[i, state.leg[i] + 1] - 1
    too_late = (clock_s[HOPS_S] > clock_s[DRIVING_S]
                or clock_s[HOPS_S] + clock_s[IDLE] * state.waited[i] * _DT > clock_s[FUEL_S])
    stop(state, i, HAS_ENDED if too_late else HAS_ARRIVED)
    return True


@njit(cache=True)  # type: ignore[untyped-decorator]
def _next_stretch(state: State, i: int) -> None:
    begin_stretch(state, i, state.stretch[i] + 1)


@njit(cache=True)  # type: ignore[untyped-decorator]
def begin_stretch(state: State, i: int, stretch: int) -> None:
    """Put a robot at the start of a stretch."""
    state.stretch[i], state.taken[i] = stretch, 0
    state.follow[i] = 0.0
    state.checked[i, 0], state.checked[i, 1], state.checked[i, 2] = 0.0, state.pose[i, 2], 0.0


@njit(cache=True)  # type: ignore[untyped-decorator]
def _enter(ways: Ways, state: State, i: int, arc_m: float) -> None:
    """Note the cell that a robot is in, by how far it is on its leg."""
    first, end = ways.leg_cell[i, state.leg[i]], ways.leg_cell[i, state.leg[i] + 1]
    state.cell[i] = max(state.cell[i], first + cell_at(arc_m, end - first))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _check(state: State, i: int, yaw: float) -> None:
    """Stop a robot that has hardly moved since the last check."""
    progress_m = state.follow[i, 1] - state.checked[i, 0]
    turned_rad = wrap(yaw - state.checked[i, 1])
    on_the_way = state.follow[i, 0] == DRIVE and state.checked[i, 2] >= STUCK_DRIVING * STUCK_STEPS
    if is_stuck(progress_m, turned_rad, on_the_way):
        stop(state, i, IS_STUCK)
    state.checked[i, 0], state.checked[i, 1], state.checked[i, 2] = state.follow[i, 1], yaw, 0.0


@njit(cache=True)  # type: ignore[untyped-decorator]
def _steps_to_wait(state: State) -> int:
    """Control steps until something changes though nobody moves; -1 = never."""
    now, least = state.team[NOW], -1
    for i in range(len(state.doing)):
        clock_s, steps = state.clock_s[i], -1
        if state.doing[i] == STANDS:
            continue
        if state.doing[i] == READY and clock_s[READY_S] > now * _DT + _SAME_S:
            steps = math.ceil((clock_s[READY_S] - _SAME_S) * CONTROL_HZ) - now
        elif state.hold_left[i] >= 0:
            steps = state.hold_left[i] + 1
        if clock_s[IDLE] > 0.0 and clock_s[FUEL_S] < math.inf and (state.doing[i] == DRIVES or steps < 0):
            spent_s = clock_s[HOPS_S] + (state.steps[i] + clock_s[IDLE] * state.waited[i]) * _DT
            dry = int(max(clock_s[FUEL_S] - spent_s, 0.0) / (clock_s[IDLE] * _DT)) + 1
            steps = dry if steps < 0 else min(steps, dry)
        if steps >= 0:
            least = max(steps, 1) if least < 0 else min(least, max(steps, 1))
    return least


@njit(cache=True)  # type: ignore[untyped-decorator]
def _pass_over(state: State, steps: int) -> None:
    """Let some control steps pass in which nobody moves, beginning with the one that commands were given for."""
    for i in range(len(state.doing)):
        state.commanded[i] = False
        if state.doing[i] == STANDS or (
                state.doing[i] == READY and state.clock_s[i, READY_S] > state.team[NOW] * _DT + _SAME_S):
            continue
        state.elapsed[i] += steps
        wait(state, i, int(state.waits[i, state.wait_count[i] - 1, CAUSE]), steps - 1)
        if state.hold_left[i] >= 0:
            state.hold_left[i] -= steps - 1
    state.team[NOW] += steps


@njit(cache=True)  # type: ignore[untyped-decorator]
def look(figures: Figures, state: State, by_distance: bool) -> bool:
    """End a control step after the robots moved: clock, kept poses, and hulls that touch.

    Args:
        figures, state: The team; ``state`` is changed in place.
        by_distance: Whether contact is told from the distance of the robots.

    Returns:
        Whether a pair came to touch.
    """
    n, came = len(state.doing), False
    now_s = state.team[NOW] * _DT + _SAME_S
    for i in range(n):
        state.commanded[i] = False
        if state.doing[i] == STANDS or (state.doing[i] == READY and state.clock_s[i, READY_S] > now_s):
            continue
        state.elapsed[i] += 1
        if state.team[TRACED] and state.elapsed[i] % _KEPT_STEPS == 0 and not state.at_rest[i]:
            kept = state.poses[i, state.pose_count[i]]
            kept[0], kept[1], kept[2], kept[3] = (
                state.elapsed[i], state.pose[i, 0], state.pose[i, 1], state.pose[i, 2])
            state.pose_count[i] += 1
    state.team[NOW] += 1
    if by_distance:
        for i in range(n):
            for j in range(i + 1, n):
                dx, dy = state.pose[i, 0] - state.pose[j, 0], state.pose[i, 1] - state.pose[j, 1]
                apart, hulls = dx * dx + dy * dy, figures.radius[i] + figures.radius[j]
                if apart < hulls * hulls:
                    came = came or not state.near[i, j]
                    state.touched[i, j] = state.touched[i, j] or not state.near[i, j]
                    state.near[i, j] = True
                elif apart > (hulls + _FREE_M) ** 2:
                    state.near[i, j] = False
    return came


@njit(cache=True)  # type: ignore[untyped-decorator]
def drive_twins(ways: Ways, figures: Figures, state: State, parts: FloatArray) -> int:
    """Drive unicycles until something happens; why it came back."""
    while True:
        code: int = command_all(ways, figures, state, parts)
        if code != GO:
            return code
        for i in range(len(state.doing)):
            left, right = state.wheels[i, 0], state.wheels[i, 1]
            if left != 0.0 or right != 0.0:
                advance(state.pose[i], left * figures.gains[i, 0], right * figures.gains[i, 1],
                        figures.track[i] * figures.track_gain[i], _DT)
        if look(figures, state, True):
            return TOUCH
