"""What a policy is: from the state of a team at an epoch to what is left of its orders."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from sva_bench.choices import End


@dataclass(frozen=True, kw_only=True)
class RobotState:
    """One robot at an epoch, or at its next one: legs are atomic.

    Attributes:
        robot: Its name.
        site: Site of its next epoch; where it was last, if its mission is over.
        ready_s: When that epoch is [s on the mission clock].
        burnt_s: Fuel burnt since it was filled last [s of driving].
        remaining: Sites that it is to go to from there, the base last.
        end: How its mission ended; ``None`` as long as it goes on.
    """

    robot: str
    site: str
    ready_s: float
    burnt_s: float
    remaining: tuple[str, ...]
    end: End | None


@dataclass(frozen=True, kw_only=True)
class TeamState:
    """A team at an epoch: a robot stands at a stop, its stop time over.

    Attributes:
        time_s: Mission clock [s].
        at_epoch: Position of the robot whose epoch it is.
        robots: Every robot, in the order of the team.
    """

    time_s: float
    at_epoch: int
    robots: tuple[RobotState, ...]


class Policy(Protocol):
    """A rule that says what is left of each robot's orders. A pure function: the same state, the same orders."""

    def __call__(self, state: TeamState) -> Mapping[str, tuple[str, ...]]:
        """Sites that robots are to go to from their next epochs on, the base last; who is left out keeps its orders."""
        ...
