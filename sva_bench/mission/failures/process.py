"""The interface of failure processes: draws, closed-form values of routes, and terms for planning."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.choices import FailureProcess
from sva_bench.mission.failures.joint import JointState
from sva_bench.seeds import Stream, uniforms

NEVER = np.iinfo(np.int64).max
"""``Failures.before_poi`` of a robot that doesn't fail."""


@dataclass(frozen=True, kw_only=True)
class Reliability:
    """The reliability parameters of one vehicle; each process has its own interpretation.

    Attributes:
        availability: Probability of no failure: in the whole mission, on the way to the next POI, or driving for the
            whole mission limit.
        mission_limit_s: Longest mission [s]; ``inf`` = no limit.
        mtbf_s: Mean driving time to failure [s]; ``None`` = by availability and mission limit.
        loss_cost: Cost of a robot that left the base and doesn't come home [incentive].
    """

    availability: float
    mission_limit_s: float = math.inf
    mtbf_s: float | None = None
    loss_cost: float = 0.0


@dataclass(frozen=True, kw_only=True)
class RouteProfile:
    """What of a route its value under failures depends on.

    Attributes:
        incentives: Incentive of each POI, in the order of visits.
        arrival_s: Driving time until each of them [s], without stops; ``None`` = not known.
        home_s: Driving time until the base [s]; ``None`` = not known.
    """

    incentives: tuple[float, ...]
    arrival_s: tuple[float, ...] | None = None
    home_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class FailureDraw:
    """The parameters of a draw of failures.

    Attributes:
        seed: Root seed.
        vehicles: Names; a vehicle's position is the key of its stream.
        reliability: Of each vehicle.
        trials: Number of trials.
        first: Number of the first trial.
        pois: Greatest number of POIs on a route.
        joint: Joint distribution of the availabilities; ``None`` = independent.
    """

    seed: int
    vehicles: tuple[str, ...]
    reliability: tuple[Reliability, ...]
    trials: int
    first: int = 0
    pois: int
    joint: tuple[JointState, ...] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Failures:
    """When each robot fails in each trial, independent of its route.

    Attributes:
        before_poi: Shape (trials, vehicles). 0: fails before leaving the base; k >= 1: fails on its way to the k-th POI
            of its route; ``NEVER``: no such failure.
        lifetime_s: Driving time after which it fails [s], shape (trials, vehicles); ``inf`` = never.
    """

    before_poi: IntArray
    lifetime_s: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanningTerms:
    """The expected rewards under a process: all that a solver knows of it.

    The k-th POI of vehicle m's route, reached after ``T`` seconds of driving, earns ``share[m] * survival[m]**k *
    exp(-rate[m] * T)`` times its incentive. A vehicle that leaves pays ``loss_cost[m]`` and gets it back at home, times
    the same discount.

    Attributes:
        share: Share of every incentive that a vehicle earns on average, independent of its route, shape (M,).
        survival: Probability of a vehicle to get to its next POI, shape (M,); ``None`` = 1. Where it, ``rate`` and
            ``loss_cost`` are ``None``, the order of visits makes no difference.
        rate: Failures in a second of driving, shape (M,); ``None`` = 0; ``inf`` = nothing is ever reached.
        loss_cost: Cost of a vehicle that doesn't come home, shape (M,); ``None`` = 0.
    """

    share: FloatArray
    survival: FloatArray | None = None
    rate: FloatArray | None = None
    loss_cost: FloatArray | None = None

    def most(self, vehicle: int) -> float:
        """Upper bound on the share of an incentive that a visit of a vehicle earns on average."""
        survival = 1.0 if self.survival is None else float(self.survival[vehicle])
        return 0.0 if self.rate_of(vehicle) == math.inf else float(self.share[vehicle]) * survival

    def rate_of(self, vehicle: int) -> float:
        """Failures of a vehicle in a second of driving."""
        return 0.0 if self.rate is None else float(self.rate[vehicle])

    def certain(self, vehicle: int) -> bool:
        """Whether no failure makes a difference to a vehicle: it never fails, or is never of use."""
        return self.most(vehicle) <= 0 or (self.most(vehicle) >= 1 and self.rate_of(vehicle) == 0)


class Process(Protocol):
    """A failure process. It has no state; ``sva_bench.mission.failures.PROCESSES`` holds one of each.

    Attributes:
        name: Its name in files and options.
        how: How a robot fails, as a phrase of messages: "the instance fails ...".
        collapses: Whether the expected reward of a visit depends on the vehicle alone, not on its route. Then the
            two-stage problem is a one-stage problem, and the methods that keep the second stage apply.
        joint: Whether availabilities may have a joint distribution.
    """

    @property
    def name(self) -> FailureProcess: ...
    @property
    def how(self) -> str: ...
    @property
    def collapses(self) -> bool: ...
    @property
    def joint(self) -> bool: ...

    def draw(self, request: FailureDraw) -> Failures:
        """Failures of each trial and robot.

        Uniforms are keyed by (seed, trial, robot, POI number): plans, scenarios and processes are compared under the
        same ones (common random numbers).
        """

    def route_value(self, route: RouteProfile, reliability: Reliability) -> float:
        """Expected value of one route, in closed form: its incentives less the cost of a lost robot.

        Raises:
            ValueError: If it depends on driving times that aren't known.
        """

    def terms(self, reliability: Sequence[Reliability]) -> PlanningTerms:
        """The expected rewards of the vehicles' visits, for a solver."""

    def can_leave(self, reliability: Reliability) -> bool:
        """Whether a robot leaves the base in any trial."""


def no_failures(trials: int, vehicles: int) -> Failures:
    """Failures of no robot in any trial, to which a process adds its own."""
    return Failures(before_poi=np.full((trials, vehicles), NEVER, dtype=np.int64),
                    lifetime_s=np.full((trials, vehicles), np.inf))


def failure_uniforms(seed: int, vehicle: int, poi: int, trials: int, first: int = 0) -> FloatArray:
    """The uniforms that decide the failures of one vehicle before its ``poi``-th POI, shape (trials,)."""
    return uniforms(seed, Stream.FAILURE, vehicle, poi, first=first, count=trials)


def loss_costs(reliability: Sequence[Reliability]) -> FloatArray | None:
    """Cost of each vehicle's loss, shape (M,); ``None`` where none costs anything."""
    costs = np.array([vehicle.loss_cost for vehicle in reliability], dtype=np.float64)
    return costs if costs.any() else None


def availabilities(reliability: Sequence[Reliability]) -> FloatArray:
    """Availability of each vehicle, shape (M,)."""
    return np.array([vehicle.availability for vehicle in reliability], dtype=np.float64)
