"""Driving times of legs as they come to be known, for missions whose legs depend on what happens in them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from sva_bench.execution.case import Settings
from sva_bench.execution.drives import Drives, RouteKey
from sva_bench.execution.rules import LegDriven, legs_of
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

Stops = tuple[str, ...]


class KnownLegs:
    """Driving times of legs: as driven, or as planned where that is unknown yet.

    Attributes:
        missing: Routes with a leg that was asked for and is unknown yet.
        misses: How many times an unknown leg was asked for.
    """

    def __init__(self, world: World, costs: Mapping[str, FuelCosts], settings: Settings) -> None:
        self._world, self._composed = world, settings.fidelity == "rollout"
        self._kinds = [world.kind_of(robot) for robot in world.robots]
        self._names = [robot.name for robot in world.robots]
        self._number = {site.name: k for k, site in enumerate(world.sites)}
        self._planned = {kind: (cost.repaired_ms / 1000).tolist() for kind, cost in costs.items()}
        self._scheduled = {kind: cost.cost_s.tolist() for kind, cost in costs.items()}
        self._driven: dict[tuple[int, int, Stops], LegDriven] = {}
        # A typical mission is mostly one of the first noise draw: so its hops needn't be driven twice.
        self._traced = self._composed and settings.recorded
        self.missing: dict[RouteKey, bool] = {}
        self.misses = 0

    def scheduled_s(self, robot: int, origin: str, destination: str) -> float:
        """What the plan reckons with, margin included [s]."""
        cost_s: float = self._scheduled[self._kinds[robot]][self._number[origin]][self._number[destination]]
        return cost_s

    def planned(self, robot: int, stops: Stops) -> LegDriven:
        """The last leg as planned, without margin."""
        row = self._planned[self._kinds[robot]][self._number[stops[-2]]]
        return LegDriven(row[self._number[stops[-1]]])

    def noting(self, used: dict[tuple[int, Stops], None]) -> Callable[[int, Stops], LegDriven]:
        """Legs as planned; what they are known by is added to a set in order."""
        def leg(robot: int, stops: Stops) -> LegDriven:
            used[robot, self._key(stops)] = None
            return self.planned(robot, stops)

        return leg

    def want(self, used: Iterable[tuple[int, Stops]], rollouts: Iterable[int]) -> None:
        """Ask for legs under some noise draws before they are missed."""
        for rollout in rollouts:
            for robot, key in used:
                self.missing[self._names[robot], key, rollout, 0] = self._traced and rollout == 0

    def _key(self, stops: Stops) -> Stops:
        """What a leg depends on: up to ``rollout`` it begins at rest in its origin's own pose, else on all before."""
        return stops[-2:] if self._composed else stops

    def driven(self, rollout: int) -> Callable[[int, Stops], LegDriven]:
        """The last leg as it was driven under a noise draw; what isn't known is noted in ``missing``."""
        def leg(robot: int, stops: Stops) -> LegDriven:
            key = self._key(stops)
            found = self._driven.get((robot, rollout, key))
            if found is None:
                self.misses += 1
                self.missing[self._names[robot], key, rollout, 0] = self._traced and rollout == 0
                return self.planned(robot, stops)
            return found

        return leg

    def learn(self, keys: Iterable[RouteKey], drives: Drives) -> None:
        """Take in what was driven."""
        for key in keys:
            name, stops, rollout, _ = key
            robot, driven = self._names.index(name), drives.routes[key]
            for leg, known in enumerate(legs_of(driven)):
                self._driven[robot, rollout, stops[: leg + 2]] = known


def longest(missing: Mapping[RouteKey, bool]) -> dict[RouteKey, bool]:
    """The routes of which no other is a longer version."""
    shorter = {(name, stops[:k], rollout, trial) for name, stops, rollout, trial in missing
               for k in range(2, len(stops))}
    return {key: traced for key, traced in missing.items() if key not in shorter}
