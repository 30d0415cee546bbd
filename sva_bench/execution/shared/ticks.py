"""One control step of a team, compiled: commands to all, and a look at what came of them.

The kinematic twin and physics run the same code and differ in what moves the robots between the two.
"""

from __future__ import annotations

import math

from numba import njit

from sva_bench.arrays import FloatArray
from sva_bench.execution.following import STUCK_DRIVING, STUCK_STEPS, is_stuck
from sva_bench.execution.shared.gates import blocker, line_of, wait
from sva_bench.execution.shared.lanes import cell_at
from sva_bench.execution.shared.state import (
    BRAKED,
    CAUSE,
    DRAINS,
    DRIVES,
    NO_END,
    READY,
    STANDS,
    Notes,
    Records,
    Robot,
    Team,
)
from sva_bench.execution.shared.ways import ENDS_LEG, GOES_ON, Stretch, Ways
from sva_bench.robot.disturbance import error_at
from sva_bench.robot.follower import ARRIVED, CONTROL_HZ, DRIVE, NO_LINE, braked, control, wrap
from sva_bench.robot.twin import advance, delayed

GO, EVENT, TOUCH, REST, NOBODY, DEADLOCK, FULL, TIME = 0, 1, 2, 3, 4, 5, 6, 7
"""Why compiled code comes back: not at all; something happened to a robot, to a pair; all rest that brake; nobody has
anything to do; robots wait for each other; waits or poses need more room; it is as late as was asked for."""
HAS_ARRIVED, HAS_ENDED, IS_STUCK, ASKS = 1, 2, 3, 4
"""What happens to a robot."""
FREE_M = 0.01
"""Between hulls that touched, from which on they may touch again [m]."""

_DT = 1.0 / CONTROL_HZ
_SAME_S = 1e-9  # rounding of clocks
_KEPT_STEPS = 3  # from one kept pose to the next: 20 Hz
_SPARE = 4  # waits for which there is always room


