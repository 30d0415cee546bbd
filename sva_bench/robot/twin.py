"""Kinematic twin: the path follower driving a unicycle, ideal or disturbed. The time of a leg without physics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray
from sva_bench.robot.disturbance import NO_WAVES, UNDISTURBED, Disturbance, error_at
from sva_bench.robot.follower import ARRIVED, CONTROL_HZ, NO_LINE, Stretch, control, horizon_m, new_state
from sva_bench.robot.model import RobotModel

_SLOWEST = 0.05  # a stretch that takes longer than at this share of the robot's speeds counts as stuck
_SETTLING_S = 30.0


def patience_steps(stretch: Stretch, model: RobotModel) -> int:
    """Control steps after which an unfinished stretch counts as stuck."""
    fastest_s = float(stretch.arc[-1]) / model.followed_speed_m_s + 2 * math.pi / model.max_turn_rad_s
    return math.ceil((fastest_s / _SLOWEST + _SETTLING_S) * CONTROL_HZ)


@njit(cache=True)  # type: ignore[untyped-decorator]
def advance(pose: FloatArray, left: float, right: float, track: float, dt: float) -> None:
    """Move an ideal unicycle for one control step; changes ``pose`` in place.

    Args:
        pose: x, y [m], yaw [rad].
        left, right: Speed of the left and the right wheel along the floor [m/s].
        track: Distance between the wheels [m].
        dt: Length of the step [s].
    """
    speed, rate = 0.5 * (left + right), (right - left) / track
    # Exact motion along an arc, written so that it has no singularity at rate 0.
    half = 0.5 * rate * dt
    chord = speed * dt * (1.0 - half * half / 6.0 if abs(half) < 1e-4 else math.sin(half) / half)
    pose[0] += chord * math.cos(pose[2] + half)
    pose[1] += chord * math.sin(pose[2] + half)
    pose[2] += rate * dt


@njit(cache=True)  # type: ignore[untyped-decorator]
def _drive(
    path: FloatArray, arc: FloatArray, heading: float, limits: FloatArray, state: FloatArray, pose: FloatArray,
    gain_left: float, gain_right: float, track: float, track_gain: float, waves: FloatArray, queue: FloatArray,
    dt: float, first: int, steps: int, until: float, trace: FloatArray,
) -> int:
    """Drive one stretch from step ``first`` to arrival, step ``steps`` or beyond arc length ``until``; the last step.

    Changes ``state``, ``pose`` and ``queue``, the commands on their way, in place, and fills ``trace`` with the pose
    after each step.
    """
    parts = np.empty((3, waves.shape[1]))
    for step in range(first, steps):
        if state[1] > until:
            return step
        x, y, yaw = pose[0], pose[1], pose[2]
        if waves.shape[1] > 0:
            ex, ey, eyaw = error_at(waves, parts, x, y)
            x, y, yaw = x + ex, y + ey, yaw + eyaw
        speed, rate = control(path, arc, heading, limits, state, x, y, yaw, dt, NO_LINE)
        if state[0] == ARRIVED:
            return step
        speed, rate = delayed(queue, speed, rate)
        left = (speed - 0.5 * track * rate) * gain_left
        right = (speed + 0.5 * track * rate) * gain_right
        advance(pose, left, right, track * track_gain, dt)
        if step < len(trace):
            trace[step, 0], trace[step, 1], trace[step, 2] = pose[0], pose[1], pose[2]
    return steps


@njit(cache=True)  # type: ignore[untyped-decorator]
def delayed(queue: FloatArray, speed: float, rate: float) -> tuple[float, float]:
    """Put a command behind those on their way, and take the first of them.

    Args:
        queue: Speed [m/s] and turn rate [rad/s] of the commands on their way, the first first, shape (delay, 2);
            changed in place.
        speed, rate: The command.
    """
    if len(queue) == 0:
        return speed, rate
    first_speed, first_rate = queue[0, 0], queue[0, 1]
    for k in range(len(queue) - 1):
        queue[k, 0], queue[k, 1] = queue[k + 1, 0], queue[k + 1, 1]
    queue[-1, 0], queue[-1, 1] = speed, rate
    return first_speed, first_rate


@njit(cache=True)  # type: ignore[untyped-decorator]
def _drain(
    pose: FloatArray, gain_left: float, gain_right: float, track: float, track_gain: float, queue: FloatArray,
    dt: float, trace: FloatArray,
) -> None:
    """Obey the commands that are still on their way, standing from then on."""
    for step in range(len(queue)):
        speed, rate = delayed(queue, 0.0, 0.0)
        left = (speed - 0.5 * track * rate) * gain_left
        right = (speed + 0.5 * track * rate) * gain_right
        advance(pose, left, right, track * track_gain, dt)
        if step < len(trace):
            trace[step, 0], trace[step, 1], trace[step, 2] = pose[0], pose[1], pose[2]


def drive(
    model: RobotModel, course: Sequence[Stretch], pose: FloatArray, disturbance: Disturbance = UNDISTURBED,
    *, traced: bool = False,
) -> tuple[float, FloatArray]:
    """Time that a course takes the robot by its equations of motion alone.

    It begins and ends at rest, with no command on its way.

    Args:
        model: The robot.
        course: The stretches of the course.
        pose: x, y [m], yaw [rad] at the start, shape (3,); changed in place to the end. Where the robot is, not where
            it believes to be.
        disturbance: How it differs from its model; payload and friction make no difference here.
        traced: Whether to return the poses.

    Returns:
        The time [s], ``inf`` if it never arrives; the pose after each control step, shape (steps, 3), if traced.
    """
    dt, limits, delay = 1.0 / CONTROL_HZ, model.limits, disturbance.delay_steps
    motion = (*disturbance.wheel_gains, model.track_m, disturbance.track_gain)
    waves, queue = disturbance.waves, np.zeros((delay, 2))
    total, traces = 0, []
    for stretch in course:
        steps, state = patience_steps(stretch, model), new_state()
        trace = np.empty((steps if traced else 0, 3))
        taken = _drive(stretch.path, stretch.arc, stretch.heading_rad, limits, state, pose, *motion, waves, queue, dt,
                       0, steps, math.inf, trace)
        traces.append(trace[:taken])
        if state[0] != ARRIVED:
            return math.inf, np.concatenate(traces)
        total += taken
    if delay:
        trace = np.empty((delay if traced else 0, 3))
        _drain(pose, *motion, queue, dt, trace)
        traces.append(trace)
    return (total + delay) * dt, np.concatenate(traces) if traces else np.empty((0, 3))


_NO_QUEUE = np.empty((0, 2))


@dataclass(frozen=True, eq=False, kw_only=True)
class _DriveState:
    """The state of a robot part of the way along a course.

    Attributes:
        stretch: Index of its stretch in the course.
        done: Control steps of the stretches before.
        taken: Control steps on this stretch so far.
        state: The follower's state.
        pose: x, y [m], yaw [rad].
    """

    stretch: int
    done: int
    taken: int
    state: FloatArray
    pose: FloatArray


def leg_times(model: RobotModel, courses: Sequence[Sequence[Stretch]], pose: FloatArray) -> FloatArray:
    """Times that legs from one pose take the ideal robot, equal to those of ``drive`` to the bit.

    The common beginning of legs is driven once, as far as their difference is beyond the follower's horizon. Paths
    through a maze have most of their length in common.

    Args:
        model: The robot.
        courses: The stretches of each leg.
        pose: x, y [m], yaw [rad] at the start of all, shape (3,).

    Returns:
        Time of each leg [s], ``inf`` if it never arrives, shape (legs,).
    """
    vertices = [np.concatenate([course[0].path[:1], *(stretch.path[1:] for stretch in course)]) for course in courses]
    times = np.full(len(courses), math.inf)
    work = [(list(range(len(courses))), _DriveState(stretch=0, done=0, taken=0, state=new_state(), pose=pose))]
    while work:
        legs, reached = work.pop()
        first = legs[0]
        shared = min((_common_vertices(vertices[first], vertices[leg]) for leg in legs[1:]),
                     default=len(vertices[first]))
        apart: dict[tuple[float, ...] | int, list[int]] = {}
        for leg in legs:
            ends = len(vertices[leg]) == shared
            apart.setdefault(leg if ends else tuple(vertices[leg][shared].tolist()), []).append(leg)
        if len(legs) > 1:
            reached = _drive_on(model, courses[first], reached, shared)
            work += [(part, reached) for part in apart.values()]
        else:
            reached = _drive_on(model, courses[first], reached, None)
            if reached.stretch == len(courses[first]):
                times[first] = reached.done * (1.0 / CONTROL_HZ)
    return times


def _common_vertices(one: FloatArray, other: FloatArray) -> int:
    """Number of vertices that the beginnings of two paths have in common."""
    most = min(len(one), len(other))
    differ = (one[:most] != other[:most]).any(axis=1)
    return int(differ.argmax()) if differ.any() else most


def _drive_on(model: RobotModel, course: Sequence[Stretch], reached: _DriveState, shared: int | None) -> _DriveState:
    """The state after driving with only the first ``shared`` vertices within the horizon; ``None`` = to the end."""
    dt, limits, no_trace = 1.0 / CONTROL_HZ, model.limits, np.empty((0, 3))
    number, done, taken = reached.stretch, reached.done, reached.taken
    state, pose = reached.state.copy(), reached.pose.copy()
    before = sum(len(stretch.path) - 1 for stretch in course[:number])  # vertices before the stretch
    while number < len(course):
        stretch = course[number]
        last = before + len(stretch.path) - 1
        until = math.inf
        # Whether a stretch ends at a vertex, and in which heading, depends on the next vertex.
        if shared is not None and last > shared - 2:
            until = float(stretch.arc[shared - 1 - before]) - horizon_m(limits, dt)
        taken = _drive(stretch.path, stretch.arc, stretch.heading_rad, limits, state, pose, 1.0, 1.0, model.track_m,
                       1.0, NO_WAVES, _NO_QUEUE, dt, taken, patience_steps(stretch, model), until, no_trace)
        if state[0] != ARRIVED:
            break
        number, done, taken, state, before = number + 1, done + taken, 0, new_state(), last
    return _DriveState(stretch=number, done=done, taken=taken, state=state, pose=pose)
