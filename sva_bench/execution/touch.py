"""What a robot's hull touched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sva_bench.geometry.distances import point_box
from sva_bench.geometry.obstacles import Obstacles


@dataclass(frozen=True, kw_only=True)
class Touch:
    """One time that a hull touched an obstacle or another robot, until it was free again.

    Attributes:
        since_s: When it came to touch [s of driving since the leg began; in an engine, since it was opened].
        lasted_s: For how long [s].
        x_m, y_m: Where the hull touched first [m].
        solid: What: ``wall`` (of the bounds), ``box 3``, ``cylinder 1``, numbered in the order of the world; engines
            leave it open, for they don't know all.
        leg: The leg of the route on which it happened; engines know of one only.
        robot: Number of the robot that it touched; ``None`` = it was an obstacle.
    """

    since_s: float
    lasted_s: float
    x_m: float
    y_m: float
    solid: str = ""
    leg: int = 0
    robot: int | None = None


def solid_at(obstacles: Obstacles, x: float, y: float) -> str:
    """The obstacle that is nearest to a point, as ``Touch.solid`` names it."""
    x0, y0, x1, y1 = obstacles.bounds_m.tolist()
    nearest, name = min(x - x0, y - y0, x1 - x, y1 - y), "wall"
    for k, (bx, by, hx, hy, yaw) in enumerate(obstacles.boxes.tolist()):
        c, s = np.cos(yaw), np.sin(yaw)
        gap = point_box(c * (x - bx) + s * (y - by), -s * (x - bx) + c * (y - by), hx, hy)
        if gap < nearest:
            nearest, name = gap, f"box {k + 1}"
    for k, (cx, cy, radius) in enumerate(obstacles.cylinders.tolist()):
        gap = float(np.hypot(x - cx, y - cy)) - radius
        if gap < nearest:
            nearest, name = gap, f"cylinder {k + 1}"
    return name