@njit(cache=True)  # type: ignore[untyped-decorator]
def drive_on(robots: Records, teams: Records, ways: Ways, notes: Notes, parts: FloatArray, by_twin: bool) -> int:
    """Command robots, and move them as unicycles unless something else moves them, until something happens.

    One long function, for in compiled code passing arrays on takes longer than a control step.

    Args:
        robots, teams: The records, changed in place.
        ways: What they drive.
        notes: What is noted of them, changed in place.
        parts: Room for ``error_at``.
        by_twin: Whether to move them; else it comes back as soon as all have their commands, with ``GO``.

    Returns:
        Why it came back.
    """
    team, stretches, path, arc, need = teams[0], ways.stretches, ways.path, ways.arc, ways.need
    holds, waits, poses, near, touched = notes.holds, notes.waits, notes.poses, notes.near, notes.touched
    room, kept_room = waits.shape[1] - _SPARE, poses.shape[1]
    stale = False  # whether a robot has its command from before something happened: its gate may be open now
    for i in range(len(robots)):
        stale = stale or robots[i].commanded
    while True:
        if team.now >= team.until:
            return TIME
        happened, busy, still, full = False, False, True, False
        for i in range(len(robots)):
            robot = robots[i]
            if robot.wait_count > room or (team.traced and robot.pose_count >= kept_room):
                full = True
                break
            if not robot.commanded:
                robot.left = robot.right = 0.0
                robot.at_rest = True
                cause = -1
                if robot.doing != STANDS and robot.open_to < robot.cells:
                    cause = blocker(robots, robot, need)
                if robot.doing == READY and robot.ready_s <= team.now * _DT + _SAME_S:
                    _set_off(robot, team, waits[i], cause)
                if robot.doing == DRAINS:
                    _drain(robot, stretches[robot.stretch])
                if robot.doing == DRIVES:
                    x, y, yaw = robot.pose[0], robot.pose[1], robot.pose[2]
                    if robot.lost:
                        ex, ey, eyaw = error_at(robot.waves, parts, x, y)
                        x, y, yaw = x + ex, y + ey, yaw + eyaw
                    while True:
                        stretch = stretches[robot.stretch]
                        hold_m = holds[i, robot.hold, 0] if robot.hold < robot.hold_count else NO_LINE
                        line, why = line_of(robot, team, stretch.before_m, cause, hold_m)
                        if team.braking and robot.follow[0] != DRIVE:
                            braked(robot.limits, robot.follow, _DT)
                        else:
                            control(path[stretch.first:stretch.end], arc[stretch.first:stretch.end], stretch.heading,
                                    robot.limits, robot.follow, x, y, yaw, _DT, line)
                        if robot.follow[4] == 0.0 and robot.follow[0] != ARRIVED:
                            _goes(robot, team, stretch, yaw)
                            break
                        if robot.follow[0] == ARRIVED and (
                                stretch.ends != ENDS_LEG or robot.hold >= robot.hold_count):
                            if _stretch_over(robot, stretch):
                                break
                        elif _is_held(robot, stretch, holds[i], waits[i], why):
                            break
                if robot.event == 0 and team.asks > 0 and robot.asked >= team.asks:
                    robot.event, robot.asked = ASKS, 0
                robot.commanded = robot.event == 0 or robot.event == ASKS
            happened = happened or robot.event != 0
            busy = busy or robot.doing != STANDS
            still = still and robot.at_rest
        if full:
            return FULL
        if happened:
            return EVENT
        if not busy:
            if team.until == NO_END:
                return NOBODY
            team.now = team.until
            return TIME
        if still:
            steps = 1 if team.braking or stale else _steps_to_wait(robots, team, waits)
            stale = False
            _pass_over(robots, team, waits, min(abs(steps), team.until - team.now))
            if team.braking:
                return REST
            if steps < 0:
                return DEADLOCK
            continue
        if not by_twin:
            return GO
        for i in range(len(robots)):
            robot = robots[i]
            if robot.left != 0.0 or robot.right != 0.0:
                advance(robot.pose, robot.left * robot.gain_left, robot.right * robot.gain_right,
                        robot.track * robot.track_gain, _DT)
            _count(robot, team, poses, i)
        team.now += 1
        came = False
        for i in range(len(robots)):
            for j in range(i):
                dx, dy = robots[i].pose[0] - robots[j].pose[0], robots[i].pose[1] - robots[j].pose[1]
                apart, hulls = dx * dx + dy * dy, robots[i].radius + robots[j].radius
                if apart < hulls * hulls:
                    if not near[j, i]:
                        near[j, i] = touched[j, i] = came = True
                elif near[j, i] and apart > (hulls + FREE_M) ** 2:
                    near[j, i] = False
        if came:
            return TOUCH


@njit(cache=True)  # type: ignore[untyped-decorator]
def _set_off(robot: Robot, team: Team, waits: FloatArray, cause: int) -> None:
    """Let a robot whose time has come begin its leg, or wait."""
    if not team.braking and (cause < 0 or robot.open_to > robot.first_cell):
        robot.doing, robot.cell = DRIVES, robot.first_cell
    elif not _spent(robot):
        wait(robot, waits, BRAKED if team.braking else cause, 1)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _goes(robot: Robot, team: Team, stretch: Stretch, yaw: float) -> None:
    """Let a robot that nothing holds do what its follower says."""
    robot.cell = max(robot.cell, robot.first_cell + cell_at(
        stretch.before_m + robot.follow[1], robot.end_cell - robot.first_cell))
    if robot.taken >= stretch.patience:
        stop(robot, IS_STUCK)
    elif not _spent(robot):
        robot.taken += 1
        robot.steps += 1
        robot.checked_steps += robot.follow[0] == DRIVE
        if team.checked and robot.taken % STUCK_STEPS == 0 and _hardly_moved(robot, yaw):
            stop(robot, IS_STUCK)
        else:
            _obey(robot, robot.follow[2], robot.follow[3], False)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _is_held(robot: Robot, stretch: Stretch, holds: FloatArray, waits: FloatArray, cause: int) -> bool:
    """Let a robot that something holds brake or stand; False = its hold is over, so ask again."""
    robot.cell = max(robot.cell, robot.first_cell + cell_at(
        stretch.before_m + robot.follow[1], robot.end_cell - robot.first_cell))
    if robot.follow[0] == ARRIVED:
        cause = -2 - robot.hold  # a hold at the end of the leg
    if _spent(robot):
        return True
    if cause < BRAKED and robot.follow[2] == 0.0 and _hold_over(robot, int(holds[robot.hold, 1])):
        return False
    wait(robot, waits, cause, 1)
    _obey(robot, robot.follow[2], robot.follow[3], True)
    return True


