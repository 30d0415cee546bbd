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
    READY,
    STANDS,
    Notes,
    Records,
    Robot,
    Team,
)
from sva_bench.execution.shared.ways import ENDS_LEG, GOES_ON, Ways
from sva_bench.robot.disturbance import error_at
from sva_bench.robot.follower import ARRIVED, CONTROL_HZ, DRIVE, NO_LINE, braked, control, wrap
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
_SPARE = 4  # waits for which there is always room


@njit(cache=True)  # type: ignore[untyped-decorator]
def command_all(robots: Records, team: Team, ways: Ways, notes: Notes, parts: FloatArray) -> int:
    """Give each robot its command of this control step, and pass over time in which nobody moves.

    Args:
        robots, team: Their records, changed in place.
        ways: What they drive.
        notes: What is noted of them, changed in place.
        parts: Room for ``error_at``.

    Returns:
        ``GO`` if the robots are to be moved, else why not.
    """
    while True:
        happened, busy, still = False, False, True
        for i in range(len(robots)):
            robot = robots[i]
            if robot.doing != STANDS and (robot.wait_count > notes.waits.shape[1] - _SPARE or (
                    team.traced and robot.pose_count >= notes.poses.shape[1])):
                return FULL
        for i in range(len(robots)):
            robot = robots[i]
            if not robot.commanded:
                _command(robots, i, team, ways, notes, parts)
                robot.commanded = robot.event == 0
            happened = happened or robot.event != 0
            busy = busy or robot.doing != STANDS
            still = still and robot.at_rest
        if happened:
            return EVENT
        if not busy:
            return NOBODY
        if not still:
            return GO
        if team.braking:
            return REST
        steps = _steps_to_wait(robots, team)
        if steps < 0:
            return DEADLOCK
        _pass_over(robots, team, notes.waits, steps)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _command(robots: Records, i: int, team: Team, ways: Ways, notes: Notes, parts: FloatArray) -> None:
    """Set a robot's wheels for this control step, or say that its leg is over."""
    robot = robots[i]
    robot.left = robot.right = 0.0
    robot.at_rest = True
    if robot.doing == STANDS:
        return
    cause = blocker(robots, robot, ways.need)
    if robot.doing == READY:
        if robot.ready_s > team.now * _DT + _SAME_S:
            return
        if team.braking or (cause >= 0 and robot.open_to <= robot.first_cell):
            if not _spent(robot):
                wait(robot, notes.waits[i], BRAKED if team.braking else cause, 1)
            return
        robot.doing = DRIVES
        robot.cell = robot.first_cell
    if robot.doing == DRAINS:
        if robot.drained < robot.delay:
            _drain(robot)
            return
        robot.doing = DRIVES
        if _hop_over(robot, ways):
            return
    x, y, yaw = robot.pose[0], robot.pose[1], robot.pose[2]
    if robot.lost:
        ex, ey, eyaw = error_at(robot.waves, parts, x, y)
        x, y, yaw = x + ex, y + ey, yaw + eyaw
    while not _drive(robot, i, team, ways, notes, cause, x, y, yaw):
        pass


@njit(cache=True)  # type: ignore[untyped-decorator]
def _drive(robot: Robot, i: int, team: Team, ways: Ways, notes: Notes, cause: int, x: float, y: float, yaw: float
           ) -> bool:
    """Command a robot on its way; False = its stretch or a hold ended, which takes no time: ask again."""
    stretch, follow = ways.stretches[robot.stretch], robot.follow
    if robot.taken >= stretch.patience:
        stop(robot, IS_STUCK)
        return True
    hold_m = notes.holds[i, robot.hold, 0] if robot.hold < robot.hold_count else NO_LINE
    line, cause = line_of(robot, team, stretch.before_m, cause, hold_m)
    if team.braking and follow[0] != DRIVE:
        braked(robot.limits, follow, _DT)
    else:
        control(ways.path[stretch.first:stretch.end], ways.arc[stretch.first:stretch.end], stretch.heading,
                robot.limits, follow, x, y, yaw, _DT, line)
    robot.cell = max(robot.cell, robot.first_cell + cell_at(
        stretch.before_m + follow[1], robot.end_cell - robot.first_cell))
    if follow[0] == ARRIVED:
        if stretch.ends != ENDS_LEG or robot.hold >= robot.hold_count:
            return bool(_stretch_over(robot, ways))
        follow[4], cause = 1.0, -2 - robot.hold  # a hold at the end of the leg
    if _spent(robot):
        return True
    if follow[4] == 1.0:
        if cause < BRAKED and follow[2] == 0.0 and _hold_over(robot, int(notes.holds[i, robot.hold, 1])):
            return False
        wait(robot, notes.waits[i], cause, 1)
    else:
        robot.taken += 1
        robot.steps += 1
        robot.checked_steps += follow[0] == DRIVE
        if team.checked and robot.taken % STUCK_STEPS == 0 and _hardly_moved(robot, yaw):
            stop(robot, IS_STUCK)
            return True
    _obey(robot, follow[2], follow[3], follow[4] == 1.0)
    return True


