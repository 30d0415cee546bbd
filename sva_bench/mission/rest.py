"""The rest of a mission, from where its robots are: an instance again."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.mission.failures import process_of
from sva_bench.mission.instance import Instance, Vehicle


@dataclass(frozen=True, kw_only=True)
class Afield:
    """A vehicle that goes on with its mission.

    Attributes:
        name: Its name.
        site: Where it sets off next.
        ready_s: When [s on the mission clock].
        burnt_s: Fuel burnt since it was filled last, in stops too [s of driving].
        availability: Probability that it is alive, where failures are drawn for a whole mission; else its availability.
        orders: Sites that it was to go to from there, the base last; a plan to start from.
    """

    name: str
    site: str
    ready_s: float
    burnt_s: float
    availability: float
    orders: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class Rest:
    """What is left of a mission.

    Attributes:
        instance: The whole mission's, under the failure process executed.
        vehicles: Those that go on.
        open_pois: POIs that they may visit.
    """

    instance: Instance
    vehicles: tuple[Afield, ...]
    open_pois: frozenset[str]


def instance_of_rest(rest: Rest) -> Instance:
    """The rest as an instance: each vehicle's own costs begin where it is.

    A vehicle's row of the base is the row of its site, plus the fuel that it has burnt already, which a station where
    charging takes time fills up too; its limit is shortened by the time that has passed, less that fuel where the
    mission clock runs by fuel. So the triangle inequality doesn't hold for legs from the base.
    Incentives and cost of a loss are worth more by what it has survived already, so that discounts count from now.
    """
    whole = rest.instance
    kept = [k for k, site in enumerate(whole.sites)
            if k == whole.base or k in whole.stations or site in rest.open_pois]
    number = {site: k for k, site in enumerate(kept)}
    burdens = [afield.burnt_s * rate for afield, rate in zip(rest.vehicles, failure_rates(rest), strict=True)]
    worth = np.exp(np.array(burdens) - max(burdens, default=0.0))  # up to a common factor, which changes no plan
    vehicles = tuple(_vehicle(whole, afield, kept, float(w)) for afield, w in zip(rest.vehicles, worth, strict=True))
    return replace(whole, name=f"{whole.name}, the rest", sites=tuple(whole.sites[k] for k in kept),
                   base=number[whole.base], stations=tuple(number[k] for k in whole.stations),
                   stop_s=whole.stop_s[kept], vehicles=vehicles, joint=None,
                   charge_rate=None if whole.charge_rate is None else whole.charge_rate[kept])


def failure_rates(rest: Rest) -> list[float]:
    """Failures of each vehicle in a second of driving; a vehicle that fails at once isn't afield."""
    reliability = [rest.instance.vehicle(afield.name).reliability for afield in rest.vehicles]
    rate = process_of(rest.instance.failure).terms(reliability).rate
    return [0.0 if rate is None or math.isinf(rate[k]) else float(rate[k]) for k in range(len(reliability))]


def _vehicle(whole: Instance, afield: Afield, kept: list[int], worth: float) -> Vehicle:
    vehicle = whole.vehicle(afield.name)
    site, base = whole.sites.index(afield.site), kept.index(whole.base)

    def from_here(legs: FloatArray, already_s: float) -> FloatArray:
        own: FloatArray = legs[np.ix_(kept, kept)].copy()
        own[base] = legs[site, kept] + already_s
        if site != whole.base and site in kept:
            own[base, kept.index(site)] = math.inf  # it stands there
        own[base, base] = 0.0
        return own

    time_s, left_s = None, vehicle.mission_limit_s - afield.ready_s + afield.burnt_s
    if vehicle.time_s is not None:
        time_s, left_s = from_here(vehicle.time_s, 0.0), vehicle.mission_limit_s - afield.ready_s
    # By an availability alone, lifetimes would be those of the limit that is left.
    rate = process_of(whole.failure).terms([vehicle.reliability]).rate
    mtbf_s = vehicle.mtbf_s if rate is None else 1.0 / float(rate[0]) if rate[0] > 0 else math.inf
    return replace(vehicle, fuel_s=from_here(vehicle.fuel_s, afield.burnt_s), time_s=time_s, mtbf_s=mtbf_s,
                   incentives=vehicle.incentives[kept] * worth, loss_cost=vehicle.loss_cost * worth,
                   availability=afield.availability, mission_limit_s=max(left_s, 0.0))