@njit(cache=True)  # type: ignore[untyped-decorator]
def _stretch_over(robot: Robot, stretch: Stretch) -> bool:
    """Go on to the next stretch, or stop at the end of the hop; False = it has no command yet, so ask again."""
    if stretch.ends == GOES_ON:
        begin_stretch(robot, robot.stretch + 1)
    elif robot.delay > 0:
        robot.doing, robot.drained = DRAINS, 0
        _drain(robot, stretch)
    else:
        _hop_over(robot, stretch)
    return bool(robot.doing != DRIVES)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _hold_over(robot: Robot, lasts: int) -> bool:
    """Count a control step of the hold at which a robot stands; whether it is over."""
    if robot.hold_left < 0:
        robot.hold_left = lasts
    robot.hold_left -= 1
    if robot.hold_left >= 0:
        return False
    robot.hold += 1
    return True


@njit(cache=True)  # type: ignore[untyped-decorator]
def _drain(robot: Robot, stretch: Stretch) -> None:
    """Let a robot at a stop obey one of the commands that are still under way; without any its hop is over."""
    if robot.drained == robot.delay:
        robot.doing = DRIVES
        _hop_over(robot, stretch)
    elif not _spent(robot):
        robot.drained += 1
        robot.steps += 1
        _obey(robot, 0.0, 0.0, False)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _obey(robot: Robot, speed: float, rate: float, held: bool) -> None:
    """Set a robot's wheels to the command that is due, and put one behind those under way."""
    rests = held and speed == 0.0 and rate == 0.0
    if robot.delay > 0:
        speed, rate = delayed(robot.queue[:robot.delay], speed, rate)
        if rests:
            for k in range(robot.delay):
                rests = rests and robot.queue[k, 0] == 0.0 and robot.queue[k, 1] == 0.0
    robot.at_rest = rests and speed == 0.0 and rate == 0.0
    turning = 0.5 * robot.track * rate
    robot.left, robot.right = speed - turning, speed + turning


@njit(cache=True)  # type: ignore[untyped-decorator]
def _spent(robot: Robot) -> bool:
    """Stop a robot for good if its driving time or its fuel is used up; whether it is."""
    driven_s = robot.hops_s + robot.steps * _DT
    if driven_s >= robot.driving_s or driven_s + robot.idle * robot.waited * _DT >= robot.fuel_s:
        stop(robot, HAS_ENDED)
        return True
    return False


@njit(cache=True)  # type: ignore[untyped-decorator]
def stop(robot: Robot, event: int) -> None:
    """Let a robot stand where it is."""
    robot.doing, robot.event, robot.at_rest = STANDS, event, True
    robot.left = robot.right = 0.0
    robot.queue[:robot.delay] = 0.0
    robot.follow[2] = robot.follow[3] = 0.0


@njit(cache=True)  # type: ignore[untyped-decorator]
def _hop_over(robot: Robot, stretch: Stretch) -> None:
    """End a robot's hop, and its leg if that was the last."""
    robot.hops_s += robot.steps * _DT
    robot.steps = 0
    if stretch.ends != ENDS_LEG:
        begin_stretch(robot, robot.stretch + 1)
        return
    robot.cell = robot.end_cell - 1
    too_late = robot.hops_s > robot.driving_s or robot.hops_s + robot.idle * robot.waited * _DT > robot.fuel_s
    stop(robot, HAS_ENDED if too_late else HAS_ARRIVED)


@njit(cache=True)  # type: ignore[untyped-decorator]
def begin_stretch(robot: Robot, stretch: int) -> None:
    """Put a robot at the start of a stretch."""
    robot.stretch, robot.taken = stretch, 0
    robot.follow[:] = 0.0
    robot.checked_m, robot.checked_rad, robot.checked_steps = 0.0, robot.pose[2], 0


