"""The shape of a robot as convex solids: a cylinder, or those of its own body, and its driven wheels."""

from __future__ import annotations

import math

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.robot.body import Solid, Vector
from sva_bench.robot.model import RobotModel

_WHEEL_SHARE = 0.35  # shown width of a wheel, in its radii


def solids_of(model: RobotModel) -> tuple[Solid, ...]:
    """Solids of a robot seen from the floor below the middle of its axle: x ahead, y to the left, z up [m]."""
    if model.body is None:
        height = 2 * model.radius_m
        return (Solid(kind="cylinder", size_m=(model.radius_m, height, 0.0), at_m=(0.0, 0.0, height / 2)),)
    up = model.wheel_radius_m
    hull = [Solid(kind=solid.kind, size_m=solid.size_m, at_m=(*solid.at_m[:2], solid.at_m[2] + up),
                  rpy_rad=solid.rpy_rad) for solid in model.body.solids]
    wheels = [Solid(kind="cylinder", size_m=(up, _WHEEL_SHARE * up, 0.0), at_m=(0.0, side * model.track_m / 2, up),
                    rpy_rad=(math.pi / 2, 0.0, 0.0)) for side in (1, -1)]
    return (*hull, *wheels)


def top_m(solids: tuple[Solid, ...]) -> float:
    """The greatest height of some solids [m]."""
    return max(solid.at_m[2] + float(np.abs(turn_of(solid)[2] @ np.diag(half_of(solid))).sum()) for solid in solids)


def half_of(solid: Solid) -> Vector:
    """Half the extent of a solid along its own axes [m]."""
    a, b, c = solid.size_m
    return {"box": (a / 2, b / 2, c / 2), "cylinder": (a, a, b / 2), "sphere": (a, a, a)}[solid.kind]


def turn_of(solid: Solid) -> FloatArray:
    """Its rotation, shape (3, 3)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(solid.rpy_rad), np.cos(solid.rpy_rad)
    return np.array([[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                     [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                     [-sp, cp * sr, cp * cr]])


def quaternion_of(solid: Solid) -> FloatArray:
    """Its rotation as x, y, z, w."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(np.array(solid.rpy_rad) / 2), np.cos(np.array(solid.rpy_rad) / 2)
    return np.array([sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy,
                     cr * cp * cy + sr * sp * sy])
