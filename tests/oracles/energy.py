"""Energy by brute force: every route of a tiny instance, driven stop by stop, with idle burn, charging and clock.

Shares nothing with the solver or the certificate, and drops no route because another one is better.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import FailureProcess
from sva_bench.mission.instance import Instance, Vehicle

TOLERANCE_S = 1e-6


@dataclass(frozen=True, kw_only=True)
class Way:
    """A vehicle on its way: what it has visited, burnt and earned, and when it sets off again.

    Attributes:
        route: Sites so far, the base first.
        pois: POIs among them, in order.
        tank_s: Fuel burnt since the last refuel.
        burnt_s: Fuel burnt in all.
        clock_s: Mission clock.
        driven_s: Seconds of driving by which lifetimes count.
        value: What it has earned on average.
    """

    route: tuple[int, ...]
    pois: tuple[int, ...] = ()
    tank_s: float = 0.0
    burnt_s: float = 0.0
    clock_s: float = 0.0
    driven_s: float = 0.0
    value: float = 0.0


def survival(vehicle: Vehicle, process: FailureProcess, pois: int, driven_s: float) -> float:
    """Probability of a vehicle to get so far; under ``mission`` that it left at all."""
    if process == "mission":
        return vehicle.availability
    if process == "per_leg":
        return float(vehicle.availability**pois)
    if vehicle.mtbf_s is None:
        return float(vehicle.availability ** (driven_s / vehicle.mission_limit_s))
    return math.exp(-driven_s / vehicle.mtbf_s)


def step(instance: Instance, vehicle: Vehicle, way: Way, there: int) -> Way | None:
    """The way with one more stop; ``None`` if tank or clock doesn't last."""
    here, process = way.route[-1], instance.failure
    leg_s = float(vehicle.fuel_s[here, there])
    clock_s = way.clock_s + (leg_s if vehicle.time_s is None else float(vehicle.time_s[here, there]))
    tank_s, burnt_s, driven_s, value = way.tank_s + leg_s, way.burnt_s + leg_s, way.driven_s + leg_s, way.value
    if not tank_s <= vehicle.fuel_capacity_s + TOLERANCE_S or math.isinf(leg_s):
        return None
    stop_s, pois = float(instance.stop_s[there]), way.pois
    if there == instance.base:
        if pois and process != "mission":
            value -= vehicle.loss_cost * (1 - survival(vehicle, process, len(pois), driven_s))
    elif there in instance.stations:
        if instance.charge_rate is not None:
            clock_s += tank_s / float(instance.charge_rate[there])
        tank_s = 0.0
    else:
        pois = (*pois, there)
        tank_s, burnt_s = tank_s + vehicle.idle_share * stop_s, burnt_s + vehicle.idle_share * stop_s
        value += survival(vehicle, process, len(pois), driven_s) * float(vehicle.incentives[there])
    clock_s += stop_s
    if not clock_s <= vehicle.mission_limit_s + TOLERANCE_S:
        return None
    return Way(route=(*way.route, there), pois=pois, tank_s=tank_s, burnt_s=burnt_s, clock_s=clock_s,
               driven_s=driven_s, value=value)


def ways(instance: Instance, vehicle: Vehicle) -> Iterator[Way]:
    """Every way out of the base and back over some POIs, each station at most once between two others."""
    waiting = [Way(route=(instance.base,))]
    while waiting:
        way = waiting.pop()
        since = len(way.route) - 1 - max(k for k, j in enumerate(way.route) if j not in instance.stations)
        passed = way.route[len(way.route) - since:]
        for there in range(len(instance.sites)):
            if there in way.pois or there in passed or there == way.route[-1]:
                continue
            further = step(instance, vehicle, way, there)
            if further is None:
                continue
            if there != instance.base:
                waiting.append(further)
            elif further.pois:
                yield further


def greatest_value(instance: Instance) -> float:
    """The greatest expected value of a plan."""
    best = {frozenset[int](): 0.0}
    for vehicle in instance.vehicles:
        own = {frozenset[int](): 0.0}
        for way in ways(instance, vehicle):
            own[frozenset(way.pois)] = max(own.get(frozenset(way.pois), -math.inf), way.value)
        now: dict[frozenset[int], float] = {}
        for visited, value in best.items():
            for more, gained in own.items():
                if not visited & more:
                    now[visited | more] = max(now.get(visited | more, -math.inf), value + gained)
        best = now
    return max(best.values())


def driven(instance: Instance, vehicle: Vehicle, route: tuple[int, ...]) -> Way | None:
    """A route driven stop by stop; ``None`` if it breaks a rule."""
    way: Way | None = Way(route=route[:1])
    for there in route[1:]:
        way = way and step(instance, vehicle, way, there)
    return way


def with_energy(instance: Instance, seed: int, *, clock: bool = True) -> Instance:
    """The instance with idle burn, charging and times of its own drawn for it, and limits that leave room for them."""
    rng = np.random.default_rng((seed, 23))
    n = len(instance.sites)
    stop_s = np.where(rng.random(n) < 0.5, instance.stop_s, rng.choice([0.0, 1.0, 3.0, 7.5], size=n))
    stop_s[instance.base] = 0.0
    rates = np.full(n, math.inf)
    for station in instance.stations:
        if rng.random() < 0.8:
            rates[station] = float(rng.choice([0.3, 1.0, 2.5, 6.0]))
    common = _times(instance.vehicles[0].fuel_s, rng)
    vehicles = []
    for vehicle in instance.vehicles:
        time_s = None
        if clock and rng.random() < 0.6:
            time_s = common if rng.random() < 0.5 else _times(vehicle.fuel_s, rng)
        vehicles.append(replace(
            vehicle, idle_share=float(rng.choice([0.0, 0.2, 0.6, 1.0])), time_s=time_s,
            mission_limit_s=vehicle.mission_limit_s * float(rng.choice([1.0, 1.5, 2.5])),
            fuel_capacity_s=vehicle.fuel_capacity_s * float(rng.choice([1.0, 1.0, 1.3]))))
    return replace(instance, stop_s=stop_s, vehicles=tuple(vehicles),
                   charge_rate=rates if rng.random() < 0.9 else None)


def _times(fuel_s: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Times of legs, now and then with the triangle inequality, longer or shorter than their fuel; ``inf`` as there."""
    n = len(fuel_s)
    if rng.random() < 0.3:
        return fuel_s * float(rng.choice([0.5, 0.8, 1.3]))
    time_s = np.round(fuel_s * rng.uniform(0.4, 1.7, size=(n, n)), 3)
    if rng.random() < 0.5:
        for k in range(n):
            time_s = np.where(np.isinf(fuel_s), np.inf, np.minimum(time_s, time_s[:, [k]] + time_s[[k], :]))
    np.fill_diagonal(time_s, 0.0)
    return time_s
