"""Instances: the data of the optimisation problem, as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Real

import numpy as np

from sva_bench.arrays import FloatArray, frozen
from sva_bench.choices import FailureProcess
from sva_bench.errors import BadInput, UnknownName, nearest
from sva_bench.files.printable import counted
from sva_bench.mission.failures import JointState, Reliability, undefined_under

TOLERANCE_S = 1e-6
"""Feasibility tolerance of fuel and time [s]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Vehicle:
    """One vehicle of an instance.

    Attributes:
        name: Its name.
        fuel_capacity_s: Fuel capacity [s of driving]; ``inf`` = no limit.
        mission_limit_s: Longest mission, driving and stops [s]; ``inf`` = no limit.
        availability: Probability that it is available, that it survives each leg (``per_leg``), or that it survives
            driving for as long as its mission limit (``hazard``, without ``mtbf_s``).
        incentives: Incentive of its visit to each site, shape (n,); 0 at base and stations.
        fuel_s: Fuel of the leg from site i to site j [s of driving], shape (n, n), zero diagonal; ``inf`` = no leg.
        mtbf_s: Mean driving time to failure under ``hazard`` [s]; ``None`` = by availability and mission limit.
        loss_cost: Cost if it leaves the base and doesn't come home [incentive].
        idle_share: Share of a second of driving that a second of a stop at a POI burns, 0 to 1.
        time_s: Time of the leg from site i to site j on the mission clock [s], shape (n, n), ``inf`` where there is no
            leg; ``None`` = that of ``fuel_s``. Lifetimes under ``hazard`` are in seconds of ``fuel_s`` in any case.
    """

    name: str
    fuel_capacity_s: float
    mission_limit_s: float
    availability: float
    incentives: FloatArray
    fuel_s: FloatArray
    mtbf_s: float | None = None
    loss_cost: float = 0.0
    idle_share: float = 0.0
    time_s: FloatArray | None = None

    def __post_init__(self) -> None:
        n = len(self.incentives)
        if not 0 <= self.availability <= 1:
            raise ValueError(f"availability of {self.name}: expected 0 to 1, found {self.availability}")
        object.__setattr__(self, "incentives", frozen(self.incentives, (n,)))
        object.__setattr__(self, "fuel_s", frozen(self.fuel_s, (n, n)))
        if not 0 <= self.idle_share <= 1:
            raise ValueError(f"idle_share of {self.name}: expected 0 to 1, found {self.idle_share}")
        if self.time_s is not None:
            object.__setattr__(self, "time_s", frozen(self.time_s, (n, n)))
            if not np.array_equal(np.isinf(self.time_s), np.isinf(self.fuel_s)):
                raise ValueError(f"time_s of {self.name}: expected inf where fuel_s is, and nowhere else")

    @property
    def leg_time_s(self) -> FloatArray:
        """Time of a leg on the mission clock, without stops [s], shape (n, n)."""
        return self.fuel_s if self.time_s is None else self.time_s

    @property
    def reliability(self) -> Reliability:
        """What a failure process has to know of it."""
        return Reliability(availability=self.availability, mission_limit_s=self.mission_limit_s, mtbf_s=self.mtbf_s,
                           loss_cost=self.loss_cost)


@dataclass(frozen=True, eq=False, kw_only=True)
class Instance:
    """A two-stage stochastic team-orienteering problem with refuelling.

    Attributes:
        name: Its name.
        sites: Names of all sites, length n; an index into it is a site's identity.
        base: Index of the base.
        stations: Indices of the refuelling stations, without the base.
        stop_s: Duration of a stop [s], shape (n,); counts towards the mission limit, and burns fuel at POIs alone, by
            ``Vehicle.idle_share``.
        vehicles: The vehicles.
        failure: The failure process that plans are made for.
        joint: Joint distribution of the availabilities; ``None`` = independent.
        charge_rate: Seconds of driving that a second at a station fills into the tank, on top of ``stop_s``, shape
            (n,); ``inf`` at all other sites, and at stations where a stop takes ``stop_s`` alone; ``None`` = at all.
    """

    name: str
    sites: tuple[str, ...]
    base: int
    stations: tuple[int, ...]
    stop_s: FloatArray
    vehicles: tuple[Vehicle, ...]
    failure: FailureProcess = "mission"
    joint: tuple[JointState, ...] | None = None
    charge_rate: FloatArray | None = None

    def __post_init__(self) -> None:
        n = len(self.sites)
        object.__setattr__(self, "stop_s", frozen(self.stop_s, (n,)))
        if self.charge_rate is not None:
            object.__setattr__(self, "charge_rate", frozen(self.charge_rate, (n,)))
            charged = np.flatnonzero(np.isfinite(self.charge_rate)).tolist()
            if not (self.charge_rate > 0).all() or not set(charged) <= set(self.stations):
                raise ValueError("charge_rate: expected rates above 0 at stations, inf at all other sites")

    def __repr__(self) -> str:
        counts = ((self.vehicles, "vehicle"), (self.pois, "POI"), (self.stations, "station"))
        return f"Instance({self.name}: {', '.join(counted(len(c), what) for c, what in counts)}; {self.failure})"

    @property
    def pois(self) -> tuple[int, ...]:
        """Indices of the POIs: every site that is neither base nor station."""
        return tuple(i for i in range(len(self.sites)) if i != self.base and i not in self.stations)

    @property
    def charging(self) -> FloatArray:
        """Time that a stop takes for each second of driving burnt since the last refuel, shape (n,)."""
        return np.zeros(len(self.sites)) if self.charge_rate is None else 1.0 / self.charge_rate

    def idle_fuel_s(self, vehicle: Vehicle) -> FloatArray:
        """Fuel that a vehicle burns in a stop [s of driving], shape (n,); 0 at base and stations."""
        idle: FloatArray = vehicle.idle_share * self.stop_s
        idle[[self.base, *self.stations]] = 0.0
        return idle

    def vehicle(self, name: str) -> Vehicle:
        """The vehicle of that name.

        Raises:
            UnknownName: If there is none.
        """
        for vehicle in self.vehicles:
            if vehicle.name == name:
                return vehicle
        raise UnknownName(f"{self.name} has no vehicle {name!r}; {nearest(name, [v.name for v in self.vehicles])}")

    def with_availability(self, availability: Mapping[str, float]) -> Instance:
        """The same instance with other, independent availabilities, also in place of ``mtbf_s``.

        Vehicles that aren't named keep theirs.

        Raises:
            UnknownName: If the instance has no such vehicle.
            BadInput: If an availability is no probability, or says nothing of failures under the instance's process.
            ValueError: If it is no number.
        """
        for name, probability in availability.items():
            self.vehicle(name)
            if not isinstance(probability, Real):
                raise ValueError(f"availability of {name}: expected a number, found {type(probability).__name__}")
            if not 0 <= probability <= 1:
                raise BadInput(f"{self.name}: availability of {name}: {probability} is no probability; expected 0 to 1")
        vehicles = tuple(replace(v, availability=availability[v.name], mtbf_s=None) if v.name in availability else v
                         for v in self.vehicles)
        for vehicle in vehicles:
            if problem := undefined_under([self.failure], vehicle.reliability):
                raise BadInput(f"{self.name}: availability of {vehicle.name}: {problem} of the vehicle")
        return replace(self, vehicles=vehicles, joint=None)
