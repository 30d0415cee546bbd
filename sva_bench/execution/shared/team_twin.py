"""A team in motion by its equations of motion alone: the kinematic twins of its robots, together."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.execution.shared.driver import Member
from sva_bench.execution.shared.motion import TeamMotion
from sva_bench.execution.shared.ticks import drive_on
from sva_bench.execution.shared.ways import Ways


class TeamTwin(TeamMotion):
    """Robots that do what they are told, but for their gains, track, delay and localisation.

    They drive through obstacles and through each other; that hulls touch is told from their distance. A robot that has
    no gates takes the time, and the way, that ``robot.twin.drive`` takes for its hops, to the bit.
    """

    def __init__(self, members: Sequence[Member], *, traced: bool = False) -> None:
        """The robots at rest, at 0 on the mission clock.

        Args:
            members: The robots.
            traced: Whether poses are kept.
        """
        super().__init__(members, traced=traced)

    def _until_something(self, ways: Ways) -> int:
        code: int = drive_on(self._robots, self._teams, ways, self._notes, self._parts, True)
        return code
