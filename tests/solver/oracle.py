"""Brute force over all visits of a tiny instance. Shares nothing with the solver."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.solver.risk import RiskMeasure

TOLERANCE = 1e-6


def moves(
    instance: Instance, vehicle: Vehicle, site: int, visited: frozenset[int], fuel: float, time: float,
) -> Iterator[tuple[int, float, float]]:
    """Where a vehicle can go next: the site, fuel burnt since the last refuel, and time, as it sets off from there."""
    clock = vehicle.fuel_s if vehicle.time_s is None else vehicle.time_s
    for j in range(len(instance.sites)):
        burnt = fuel + float(vehicle.fuel_s[site, j])
        later = time + float(clock[site, j]) + float(instance.stop_s[j])
        if j in instance.stations and instance.charge_rate is not None:
            later += burnt / float(instance.charge_rate[j])
        if j != site and j not in visited and burnt <= vehicle.fuel_capacity_s + TOLERANCE \
                and later <= vehicle.mission_limit_s + TOLERANCE and np.isfinite(later):
            if j != instance.base and j not in instance.stations:
                burnt += vehicle.idle_share * float(instance.stop_s[j])
            yield j, burnt, later


def least_times(instance: Instance, vehicle: Vehicle) -> dict[frozenset[int], float]:
    """Least time of a route for every set of POIs that the vehicle can visit: labels (site, visited, fuel, time)."""
    pois = set(instance.pois)
    found = {frozenset[int](): 0.0}
    front: dict[tuple[int, frozenset[int]], list[tuple[float, float]]] = {}
    waiting = [(instance.base, frozenset[int](), 0.0, 0.0)]
    while waiting:
        site, visited, fuel, time = waiting.pop()
        for j, burnt, later in moves(instance, vehicle, site, visited, fuel, time):
            if j == instance.base:
                found[visited] = min(found.get(visited, np.inf), later)
                continue
            now = visited | {j} if j in pois else visited
            left = burnt if j in pois else 0.0
            labels = front.setdefault((j, now), [])
            if any(t <= later and f <= left for t, f in labels):
                continue
            labels[:] = [(t, f) for t, f in labels if not (later <= t and left <= f)] + [(later, left)]
            waiting.append((j, now, left, later))
    return found


@dataclass(frozen=True, kw_only=True)
class Truth:
    """What enumeration says of an instance.

    Attributes:
        stochastic: Greatest expected value.
        nominal: Greatest sum of incentives.
        most: Greatest expected value of a plan with that sum.
        least: Least one.
        soonest: Least time of a plan with that sum and the greatest expected value.
        foresight: Expected value with perfect foresight.
    """

    stochastic: float
    nominal: float
    most: float
    least: float
    soonest: float
    foresight: float


def truth(instance: Instance) -> Truth:
    """Enumerate every plan of an instance with up to two vehicles."""
    times = [least_times(instance, v) for v in instance.vehicles]
    plans = [visits for visits in itertools.product(*times)
             if sum(map(len, visits)) == len(frozenset().union(*visits))]
    sums = np.array([[sum(v.incentives[j] for j in s) for v, s in zip(instance.vehicles, visits, strict=True)]
                     for visits in plans]).reshape(len(plans), len(instance.vehicles))
    seconds = np.array([sum(t[s] for t, s in zip(times, visits, strict=True)) for visits in plans])
    p = np.array([v.availability for v in instance.vehicles])
    expected, nominal = sums @ p, sums.sum(axis=1)
    tied = nominal >= nominal.max() - 1e-9
    best = tied & (expected >= expected[tied].max() - 1e-9)
    foresight = 0.0
    for there in itertools.product((0, 1), repeat=len(p)):
        probability = float(np.prod([q if t else 1 - q for q, t in zip(p, there, strict=True)]))
        foresight += probability * float((sums @ np.array(there, dtype=float)).max())
    return Truth(stochastic=float(expected.max()), nominal=float(nominal.max()), most=float(expected[tied].max()),
                 least=float(expected[tied].min()), soonest=float(seconds[best].min()), foresight=foresight)


def risk_optimum(instance: Instance, measure: RiskMeasure) -> float:
    """Greatest value of a plan under a measure of risk, each plan's outcomes sorted by what they pay."""
    times = [least_times(instance, v) for v in instance.vehicles]
    outcomes: list[tuple[float, list[bool]]] = []
    if instance.joint is not None:
        outcomes = [(s.probability, [v.name in s.available for v in instance.vehicles]) for s in instance.joint]
    else:
        for there in itertools.product((True, False), repeat=len(instance.vehicles)):
            outcomes.append((float(np.prod([v.availability if t else 1 - v.availability
                                            for v, t in zip(instance.vehicles, there, strict=True)])), list(there)))
    best = -np.inf
    for visits in itertools.product(*times):
        if sum(map(len, visits)) != len(frozenset().union(*visits)):
            continue
        sums = [sum(float(v.incentives[j]) for j in s) for v, s in zip(instance.vehicles, visits, strict=True)]
        paid = sorted((sum(x for x, t in zip(sums, there, strict=True) if t), p) for p, there in outcomes)
        mean = sum(x * p for x, p in paid)
        if measure.kind == "excess":
            bad = -sum(max(measure.target - x, 0.0) * p for x, p in paid)
        else:
            bad, spare = 0.0, measure.beta
            for x, p in reversed(paid):  # from the best one: 1 less a tiny probability is rounding
                bad += x * (p - min(p, spare)) / (1 - measure.beta)
                spare -= min(p, spare)
        best = max(best, (1 - measure.weight) * mean + measure.weight * bad)
    return best


