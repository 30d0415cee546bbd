"""Missions of teams that react, driven whole in physics: the check of those put together from legs."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import replace

from sva_bench.execution.case import Settings
from sva_bench.execution.chance import Drawn
from sva_bench.execution.drives import Courses, Drives, drive_all
from sva_bench.execution.known_legs import KnownLegs, longest
from sva_bench.execution.team import Team, play
from sva_bench.execution.team_outcome import TeamOutcome
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World


class WholeDrives:
    """Physics in which robots drive one leg after the other without being put onto their sites in between.

    Args:
        world, costs, settings: As missions were played.
        executor: Where drives run; ``None`` = here.
    """

    def __init__(self, world: World, costs: Mapping[str, FuelCosts], settings: Settings, executor: Executor | None
                 ) -> None:
        whole = replace(settings, fidelity="physics", recorded=False)
        self._legs, self._courses = KnownLegs(world, costs, whole), Courses(world, costs, whole)
        self._drives, self._executor = Drives(), executor

    def ends_alike(self, team: Team, mission: TeamOutcome, rollout: int) -> bool:
        """Whether a mission has the same stops, ends and incentives if every robot drives its route whole.

        Args:
            team: What it was played with.
            mission: What came of it.
            rollout: Its noise draw.
        """
        while True:
            again = play(team, Drawn(mission.fates), self._legs.driven(rollout))
            if not self._legs.missing:
                return _essence(again) == _essence(mission)
            wanted, self._legs.missing = longest(self._legs.missing), {}
            drive_all(self._courses.chunks(wanted, self._drives), self._drives, self._executor, None)
            self._courses.compose(wanted, self._drives)
            self._legs.learn(wanted, self._drives)


def _essence(mission: TeamOutcome) -> list[tuple[object, ...]]:
    return [(stops, outcome.end, outcome.incentive)
            for stops, outcome in zip(mission.stops, mission.robots, strict=True)]
