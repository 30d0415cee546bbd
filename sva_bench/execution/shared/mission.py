"""One mission of robots that share a world: each robot's mission by its rules, while all of them are in motion.

A plan in space and time says in which order robots pass where their paths meet, and a gate keeps that order. Whoever
fails, runs dry or gets stuck stands there for good. The others go on if nobody's path comes near it; else all brake,
and what is left is planned anew from where everybody is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, pairwise, repeat

from sva_bench.arrays import IntArray
from sva_bench.execution.noise import NoiseDraw
from sva_bench.execution.outcome import HELD_S, Assignment, RobotFate, Wait
from sva_bench.execution.rules import LegDriven, RobotMission
from sva_bench.execution.shared.departures import staggered
from sva_bench.execution.shared.driver import Happening, Hold, LegWait, TeamDriver
from sva_bench.execution.shared.lanes import Lane, Order
from sva_bench.execution.shared.own_ways import Disc, Ways
from sva_bench.execution.shared.planning import Onward, Present, plan_onward, uncoordinated
from sva_bench.execution.shared.players import BRAKING, Player, TeamDriven, driven_by
from sva_bench.execution.shared.switching import ASK_S, Switching
from sva_bench.execution.touch import Touch
from sva_bench.execution.waits import waits_on
from sva_bench.world.model import World

DEADLOCK = "deadlock"
"""What held robots that wait for each other for good: never, by the order of the plan."""
_BACK_M = 0.3  # from the hull to a passage that a robot waits before
_BEGUN_M = 1e-3  # on its leg a robot that is nearer to its stop stands at it


class SharedMission:
    """One mission on its way.

    Args:
        world: The world: what its robots meet on their ways.
        ways: The ways of its robots.
        orders: Each robot's orders.
        fates: When each fails.
        drawn: How each differs from its model.
        order: The plan in space and time; ``None`` = nobody coordinates them.
        driver: The team in motion.
        noise_index: Seed and number of the noise draw, for what robots meet on their ways.
        alone: Whether robots neither heed nor touch each other.
        switches: Whether robots may be let go before others that are late.
    """

    def __init__(
        self, world: World, ways: Ways, orders: Sequence[Assignment], fates: Sequence[RobotFate],
        drawn: Sequence[NoiseDraw], order: Order | None, driver: TeamDriver, noise_index: tuple[int, int],
        *, alone: bool = False, switches: bool = True,
    ) -> None:
        self._world, self._ways, self._driver, self._noise_index = world, ways, driver, noise_index
        self._coordinated, self._alone = order is not None, alone
        self._braking = self._replanned = False
        self._contacts = self._switched = 0
        self._asked_s = -math.inf
        self._switching = None if order is None else Switching(order.crossings, range(len(orders)))
        driver.ask(ASK_S if switches and order is not None else 0.0)
        self._names = [own.robot for own in orders]
        departs = [0.0] * len(orders) if order is None else self._departures(order)
        self._players = [
            Player(number=number, mission=RobotMission(own, fate, start_s=departs[number]), drawn=mine,
                   stops=list(own.route[:1]))
            for number, (own, fate, mine) in enumerate(zip(orders, fates, drawn, strict=True))]
        for player in self._players:
            number, route = player.number, player.mission.orders.route
            if not player.active:
                driver.assign(number, None, None)
            elif order is None:
                self._assign(player, uncoordinated([ways.shortest(number, a, b) for a, b in pairwise(route)]), None)
            else:
                self._follow(player, order, route)
        self._planned = tuple(tuple(player.cuts) for player in self._players)
        self._starts = tuple(driver.pose(player.number) for player in self._players)
        for player in self._players:
            if player.active:
                player.at = player.mission.site
                self._depart(player)

    def play(self) -> TeamDriven:
        """Play it to its end."""
        while (happening := self._driver.run(self._until_s)).kind != "idle":
            self._take(happening)
        return TeamDriven(
            names=tuple(self._names), contacts=self._contacts,
            robots=tuple(player.mission.outcome() for player in self._players),
            stops=tuple(tuple(player.stops) for player in self._players), cuts=self._planned, starts=self._starts,
            led_round=tuple(tuple(player.led_round) for player in self._players),
            driven=tuple(driven_by(player) for player in self._players),
            replanned=self._replanned or any(player.down for player in self._players),
            trails=tuple(tuple(player.trail) for player in self._players), asked_s=self._asked_s,
            switched=self._switched)

    @property
    def _until_s(self) -> float:
        """When to look at the mission next, whatever happens [s]."""
        return math.inf

    def _departures(self, order: Order) -> Sequence[float]:
        """When each robot leaves its berth by a plan in space and time [s]."""
        return staggered(order) if self._world.departures == "staggered" else [0.0] * len(order.lanes)

    def _take(self, happening: Happening) -> None:
        """React to what happened."""
        player = self._players[happening.robot]
        match happening.kind:
            case "arrived":
                self._arrive(player)
            case "ended":
                self._stop_for_good(player)
            case "stuck":
                player.fault = self._driver.fault(player.number)
                self._stop_for_good(player, stuck=True, held_by=player.fault or self._held_by(player.number))
            case "touch":
                self._touch(player, self._players[happening.other])
            case "waits":
                self._ask(player, happening.clock_s)
            case "rest":
                self._go_on()
            case "deadlock":
                for waiting in self._players:
                    if waiting.active:
                        self._stop_for_good(waiting, stuck=True, held_by=DEADLOCK)

    def _ask(self, player: Player, clock_s: float) -> None:
        """A robot waits for others: it goes first if that is better."""
        if self._switching is None or self._braking or not player.active:
            return
        self._asked_s = clock_s
        turned = self._switching.ask(player.number, self._driver.standing, [other.down for other in self._players])
        self._switched += bool(turned)
        for number in turned:
            self._driver.regate(number, self._switching.needs(number, len(self._players)))

    def _depart(self, player: Player) -> None:
        """Send a robot to its next stop, for when its present one is over."""
        player.stops.append(player.mission.ahead[0])
        self._set_off(player, player.mission.clock_s)

    def _set_off(self, player: Player, ready_s: float) -> None:
        """Let a robot begin its leg, or go on with it; one that is drawn to fail on leaving its stop gets no time."""
        mission, capacity, share = player.mission, player.drawn.capacity, player.mission.orders.idle_share
        driven_s, waited_s = player.so_far_s
        driving_s = 0.0 if mission.fails_on_leaving else mission.fate.lifetime_s - mission.driven_s - driven_s
        self._driver.start_leg(
            player.number, ready_s, driving_s, () if player.anew else self._holds(player), idle_share=share,
            fuel_s=max(mission.tank_s * capacity - driven_s - share * waited_s, 0.0))

    def _holds(self, player: Player) -> list[Hold]:
        """What a robot meets on its leg, or on what is left of it.

        On what is left of its way it meets what it has not met yet, and stands out what it was standing at. On a way
        that was planned anew it may meet others, but stands at a passage no longer than it is shut.
        """
        if player.parts and player.on_its_way:
            part = player.parts[-1]
            left = player.holds[part.holds_over:]
            if left and part.hold_left_s is not None:
                left = [replace(left[0], lasts_s=part.hold_left_s), *left[1:]]
            player.holds = [replace(hold, along_m=max(hold.along_m - player.begun_m, 0.0)) for hold in left]
            return player.holds
        noise, passages = self._world.noise, self._world.passages
        if noise.people is None and not passages:
            return []
        served = {passage.name: sum(wait.lasts_s for part in player.parts for wait in part.waits
                                    if wait.hold == passage.name) for passage in passages}
        seed, rollout = self._noise_index
        back_m = self._ways.model(player.number).radius_m + _BACK_M
        ends, leg = self._ways.hops(player.number, player.stops[-2], player.stops[-1]), player.cuts[0].leg
        if len(ends) != len(leg):  # a way round leads to the stop at once, or by way of a place aside
            ends = [(player.stops[-2], player.stops[-1])] * len(leg)
        player.holds, way_m = [], 0.0
        for hop, between in zip(leg, ends, strict=True):
            for wait in waits_on(hop, between, noise, passages, seed, rollout, player.number, back_m):
                over_s = min(served.get(wait.cause, 0.0), wait.lasts_s)
                if over_s > 0:
                    served[wait.cause] -= over_s
                if wait.lasts_s > over_s:
                    player.holds.append(Hold(along_m=way_m + wait.along_m, lasts_s=wait.lasts_s - over_s,
                                             cause=wait.cause))
            way_m += sum(float(stretch.arc[-1]) for stretch in hop)
        return player.holds

    def _arrive(self, player: Player) -> None:
        """A robot is where its leg ends."""
        self._finish(player)
        if player.active:
            player.at = self._ways.site_at(player.number, player.stops[-1], player.cuts[0])
            player.cuts, player.around = player.cuts[1:], player.around[1:]
            self._depart(player)
        elif player.mission.end in ("home", "late", "stuck"):  # stuck at home: kept off a stop
            player.cuts = []
        else:  # it ran dry while it stood at its stop
            self._stands(player)

    def _finish(self, player: Player, *, stuck: bool = False, over: bool = False, held_by: str = "") -> None:
        """A robot's leg is over, by arrival or for good: its mission is told."""
        parts = [*player.parts, self._driver.leg(player.number)]
        number = len(player.legs)
        waits, touches, driving_s = [], [], 0.0
        for part in parts:
            waits += [self._wait(wait, number, driving_s) for wait in part.waits]
            touches += [replace(touch, leg=number, since_s=touch.since_s + driving_s, solid=self._met(touch))
                        for touch in part.touches]
            driving_s += part.driving_s
        leg = LegDriven(driving_s, stuck, len(touches), sum(wait.lasts_s for wait in waits), player.drawn.capacity,
                        tuple(touches), tuple(waits), held_by)
        player.mission.drive(leg._replace(time_s=math.inf) if over else leg)
        player.legs.append(leg)
        player.led_round.append(player.around[0] if player.around else False)
        player.trail.append(tuple(parts))
        player.parts = []

    def _wait(self, wait: LegWait, leg: int, before_s: float) -> Wait:
        cause = wait.hold or (BRAKING if wait.robot is None else self._names[wait.robot])
        return Wait(leg=leg, lasts_s=wait.lasts_s, x_m=wait.x_m, y_m=wait.y_m, cause=cause,
                    since_s=before_s + wait.since_s)

    def _stop_for_good(self, player: Player, *, stuck: bool = False, held_by: str = "") -> None:
        """A robot's fuel or life is over on its way or on leaving its stop, or it is stuck."""
        if player.mission.fails_on_leaving and not stuck:
            player.stops.pop()
            player.mission.depart()
        elif player.active:
            self._finish(player, stuck=stuck, over=not stuck, held_by=held_by)
        self._stands(player)

    def _held_by(self, number: int) -> str:
        """What a stuck robot touches, or touched until shortly before."""
        leg = self._driver.leg(number)
        held = [touch for touch in leg.touches if touch.since_s + touch.lasted_s >= leg.driving_s - HELD_S]
        return self._met(held[-1]) if held else ""

    def _met(self, touch: Touch) -> str:
        """What a hull touched, a robot by its name."""
        return touch.solid if touch.robot is None else self._names[touch.robot]

    def _touch(self, one: Player, other: Player) -> None:
        """Two hulls touched: of robots that nobody coordinates, that is the end of both."""
        if self._alone:
            return
        self._contacts += 1
        if not self._coordinated:
            for player, met in ((one, other), (other, one)):
                if player.active:
                    self._stop_for_good(player, stuck=True, held_by=self._names[met.number])

    def _stands(self, player: Player) -> None:
        """A robot's mission ended away from its berth: it stands there for good, and the others go on if they can."""
        player.down, player.cuts = True, []
        self._driver.drop(player.number)
        if self._coordinated and not self._braking and self._in_the_way(player):
            self._brake()

    def _brake(self) -> None:
        """Let all come to rest, to plan the rest anew."""
        self._braking = self._replanned = True
        self._driver.brake(True)

    def _in_the_way(self, down: Player) -> bool:
        """Whether a robot stands where another still has to pass."""
        x, y, _ = self._driver.pose(down.number)
        disc = Disc(x_m=x, y_m=y, radius_m=self._ways.model(down.number).radius_m, name=self._names[down.number])
        return any(self._ways.blocked(player.number, way, [disc], passed_m=passed_m) is not None
                   for player in self._players if player.active for way, passed_m in zip(
                       player.cuts, chain([self._driver.arc_m(player.number)], repeat(0.0)), strict=False))

    def _go_on(self) -> None:
        """All stand: plan the rest anew."""
        self._braking = False
        self._driver.brake(False)
        for player in self._players:
            if player.active and self._driver.leg(player.number).clock_s > player.mission.clock_s:
                player.parts.append(self._driver.leg(player.number))
        onward, self._switching = plan_onward(
            self._ways, [self._present(player) for player in self._players], self._driver.clock_s)
        moving = [(player, then) for player, then in zip(self._players, onward, strict=True) if player.active]
        for player, then in sorted(moving, key=lambda both: both[1].lane is None):  # who stands, stands in no one's way
            self._take_up(player, then)
        for player, _ in moving:
            if player.active:
                self._set_off(player, self._ready_s(player))

    def _ready_s(self, player: Player) -> float:
        """When a robot at rest can go on [s]."""
        return self._driver.clock_s if player.parts else player.mission.clock_s

    def _present(self, player: Player) -> Present:
        mission, number = player.mission, player.number
        driven_s, _ = player.so_far_s
        arc_m = self._driver.arc_m(number) if player.parts else 0.0
        at_stop = driven_s == 0 and arc_m < _BEGUN_M
        return Present(
            number=number, orders=mission.orders, pose=self._driver.pose(number), down=player.down,
            site=player.at if at_stop else None, ahead=mission.ahead if player.active else (),
            ready_s=mission.clock_s, burnt_s=mission.burnt_s + driven_s,
            cuts=() if player.anew else tuple(player.cuts), around=tuple(player.around),
            arc_m=None if at_stop else arc_m, name=self._names[number])

    def _take_up(self, player: Player, then: Onward) -> None:
        """Give a robot new orders, which it takes up where it stands."""
        mission = player.mission
        if then.lane is None:
            self._driver.assign(player.number, None, None)  # what it drove is among its parts
            self._stop_for_good(player, stuck=True, held_by=then.kept_off)
            return
        mission.kept_off = mission.kept_off or then.kept_off
        mission.give(then.ahead)
        player.stops[-1] = then.ahead[0]
        player.on_its_way, player.begun_m = then.on_its_way, then.begun_m
        self._assign(player, then.lane, then.needs, then.around)

    def _follow(self, player: Player, order: Order, route: Sequence[str]) -> None:
        """Give a robot at its berth its way by a plan in space and time."""
        lane = order.lanes[player.number]
        self._assign(player, lane, order.needs[player.number], [
            way is not self._ways.shortest(player.number, a, b)
            for way, (a, b) in zip(lane.cuts, pairwise(route), strict=True)])

    def _assign(self, player: Player, lane: Lane, needs: Sequence[IntArray] | None, around: Sequence[bool] = ()
                ) -> None:
        """Give a robot at rest its way from here on; ``around``: as of ``Player``, none by default."""
        player.cuts, player.anew = list(lane.cuts), False
        player.around = list(around) or [False] * len(player.cuts)
        self._driver.assign(player.number, lane, needs)
