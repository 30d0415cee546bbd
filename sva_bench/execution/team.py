"""A team's mission, event by event: robots leave stops, fail, are missed, and get new orders from a policy.

Decision epochs come at news of a failure and at no other time. A leg is driven to its end, so new orders begin at the
stop that a robot stands at or is going to. The team counts on its schedule, or on a robot's own report if that was
later than the schedule: what it decides is then the same whatever noise makes a robot quicker than planned.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

from sva_bench.choices import News, Standing
from sva_bench.execution.chance import Chance, Window
from sva_bench.execution.outcome import Assignment, RobotFate
from sva_bench.execution.policies.policy import Policy, RobotState, TeamState
from sva_bench.execution.rules import LegDriven, RobotMission
from sva_bench.execution.team_outcome import Reaction, TeamOutcome

_NEWS, _STOP = 0, 1  # news comes before departures at the same time


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
class _Leg:
    """A leg that a robot is on.

    Attributes:
        to: Its end.
        departed_s: When it left and began to drive, its waits on the way being over [s].
        due_s: When it is expected there [s].
        ready_s, burnt_s: When it is expected to leave again, and what it will have burnt by then, by schedule [s].
        arrived_s: When it gets there [s]; ``inf`` if it never does.
        window: When it fails on the leg [s of driving], if it does and the moment is open.
        driven: The leg, as long as the moment is open.
    """

    to: str
    departed_s: float
    due_s: float
    ready_s: float
    burnt_s: float
    arrived_s: float = math.inf
    window: Window | None = None
    driven: LegDriven | None = None


@dataclass(eq=False, kw_only=True)
class _Robot:
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
    """

    number: int
    mission: RobotMission | None
    stops: list[str]
    remaining: tuple[str, ...]
    ready_s: float = 0.0
    burnt_s: float = 0.0
    leg: _Leg | None = None
    heard_s: float = math.inf
    visited: list[str] = field(default_factory=list)
    learned: set[int] = field(default_factory=set)


def play(team: Team, chance: Chance, legs: Callable[[int, tuple[str, ...]], LegDriven]) -> TeamOutcome:
    """Play one mission.

    Events come by time; at equal times news before departures, then by the robot's position.

    Args:
        team: The team.
        chance: What decides about failures.
        legs: The last leg of a robot that was sent to these stops so far, by its position.

    Raises:
        ValueError: If the policy leaves a robot with orders that don't end at the base.
    """
    return _Play(team, chance, legs).outcome()


