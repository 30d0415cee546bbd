"""A unicycle: wheels that do what they are told, but for their gains and track, in a world that nothing stands in."""

from __future__ import annotations

from types import TracebackType
from typing import Self

import numpy as np

from sva_bench.choices import Fault
from sva_bench.execution.touch import Touch
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.disturbance import Disturbance
from sva_bench.robot.follower import CONTROL_HZ
from sva_bench.robot.model import RobotModel
from sva_bench.robot.twin import advance


class Ideal:
    """The kinematic twin, step by step: the same arithmetic to the bit, so the follower takes the same time."""

    touches: tuple[Touch, ...] = ()
    fault: Fault | None = None

    def __init__(self, obstacles: Obstacles, model: RobotModel, pose: tuple[float, float, float],
                 disturbance: Disturbance) -> None:
        del obstacles  # it drives through all of them
        self._pose = np.array(pose, dtype=np.float64)
        self._track = model.track_m * disturbance.track_gain
        self._gains = disturbance.wheel_gains

    def pose(self) -> tuple[float, float, float]:
        """x, y [m], yaw [rad]."""
        return float(self._pose[0]), float(self._pose[1]), float(self._pose[2])

    def step(self, left_m_s: float, right_m_s: float) -> None:
        """Advance by one control step along an arc."""
        left, right = self._gains
        advance(self._pose, left_m_s * left, right_m_s * right, self._track, 1.0 / CONTROL_HZ)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Nothing to close."""
