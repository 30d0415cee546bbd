"""What an engine is: a robot in a world that is moved one control step at a time.

An engine knows no path, no mission and no rule: the follower's loop and the stuck rule are in ``following``. A new one
is a class and a line in ``ENGINES``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Protocol, Self

from sva_bench.choices import EngineName, Fault, Fidelity
from sva_bench.execution.engines.bullet import Bullet
from sva_bench.execution.engines.ideal import Ideal
from sva_bench.execution.touch import Touch
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.disturbance import Disturbance
from sva_bench.robot.model import RobotModel

Pose = tuple[float, float, float]
"""x, y [m], yaw [rad]."""


class Engine(Protocol):
    """One robot in a world. A context manager; each drive wants a fresh one, which repeats bit for bit."""

    @property
    def touches(self) -> Sequence[Touch]:
        """Each time that the hull came to touch an obstacle, so far."""
        ...

    @property
    def fault(self) -> Fault | None:
        """Why it drives no more, once it doesn't, wherever it may be."""
        ...

    def pose(self) -> Pose:
        """x, y [m], yaw [rad]."""
        ...

    def step(self, left_m_s: float, right_m_s: float) -> None:
        """Advance by one control step, 1 / ``CONTROL_HZ`` s.

        Args:
            left_m_s, right_m_s: Speed along the floor that the left and the right wheel are commanded to have, before
                the disturbance.
        """
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None: ...


class MakesEngine(Protocol):
    """Builds a world with one robot in it."""

    def __call__(self, obstacles: Obstacles, model: RobotModel, pose: Pose, disturbance: Disturbance) -> Engine:
        """The robot at rest in that pose."""
        ...


ENGINES: Mapping[EngineName, MakesEngine] = {"ideal": Ideal, "bullet": Bullet}

ENGINE_OF: Mapping[Fidelity, EngineName] = {"kinematic": "ideal", "rollout": "bullet", "physics": "bullet"}
"""What each fidelity drives in; ``kinematic`` by the compiled twin, which is the follower over ``ideal``."""
