"""Which drives want physics: those in which the twin may miss something, and a sample of the others as a check."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray
from sva_bench.geometry.distances import segment_distance
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.disturbance import Disturbance
from sva_bench.robot.model import RobotModel
from sva_bench.seeds import key_of

NEAR_M = 0.02
"""A twin that comes so near to an obstacle may touch it in physics, which agrees with it to a centimetre."""
SLIPPERY = 0.1
"""Friction below which a floor costs a robot its way; the twin rolls over it as over any other."""
CHECKED = 0.05
"""Share of the drives without any such reason that physics drives all the same."""


def wants_physics(obstacles: Obstacles, model: RobotModel, disturbance: Disturbance, poses: FloatArray) -> bool:
    """Whether something may happen on a drive that the twin knows nothing of.

    Args:
        obstacles: Those near the course.
        model: The robot.
        disturbance: How it differs from its model.
        poses: x, y [m], yaw [rad] of the twin after each control step, shape (steps, 3).
    """
    if disturbance.payload_kg > model.mass_kg:  # motors are three times as strong as the robot alone needs
        return True
    slippery = obstacles.floors[obstacles.floors[:, 5] < SLIPPERY]
    return bool(_comes_near(poses, obstacles.bounds_m, obstacles.boxes, obstacles.cylinders, model.radius_m + NEAR_M)
                or _crosses(poses, slippery, model.radius_m))


def checked(model: RobotModel, disturbance: Disturbance, course: FloatArray) -> bool:
    """Whether a drive is one of the sample, by what it consists of."""
    word, *_ = key_of("checked", model.name, repr(disturbance), course.tobytes())
    return word < CHECKED * 2**32


@njit(cache=True)  # type: ignore[untyped-decorator]
def _comes_near(poses: FloatArray, bounds: FloatArray, boxes: FloatArray, cylinders: FloatArray, reach: float) -> bool:
    for k in range(len(poses)):
        x, y = poses[k, 0], poses[k, 1]
        if segment_distance(bounds, boxes, cylinders, x, y, x, y, reach) < reach:
            return True
    return False


def _crosses(poses: FloatArray, floors: FloatArray, radius_m: float) -> bool:
    """Whether a robot comes onto one of these floors with any part of it."""
    for x, y, hx, hy, yaw, _ in floors.tolist():
        c, s = math.cos(yaw), math.sin(yaw)
        along, across = poses[:, 0] - x, poses[:, 1] - y
        on_it = (np.abs(c * along + s * across) <= hx + radius_m) & (np.abs(c * across - s * along) <= hy + radius_m)
        if on_it.any():
            return True
    return False