@njit(cache=True)  # type: ignore[untyped-decorator]
def _stretch_over(robot: Robot, ways: Ways) -> bool:
    """Go on to the next stretch, or stop at the end of the hop; whether the robot has its command."""
    if ways.stretches[robot.stretch].ends == GOES_ON:
        begin_stretch(robot, robot.stretch + 1)
        return False
    if robot.delay > 0:
        robot.doing, robot.drained = DRAINS, 0
        _drain(robot)
        return True
    return bool(_hop_over(robot, ways))


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
def _drain(robot: Robot) -> None:
    """Let a robot at a stop obey one of the commands that are still under way."""
    if not _spent(robot):
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
def _hop_over(robot: Robot, ways: Ways) -> bool:
    """End a robot's hop; whether its leg is over with it."""
    robot.hops_s += robot.steps * _DT
    robot.steps = 0
    if ways.stretches[robot.stretch].ends != ENDS_LEG:
        begin_stretch(robot, robot.stretch + 1)
        return False
    robot.cell = robot.end_cell - 1
    too_late = (robot.hops_s > robot.driving_s
                or robot.hops_s + robot.idle * robot.waited * _DT > robot.fuel_s)
    stop(robot, HAS_ENDED if too_late else HAS_ARRIVED)
    return True


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
def _steps_to_wait(robots: Records, team: Team) -> int:
    """Control steps until something changes though nobody moves; -1 = never."""
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
def look(robots: Records, team: Team, notes: Notes, by_distance: bool) -> bool:
    """End a control step after the robots moved: clock, kept poses, and hulls that touch.

    Args:
        robots, team, notes: As of ``command_all``.
        by_distance: Whether contact is told from the distance of the robots.

    Returns:
        Whether a pair came to touch.
    """
    came = False
    for i in range(len(robots)):
        robot = robots[i]
        robot.commanded = False
        if robot.doing == STANDS or (robot.doing == READY and robot.ready_s > team.now * _DT + _SAME_S):
            continue
        robot.elapsed += 1
        if team.traced and robot.elapsed % _KEPT_STEPS == 0 and not robot.at_rest:
            kept = notes.poses[i, robot.pose_count]
            kept[0], kept[1], kept[2], kept[3] = robot.elapsed, robot.pose[0], robot.pose[1], robot.pose[2]
            robot.pose_count += 1
    team.now += 1
    if by_distance:
        for i in range(len(robots)):
            for j in range(i):
                dx, dy = robots[i].pose[0] - robots[j].pose[0], robots[i].pose[1] - robots[j].pose[1]
                apart, hulls = dx * dx + dy * dy, robots[i].radius + robots[j].radius
                if apart < hulls * hulls and not notes.near[j, i]:
                    notes.near[j, i] = notes.touched[j, i] = came = True
                elif notes.near[j, i] and apart > (hulls + _FREE_M) ** 2:
                    notes.near[j, i] = False
    return came


@njit(cache=True)  # type: ignore[untyped-decorator]
def drive_twins(robots: Records, teams: Records, ways: Ways, notes: Notes, parts: FloatArray) -> int:
    """Drive unicycles until something happens; why it came back."""
    team = teams[0]
    while True:
        code: int = command_all(robots, team, ways, notes, parts)
        if code != GO:
            return code
        for i in range(len(robots)):
            robot = robots[i]
            if robot.left != 0.0 or robot.right != 0.0:
                advance(robot.pose, robot.left * robot.gain_left, robot.right * robot.gain_right,
                        robot.track * robot.track_gain, _DT)
        if look(robots, team, notes, True):
            return TOUCH


@njit(cache=True)  # type: ignore[untyped-decorator]
def begin_tick(robots: Records, teams: Records, ways: Ways, notes: Notes, parts: FloatArray, wheels: FloatArray) -> int:
    """``command_all``; ``wheels`` receives the speeds of the left and the right wheels [m/s], shape (n, 2)."""
    code: int = command_all(robots, teams[0], ways, notes, parts)
    for i in range(len(robots)):
        wheels[i, 0], wheels[i, 1] = robots[i].left, robots[i].right
    return code


@njit(cache=True)  # type: ignore[untyped-decorator]
def end_tick(robots: Records, teams: Records, notes: Notes, poses: FloatArray) -> None:
    """``look``, where others moved the robots to ``poses``, shape (n, 3), and tell of contacts."""
    for i in range(len(robots)):
        for axis in range(3):
            robots[i].pose[axis] = poses[i, axis]
    look(robots, teams[0], notes, False)


@njit(cache=True)  # type: ignore[untyped-decorator]
def stop_robot(robots: Records, robot: int, event: int) -> None:
    """Let a robot stand where it is: something happened to it, or 0 if that is known."""
    stop(robots[robot], event)
    robots[robot].commanded = False


@njit(cache=True)  # type: ignore[untyped-decorator]
def begin_leg(robots: Records, robot: int, stretch: int) -> None:
    """Put a robot at the start of the first stretch of a leg."""
    begin_stretch(robots[robot], stretch)
