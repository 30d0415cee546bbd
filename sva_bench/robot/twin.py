"""Kinematic twin: the path follower driving an ideal unicycle. Predicts the time of a leg without physics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray
from sva_bench.robot.follower import ARRIVED, CONTROL_HZ, Stretch, control, new_state, sight_m
from sva_bench.robot.model import RobotModel

_SLOWEST = 0.05  # a stretch that takes longer than at this share of the robot's speeds counts as stuck
_SETTLING_S = 30.0


def patience_steps(stretch: Stretch, model: RobotModel) -> int:
    """Control steps after which a stretch that isn't finished counts as stuck."""
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
    gain_left: float, gain_right: float, track: float, dt: float, first: int, steps: int, until: float,
    trace: FloatArray,
) -> int:
    """Drives one stretch, from step ``first`` to arrival, to step ``steps`` or beyond an arc length, and says to which.

    Changes ``state`` and ``pose`` in place and fills ``trace`` with the pose after each step.
    """
    for step in range(first, steps):
        if state[1] > until:
            return step
        speed, rate = control(path, arc, heading, limits, state, pose[0], pose[1], pose[2], dt)
        if state[0] == ARRIVED:
            return step
        left = (speed - 0.5 * track * rate) * gain_left
        right = (speed + 0.5 * track * rate) * gain_right
        advance(pose, left, right, track, dt)
        if step < len(trace):
            trace[step, 0], trace[step, 1], trace[step, 2] = pose[0], pose[1], pose[2]
    return steps


def drive(
    model: RobotModel, course: Sequence[Stretch], pose: FloatArray, wheel_gains: tuple[float, float] = (1.0, 1.0),
    *, traced: bool = False,
) -> tuple[float, FloatArray]:
    """Time that a hop takes the ideal robot.

    Args:
        model: The robot.
        course: The stretches of the hop.
        pose: x, y [m], yaw [rad]; moved to the end of the hop.
        wheel_gains: Factor on the speed of the left and the right wheel.
        traced: Whether to keep the poses.

    Returns:
        The time [s], ``inf`` if it never arrives; the pose after each control step, shape (steps, 3), if traced.
    """
    dt, limits = 1.0 / CONTROL_HZ, model.limits
    total, traces = 0, []
    for stretch in course:
        steps, state = patience_steps(stretch, model), new_state()
        trace = np.empty((steps if traced else 0, 3))
        taken = _drive(stretch.path, stretch.arc, stretch.heading_rad, limits, state, pose, *wheel_gains,
                       model.track_m, dt, 0, steps, math.inf, trace)
        traces.append(trace[:taken])
        if state[0] != ARRIVED:
            return math.inf, np.concatenate(traces)
        total += taken
    return total * dt, np.concatenate(traces) if traces else np.empty((0, 3))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Halt:
    """Where a robot has got to on a course.

    Attributes:
        stretch: The stretch that it is on, by its place in the course.
        done: Control steps that the stretches before it took.
        taken: Control steps that it took so far.
        state: The follower's state.
        pose: x, y [m], yaw [rad].
    """

    stretch: int
    done: int
    taken: int
    state: FloatArray
    pose: FloatArray


def leg_times(model: RobotModel, courses: Sequence[Sequence[Stretch]], pose: FloatArray) -> FloatArray:
    """Times that legs from one place take the ideal robot, bit by bit as ``drive`` has them.

    A beginning that legs share is driven once: as far as the follower can't see yet where they part. Paths through a
    maze share nearly all of their way.

    Args:
        model: The robot.
        courses: The stretches of each leg.
        pose: x, y [m], yaw [rad] where all of them begin.

    Returns:
        Time of each leg [s], ``inf`` if it never arrives.
    """
    vertices = [np.concatenate([course[0].path[:1], *(stretch.path[1:] for stretch in course)]) for course in courses]
    times = np.full(len(courses), math.inf)
    work = [(list(range(len(courses))), _Halt(stretch=0, done=0, taken=0, state=new_state(), pose=pose))]
    while work:
        legs, halt = work.pop()
        first = legs[0]
        shared = min((_shared(vertices[first], vertices[leg]) for leg in legs[1:]), default=len(vertices[first]))
        apart: dict[tuple[float, ...] | int, list[int]] = {}
        for leg in legs:
            ends = len(vertices[leg]) == shared
            apart.setdefault(leg if ends else tuple(vertices[leg][shared].tolist()), []).append(leg)
        if len(legs) > 1:
            halt = _advanced(model, courses[first], halt, shared)
            work += [(part, halt) for part in apart.values()]
        else:
            halt = _advanced(model, courses[first], halt, None)
            if halt.stretch == len(courses[first]):
                times[first] = halt.done * (1.0 / CONTROL_HZ)
    return times


def _shared(one: FloatArray, other: FloatArray) -> int:
    """How many vertices two paths begin with in common."""
    most = min(len(one), len(other))
    differ = (one[:most] != other[:most]).any(axis=1)
    return int(differ.argmax()) if differ.any() else most


def _advanced(model: RobotModel, course: Sequence[Stretch], halt: _Halt, shared: int | None) -> _Halt:
    """A robot driven on, as long as it sees nothing but the first so many vertices; ``None`` = to the end."""
    dt, limits, no_trace = 1.0 / CONTROL_HZ, model.limits, np.empty((0, 3))
    number, done, taken, state, pose = halt.stretch, halt.done, halt.taken, halt.state.copy(), halt.pose.copy()
    before = sum(len(stretch.path) - 1 for stretch in course[:number])  # vertices before the stretch
    while number < len(course):
        stretch = course[number]
        last = before + len(stretch.path) - 1
        until = math.inf
        # Whether a stretch ends at a vertex, and in which heading, depends on the one behind it.
        if shared is not None and last > shared - 2:
            until = float(stretch.arc[shared - 1 - before]) - sight_m(limits, dt)
        taken = _drive(stretch.path, stretch.arc, stretch.heading_rad, limits, state, pose, 1.0, 1.0, model.track_m,
                       dt, taken, patience_steps(stretch, model), until, no_trace)
        if state[0] != ARRIVED:
            break
        number, done, taken, state, before = number + 1, done + taken, 0, new_state(), last
    return _Halt(stretch=number, done=done, taken=taken, state=state, pose=pose)
