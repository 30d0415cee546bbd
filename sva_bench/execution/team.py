"""A team's mission, event by event: robots leave stops, fail, are missed, and get new orders from a policy.

Decision epochs come at news of a failure and at no other time. A leg is driven to its end, so new orders begin at the
stop that a robot stands at or is going to.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from sva_bench.execution.chance import Chance, Window
from sva_bench.execution.known_team import KnownRobot, KnownTeam
from sva_bench.execution.known_team import Team as Team
from sva_bench.execution.outcome import Assignment, RobotFate
from sva_bench.execution.rules import LegDriven, RobotMission
from sva_bench.execution.team_outcome import TeamOutcome

_NEWS, _STOP = 0, 1  # news comes before departures at the same time


@dataclass(eq=False, kw_only=True)
class _Robot(KnownRobot):
    """One robot on its way.

    Attributes:
        window: When it fails on the leg that it is on [s of driving], if it does and the moment is open.
        driven: The leg, as long as the moment is open.
    """

    window: Window | None = None
    driven: LegDriven | None = None


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
        self._robots = [_Robot(number=number, mission=None, stops=[team.base], remaining=own.route[1:])
                        for number, own in enumerate(team.orders)]
        self._known = KnownTeam(team, self._robots)
        for robot, own in zip(self._robots, team.orders, strict=True):
            self._begin(robot, own)
        while self._events:
            now, kind, number = heapq.heappop(self._events)
            if kind == _NEWS:
                heard = [self._robots[number]]
                while self._events and self._events[0][:2] == (now, _NEWS):  # what comes at once is answered at once
                    heard.append(self._robots[heapq.heappop(self._events)[2]])
                self._hear(now, heard)
            else:
                self._leave(now, self._robots[number])

    def _begin(self, robot: _Robot, orders: Assignment) -> None:
        """A robot at the base, at the start."""
        if orders.route:
            self._set_off(robot, orders, 0.0)
        elif self._team.news == "instant" and not self._chance.leaves(robot.number):
            heapq.heappush(self._events, (0.0, _NEWS, robot.number))

    def _set_off(self, robot: _Robot, orders: Assignment, now: float) -> None:
        """Give a robot at the base its route; one drawn to fail for the whole mission never leaves."""
        able = self._chance.leaves(robot.number)
        robot.mission = RobotMission(orders, RobotFate() if able else RobotFate(before_poi=0), start_s=now)
        robot.ready_s = now
        if able:
            heapq.heappush(self._events, (now, _STOP, robot.number))
        else:
            self._known.leave(robot, orders.route[1], now)
            robot.remaining = orders.route[2:]
            self._report_missing(robot, now)

    def _leave(self, now: float, robot: _Robot) -> None:
        """A robot's stop is over: it may learn of failures there, and goes on."""
        mission = robot.mission
        assert mission is not None
        if found := self._found_failed(now, robot):
            self._hear(now, found)
        if mission.end is not None:  # told to stay at the base
            return
        if self._team.news == "station" and robot.stops[-1] in mission.orders.stations and \
                (new := self._known.dead - robot.learned):
            self._react(now, new, [robot])
        to = mission.ahead[0]
        if mission.orders.is_poi(to) and not self._chance.tries(robot.number, mission.pois + 1):
            mission.fate = RobotFate(before_poi=mission.pois + 1)
        self._known.leave(robot, to, now)
        robot.remaining = mission.ahead[1:]
        if mission.depart() is None:
            self._report_missing(robot, now)
            return
        robot.stops.append(to)
        driven = self._legs(robot.number, tuple(robot.stops))
        assert robot.leg is not None
        robot.leg.departed_s = now + driven.waited_s
        window = self._chance.drives(robot.number, mission.driven_s, mission.driven_s + mission.lasts(driven))
        if window is None:
            self._drive(robot, driven)
        elif window.since_s == window.until_s:
            self._fail_at(robot, driven, window.since_s)
        else:
            self._fail_within(robot, driven, window)

    def _drive(self, robot: _Robot, driven: LegDriven) -> None:
        """Drive a leg, and wait for the end of the stop."""
        mission = robot.mission
        assert mission is not None
        at_poi = mission.orders.is_poi(mission.ahead[0])
        mission.drive(driven)
        if mission.end in ("failed", "out_of_fuel", "stuck"):
            self._report_missing(robot, mission.clock_s)
            return
        self._known.arrive(robot, at_poi=at_poi)
        if mission.end is None:
            heapq.heappush(self._events, (mission.clock_s, _STOP, robot.number))

    def _fail_at(self, robot: _Robot, driven: LegDriven, driven_s: float) -> None:
        """Fail on a leg after so much driving in all."""
        assert robot.mission is not None
        robot.mission.fate = RobotFate(lifetime_s=driven_s)
        self._drive(robot, driven)

    def _fail_within(self, robot: _Robot, driven: LegDriven, window: Window) -> None:
        """Fail on a leg at a moment that stays open as long as it makes no difference to anybody."""
        leg = robot.leg
        assert leg is not None
        ends_s = leg.departed_s + (window.until_s - window.since_s)
        robot.window, robot.driven = window, driven
        if self._team.news == "never" or (self._team.news != "instant" and leg.due_s >= ends_s):
            self._close(robot, window)
        else:
            heapq.heappush(self._events, (ends_s, _NEWS, robot.number))

    def _close(self, robot: _Robot, window: Window) -> None:
        """Settle when a robot failed, by the mean of what is possible."""
        assert robot.driven is not None
        robot.window = None
        self._fail_at(robot, robot.driven, self._chance.middle_s(robot.number, window))

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
            if robot is leaving or leg is None or robot.window is None or robot.mission is None:
                continue
            if news == "instant" or (now >= leg.due_s and (news == "report" or at_station)):
                by_now = robot.mission.driven_s + max(now - leg.departed_s, 0.0)
                found = self._chance.failed_by(robot.number, robot.window, by_now)
                if found is None:
                    robot.window = Window(max(robot.window.since_s, by_now), robot.window.until_s)
                else:
                    self._close(robot, found)
                    heard.append(robot)
        return heard

    def _report_missing(self, robot: _Robot, failed_s: float) -> None:
        """A robot has failed: when news of it comes."""
        when = self._known.missing_s(robot, failed_s)
        if when is not None:
            heapq.heappush(self._events, (when, _NEWS, robot.number))

    def _hear(self, now: float, robots: Sequence[_Robot]) -> None:
        """News of failures comes; of a robot whose failure is open yet, the moment is over by which it happened."""
        for robot in robots:
            if robot.window is not None:
                self._close(robot, robot.window)
        new = {robot.number for robot in robots} - self._known.dead
        if not new:
            return
        new |= {robot.number for robot in self._found_failed(now)}  # what comes at once is answered at once
        self._known.dead |= new
        if self._team.news != "station":
            self._react(now, new, [r for r in self._robots if self._known.takes_orders(r, now)])

    def _react(self, now: float, failed: Iterable[int], reached: Sequence[_Robot]) -> None:
        """Ask the policy, and pass its orders on."""
        def give(robot: _Robot, new: tuple[str, ...]) -> bool:
            self._give(robot, new, now)
            return _lives(robot)

        self._known.react(now, failed, reached, give)

    def _give(self, robot: _Robot, new: tuple[str, ...], now: float) -> None:
        """Change a robot's orders from its next decision epoch on."""
        if robot.mission is None:
            self._set_off(robot, replace(self._team.orders[robot.number], route=(self._team.base, *new)), now)
            return
        # A leg whose failure is open hasn't been driven yet in the robot's own mission.
        robot.mission.give(new if robot.window is None else (robot.mission.ahead[0], *new))

    def outcome(self) -> TeamOutcome:
        """What came of it, once all events are over."""
        return self._known.outcome()


def _lives(robot: _Robot) -> bool:
    """Whether a robot gets to the stop from which its new orders go on, or is well there and told to stay."""
    return robot.mission is not None and robot.mission.end in (None, "home") and robot.window is None
