"""What a team knows of its robots on their way, and what it makes of news: the same however its robots are driven.

The team counts on its schedule, or on a robot's own report if that was later than the schedule: what it decides is then
the same whatever noise makes a robot quicker than planned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

from sva_bench.choices import News, Standing
from sva_bench.execution.outcome import Assignment
from sva_bench.execution.policies.policy import Policy, RobotState, TeamState
from sva_bench.execution.rules import RobotMission
from sva_bench.execution.team_outcome import Reaction, TeamOutcome


@dataclass(frozen=True, kw_only=True)
class Team:
    """What a mission is played with.

    Attributes:
        orders: Each robot's plan and rules.
        base: Where all begin and end.
        pois: All POIs, also those on nobody's route.
        policy: What the team does about news.
        news: When it learns of a failure.
        scheduled_s: Planned driving time from one stop to another, by the robot's position [s].
    """

    orders: tuple[Assignment, ...]
    base: str
    pois: frozenset[str]
    policy: Policy
    news: News
    scheduled_s: Callable[[int, str, str], float]


@dataclass(eq=False, kw_only=True)
class LegDue:
    """A leg that a robot is on, as its team knows it.

    Attributes:
        to: Its end.
        departed_s: When it left and began to drive, waits on the way that are known ahead being over [s].
        due_s: When it is expected there [s].
        ready_s, burnt_s: When it is expected to leave again, and what it will have burnt by then, by schedule [s].
        arrived_s: When it gets there [s]; ``inf`` if it never does, or hasn't yet.
    """

    to: str
    departed_s: float
    due_s: float
    ready_s: float
    burnt_s: float
    arrived_s: float = math.inf


@dataclass(eq=False, kw_only=True)
class KnownRobot:
    """One robot: its mission as it is, and what the team counts on.

    Attributes:
        number: Its position in the team.
        mission: Its mission; ``None`` while it waits at the base without a route.
        stops: Stops that it was sent to, the base first.
        ready_s, burnt_s: When it is to leave its last stop, and what it has burnt by then, by schedule or report.
        remaining: Orders from its next decision epoch on.
        leg: The leg that it is on, or was on when it ended.
        heard_s: When it first reported [s].
        visited: POIs that it reached.
        learned: Robots that it knows to be dead.
        left_out: POIs that it was to visit and was kept from.
    """

    number: int
    mission: RobotMission | None
    stops: list[str]
    remaining: tuple[str, ...]
    ready_s: float = 0.0
    burnt_s: float = 0.0
    leg: LegDue | None = None
    heard_s: float = math.inf
    visited: list[str] = field(default_factory=list)
    learned: set[int] = field(default_factory=set)
    left_out: list[str] = field(default_factory=list)


RobotT = TypeVar("RobotT", bound=KnownRobot)


class KnownTeam(Generic[RobotT]):
    """A team on its way.

    Args:
        team: The team.
        robots: Its robots, at the base.

    Attributes:
        robots: Its robots.
        dead: Those of whose failure news has come.
    """

    def __init__(self, team: Team, robots: Sequence[RobotT]) -> None:
        self._team, self.robots = team, robots
        self.dead: set[int] = set()
        self._reactions: list[Reaction] = []
        self._told: dict[int, list[int]] = {}  # reactions by whose orders robots go on, if they get so far

    def leave(self, robot: RobotT, to: str, now: float) -> None:
        """A robot sets off, with a leg as it is expected to be."""
        scheduled_s = self._team.scheduled_s(robot.number, robot.stops[-1], to)
        orders, due_s = self._team.orders[robot.number], robot.ready_s + scheduled_s
        burnt_s, stop_s = robot.burnt_s + scheduled_s, orders.stop_s[to]
        if to in orders.stations:
            robot.leg = LegDue(to=to, departed_s=now, due_s=due_s, burnt_s=0.0,
                               ready_s=due_s + stop_s + burnt_s / orders.charge_rate.get(to, math.inf))
        else:
            robot.leg = LegDue(to=to, departed_s=now, due_s=due_s, ready_s=due_s + stop_s,
                               burnt_s=burnt_s + orders.idle_share * stop_s)

    def arrive(self, robot: RobotT, *, at_poi: bool) -> None:
        """A robot reached the end of its leg, and reports; its mission is that after the stop."""
        mission, leg = robot.mission, robot.leg
        assert mission is not None
        assert leg is not None
        leg.arrived_s = mission.arrived_s
        robot.heard_s = min(robot.heard_s, leg.arrived_s)
        if at_poi:
            robot.visited.append(leg.to)
        robot.ready_s = max(leg.ready_s, mission.clock_s)
        robot.burnt_s = leg.burnt_s
        if leg.to not in mission.orders.stations:
            robot.burnt_s = max(leg.burnt_s, mission.orders.fuel_capacity_s - mission.tank_s)

    def missing_s(self, robot: RobotT, failed_s: float) -> float | None:
        """When news comes of a robot that has failed [s]; ``None`` = never."""
        assert robot.leg is not None
        if self._team.news == "never":
            return None
        return failed_s if self._team.news == "instant" else max(failed_s, robot.leg.due_s)

    def takes_orders(self, robot: RobotT, now: float) -> bool:
        """Whether a robot can be told something that makes a difference, as far as anybody knows."""
        if robot.number in self.dead:
            return False
        if robot.mission is None:
            return True
        return bool(robot.remaining) and not (robot.mission.end == "home" and now >= robot.ready_s)

    def react(self, now: float, failed: Iterable[int], reached: Sequence[RobotT],
              give: Callable[[RobotT, tuple[str, ...]], bool]) -> None:
        """Ask the policy, and pass its orders on.

        Args:
            now: When [s].
            failed: Robots that are known to be dead from now on.
            reached: Robots that learn of it.
            give: Changes a robot's orders from its next decision epoch on; whether it gets to the stop from which they
                go on, as far as that is known.

        Raises:
            ValueError: If the policy leaves a robot with orders that don't end at the base.
        """
        for robot in reached:
            robot.learned |= set(failed)
        names = [own.robot for own in self._team.orders]
        state = self._state(now, {robot.number for robot in reached})
        orders = self._team.policy(state) if reached else {}
        before, after, since = {}, {}, {}
        lived = []
        for robot in reached:
            name = names[robot.number]
            new = orders.get(name, robot.remaining)
            if new != robot.remaining:
                if new and new[-1] != self._team.base:
                    raise ValueError(f"the remaining orders of {name} don't end at the base: {new}")
                before[name], after[name] = robot.remaining, new
                since[name] = state.robots[robot.number].site
                robot.remaining = new
                if give(robot, new):
                    lived.append(name)
                else:
                    self._told.setdefault(robot.number, []).append(len(self._reactions))
        self._reactions.append(Reaction(
            time_s=now, failed=tuple(names[k] for k in sorted(failed)), before=before, after=after, since=since,
            lived=tuple(lived), learned=tuple(names[robot.number] for robot in reached)))

    def gets_orders(self, robot: RobotT) -> None:
        """A robot got to the stop from which its new orders go on, if it has any, which was not known before."""
        for number in self._told.pop(robot.number, []):
            reaction = self._reactions[number]
            lived = {*reaction.lived, self._team.orders[robot.number].robot}
            self._reactions[number] = replace(reaction, lived=tuple(name for name in reaction.after if name in lived))

    def _state(self, now: float, reached: set[int]) -> TeamState:
        taken = {site for robot in self.robots for site in self._taken_by(robot, now)}
        return TeamState(time_s=now, open_pois=self._team.pois - taken, robots=tuple(
            self._seen(robot, now, reached=robot.number in reached) for robot in self.robots))

    def _taken_by(self, robot: RobotT, now: float) -> list[str]:
        """POIs that a robot has visited, or is on its way to."""
        leg = robot.leg
        on_the_way = leg is not None and now < leg.arrived_s
        visited = [poi for poi in robot.visited if not (on_the_way and leg is not None and poi == leg.to)]
        return [*visited, leg.to] if leg is not None and on_the_way and robot.number not in self.dead else visited

    def _seen(self, robot: RobotT, now: float, *, reached: bool) -> RobotState:
        """A robot as the team knows it."""
        orders, leg = self._team.orders[robot.number], robot.leg
        site, ready_s, burnt_s = robot.stops[-1], robot.ready_s, robot.burnt_s
        if robot.mission is None:
            ready_s = now
        elif leg is not None and now < leg.arrived_s:  # whether it is late, or ended on this leg, isn't known yet
            site, ready_s, burnt_s = leg.to, leg.ready_s, leg.burnt_s
        standing: Standing = "alive"
        if robot.number in self.dead:
            standing = "dead"
        elif robot.mission is not None and robot.mission.end in ("home", "late") and leg is not None and \
                now >= leg.arrived_s:
            standing = "home"
        elif self._team.news != "instant" and now < robot.heard_s:
            standing = "unheard"
        return RobotState(robot=orders.robot, site=site, ready_s=ready_s, burnt_s=burnt_s, remaining=robot.remaining,
                          standing=standing, reached=reached)

    def outcome(self) -> TeamOutcome:
        """What came of it, once all events are over."""
        visits = [poi for robot in self.robots for poi in robot.visited]
        missions = [robot.mission or RobotMission(self._team.orders[robot.number]) for robot in self.robots]
        robots = tuple(mission.outcome() for mission in missions)
        collected = {event.site for robot in robots for event in robot.events if event.kind == "collected"}
        left_over = tuple(tuple(site for site in (*robot.visited, *robot.left_out, *mission.ahead)
                                if site in self._team.pois - collected)
                          for robot, mission in zip(self.robots, missions, strict=True))
        return TeamOutcome(
            robots=robots, reactions=tuple(self._reactions), fates=tuple(mission.fate for mission in missions),
            left_over=left_over,
            stops=tuple(tuple(robot.stops) if robot.mission is not None else () for robot in self.robots),
            doubled=len(visits) - len(set(visits)))
