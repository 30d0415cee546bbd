"""Instances: the data of the optimisation problem, as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Real

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
    """

    name: str
    fuel_capacity_s: float
    mission_limit_s: float
    availability: float
    incentives: FloatArray
    fuel_s: FloatArray
    mtbf_s: float | None = None
    loss_cost: float = 0.0

    def __post_init__(self) -> None:
        n = len(self.incentives)
        if not 0 <= self.availability <= 1:
            raise ValueError(f"availability of {self.name}: expected 0 to 1, found {self.availability}")
        object.__setattr__(self, "incentives", frozen(self.incentives, (n,)))
        object.__setattr__(self, "fuel_s", frozen(self.fuel_s, (n, n)))

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
        stop_s: Duration of a stop [s], shape (n,); counts towards the mission limit, burns no fuel.
        vehicles: The vehicles.
        failure: The failure process that plans are made for.
        joint: Joint distribution of the availabilities; ``None`` = independent.
    """

    name: str
    sites: tuple[str, ...]
    base: int
    stations: tuple[int, ...]
    stop_s: FloatArray
    vehicles: tuple[Vehicle, ...]
    failure: FailureProcess = "mission"
    joint: tuple[JointState, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "stop_s", frozen(self.stop_s, (len(self.sites),)))

    def __repr__(self) -> str:
        counts = ((self.vehicles, "vehicle"), (self.pois, "POI"), (self.stations, "station"))
        return f"Instance({self.name}: {', '.join(counted(len(c), what) for c, what in counts)}; {self.failure})"

    @property
    def pois(self) -> tuple[int, ...]:
        """Indices of the POIs: every site that is neither base nor station."""
        return tuple(i for i in range(len(self.sites)) if i != self.base and i not in self.stations)

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
