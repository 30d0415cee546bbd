"""What came of a team's mission: the robots' outcomes, and the news that changed their orders."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sva_bench.execution.outcome import Outcome, RobotFate


@dataclass(frozen=True, kw_only=True)
class Reaction:
    """News of failures, and what a policy made of it.

    Attributes:
        time_s: When the news came [s on the mission clock].
        failed: Robots that are known to be dead from now on.
        learned: Robots that it reached.
        before, after: Remaining orders of the robots whose orders changed.
        since: Site from which these go on: where the robot stands or is going.
        lived: Robots of these that get there. One that is dead, or dies on the way, and isn't missed yet is told in
            vain.
    """

    time_s: float
    failed: tuple[str, ...]
    learned: tuple[str, ...]
    before: Mapping[str, tuple[str, ...]]
    after: Mapping[str, tuple[str, ...]]
    since: Mapping[str, str] = field(default_factory=dict)
    lived: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class TeamOutcome:
    """What came of a team's mission.

    Attributes:
        robots: Each robot's outcome.
        stops: Stops that each robot was sent to one after the other, the base first, up to the one at which it ended or
            which it was on its way to.
        reactions: News that came, in order.
        fates: When each robot failed, in this mission.
        left_over: POIs that each robot had yet to visit when it ended, or visited too late, and that nobody collected.
        doubled: POIs that two robots visited.
    """

    robots: tuple[Outcome, ...]
    stops: tuple[tuple[str, ...], ...]
    reactions: tuple[Reaction, ...]
    fates: tuple[RobotFate, ...]
    left_over: tuple[tuple[str, ...], ...]
    doubled: int

    @property
    def orders_change(self) -> bool:
        """Whether a robot that lives to take them gets other orders."""
        return any(reaction.lived for reaction in self.reactions)
