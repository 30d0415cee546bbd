"""What a policy is: from the state of a team, as it knows it, to what is left of its orders."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from sva_bench.choices import Standing

Orders = Mapping[str, tuple[str, ...]]
"""Sites that robots are to go to from their next stops on, the base last; who is left out keeps its orders."""


@dataclass(frozen=True, kw_only=True)
class RobotState:
    """One robot as its team knows it: where it can take new orders next, by schedule or by its own report.

    Attributes:
        robot: Its name.
        site: The stop at which it can: where it stands, or where it is going, for a leg is driven to its end.
        ready_s: When its stop there is over [s on the mission clock]: by the schedule, or later if it was late before.
        burnt_s: Fuel burnt since it was filled last, then [s of driving].
        remaining: Its orders from there on, the base last; empty if it goes home, or waits there.
        standing: What is known of it.
        reached: Whether it takes new orders now.
    """

    robot: str
    site: str
    ready_s: float
    burnt_s: float
    remaining: tuple[str, ...]
    standing: Standing
    reached: bool


@dataclass(frozen=True, kw_only=True)
class TeamState:
    """A team to which news of a failure has come.

    Attributes:
        time_s: Mission clock [s].
        robots: Every robot, in the order of the team.
        open_pois: POIs that no robot has visited, and none that isn't known to be dead is on its way to.
    """

    time_s: float
    robots: tuple[RobotState, ...]
    open_pois: frozenset[str]


class Policy(Protocol):
    """A rule that says what is left of each robot's orders.

    It is asked when news of a failure comes, never because time has passed, so the plan stays the plan. A pure
    function, and not of the time: the same robots and POIs, the same orders.
    """

    def __call__(self, state: TeamState) -> Orders:
        """The orders of robots that are reached."""
        ...
