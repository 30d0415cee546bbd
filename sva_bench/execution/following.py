"""The follower's loop over an engine: one hop from stop to stop, and when a robot counts as stuck."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray
from sva_bench.execution.engines.engine import Engine, Pose
from sva_bench.robot.disturbance import UNDISTURBED, Disturbance, error_at, room_for
from sva_bench.robot.follower import ARRIVED, CONTROL_HZ, DRIVE, NO_LINE, Stretch, control, new_state
from sva_bench.robot.model import RobotModel
from sva_bench.robot.twin import delayed, patience_steps

STUCK_STEPS = round(10.0 * CONTROL_HZ)
"""Control steps after which a robot that hardly moved or turned in them is stuck."""
_STUCK_M, _STUCK_RAD = 0.02, 0.05
STUCK_DRIVING = 0.5  # share of the time between two checks spent on the way from which on only progress counts


def follow(engine: Engine, model: RobotModel, hop: Sequence[Stretch], poses: list[Pose] | None = None,
           disturbance: Disturbance = UNDISTURBED) -> tuple[float, bool]:
    """Drive the stretches of one hop; it begins and ends at rest, with no command on its way.

    Args:
        engine: The robot in its world.
        model: Its figures, which the follower goes by.
        hop: The stretches.
        poses: Receives the pose after each control step; ``None`` keeps none.
        disturbance: Where the robot believes to be, and how late its commands are obeyed; the rest is the engine's.

    Returns:
        Driving time [s], and whether the robot arrived; False if it got stuck.
    """
    limits, dt, half = model.limits, 1.0 / CONTROL_HZ, 0.5 * model.track_m
    waves, queue = disturbance.waves, np.zeros((disturbance.delay_steps, 2))
    lost, late, parts = waves.shape[1] > 0, len(queue) > 0, room_for(waves)
    where, step = engine.pose, engine.step
    total = 0
    pose = where()
    for stretch in hop:
        path, arc, heading = stretch.path, stretch.arc, stretch.heading_rad
        state, since_yaw, since_s, driving = new_state(), pose[2], 0.0, 0
        for number in range(1, patience_steps(stretch, model) + 1):
            x, y, yaw = pose
            if lost:
                ex, ey, eyaw = error_at(waves, parts, x, y)
                x, y, yaw = x + ex, y + ey, yaw + eyaw
            speed, rate = control(path, arc, heading, limits, state, x, y, yaw, dt, NO_LINE)
            phase = state[0]
            if phase == ARRIVED:
                break
            if late:
                speed, rate = delayed(queue, speed, rate)
            step(speed - half * rate, speed + half * rate)
            total += 1
            driving += phase == DRIVE
            pose = where()
            if poses is not None:
                poses.append(pose)
            if engine.fault:
                return total * dt, False
            if number % STUCK_STEPS == 0:
                progress_m, turned_rad = float(state[1]) - since_s, math.remainder(yaw - since_yaw, 2 * math.pi)
                if is_stuck(progress_m, turned_rad, phase == DRIVE and driving >= STUCK_DRIVING * STUCK_STEPS):
                    return total * dt, False
                since_yaw, since_s, driving = yaw, float(state[1]), 0
        else:
            return total * dt, False
    for _ in range(len(queue)):  # what is still on its way
        speed, rate = delayed(queue, 0.0, 0.0)
        step(speed - half * rate, speed + half * rate)
        pose = where()
        if poses is not None:
            poses.append(pose)
    return (total + len(queue)) * dt, not engine.fault


@njit(cache=True)  # type: ignore[untyped-decorator]
def is_stuck(progress_m: float, turned_rad: float, on_the_way: bool) -> bool:
    """Whether a robot is stuck, by what it did in the ten seconds since the last check.

    On the way only progress along the path counts: a robot that pushes a wall sways and slides. One that has turned for
    nearly all of the time has not had any to make progress.

    Args:
        progress_m: How far it got along its path.
        turned_rad: How far it turned, either way round.
        on_the_way: Whether it is on its way along the path, and was for at least half of the time.
    """
    return bool(progress_m < _STUCK_M and (on_the_way or abs(turned_rad) < _STUCK_RAD))


def downsampled(poses: Sequence[Pose], keep_hz: float) -> tuple[FloatArray, FloatArray]:
    """Times since the first control step [s] and poses at a lower rate, the last always among them."""
    every = max(round(CONTROL_HZ / keep_hz), 1)
    kept = sorted({*range(every - 1, len(poses), every), len(poses) - 1}) if poses else []
    return np.array([(k + 1) / CONTROL_HZ for k in kept]), np.array([poses[k] for k in kept]).reshape(-1, 3)