def per_leg_optimum(instance: Instance) -> float:
    """Greatest expected value of a plan if vehicles fail along the way: every order of visits counts."""
    worth = [_best_orders(instance, v) for v in instance.vehicles]
    best = 0.0
    for visits in itertools.product(*worth):
        if sum(map(len, visits)) == len(frozenset().union(*visits)):
            best = max(best, sum(w[s] for w, s in zip(worth, visits, strict=True)))
    return best


def _best_orders(instance: Instance, vehicle: Vehicle) -> dict[frozenset[int], float]:
    """Greatest value of a route for every set of POIs: labels (site, visited, fuel, time, value)."""
    pois = set(instance.pois)
    found = {frozenset[int](): 0.0}
    front: dict[tuple[int, frozenset[int]], list[tuple[float, float, float]]] = {}
    waiting = [(instance.base, frozenset[int](), 0.0, 0.0, 0.0)]
    while waiting:
        site, visited, fuel, time, value = waiting.pop()
        for j, burnt, later in moves(instance, vehicle, site, visited, fuel, time):
            if j == instance.base:
                found[visited] = max(found.get(visited, 0.0), value)
                continue
            now = visited | {j} if j in pois else visited
            left = burnt if j in pois else 0.0
            earned = value + (vehicle.availability**len(now) * float(vehicle.incentives[j]) if j in pois else 0.0)
            labels = front.setdefault((j, now), [])
            if any(t <= later and f <= left and v >= earned for t, f, v in labels):
                continue
            labels.append((later, left, earned))
            waiting.append((j, now, left, later, earned))
    return found


def closure(cost: FloatArray) -> FloatArray:
    """The triangle inequality put right over every site but the base, site 0."""
    cost = cost.copy()
    for k in range(1, len(cost)):
        cost = np.minimum(cost, cost[:, [k]] + cost[[k], :])
    np.fill_diagonal(cost, 0.0)
    return cost