@njit(cache=True)  # type: ignore[untyped-decorator]
def _hardly_moved(robot: Robot, yaw: float) -> bool:
    """Whether a robot has hardly moved since the last check."""
    on_the_way = robot.follow[0] == DRIVE and robot.checked_steps >= STUCK_DRIVING * STUCK_STEPS
    stuck = is_stuck(robot.follow[1] - robot.checked_m, wrap(yaw - robot.checked_rad), on_the_way)
    robot.checked_m, robot.checked_rad, robot.checked_steps = robot.follow[1], yaw, 0
    return bool(stuck)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _steps_to_wait(robots: Records, team: Team, waits: FloatArray) -> int:
    """Control steps until something changes though nobody moves; -1 = nothing ever does."""
    least = -1
    for i in range(len(robots)):
        robot, steps = robots[i], -1
        if robot.doing == STANDS:
            continue
        asleep = robot.doing == READY and robot.ready_s > team.now * _DT + _SAME_S
        if asleep:
            steps = math.ceil((robot.ready_s - _SAME_S) * CONTROL_HZ) - team.now
        elif robot.hold_left >= 0:
            steps = robot.hold_left + 1
        if not asleep and robot.idle > 0.0 and robot.fuel_s < math.inf:
            spent_s = robot.hops_s + (robot.steps + robot.idle * robot.waited) * _DT
            dry = int(max(robot.fuel_s - spent_s, 0.0) / (robot.idle * _DT)) + 1
            steps = dry if steps < 0 else min(steps, dry)
        if steps >= 0:
            least = max(steps, 1) if least < 0 else min(least, max(steps, 1))
    for i in range(len(robots) if team.asks > 0 else 0):
        robot = robots[i]
        if robot.doing != STANDS and robot.wait_count > 0 and waits[i, robot.wait_count - 1, CAUSE] >= 0:
            least = min(least, max(team.asks - robot.asked, 1))
    return least


@njit(cache=True)  # type: ignore[untyped-decorator]
def _pass_over(robots: Records, team: Team, waits: FloatArray, steps: int) -> None:
    """Let some control steps pass in which nobody moves, beginning with the one that commands were given for."""
    for i in range(len(robots)):
        robot = robots[i]
        robot.commanded = False
        if robot.doing == STANDS or (robot.doing == READY and robot.ready_s > team.now * _DT + _SAME_S):
            continue
        robot.elapsed += steps
        wait(robot, waits[i], int(waits[i, robot.wait_count - 1, CAUSE]), steps - 1)
        if robot.hold_left >= 0:
            robot.hold_left -= steps - 1
    team.now += steps


@njit(cache=True)  # type: ignore[untyped-decorator]
def _count(robot: Robot, team: Team, poses: FloatArray, i: int) -> None:
    """End a control step of a robot after it was moved, and keep its pose."""
    robot.commanded = False
    if robot.doing == STANDS or (robot.doing == READY and robot.ready_s > team.now * _DT + _SAME_S):
        return
    robot.elapsed += 1
    if team.traced and robot.elapsed % _KEPT_STEPS == 0 and not robot.at_rest:
        k = robot.pose_count
        poses[i, k, 0] = robot.elapsed
        poses[i, k, 1], poses[i, k, 2], poses[i, k, 3] = robot.pose[0], robot.pose[1], robot.pose[2]
        robot.pose_count += 1


@njit(cache=True)  # type: ignore[untyped-decorator]
def moved(robots: Records, teams: Records, notes: Notes, poses: FloatArray) -> None:
    """End a control step after something else moved the robots to ``poses``, shape (n, 3)."""
    for i in range(len(robots)):
        robots[i].pose[0], robots[i].pose[1], robots[i].pose[2] = poses[i, 0], poses[i, 1], poses[i, 2]
        _count(robots[i], teams[0], notes.poses, i)
    teams[0].now += 1


@njit(cache=True)  # type: ignore[untyped-decorator]
def stop_robot(robots: Records, robot: int, event: int) -> None:
    """Let a robot stand where it is: something happened to it, or 0 if that is known."""
    stop(robots[robot], event)
    robots[robot].commanded = False


@njit(cache=True)  # type: ignore[untyped-decorator]
def begin_leg(robots: Records, robot: int, stretch: int) -> None:
    """Put a robot at the start of the first stretch of a leg."""
    begin_stretch(robots[robot], stretch)
