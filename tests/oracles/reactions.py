"""What a team with reactions is worth, exactly: a dynamic program over states, for tiny instances without noise.

It shares nothing with the engine. Chance is asked at the latest moment at which the answer makes a difference to
anybody: where news comes as reports, when a robot is due, whether it failed; where it comes at once under ``hazard``,
at each event, which of the robots failed since the event before. (A robot that waits at the base without a route
could set off in between; with one, values under ``hazard`` with instant news are those of a team that hears at events.)
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from sva_bench.choices import News
from tests.oracles.rest import Ground, Here

Orders = tuple[int, ...]
Answer = Callable[[list[Here], int], dict[int, Orders]]
"""A policy: from the robots that are reached and the POIs that they may have, to orders by robot."""


class Robot(NamedTuple):
    """One robot as everybody knows it.

    Attributes:
        kind: ``waits`` at the base without a route; at a ``stop``; on a ``leg``; ``home``; ``dead``.
        site: Where it is, or the end of its leg.
        time: When it leaves the stop, or is due at the end of its leg.
        burnt: What it will have burnt when it leaves.
        orders: Sites that follow; ``None``: whatever is best.
        origin: Where its leg began.
        heard: Whether it has reported.
        learned: Dead robots that it knows of, where robots learn at stations.
    """

    kind: str
    site: int
    time: float = 0.0
    burnt: float = 0.0
    orders: Orders | None = None
    origin: int = -1
    heard: bool = False
    learned: frozenset[int] = frozenset()


class State(NamedTuple):
    """A team: the time, its robots, and POIs that nobody has visited or is on its way to."""

    now: float
    robots: tuple[Robot, ...]
    free: int

    def change(self, changes: dict[int, Robot], free: int | None = None) -> State:
        """The same with some robots changed."""
        robots = tuple(changes.get(k, robot) for k, robot in enumerate(self.robots))
        return State(self.now, robots, self.free if free is None else free)

    def dead(self) -> frozenset[int]:
        """Robots that are known to be dead."""
        return frozenset(k for k, robot in enumerate(self.robots) if robot.kind == "dead")


class Reactions:
    """The expected value of a team.

    Args:
        ground: The instance.
        news: When failures are heard of.
        answer: The policy; ``None``: whatever is best, which needs news that reach everybody.
    """

    def __init__(self, ground: Ground, news: News, answer: Answer | None = None) -> None:
        self._ground, self._news, self._answer = ground, news, answer
        self._known: dict[State, float] = {}

    def of_plan(self, plan: Sequence[Orders]) -> float:
        """The value of a plan: each robot's sites after the base, the base last; none for one that waits."""
        robots = tuple(Robot("stop" if route else "waits", self._ground.base, orders=route) for route in plan)
        return self._begun(State(0.0, robots, self._ground.everything))

    def best(self) -> float:
        """The greatest value of all plans, with what is best to do about news."""
        base, values = self._ground.base, []
        for kinds in itertools.product(("stop", "waits"), repeat=len(self._ground.robots)):
            robots = tuple(Robot(kind, base, orders=None if kind == "stop" else ()) for kind in kinds)
            values.append(self._begun(State(0.0, robots, self._ground.everything)))
        return max(values)

    def _begun(self, state: State) -> float:
        """Under ``mission``, news at once means that all is known before anybody leaves."""
        if self._ground.process != "mission" or self._news != "instant":
            return self._value(state)
        value = 0.0
        for probability, failed in self._outcomes(state, list(self._ground.robots), self._leaves):
            told = state.change({k: Robot("dead", self._ground.base) if k in failed else r._replace(heard=True)
                                 for k, r in enumerate(state.robots)})
            value += probability * (self._told(told) if failed else self._value(told))
        return value

    def _leaves(self, state: State, robot: int) -> float:
        """Probability that a robot can leave the base at all, given what is known of the others."""
        if self._ground.instance.joint is None:
            return self._ground.chance[robot]
        names = [v.name for v in self._ground.instance.vehicles]
        likely = [s for s in self._ground.instance.joint if all(
            (names[k] in s.available) == (r.kind != "dead") for k, r in enumerate(state.robots)
            if r.heard or r.kind == "dead")]
        able = math.fsum(s.probability for s in likely if names[robot] in s.available)
        return able / math.fsum(s.probability for s in likely) if likely else 0.0

    def _outcomes(self, state: State, robots: list[int], survives: Callable[[State, int], float]
                  ) -> Iterator[tuple[float, frozenset[int]]]:
        """Which of some robots fail, with probabilities, one robot after the other."""
        if not robots:
            yield 1.0, frozenset()
            return
        first, chance = robots[0], survives(state, robots[0])
        alive = state.robots[first]._replace(heard=True)
        for probability, failed, after in ((chance, frozenset[int](), alive),
                                           (1 - chance, frozenset({first}), Robot("dead", alive.site))):
            if probability > 0:
                for rest, others in self._outcomes(state.change({first: after}), robots[1:], survives):
                    yield probability * rest, failed | others

    def _value(self, state: State) -> float:
        """What a team earns from a state on."""
        if state not in self._known:
            due = [k for k, r in enumerate(state.robots) if r.kind == "leg" and r.time <= state.now]
            leaving = [k for k, r in enumerate(state.robots) if r.kind == "stop" and r.time <= state.now]
            times = [r.time for r in state.robots if r.kind in ("leg", "stop")]
            if due:
                value = self._arrive(state, due)
            elif leaving:
                value = self._leave(state, leaving[0])
            else:
                value = self._pass(state, min(times)) if times else 0.0
            self._known[state] = value
        return self._known[state]

    def _fails(self, state: State, failed: frozenset[int]) -> tuple[float, State]:
        """Robots fail on their legs and it is known: what they cost, and the state."""
        free, lost = state.free, 0.0
        for k in failed:
            free |= self._ground.bit.get(state.robots[k].site, 0)
            lost += self._ground.loss[k]
        return -lost, state.change({k: Robot("dead", self._ground.base) for k in failed}, free)

    def _pass(self, state: State, until: float) -> float:
        """Nothing happens until some time but failures while driving, if they are heard of at once."""
        at_once = self._ground.process == "hazard" and self._news == "instant"
        driving = [k for k, r in enumerate(state.robots) if r.kind == "leg"] if at_once else []
        seconds, value = until - state.now, 0.0
        later = state._replace(now=until)
        for probability, failed in self._outcomes(state, driving, lambda _, k: self._drives(k, seconds)):
            lost, after = self._fails(later, failed)
            value += probability * (lost + (self._told(after) if failed else self._value(after)))
        return value

    def _drives(self, robot: int, seconds: float) -> float:
        rate = self._ground.rate[robot]
        return math.exp(-rate * seconds) if rate * seconds > 0 else 1.0

    def _arrive(self, state: State, due: list[int]) -> float:
        """Robots are due: they have arrived, unless they failed and this is heard of now."""
        value = 0.0
        for probability, failed in self._outcomes(state, due, self._arrives):
            lost, after = self._fails(state, failed) if self._ground.process != "mission" else \
                (0.0, self._fails(state, failed)[1])
            earned = sum(self._ground.reward[k][state.robots[k].site] for k in due if k not in failed)
            after = after.change({k: self._arrived(state.robots[k]) for k in due if k not in failed})
            told = failed and self._news in ("instant", "report")
            value += probability * (earned + lost + (self._told(after) if told else self._value(after)))
        return value

    def _arrived(self, robot: Robot) -> Robot:
        if robot.site == self._ground.base:
            return Robot("home", robot.site, heard=True)
        return robot._replace(kind="stop", time=robot.time + self._ground.stop[robot.site], heard=True,
                              burnt=0.0 if robot.site in self._ground.stations else robot.burnt)

    def _arrives(self, state: State, robot: int) -> float:
        """Probability that a robot arrives, if it isn't known yet."""
        if self._news == "instant":
            return 1.0
        own = state.robots[robot]
        if self._ground.process == "mission":
            return 1.0 if own.heard else self._leaves(state, robot)
        return self._ground.survives(robot, own.origin, own.site)

    def _leave(self, state: State, number: int) -> float:
        """A robot leaves a stop, after it has learned what is to learn there."""
        own = state.robots[number]
        new = state.dead() - own.learned
        if self._news == "station" and own.site in self._ground.stations and new:
            state = self._ordered(state.change({number: own._replace(learned=own.learned | new)}), [number])
            own = state.robots[number]
        if own.orders is not None:
            return self._depart(state, number, own.orders[0])
        ways = (self._ground.base, *self._ground.stations, *(j for j, bit in self._ground.bit.items()
                                                              if bit & state.free))
        return max(self._depart(state, number, there) for there in ways if self._is_open(number, own, there))

    def _is_open(self, number: int, own: Robot, there: int) -> bool:
        if there == self._ground.base == own.site:
            return True
        arrival = self._ground.arrival(number, own.site, there, own.time, own.burnt)
        return arrival is not None and (there == self._ground.base or self._ground.is_safe(number, there, *arrival))

    def _depart(self, state: State, number: int, there: int) -> float:
        own, ground = state.robots[number], self._ground
        if there == own.site == ground.base:
            return self._value(state.change({number: Robot("home", there, heard=own.heard)}))
        seconds = ground.cost[number][own.site][there]
        leg = own._replace(kind="leg", site=there, time=own.time + seconds, burnt=own.burnt + seconds, origin=own.site,
                           orders=None if own.orders is None else own.orders[1:])
        away = state.change({number: leg}, state.free & ~ground.bit.get(there, 0))
        at_once = ground.process == "per_leg" or (ground.process == "hazard" and math.isinf(ground.rate[number]))
        if not at_once or self._news != "instant":
            return self._value(away)
        survives = ground.survives(number, own.site, there)
        value = survives * self._value(away) if survives > 0 else 0.0
        if survives < 1:
            lost, after = self._fails(away, frozenset({number}))
            value += (1 - survives) * (lost + self._told(after))
        return value

    def _told(self, state: State) -> float:
        """News that reach everybody: new orders, and what the team earns from there on."""
        ground = self._ground
        if self._answer is not None:
            reached = [k for k, r in enumerate(state.robots) if r.kind == "waits" or (
                r.kind in ("leg", "stop") and r.orders)]
            return self._value(self._ordered(state, reached) if reached else state)
        free = {k: r._replace(orders=None) for k, r in enumerate(state.robots) if r.kind in ("leg", "stop")}
        waiting = [k for k, r in enumerate(state.robots) if r.kind == "waits"]
        values = []
        for go in itertools.product((True, False), repeat=len(waiting)):
            off = {k: Robot("stop", ground.base, state.now, heard=state.robots[k].heard)
                   for k, goes in zip(waiting, go, strict=True) if goes}
            values.append(self._value(state.change({**free, **off})))
        return max(values)

    def _here(self, state: State, number: int) -> Here:
        """A robot at its next epoch."""
        own = state.robots[number]
        ready = {"waits": state.now, "stop": own.time, "leg": own.time + self._ground.stop[own.site]}[own.kind]
        burnt = 0.0 if own.site in self._ground.stations else own.burnt
        alive = 1.0 if self._ground.process != "mission" or own.heard else self._leaves(state, number)
        return Here(number, own.site, ready, burnt, alive, own.orders or ())

    def _ordered(self, state: State, reached: list[int]) -> State:
        """The state after the policy has given orders to those that are reached."""
        assert self._answer is not None
        claimed = 0
        for k, robot in enumerate(state.robots):
            if k not in reached and robot.kind in ("leg", "stop"):
                claimed |= sum(self._ground.bit.get(j, 0) for j in robot.orders or ())
        orders = self._answer([self._here(state, k) for k in reached], state.free & ~claimed)
        changes = {}
        for k in reached:
            own, new = state.robots[k], orders.get(k)
            if new is None:
                continue
            if own.kind == "waits":
                changes[k] = Robot("stop", own.site, state.now, orders=new, heard=own.heard) if new else own
            elif own.kind == "stop" and not new:
                changes[k] = Robot("home", own.site, heard=own.heard)
            else:
                changes[k] = own._replace(orders=new)
        return state.change(changes)