def random_instance(seed: int) -> Instance:
    """A tiny instance with what makes instances hard: one-way legs, ties, tight fuel, stops, several tanks."""
    rng = np.random.default_rng(seed)
    pois, stations = int(rng.integers(1, 6)), int(rng.integers(0, 4))
    n = 1 + stations + pois
    at = rng.uniform(0, 10, size=(n, 2))
    distance = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    kind = rng.integers(5)
    spread = {0: 0.05, 1: 0.5, 2: 1.0, 3: 1.0, 4: 0.5}[int(kind)]
    fuel = distance * rng.uniform(1, 1 + spread, size=(n, n)) + 0.5
    if kind >= 3:  # no triangle inequality, some legs missing
        fuel *= rng.uniform(0.4, 1.6, size=(n, n))
        fuel[rng.random((n, n)) < 0.15] = np.inf
    np.fill_diagonal(fuel, 0.0)
    if kind < 3:
        fuel = closure(fuel)
    stop = rng.choice([0.0, 1.0, 2.5], size=n) * (rng.random() < 0.5)
    stop[0] = 0.0
    vehicles = []
    for name in ("a", "b")[:int(rng.integers(1, 3)) if seed % 7 == 0 else 2]:
        own = fuel if rng.random() < 0.7 else fuel * 1.3
        incentives = np.zeros(n)
        incentives[1 + stations:] = rng.integers(0, 6, size=pois) * 10.0
        vehicles.append(Vehicle(
            name=name, fuel_capacity_s=float(rng.choice([8.0, 11.0, 15.0, 25.0, np.inf])),
            mission_limit_s=float(rng.choice([20.0, 30.0, 45.0, 60.0])), incentives=incentives, fuel_s=own,
            availability=float(rng.choice([0.0, 0.25, 0.5, 0.75, 1.0]))))
    order = rng.permutation(n)  # the base and the stations stand anywhere
    place = np.argsort(order)
    names = np.array(["base", *(f"r{k}" for k in range(stations)), *(f"p{k}" for k in range(pois))])
    return Instance(
        name=f"random-{seed}", sites=tuple(str(x) for x in names[order]), base=int(place[0]),
        stations=tuple(int(place[1 + k]) for k in range(stations)), stop_s=stop[order],
        vehicles=tuple(Vehicle(name=v.name, fuel_capacity_s=v.fuel_capacity_s, mission_limit_s=v.mission_limit_s,
                               availability=v.availability, incentives=v.incentives[order],
                               fuel_s=v.fuel_s[np.ix_(order, order)]) for v in vehicles))


def discounted_optimum(instance: Instance) -> float:
    """Greatest value under ``per_leg`` or ``hazard``, costs of losses included: every order and every way counts."""
    worth = [_best_ways(instance, v) for v in instance.vehicles]
    best = {frozenset[int](): 0.0}  # value by the POIs that the vehicles so far visit
    for of_vehicle in worth:
        now: dict[frozenset[int], float] = {}
        for visited, value in best.items():
            for own, more in of_vehicle.items():
                if not visited & own:
                    now[visited | own] = max(now.get(visited | own, -np.inf), value + more)
        best = now
    return max(best.values())


def _chance(instance: Instance, vehicle: Vehicle, visits: int, driven: float) -> float:
    if instance.failure == "per_leg":
        return float(vehicle.availability**visits)
    mtbf = vehicle.mtbf_s
    if mtbf is None:
        if vehicle.availability in (0.0, 1.0):
            return float(vehicle.availability)
        mtbf = -vehicle.mission_limit_s / float(np.log(vehicle.availability))
    return float(np.exp(-driven / mtbf)) if mtbf > 0 else 0.0


def _best_ways(instance: Instance, vehicle: Vehicle) -> dict[frozenset[int], float]:
    """Greatest value of a route for every set of POIs: labels (site, visited, fuel, time, driven, value)."""
    pois = set(instance.pois)
    found = {frozenset[int](): 0.0}
    front: dict[tuple[int, frozenset[int]], list[tuple[float, float, float, float]]] = {}
    waiting = [(instance.base, frozenset[int](), 0.0, 0.0, 0.0, 0.0)]
    while waiting:
        site, visited, fuel, time, driven, value = waiting.pop()
        for j, burnt, later in moves(instance, vehicle, site, visited, fuel, time):
            far = driven + float(vehicle.fuel_s[site, j])
            if j == instance.base:
                if visited:
                    lost = vehicle.loss_cost * (1 - _chance(instance, vehicle, len(visited), far))
                    found[visited] = max(found.get(visited, -np.inf), value - lost)
                continue
            now = visited | {j} if j in pois else visited
            left = burnt if j in pois else 0.0
            earned = value
            if j in pois:
                earned += _chance(instance, vehicle, len(now), far) * float(vehicle.incentives[j])
            labels = front.setdefault((j, now), [])
            if any(t <= later and f <= left and d <= far and v >= earned for t, f, d, v in labels):
                continue
            labels.append((later, left, far, earned))
            waiting.append((j, now, left, later, far, earned))
    return found
