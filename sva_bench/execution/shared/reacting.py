"""One mission of robots that share a world and react to failures: new orders on the way, and a new plan for all.

News comes and orders are given by the same rules as in ``execution.team``. Orders begin at the stop that a robot stands
at or is going to; one whose stop is over has left it, even if it waits there for others to pass. As soon as orders
change, all brake, and the rest is planned anew from where everybody is. Robots that nobody coordinates do not brake:
each takes up its new orders at its next stop.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

from sva_bench.execution.known_team import KnownRobot, KnownTeam, Team
from sva_bench.execution.noise import NoiseDraw
from sva_bench.execution.outcome import RobotFate
from sva_bench.execution.rules import RobotMission
from sva_bench.execution.shared.driver import Happening, TeamDriver
from sva_bench.execution.shared.lanes import Order
from sva_bench.execution.shared.mission import SharedMission
from sva_bench.execution.shared.own_ways import Ways
from sva_bench.execution.shared.planning import Onward, first_order, uncoordinated
from sva_bench.execution.shared.players import Player, TeamDriven
from sva_bench.execution.shared.switching import Switching
from sva_bench.world.model import World

_NEWS, _STOP = 0, 1  # news comes before departures at the same time


class ReactingMission(SharedMission):
    """One mission on its way.

    Args:
        team: Each robot's orders, and what the team does about news.
        fates: When each fails; of POIs, before which that it tries, whatever its route.
        world, ways, drawn, order, driver, noise_index: As of ``SharedMission``.
    """

    def __init__(
        self, world: World, ways: Ways, team: Team, fates: Sequence[RobotFate], drawn: Sequence[NoiseDraw],
        order: Order | None, driver: TeamDriver, noise_index: tuple[int, int],
    ) -> None:
        self._team, self._fates = team, fates
        self._events: list[tuple[float, int, int]] = []
        self._changed = False
        super().__init__(world, ways, team.orders, fates, drawn, order, driver, noise_index)
        self._known = KnownTeam(team, [
            KnownRobot(number=player.number, mission=player.mission if own.route else None, stops=[team.base],
                       remaining=own.route[1:], ready_s=player.mission.start_s)
            for player, own in zip(self._players, team.orders, strict=True)])
        for robot, own, fate in zip(self._known.robots, team.orders, fates, strict=True):
            if fate.before_poi == 0 and own.route:
                self._never_leaves(robot, 0.0)
            elif fate.before_poi == 0 and team.news == "instant":
                heapq.heappush(self._events, (0.0, _NEWS, robot.number))

    def play(self) -> TeamDriven:
        """Play it to its end."""
        driven = super().play()
        for robot in self._known.robots:
            if robot.mission is not None:
                robot.mission.fate = _fate_of(robot.mission)
        told = self._known.outcome()
        told = replace(told, stops=tuple(() if robot.mission is None else stops for robot, stops in zip(
            self._known.robots, driven.stops, strict=True)))
        return replace(driven, robots=told.robots, told=told)

    @property
    def _until_s(self) -> float:
        return self._events[0][0] if self._events else math.inf

    def _take(self, happening: Happening) -> None:
        if happening.kind != "time":
            super()._take(happening)
            return
        now, kind, number = heapq.heappop(self._events)
        if kind == _STOP:
            self._leave(now, self._known.robots[number])
            return
        heard = {number}
        while self._events and self._events[0][:2] == (now, _NEWS):  # what comes at once is answered at once
            heard.add(heapq.heappop(self._events)[2])
        if new := heard - self._known.dead:
            self._known.dead |= new
            if self._team.news != "station":
                self._react(now, new, [r for r in self._known.robots if self._known.takes_orders(r, now)])

    def _leave(self, now: float, robot: KnownRobot) -> None:
        """A robot's stop is over: it may learn of failures there, and goes on."""
        mission = robot.mission
        assert mission is not None
        if mission.end is not None:  # told to stay at the base, or stuck there
            return
        if self._team.news == "station" and robot.stops[-1] in mission.orders.stations and \
                (new := self._known.dead - robot.learned):
            self._react(now, new, [robot])
        self._known.leave(robot, mission.ahead[0], now)
        robot.remaining = mission.ahead[1:]
        if mission.fails_on_leaving:
            self._report_missing(robot, now)
        else:
            robot.stops.append(mission.ahead[0])

    def _never_leaves(self, robot: KnownRobot, now: float) -> None:
        """A robot that was to leave the base is drawn to fail for the whole mission."""
        assert robot.mission is not None
        self._known.leave(robot, robot.mission.ahead[0], now)
        robot.remaining = robot.mission.ahead[1:]
        self._report_missing(robot, now)

    def _report_missing(self, robot: KnownRobot, failed_s: float) -> None:
        """A robot has failed: when news of it comes."""
        when = self._known.missing_s(robot, failed_s)
        if when is not None:
            heapq.heappush(self._events, (when, _NEWS, robot.number))

    def _depart(self, player: Player) -> None:
        if player.cuts:
            super()._depart(player)
        else:
            player.stops.append(player.mission.ahead[0])
            self._begin_anew(player)
        heapq.heappush(self._events, (player.mission.clock_s, _STOP, player.number))

    def _arrive(self, player: Player) -> None:
        robot, mission = self._known.robots[player.number], player.mission
        at_poi = mission.orders.is_poi(player.stops[-1])
        super()._arrive(player)
        if not player.down:
            self._known.arrive(robot, at_poi=at_poi)
            if mission.end in (None, "home"):
                self._known.gets_orders(robot)

    def _stands(self, player: Player) -> None:
        super()._stands(player)
        robot = self._known.robots[player.number]
        if robot.leg is None:  # it never left
            self._known.leave(robot, player.mission.ahead[0], player.mission.clock_s)
        self._report_missing(robot, player.mission.clock_s)

    def _react(self, now: float, failed: Iterable[int], reached: Sequence[KnownRobot]) -> None:
        """Ask the policy, and take its orders up."""
        def give(robot: KnownRobot, new: tuple[str, ...]) -> bool:
            return self._give(robot, new, now)

        self._changed = False
        self._known.react(now, failed, reached, give)
        if not (self._changed and self._coordinated) or self._braking:
            return
        if self._driver.clock_s > 0 or not self._order_anew():
            self._brake()

    def _give(self, robot: KnownRobot, new: tuple[str, ...], now: float) -> bool:
        """Change a robot's orders from its next decision epoch on; whether it is sure to be there."""
        player, mission = self._players[robot.number], robot.mission
        if mission is None:
            return self._send_out(robot, player, new, now)
        if mission.end is not None:
            return False
        self._changed = True
        if robot.leg is not None and math.isinf(robot.leg.arrived_s):
            mission.give((mission.ahead[0], *new))
            player.cuts = player.cuts[:1]
            return False
        mission.give(new)
        player.stops.pop()
        if new:
            player.stops.append(new[0])
            self._begin_anew(player)
        else:
            player.cuts = []
            self._driver.drop(player.number)
        return True

    def _send_out(self, robot: KnownRobot, player: Player, new: tuple[str, ...], now: float) -> bool:
        """Give a robot that waits at the base a route; whether it leaves."""
        base = self._team.base
        orders = replace(self._team.orders[robot.number], route=(base, *new))
        player.mission = robot.mission = RobotMission(orders, self._fates[robot.number], start_s=now)
        player.stops, robot.ready_s = [base], now
        if not player.active:
            self._never_leaves(robot, now)
            return False
        self._changed, player.at = True, base
        self._depart(player)
        return True

    def _begin_anew(self, player: Player) -> None:
        """Let a robot at a stop begin with new orders: at once, or once all have braked and there is a plan."""
        number, mission = player.number, player.mission
        if self._coordinated:
            # It stands until then, and has a leg for what may happen meanwhile: it fails on leaving, or runs dry.
            self._assign(player, uncoordinated([self._ways.shortest(number, *mission.orders.route[:2])]), None)
            player.anew = True
        else:
            assert player.at is not None, "who heeds nobody stops at sites"
            self._assign(player, uncoordinated([self._ways.shortest(number, a, b) for a, b in pairwise(
                (player.at, *mission.ahead))]), None)
        self._set_off(player, self._ready_s(player))

    def _order_anew(self) -> bool:
        """Plan all from their berths, which nobody has left yet; whether there is such a plan."""
        for player in self._players:
            if player.active and player.number in self._known.dead:  # it fails on leaving
                self._stop_for_good(player)
        orders = [replace(player.mission.orders, route=(self._team.base, *player.mission.ahead))
                  for player in self._players]
        order = first_order(self._ways, orders, [player.active for player in self._players])
        if order is not None:
            self._switching = Switching(order.crossings, range(len(orders)))
            for player, robot, start_s in zip(self._players, self._known.robots, self._departures(order), strict=True):
                if player.active:
                    if robot.leg is None:
                        self._leave_at(player, robot, start_s)
                    self._follow(player, order, (self._team.base, *player.mission.ahead))
                    self._set_off(player, player.mission.clock_s)
        return order is not None

    def _leave_at(self, player: Player, robot: KnownRobot, start_s: float) -> None:
        """Let a robot that has not left yet do so at another time."""
        player.mission.leave_at(start_s)
        robot.ready_s = start_s
        self._events = [(start_s, _STOP, robot.number) if event[1:] == (_STOP, robot.number) else event
                        for event in self._events]
        heapq.heapify(self._events)

    def _take_up(self, player: Player, then: Onward) -> None:
        before = player.mission.ahead
        super()._take_up(player, then)
        robot = self._known.robots[player.number]
        if not player.active or player.mission.ahead == before:
            return
        robot.left_out += [site for site in before if site in self._team.pois and site not in player.mission.ahead]
        if robot.leg is None or not math.isinf(robot.leg.arrived_s):
            robot.remaining = player.mission.ahead
            return
        robot.remaining = player.mission.ahead[1:]
        if robot.leg.to != player.mission.ahead[0]:
            robot.stops.pop()
            self._known.leave(robot, player.mission.ahead[0], robot.leg.departed_s)
            robot.stops.append(player.mission.ahead[0])


def _fate_of(mission: RobotMission) -> RobotFate:
    """When a robot failed in a mission, if it did."""
    if mission.end != "failed":
        return RobotFate()
    if mission.driven_s >= mission.fate.lifetime_s:
        return RobotFate(lifetime_s=mission.fate.lifetime_s)
    return RobotFate(before_poi=mission.fate.before_poi)
