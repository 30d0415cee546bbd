"""Orders of robots by brute force: what they are worth if nobody reacts, and the best of all. Shares nothing with the
solver, nor with the rules of a mission."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

from sva_bench.mission.instance import Instance

TOLERANCE = 1e-6
NOWHERE = -math.inf
MOST_STATES = 1_000_000  # 400 MB


class TooMany(Exception):
    """There are more states than enumeration goes through."""


class Here(NamedTuple):
    """A robot at its next decision epoch.

    Attributes:
        robot: Its position in the team.
        site: Where it is.
        ready: When it leaves.
        burnt: What it has burnt since it was filled last.
        alive: Probability that it is alive, where failures are drawn for a whole mission.
        orders: Sites that it is to go to from there, as things are.
    """

    robot: int
    site: int
    ready: float
    burnt: float
    alive: float = 1.0
    orders: tuple[int, ...] = ()


class Best(NamedTuple):
    """The greatest value, and orders that reach it: sites that follow, the base last."""

    value: float
    orders: tuple[int, ...]


class Ground:
    """What a tiny instance says, and the best way on of each robot from everywhere, as far as asked for.

    A POI is a bit of a mask: the k-th POI is ``1 << k``.
    """

    def __init__(self, instance: Instance) -> None:
        self.instance, self.base = instance, instance.base
        self.process = instance.failure
        self.stations = tuple(instance.stations)
        self.pois = tuple(j for j in range(len(instance.sites)) if j != self.base and j not in self.stations)
        self.bit = {j: 1 << k for k, j in enumerate(self.pois)}
        self.everything = (1 << len(self.pois)) - 1
        self.robots = range(len(instance.vehicles))
        self.stop = [float(x) for x in instance.stop_s]
        self.cost = [[[float(x) for x in row] for row in v.fuel_s] for v in instance.vehicles]
        self.clock = [[[float(x) for x in row] for row in (v.fuel_s if v.time_s is None else v.time_s)]
                      for v in instance.vehicles]
        self.idle = [v.idle_share for v in instance.vehicles]
        self.rates = [math.inf] * len(self.stop) if instance.charge_rate is None else list(instance.charge_rate)
        self.reward = [[float(x) for x in v.incentives] for v in instance.vehicles]
        self.tank = [v.fuel_capacity_s for v in instance.vehicles]
        self.limit = [v.mission_limit_s for v in instance.vehicles]
        self.chance = [v.availability for v in instance.vehicles]
        self.loss = [0.0 if self.process == "mission" else v.loss_cost for v in instance.vehicles]
        self.rate = [self._rate(k) for k in self.robots]
        self._known: dict[tuple[int, int, float, float, int, int], Best] = {}

    def _rate(self, robot: int) -> float:
        vehicle = self.instance.vehicles[robot]
        if vehicle.mtbf_s is not None:
            return 1 / vehicle.mtbf_s
        if vehicle.availability == 0:
            return math.inf
        return -math.log(vehicle.availability) / vehicle.mission_limit_s

    def survives(self, robot: int, here: int, there: int) -> float:
        """Probability that a living robot arrives at the end of a leg."""
        if self.process == "per_leg":
            return self.chance[robot] if there in self.bit else 1.0
        if self.process == "hazard" and self.rate[robot] > 0:
            return math.exp(-self.rate[robot] * self.cost[robot][here][there])
        return 1.0

    def arrival(self, robot: int, here: int, there: int, ready: float, burnt: float) -> tuple[float, float] | None:
        """When a robot can leave the end of a leg, and its fuel burnt then; ``None`` if the leg breaks a rule."""
        burnt = burnt + self.cost[robot][here][there]
        ready = ready + self.clock[robot][here][there] + self.stop[there]
        if there in self.stations and math.isfinite(burnt):
            ready += burnt / self.rates[there]
        if here == there or not burnt <= self.tank[robot] + TOLERANCE or not ready <= self.limit[robot] + TOLERANCE \
                or math.isinf(ready):
            return None
        if there in self.bit:
            burnt += self.idle[robot] * self.stop[there]
        return ready, 0.0 if there in self.stations else burnt

    def best(self, robot: int, here: int, ready: float, burnt: float, mask: int, passed: int = 0) -> Best:
        """The best orders of one robot that is alive, over POIs of a mask; no value if it has no safe way home.

        Args:
            robot: Its position.
            here, ready, burnt: Where it is, when it leaves, what it has burnt.
            mask: POIs that it may visit.
            passed: Stations since the last POI: none is of use again.
        """
        key = (robot, here, ready, burnt, mask, passed)
        if key not in self._known:
            found = Best(NOWHERE, ())
            if here == self.base:
                found = Best(0.0, ())
            for there in (self.base, *self.pois, *self.stations):
                tried = self._over(key, there)
                if tried.value > found.value + 1e-9:
                    found = tried
            if len(self._known) >= MOST_STATES:
                raise TooMany
            self._known[key] = found
        return self._known[key]

    def _over(self, key: tuple[int, int, float, float, int, int], there: int) -> Best:
        """The best orders that begin with a leg."""
        robot, here, ready, burnt, mask, passed = key
        bit = self.bit.get(there, 0)
        number = 1 << self.stations.index(there) if there in self.stations else 0
        arrival = self.arrival(robot, here, there, ready, burnt)
        if arrival is None or (bit and not mask & bit) or passed & number:
            return Best(NOWHERE, ())
        ahead = Best(0.0, ()) if there == self.base else \
            self.best(robot, there, *arrival, mask & ~bit, 0 if bit else passed | number)
        survives = self.survives(robot, here, there)
        return Best(survives * (self.reward[robot][there] + ahead.value) - (1 - survives) * self.loss[robot],
                    (there, *ahead.orders)) if ahead.value > NOWHERE else Best(NOWHERE, ())

    def is_safe(self, robot: int, here: int, ready: float, burnt: float) -> bool:
        """Whether a robot can come home, over stations."""
        return self.best(robot, here, ready, burnt, 0).value > NOWHERE

    def of_orders(self, robot: Here, orders: tuple[int, ...]) -> float:
        """What a robot's orders are worth if they are kept; no value if they break a rule."""
        here, ready, burnt, alive, value = robot.site, robot.ready, robot.burnt, robot.alive, 0.0
        for there in orders:
            arrival = self.arrival(robot.robot, here, there, ready, burnt)
            if arrival is None:
                return NOWHERE
            survives = self.survives(robot.robot, here, there)
            value += alive * (survives * self.reward[robot.robot][there] - (1 - survives) * self.loss[robot.robot])
            alive *= survives
            here, (ready, burnt) = there, arrival
        return value if here == self.base else NOWHERE

    def best_of_rest(self, robots: list[Here], free: int) -> tuple[float, dict[int, tuple[int, ...]]]:
        """The greatest value of orders of robots that all have a safe way home, and such orders by robot."""
        pois = [bit for bit in self.bit.values() if free & bit]
        most, orders = NOWHERE, {}
        for owners in itertools.product(range(len(robots)), repeat=len(pois)) if robots else []:
            masks = [sum(bit for bit, owner in zip(pois, owners, strict=True) if owner == k)
                     for k in range(len(robots))]
            ways = [self.best(r.robot, r.site, r.ready, r.burnt, mask) for r, mask in zip(robots, masks, strict=True)]
            value = sum(r.alive * way.value for r, way in zip(robots, ways, strict=True) if r.alive > 0)
            if value > most + 1e-9:
                most, orders = value, {r.robot: way.orders for r, way in zip(robots, ways, strict=True)}
        return (most, orders) if robots else (0.0, {})
