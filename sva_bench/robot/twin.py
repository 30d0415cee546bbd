"""Kinematic twin: the path follower driving an ideal unicycle. Predicts the time of a leg without physics."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray
from sva_bench.robot.follower import ARRIVED, CONTROL_HZ, Stretch, control
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
    path: FloatArray, arc: FloatArray, heading: float, limits: FloatArray, pose: FloatArray,
    gain_left: float, gain_right: float, track: float, dt: float, steps: int, trace: FloatArray,
) -> int:
    """Drives one stretch; changes ``pose`` in place and fills ``trace`` with the pose after each step."""
    state = np.zeros(4)
    for step in range(steps):
        speed, rate = control(path, arc, heading, limits, state, pose[0], pose[1], pose[2], dt)
        if state[0] == ARRIVED:
            return step
        left = (speed - 0.5 * track * rate) * gain_left
        right = (speed + 0.5 * track * rate) * gain_right
        advance(pose, left, right, track, dt)
        if step < len(trace):
            trace[step, 0], trace[step, 1], trace[step, 2] = pose[0], pose[1], pose[2]
    return -1


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
    dt = 1.0 / CONTROL_HZ
    total, traces = 0, []
    for stretch in course:
        steps = patience_steps(stretch, model)
        trace = np.empty((steps if traced else 0, 3))
        taken = _drive(stretch.path, stretch.arc, stretch.heading_rad, model.limits, pose, *wheel_gains, model.track_m,
                       dt, steps, trace)
        traces.append(trace[: taken if taken >= 0 else steps])
        if taken < 0:
            return math.inf, np.concatenate(traces)
        total += taken
    return total * dt, np.concatenate(traces) if traces else np.empty((0, 3))
