"""What a failure process is: how failures are drawn, what a route is worth under them, what planning needs to know."""

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
"""Number of the POI before which a robot that doesn't fail would fail."""


@dataclass(frozen=True, kw_only=True)
class Reliability:
    """How far one vehicle can be relied upon; each process reads it in its own way.

    Attributes:
        availability: Probability of no failure: in the mission, or on the way to the next POI.
        mission_limit_s: Longest mission [s]; ``inf`` = no limit.
    """

    availability: float
    mission_limit_s: float = math.inf


@dataclass(frozen=True, kw_only=True)
class RouteProfile:
    """A route as far as failures matter.

    Attributes:
        incentives: Incentive of each POI, in the order of visits.
        arrival_s: Driving time until each of them [s], stops left out; ``None`` = not known.
        home_s: Driving time until the base [s]; ``None`` = not known.
    """

    incentives: tuple[float, ...]
    arrival_s: tuple[float, ...] | None = None
    home_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class FailureDraw:
    """What to draw.

    Attributes:
        seed: Root seed.
        vehicles: Names; the position of a vehicle is its key.
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
    """When each robot fails in each trial, whatever it drives.

    Attributes:
        before_poi: Shape (trials, vehicles). 0: fails before leaving the base; k >= 1: fails on its way to the k-th POI
            that it tries; ``NEVER``: neither.
        lifetime_s: Driving time after which it fails [s], wherever that is; ``inf`` = never, shape (trials, vehicles).
    """

    before_poi: IntArray
    lifetime_s: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanningTerms:
    """What failures make of incentives, in numbers: all that a solver learns of a process.

    The k-th POI of vehicle m's route earns ``share[m] * survival[m]**k`` times its incentive. A process that discounts
    by driving time needs a field of its own here (a rate a second), in ``solver/goal.py`` and in pricing.

    Attributes:
        share: Share of every incentive that a vehicle earns, whatever its route, shape (M,).
        survival: Chance of a vehicle to get to its next POI, shape (M,); ``None`` = certain, and the order of visits
            makes no difference.
    """

    share: FloatArray
    survival: FloatArray | None = None


class Process(Protocol):
    """A failure process. It holds no state; ``sva_bench.mission.failures.PROCESSES`` has one of each.

    Attributes:
        name: How files and options call it.
        how: How a robot fails, as messages say it: "the instance fails ...".
        collapses: Whether what a visit earns on average depends on the vehicle alone, not on its route. Then the
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

    def draw(self, asked: FailureDraw) -> Failures:
        """Draw failures: keyed by (seed, trial, robot, POI number), so that plans, scenarios and processes meet the
        same uniforms, compared with each scenario's probabilities."""

    def route_value(self, route: RouteProfile, reliability: Reliability) -> float:
        """Expected incentive of one route, in closed form.

        Raises:
            ValueError: If it depends on driving times that aren't known.
        """

    def terms(self, reliability: Sequence[Reliability]) -> PlanningTerms:
        """What the vehicles' visits earn on average, for a solver."""

    def can_leave(self, reliability: Reliability) -> bool:
        """Whether a robot leaves the base in any trial."""


def no_failures(trials: int, vehicles: int) -> Failures:
    """Every robot works in every trial; for a process to enter its failures in."""
    return Failures(before_poi=np.full((trials, vehicles), NEVER, dtype=np.int64),
                    lifetime_s=np.full((trials, vehicles), np.inf))


def failure_uniforms(seed: int, vehicle: int, poi: int, trials: int, first: int = 0) -> FloatArray:
    """The uniform of each trial that decides on one vehicle before its ``poi``-th POI, shape (trials,)."""
    return uniforms(seed, Stream.FAILURE, vehicle, poi, first=first, count=trials)


def availabilities(reliability: Sequence[Reliability]) -> FloatArray:
    """Availability of each vehicle, shape (M,)."""
    return np.array([vehicle.availability for vehicle in reliability], dtype=np.float64)
