"""A mission proposed for given sites: incentives, fuel capacities, mission limits and scenarios, from travel times.

It is neither trivial, for no team collects everything, nor hopeless, for every robot can collect something; and it
pays to plan for failures, where that can be had.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree

from sva_bench.arrays import FloatArray
from sva_bench.errors import BadInput
from sva_bench.files.printable import counted
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.mission.plan import unless_interrupted
from sva_bench.robot.model import USUAL_MODEL
from sva_bench.seeds import Stream, rng_for
from sva_bench.solver.routes.fronts import leg_tables
from sva_bench.solver.routes.heuristic import VisitOrders, search
from sva_bench.solver.routes.refuelling import quickest_route, vehicle_legs
from sva_bench.solver.two_stage import SolveLimits, plan_nominal
from sva_bench.world.model import Site

SCENARIOS = {"S1": 1.0, "S2": 0.75, "S3": 0.25, "S4": 0.0}
"""Availability of the uncertain robots in each scenario (section 5.1 of the paper)."""

AVAILABILITY = 0.75  # of the uncertain robots where no scenario says otherwise
MOST_INCENTIVE = {True: 150, False: 170}
"""What a certain and an uncertain robot earns at most at a POI (section 5.1 of the paper)."""

_COLLECTED = 0.8  # share of all incentives that a team of available robots collects, at most
_PROOF = 0.2  # relative gap of the solves that bound that: 0.8 x 1.2 is still less than everything
_PAYS = 1.05  # least ratio of what the certain robots collect by their own best plan to their share of a common plan
_DRAWS = 8  # draws of incentives tried until that is so
_STEP_S = 5.0  # capacities and limits are multiples of it, or of its doubles where missions are long
_STEPS = 50  # about this number of steps is the time to the remotest POI and back


@dataclass(frozen=True, eq=False, kw_only=True)
class Proposal:
    """A mission for given sites.

    Attributes:
        robots: Names of the robots, the certain ones first.
        certain: How many of them are always available.
        fuel_capacity_s, mission_limit_s: Of each robot.
        incentives: What each robot earns at each POI, by name; POIs that earn it nothing are left out.
    """

    robots: tuple[str, ...]
    certain: int
    fuel_capacity_s: float
    mission_limit_s: float
    incentives: tuple[Mapping[str, int], ...]

    def sections(self) -> dict[str, Any]:
        """The sections of a world file for this mission."""
        uncertain = self.robots[self.certain:]
        return {
            "robots": {name: {
                "model": USUAL_MODEL, "fuel_capacity_s": _plain(self.fuel_capacity_s),
                "mission_limit_s": _plain(self.mission_limit_s),
                "availability": AVAILABILITY if name in uncertain else 1.0, "incentives": dict(earned)}
                for name, earned in zip(self.robots, self.incentives, strict=True)},
            "scenarios": {name: dict.fromkeys(uncertain, share) for name, share in SCENARIOS.items()}}

    def remarks(self) -> dict[tuple[str | int, ...], str]:
        """Comments above those sections and robots."""
        one, others = self.certain == 1, len(self.robots) - self.certain == 1
        return {
            ("robots", self.robots[0]): ("The reliable robot earns less, and nothing" if one else
                                         "Reliable robots earn less, and nothing") + " at half of the points.",
            ("robots", self.robots[self.certain]): "The better equipped robot earns more, when it is there." if others
            else "Better equipped robots earn more, when they are there."}


def propose_mission(
    sites: Sequence[Site], fuel_s: FloatArray, *, robots: int, seed: int, key: tuple[int, ...]
) -> Proposal:
    """A mission for sites that are given, all robots alike.

    Half of the robots, rounded down, are uncertain and earn up to 170 at every POI; the others are certain and earn up
    to 150 at half of them. The mission limit is the longest in which a team collects no more than four fifths of what
    there is; a filling lasts for half of it, or for the way to the remotest POI.

    Args:
        sites: The base, then stations, then POIs, all reachable.
        fuel_s: Planning cost from site to site [s], shape (n, n).
        robots: Number of robots.
        seed: Seed of the incentives.
        key: Key of the random stream, so that incentives of different worlds are independent.

    Raises:
        BadInput: If there are too few robots or POIs for a choice.

    Source:
        Sections 5.1 and 5.2 of the paper; it leaves capacities and limits open.
    """
    pois = [site.name for site in sites if site.kind == "poi"]
    if robots < 2 or len(pois) < 2 * robots:
        raise BadInput(f"{counted(robots, 'robot')} and {counted(len(pois), 'POI')} leave nothing to decide; choose "
                       "at least two robots, and two POIs for each")
    names, certain = tuple(f"uv{k + 1}" for k in range(robots)), robots - robots // 2
    first: Proposal | None = None
    for draw in range(_DRAWS):
        incentives = tuple(
            _incentives(pois, m < certain, rng_for(seed, Stream.PROPOSED_MISSION, *key, draw, m))
            for m in range(robots))
        free = Proposal(robots=names, certain=certain, fuel_capacity_s=math.inf, mission_limit_s=math.inf,
                        incentives=incentives)
        proposal = _limited(free, sites, fuel_s)
        instance = _instance(proposal, sites, fuel_s)
        if _is_hopeless(instance):
            continue
        if _is_trivial(instance):
            continue
        if _planning_pays(instance, certain):
            return proposal
        first = first or proposal
    if first is None:
        raise BadInput(f"no mission found for {counted(len(pois), 'POI')} and {counted(robots, 'robot')} that is "
                       "neither trivial nor hopeless; choose another seed, or more POIs")
    return first


def _incentives(pois: Sequence[str], certain: bool, rng: np.random.Generator) -> dict[str, int]:
    values = rng.integers(1, MOST_INCENTIVE[certain] + 1, size=len(pois))
    if certain:
        values[rng.permutation(len(pois))[: len(pois) // 2]] = 0
    return {poi: int(value) for poi, value in zip(pois, values, strict=True) if value}


def _limited(free: Proposal, sites: Sequence[Site], fuel_s: FloatArray) -> Proposal:
    """The proposal with the longest mission limit in which not too much is collected, and a capacity to go with it."""
    single = _instance(free, sites, fuel_s)
    round_trip_s = max(_single_visit_s(single, math.inf))
    step = 1.0 if round_trip_s < 4 * _STEP_S else _STEP_S
    while round_trip_s > _STEPS * step:
        step *= 2
    least_capacity = next(step * k for k in itertools.count(1) if math.isfinite(max(_single_visit_s(single, step * k))))
    everything = float(_weights(single).max(axis=0).sum())

    def limited(steps: int) -> Proposal:
        return replace(free, mission_limit_s=step * steps, fuel_capacity_s=min(
            step * steps, max(least_capacity, step * math.ceil(steps / 2))))

    def enough(steps: int) -> bool:
        instance = _instance(limited(steps), sites, fuel_s)
        weights, worth = _weights(instance), _COLLECTED * everything
        return _worth(weights, _good_orders(instance, weights, lambda value: value > worth)) > worth

    low, high = 1, math.ceil(round_trip_s / step)
    while not enough(high):
        low, high = high, math.ceil(1.5 * high)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return limited(low)


def _is_hopeless(instance: Instance) -> bool:
    """Whether some robot can collect nothing."""
    for vehicle in instance.vehicles:
        own_legs = vehicle_legs(instance, vehicle)
        if not any(quickest_route(own_legs, (poi,)) for poi in instance.pois if vehicle.incentives[poi] > 0):
            return True
    return False


def _is_trivial(instance: Instance) -> bool:
    """Whether all incentives can be collected, or that can't be ruled out.

    For that, each robot must visit the POIs where it alone earns most, and no tour is shorter than a spanning tree.
    """
    weights = _weights(instance)
    most = weights.max(axis=0)
    shared = (weights == most).sum(axis=0) > 1
    for vehicle, earned in zip(instance.vehicles, weights, strict=True):
        stops = [instance.base, *(poi for poi in instance.pois if earned[poi] == most[poi] and not shared[poi])]
        either_way = np.minimum(vehicle.fuel_s, vehicle.fuel_s.T)[np.ix_(stops, stops)]
        if minimum_spanning_tree(either_way).sum() > vehicle.mission_limit_s:
            return False
    nominal = unless_interrupted(plan_nominal(instance, SolveLimits(gap=_PROOF)))
    return nominal.bound is None or nominal.bound >= float(most.sum()) * (1 - 1e-6)


def _planning_pays(instance: Instance, certain: int) -> bool:
    """Whether the certain robots would collect more by a plan of their own than in a plan for all, if all others fail.

    Compared by heuristic plans, not proved optimal ones: that is quick, and seldom wrong.
    """
    weights = _weights(instance)
    for_all = _good_orders(instance, weights, lambda value: False)  # noqa: ARG005
    single = weights.copy()
    single[certain:] = 0.0
    otherwise = _worth(single, for_all)
    return _worth(single, _good_orders(instance, single, lambda value: value >= _PAYS * otherwise)) >= _PAYS * otherwise


def _instance(proposal: Proposal, sites: Sequence[Site], fuel_s: FloatArray) -> Instance:
    return Instance(
        name="proposal", sites=tuple(site.name for site in sites), base=0,
        stations=tuple(k for k, site in enumerate(sites) if site.kind == "station"),
        stop_s=np.array([site.stop_s for site in sites]), vehicles=tuple(Vehicle(
            name=name, fuel_capacity_s=proposal.fuel_capacity_s, mission_limit_s=proposal.mission_limit_s,
            availability=1.0, fuel_s=fuel_s, incentives=np.array([float(earned.get(site.name, 0)) for site in sites]))
            for name, earned in zip(proposal.robots, proposal.incentives, strict=True)))


def _single_visit_s(instance: Instance, capacity_s: float) -> list[float]:
    """Least time to visit each POI alone and come home on such fillings [s]; ``inf`` where they don't last."""
    own_legs = vehicle_legs(instance, replace(instance.vehicles[0], fuel_capacity_s=capacity_s))
    drives = [quickest_route(own_legs, (poi,)) for poi in instance.pois]
    return [math.inf if drive is None else drive.time_s for drive in drives]


def _weights(instance: Instance) -> FloatArray:
    return np.array([vehicle.incentives for vehicle in instance.vehicles])


def _good_orders(instance: Instance, weights: FloatArray, stop: Callable[[float], bool]) -> VisitOrders:
    """A good plan, or the first for whose value ``stop`` is true."""
    robots = len(weights)
    return search(leg_tables(instance), weights, None, tuple(() for _ in range(robots)), starts=1,
                  stop=stop).orders


def _worth(weights: FloatArray, orders: VisitOrders) -> float:
    return float(sum(weights[m, j] for m, order in enumerate(orders) for j in order))


def _plain(seconds: float) -> float | int:
    return int(seconds) if seconds == int(seconds) else seconds
