"""Tiny teams: instances in whole seconds, so that events coincide exactly, plans for them, and what foresight earns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import FailureProcess
from sva_bench.mission.failures import JointState, marginals
from sva_bench.mission.instance import Instance, Vehicle
from tests.oracles.rest import Ground


def closure(cost: FloatArray) -> FloatArray:
    """The triangle inequality put right over every site but the base, site 0."""
    cost = cost.copy()
    for k in range(1, len(cost)):
        cost = np.minimum(cost, cost[:, [k]] + cost[[k], :])
    np.fill_diagonal(cost, 0.0)
    return cost


def random_team(seed: int, process: FailureProcess, *, losses: bool = True) -> Instance:
    """A tiny instance whose legs obey the triangle inequality, as those of worlds do; one-way, in whole seconds."""
    rng = np.random.default_rng(seed)
    robots = int(rng.choice([1, 2, 2, 3]))
    pois, stations = int(rng.integers(1, 6 if robots < 3 else 5)), int(rng.integers(0, 3))
    n = 1 + stations + pois
    at = rng.uniform(0, 10, size=(n, 2))
    distance = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    cost = closure(np.ceil(distance * rng.uniform(1, 1.5, size=(n, n))) + 1)
    if rng.random() < 0.1:
        cost[:, n - 1] = np.inf  # a POI that cannot be reached
        cost[n - 1, n - 1] = 0.0
    stop = np.r_[0.0, rng.choice([0.0, 1.0, 2.0], size=n - 1)] * (rng.random() < 0.5)
    chances = rng.choice([0.0, 0.3, 0.5, 0.8, 0.9, 1.0], p=[0.04, 0.2, 0.26, 0.2, 0.2, 0.1], size=robots)
    vehicles = []
    for k, chance in enumerate(chances):
        incentives = np.zeros(n)
        incentives[1 + stations:] = rng.integers(0, 6, size=pois) * 10.0 + rng.random()
        vehicles.append(Vehicle(
            name="abc"[k], fuel_capacity_s=float(rng.choice([14.0, 18.0, 25.0, np.inf])), incentives=incentives,
            mission_limit_s=float(rng.choice([20.0, 30.0, 40.0])),
            fuel_s=cost if rng.random() < 0.6 else cost * 2 if rng.random() < 0.3 else cost + 1 - np.eye(n),
            availability=float(chance), mtbf_s=float(rng.choice([5.0, 30.0, 200.0])) if rng.random() < 0.4 else None,
            loss_cost=float(rng.choice([0.0, 5.0, 30.0])) if losses else 0.0))
    names = ("base", *(f"r{k}" for k in range(stations)), *(f"p{k}" for k in range(pois)))
    place = rng.permutation(n)  # the base and the stations stand anywhere
    back = np.argsort(place)
    instance = Instance(
        name=f"team-{seed}", sites=tuple(names[k] for k in place), base=int(back[0]), failure=process,
        stations=tuple(int(back[1 + k]) for k in range(stations)), stop_s=stop[place],
        vehicles=tuple(replace(v, incentives=v.incentives[place], fuel_s=v.fuel_s[np.ix_(place, place)])
                       for v in vehicles))
    return _correlated(instance, rng) if process != "hazard" and rng.random() < 0.3 else instance


def _correlated(instance: Instance, rng: np.random.Generator) -> Instance:
    """The same with a joint distribution of availabilities."""
    names = [v.name for v in instance.vehicles]
    weights = rng.dirichlet(np.ones(2 ** len(names)))
    if rng.random() < 0.5:  # some outcomes are impossible
        weights[rng.random(len(weights)) < 0.4] = 0.0
        weights[-1] += 0.1
        weights /= weights.sum()
    states = tuple(JointState(probability=float(w), available=frozenset(
        name for k, name in enumerate(names) if bits >> k & 1)) for bits, w in enumerate(weights))
    share = marginals(states, names)
    return replace(instance, joint=states, vehicles=tuple(
        replace(v, availability=share[v.name]) for v in instance.vehicles))


def random_plan(ground: Ground, seed: int, *, all_leave: bool = False) -> tuple[tuple[int, ...], ...]:
    """A plan that keeps every rule: sites of each robot after the base, the base last; none for one that stays."""
    rng = np.random.default_rng([seed, 7])
    routes: list[tuple[int, ...]] = [()] * len(ground.robots)
    free = ground.everything
    for k in rng.permutation(len(ground.robots)).tolist():
        here, ready, burnt = ground.base, 0.0, 0.0
        route: list[int] = []
        while True:
            ways = [(j, arrival) for j in (*ground.pois, *ground.stations)
                    if (j in ground.stations and rng.random() < 0.4) or free & ground.bit.get(j, 0)
                    if (arrival := ground.arrival(k, here, j, ready, burnt)) and ground.is_safe(k, j, *arrival)]
            stays = rng.random() < 0.2 and not (all_leave and not route)
            if not ways or stays:
                break
            here, (ready, burnt) = ways[int(rng.integers(len(ways)))]
            route.append(here)
            free &= ~ground.bit.get(here, 0)
        if route:
            way = ground.best(k, here, ready, burnt, 0)
            routes[k] = (*route, *way.orders)
    return tuple(routes)
