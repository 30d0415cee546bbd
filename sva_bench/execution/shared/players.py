"""The robots of a shared mission on their way, and what came of it: the types."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from sva_bench.choices import Fault, News, PolicyName
from sva_bench.execution.engines.engine import Pose
from sva_bench.execution.noise import NoiseDraw
from sva_bench.execution.outcome import Driven, Outcome, RobotFate
from sva_bench.execution.rules import LegDriven, RobotMission
from sva_bench.execution.shared.driver import Hold, LegSoFar
from sva_bench.execution.shared.lanes import Cut
from sva_bench.execution.team_outcome import TeamOutcome
from sva_bench.mission.failures import NEVER
from sva_bench.mission.plan import Route


class MissionKey(NamedTuple):
    """What a mission depends on in a world.

    Attributes:
        routes, fates: Those of all robots.
        rollout: The noise draw.
        reaction: Scenario, policy and news of a team that reacts; ``None`` = it keeps its orders.
    """

    routes: tuple[Route, ...]
    fates: tuple[RobotFate, ...]
    rollout: int
    reaction: tuple[str, PolicyName, News] | None = None

    @property
    def unfailed(self) -> MissionKey:
        """The same if no robot fails on its way."""
        return self._replace(fates=tuple(RobotFate(0 if fate.before_poi == 0 else NEVER) for fate in self.fates))


BRAKING = "replanning"
"""The cause of waits while a team brakes and plans anew."""

Trail = tuple[tuple[LegSoFar, ...], ...]
"""A robot's legs as it drove them, each in one part, or in several where it was planned anew on its way."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TeamDriven:
    """What came of one mission of a team.

    Attributes:
        names: The robots.
        robots: Each robot's outcome.
        stops: The stops that each was sent to, the base first.
        driven: What each drove.
        trails: The same over time; without poses unless traced.
        cuts: The ways that each was planned to drive at first.
        starts: Where each stood at first, not where it believed to be.
        contacts: How many times two robots touched each other.
        led_round: Of each leg that a robot drove, whether it led another way than the shortest, because of others.
        replanned: Whether anything was planned anew, or a robot stands for good away from its berth.
        in_physics: Whether physics drove it.
        twin_s: Driving time by the twin [s], where physics drove to check it; else ``None``.
        traced: Whether poses were kept.
        asked_s: When a robot last asked to go first [s].
        switched: How many times one was let go first.
        told: The same as of a team that reacts; ``None`` if it doesn't.
    """

    names: tuple[str, ...]
    robots: tuple[Outcome, ...]
    stops: tuple[tuple[str, ...], ...]
    driven: tuple[Driven, ...]
    trails: tuple[Trail, ...]
    cuts: tuple[tuple[Cut, ...], ...]
    starts: tuple[Pose, ...]
    contacts: int
    led_round: tuple[tuple[bool, ...], ...]
    replanned: bool
    in_physics: bool = False
    twin_s: float | None = None
    traced: bool = False
    asked_s: float = -math.inf
    switched: int = 0
    told: TeamOutcome | None = None

    @property
    def detours(self) -> int:
        """How many legs led another way than the shortest, because of other robots."""
        return sum(map(sum, self.led_round))

    @property
    def waited_s(self) -> float:
        """How long robots waited for others, or until all had braked, added up over the team [s]."""
        others = {*self.names, BRAKING}
        return sum(wait.lasts_s for driven in self.driven for wait in driven.waits if wait.cause in others)


@dataclass(eq=False, kw_only=True)
class Player:
    """One robot of a mission on its way.

    Attributes:
        number: Its position in its team.
        mission: Its mission so far.
        drawn: How it differs from its model in this mission.
        stops: Stops that it was sent to, the base first.
        at: The site where it made its last stop; ``None`` = beside one that was taken.
        cuts: The ways of its legs from here on, the one that it is on first.
        holds: What it meets on the leg that it is on, as planned last.
        on_its_way: Whether that is what is left of the leg as planned before, from ``begun_m`` along that [m].
        around: Of each of these, whether it leads another way than the shortest.
        parts: What it drove of the leg that it is on before that was planned anew.
        legs: The legs that are over.
        led_round: Of each of them, whether it led another way than the shortest.
        trail: What it drove of each of them.
        down: Whether it stands for good away from its berth.
        fault: Why it got stuck where nothing held it.
        anew: Whether it stands at a stop from which its way is to be found anew: its cuts are none that it drives.
    """

    number: int
    mission: RobotMission
    drawn: NoiseDraw
    stops: list[str]
    at: str | None = None
    cuts: list[Cut] = field(default_factory=list)
    holds: list[Hold] = field(default_factory=list)
    on_its_way: bool = False
    begun_m: float = 0.0
    around: list[bool] = field(default_factory=list)
    parts: list[LegSoFar] = field(default_factory=list)
    legs: list[LegDriven] = field(default_factory=list)
    led_round: list[bool] = field(default_factory=list)
    trail: list[tuple[LegSoFar, ...]] = field(default_factory=list)
    down: bool = False
    fault: Fault | None = None
    anew: bool = False

    @property
    def active(self) -> bool:
        """Whether its mission goes on."""
        return self.mission.end is None

    @property
    def so_far_s(self) -> tuple[float, float]:
        """How long it drove and waited on its leg before that was planned anew [s]."""
        return (sum(part.driving_s for part in self.parts),
                sum(wait.lasts_s for part in self.parts for wait in part.waits))


def driven_by(player: Player) -> Driven:
    """What a robot drove, leg by leg; poses are in its trail."""
    return Driven(
        fault=player.fault, start_s=player.mission.start_s,
        leg_s=np.array([leg.time_s for leg in player.legs]), stuck=bool(player.legs) and player.legs[-1].stuck,
        leg_of=np.empty(0), clock_s=np.empty(0), pose=np.empty((0, 3)), capacity=player.drawn.capacity,
        touches=tuple(touch for leg in player.legs for touch in leg.touches),
        waits=tuple(wait for leg in player.legs for wait in leg.waits))