class _Play:
    """One mission on its way."""

    def __init__(self, team: Team, chance: Chance, legs: Callable[[int, tuple[str, ...]], LegDriven]) -> None:
        self._team, self._chance, self._legs = team, chance, legs
        self._events: list[tuple[float, int, int]] = []
        self._dead: set[int] = set()  # of which news has come
        self._reactions: list[Reaction] = []
        self._robots = [self._begin(number, own) for number, own in enumerate(team.orders)]
        while self._events:
            now, kind, number = heapq.heappop(self._events)
            if kind == _NEWS:
                heard = [self._robots[number]]
                while self._events and self._events[0][:2] == (now, _NEWS):  # what comes at once is answered at once
                    heard.append(self._robots[heapq.heappop(self._events)[2]])
                self._hear(now, heard)
            else:
                self._leave(now, self._robots[number])

    def _begin(self, number: int, orders: Assignment) -> _Robot:
        """A robot at the base, at the start."""
        robot = _Robot(number=number, mission=None, stops=[self._team.base], remaining=orders.route[1:])
        if orders.route:
            self._set_off(robot, orders, 0.0)
        elif self._team.news == "instant" and not self._chance.leaves(number):
            heapq.heappush(self._events, (0.0, _NEWS, number))
        return robot

    def _set_off(self, robot: _Robot, orders: Assignment, now: float) -> None:
        """Give a robot at the base its route; one drawn to fail for the whole mission never leaves."""
        able = self._chance.leaves(robot.number)
        robot.mission = RobotMission(orders, RobotFate() if able else RobotFate(before_poi=0), start_s=now)
        robot.ready_s = now
        if able:
            heapq.heappush(self._events, (now, _STOP, robot.number))
        else:
            robot.leg = self._leg(robot, orders.route[1], now)
            robot.remaining = orders.route[2:]
            self._report_missing(robot, now)

    def _leg(self, robot: _Robot, to: str, now: float) -> _Leg:
        """A leg as it is expected to be."""
        scheduled_s = self._team.scheduled_s(robot.number, robot.stops[-1], to)
        orders, due_s = self._team.orders[robot.number], robot.ready_s + scheduled_s
        burnt_s, stop_s = robot.burnt_s + scheduled_s, orders.stop_s[to]
        if to in orders.stations:
            return _Leg(to=to, departed_s=now, due_s=due_s, burnt_s=0.0,
                        ready_s=due_s + stop_s + burnt_s / orders.charge_rate.get(to, math.inf))
        return _Leg(to=to, departed_s=now, due_s=due_s, ready_s=due_s + stop_s,
                    burnt_s=burnt_s + orders.idle_share * stop_s)

    def _leave(self, now: float, robot: _Robot) -> None:
        """A robot's stop is over: it may learn of failures there, and goes on."""
        mission = robot.mission
        assert mission is not None
        if found := self._found_failed(now, robot):
            self._hear(now, found)
        if mission.end is not None:  # told to stay at the base
            return
        if self._team.news == "station" and robot.stops[-1] in mission.orders.stations and \
                (new := self._dead - robot.learned):
            self._react(now, new, [robot])
        to = mission.ahead[0]
        if mission.orders.is_poi(to) and not self._chance.tries(robot.number, mission.pois + 1):
            mission.fate = RobotFate(before_poi=mission.pois + 1)
        robot.leg = leg = self._leg(robot, to, now)
        robot.remaining = mission.ahead[1:]
        if mission.depart() is None:
            self._report_missing(robot, now)
            return
        robot.stops.append(to)
        driven = self._legs(robot.number, tuple(robot.stops))
        leg.departed_s = now + driven.waited_s
        window = self._chance.drives(robot.number, mission.driven_s, mission.driven_s + mission.lasts(driven))
        if window is None:
            self._drive(robot, driven)
        elif window.since_s == window.until_s:
            self._fail_at(robot, driven, window.since_s)
        else:
            self._fail_within(robot, leg, driven, window)

    def _drive(self, robot: _Robot, driven: LegDriven) -> None:
        """Drive a leg, and wait for the end of the stop."""
        mission, leg = robot.mission, robot.leg
        assert mission is not None
        assert leg is not None
        was_poi = mission.orders.is_poi(leg.to)
        mission.drive(driven)
        if mission.end in ("failed", "out_of_fuel", "stuck"):
            self._report_missing(robot, mission.clock_s)
            return
        leg.arrived_s = mission.arrived_s
        robot.heard_s = min(robot.heard_s, leg.arrived_s)
        if was_poi:
            robot.visited.append(leg.to)
        robot.ready_s = max(leg.ready_s, mission.clock_s)
        robot.burnt_s = leg.burnt_s
        if leg.to not in mission.orders.stations:
            robot.burnt_s = max(leg.burnt_s, mission.orders.fuel_capacity_s - mission.tank_s)
        if mission.end is None:
            heapq.heappush(self._events, (mission.clock_s, _STOP, robot.number))

    def _fail_at(self, robot: _Robot, driven: LegDriven, driven_s: float) -> None:
        """Fail on a leg after so much driving in all."""
        assert robot.mission is not None
        robot.mission.fate = RobotFate(lifetime_s=driven_s)
        self._drive(robot, driven)

    def _fail_within(self, robot: _Robot, leg: _Leg, driven: LegDriven, window: Window) -> None:
        """Fail on a leg at a moment that stays open as long as it makes no difference to anybody."""
        ends_s = leg.departed_s + (window.until_s - window.since_s)
        leg.window, leg.driven = window, driven
        if self._team.news == "never" or (self._team.news != "instant" and leg.due_s >= ends_s):
            self._close(robot, window)
        else:
            heapq.heappush(self._events, (ends_s, _NEWS, robot.number))

    def _close(self, robot: _Robot, window: Window) -> None:
        """Settle when a robot failed, by the mean of what is possible."""
        leg = robot.leg
        assert leg is not None
        assert leg.driven is not None
        leg.window = None
        self._fail_at(robot, leg.driven, self._chance.middle_s(robot.number, window))

    def _found_failed(self, now: float, leaving: _Robot | None = None) -> list[_Robot]:
        """Robots whose failure was open and is known by now.

        Args:
            now: When [s].
            leaving: The robot that leaves a stop; where news comes at stations, only one that leaves a station asks.
        """
        news = self._team.news
        at_station = leaving is not None and leaving.stops[-1] in self._team.orders[leaving.number].stations
        heard = []
        for robot in self._robots:
            leg = robot.leg
            if robot is leaving or leg is None or leg.window is None or robot.mission is None:
                continue
            if news == "instant" or (now >= leg.due_s and (news == "report" or at_station)):
                by_now = robot.mission.driven_s + max(now - leg.departed_s, 0.0)
                found = self._chance.failed_by(robot.number, leg.window, by_now)
                if found is None:
                    leg.window = Window(max(leg.window.since_s, by_now), leg.window.until_s)
                else:
                    self._close(robot, found)
                    heard.append(robot)
        return heard

    def _report_missing(self, robot: _Robot, failed_s: float) -> None:
        """A robot has failed: when news of it comes."""
        assert robot.leg is not None
        if self._team.news == "never":
            return
        when = failed_s if self._team.news == "instant" else max(failed_s, robot.leg.due_s)
        heapq.heappush(self._events, (when, _NEWS, robot.number))

    def _hear(self, now: float, robots: Sequence[_Robot]) -> None:
        """News of failures comes; of a robot whose failure is open yet, the moment is over by which it happened."""
        for robot in robots:
            if robot.leg is not None and robot.leg.window is not None:
                self._close(robot, robot.leg.window)
        new = {robot.number for robot in robots} - self._dead
        if not new:
            return
        new |= {robot.number for robot in self._found_failed(now)}  # what comes at once is answered at once
        self._dead |= new
        if self._team.news != "station":
            self._react(now, new, [r for r in self._robots if self._takes_orders(r, now)])

    def _takes_orders(self, robot: _Robot, now: float) -> bool:
        """Whether a robot can be told something that makes a difference, as far as anybody knows."""
        if robot.number in self._dead:
            return False
        if robot.mission is None:
            return True
        return bool(robot.remaining) and not (robot.mission.end == "home" and now >= robot.ready_s)

    def _react(self, now: float, failed: Iterable[int], reached: Sequence[_Robot]) -> None:
        """Ask the policy, and pass its orders on."""
        for robot in reached:
            robot.learned |= set(failed)
        names = [own.robot for own in self._team.orders]
        state = self._state(now, {robot.number for robot in reached})
        orders = self._team.policy(state) if reached else {}
        before, after, since = {}, {}, {}
        lived = []
        for robot in reached:
            new = orders.get(names[robot.number], robot.remaining)
            if new != robot.remaining:
                before[names[robot.number]], after[names[robot.number]] = robot.remaining, new
                since[names[robot.number]] = state.robots[robot.number].site
                self._give(robot, new, now)
                if _lives(robot):
                    lived.append(names[robot.number])
        self._reactions.append(Reaction(
            time_s=now, failed=tuple(names[k] for k in sorted(failed)), before=before, after=after, since=since,
            lived=tuple(lived), learned=tuple(names[robot.number] for robot in reached)))

    def _state(self, now: float, reached: set[int]) -> TeamState:
        taken = {site for robot in self._robots for site in self._taken_by(robot, now)}
        return TeamState(time_s=now, open_pois=self._team.pois - taken, robots=tuple(
            self._seen(robot, now, reached=robot.number in reached) for robot in self._robots))

    def _taken_by(self, robot: _Robot, now: float) -> list[str]:
        """POIs that a robot has visited, or is on its way to."""
        leg = robot.leg
        on_the_way = leg is not None and now < leg.arrived_s
        visited = [poi for poi in robot.visited if not (on_the_way and leg is not None and poi == leg.to)]
        return [*visited, leg.to] if leg is not None and on_the_way and robot.number not in self._dead else visited

    def _seen(self, robot: _Robot, now: float, *, reached: bool) -> RobotState:
        """A robot as the team knows it."""
        orders, leg = self._team.orders[robot.number], robot.leg
        site, ready_s, burnt_s = robot.stops[-1], robot.ready_s, robot.burnt_s
        if robot.mission is None:
            ready_s = now
        elif leg is not None and now < leg.arrived_s:  # whether it is late, or ended on this leg, isn't known yet
            site, ready_s, burnt_s = leg.to, leg.ready_s, leg.burnt_s
        standing: Standing = "alive"
        if robot.number in self._dead:
            standing = "dead"
        elif robot.mission is not None and robot.mission.end in ("home", "late") and leg is not None and \
                now >= leg.arrived_s:
            standing = "home"
        elif self._team.news != "instant" and now < robot.heard_s:
            standing = "unheard"
        return RobotState(robot=orders.robot, site=site, ready_s=ready_s, burnt_s=burnt_s, remaining=robot.remaining,
                          standing=standing, reached=reached)

    def _give(self, robot: _Robot, new: tuple[str, ...], now: float) -> None:
        """Change a robot's orders from its next decision epoch on."""
        name = self._team.orders[robot.number].robot
        if new and new[-1] != self._team.base:
            raise ValueError(f"the remaining orders of {name} don't end at the base: {new}")
        if robot.mission is None:
            if new:
                robot.remaining = new
                self._set_off(robot, replace(self._team.orders[robot.number], route=(self._team.base, *new)), now)
            return
        robot.remaining = new
        # A leg whose failure is open hasn't been driven yet in the robot's own mission.
        pending = robot.leg is not None and robot.leg.window is not None
        robot.mission.give((robot.mission.ahead[0], *new) if pending else new)

    def outcome(self) -> TeamOutcome:
        """What came of it, once all events are over."""
        visits = [poi for robot in self._robots for poi in robot.visited]
        missions = [robot.mission or RobotMission(self._team.orders[robot.number]) for robot in self._robots]
        robots = tuple(mission.outcome() for mission in missions)
        collected = {event.site for robot in robots for event in robot.events if event.kind == "collected"}
        left_over = tuple(tuple(site for site in (*robot.visited, *mission.ahead)
                                if site in self._team.pois - collected)
                          for robot, mission in zip(self._robots, missions, strict=True))
        return TeamOutcome(
            robots=robots, reactions=tuple(self._reactions), fates=tuple(mission.fate for mission in missions),
            left_over=left_over,
            stops=tuple(tuple(robot.stops) if robot.mission is not None else () for robot in self._robots),
            doubled=len(visits) - len(set(visits)))


def _lives(robot: _Robot) -> bool:
    """Whether a robot gets to the stop from which its new orders go on, or is well there and told to stay."""
    return robot.mission is not None and robot.mission.end in (None, "home") and (
        robot.leg is None or robot.leg.window is None)
