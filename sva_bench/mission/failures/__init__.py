"""Failure processes: how failures are drawn, and the closed-form value of routes under them.

A new process is a file here with a class that implements ``process.Process``, its name in ``choices.FailureProcess``
and a line in ``PROCESSES``. No other code compares names of processes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from sva_bench.arrays import IntArray
from sva_bench.choices import FailureProcess
from sva_bench.mission.failures.hazard import HazardFailure, availability_by, mtbf_s
from sva_bench.mission.failures.joint import JointState, marginals
from sva_bench.mission.failures.mission import MissionFailure
from sva_bench.mission.failures.per_leg import PerLegFailure
from sva_bench.mission.failures.process import (
    NEVER,
    FailureDraw,
    Failures,
    PlanningTerms,
    Process,
    Reliability,
    RouteProfile,
    failure_uniforms,
)

__all__ = [
    "MODEL",
    "NEVER",
    "PROCESSES",
    "FailureDraw",
    "Failures",
    "JointState",
    "PlanningTerms",
    "Process",
    "Reliability",
    "RouteProfile",
    "availability_by",
    "draw_failures",
    "fails_by_driving",
    "failure_uniforms",
    "marginals",
    "mtbf_s",
    "process_of",
    "route_value",
    "undefined_under",
    "without_joint",
]

_ALL: tuple[Process, ...] = (
    MissionFailure(),
    PerLegFailure(),
    HazardFailure(),
)
PROCESSES: Mapping[FailureProcess, Process] = {process.name: process for process in _ALL}
"""The processes by name, in the order in which results list them."""

MODEL: FailureProcess = MissionFailure().name
"""The process of the two-stage model, under which ties, wait-and-see value and EVPI are computed."""


def process_of(name: FailureProcess) -> Process:
    """The process of that name."""
    return PROCESSES[name]


def fails_by_driving(name: FailureProcess, reliability: Reliability) -> bool:
    """Whether how a robot fails under a process depends on how long it drives."""
    rate = process_of(name).terms([reliability]).rate
    return rate is not None and float(rate[0]) > 0


def undefined_under(names: Iterable[FailureProcess], reliability: Reliability) -> str | None:
    """Why the failures of a robot are unknown under one of some processes; ``None`` if they are known."""
    for name in names:
        try:
            process_of(name).terms([reliability])
        except ValueError as error:
            return f"under {name}, {error}"
    return None


def without_joint(names: Iterable[FailureProcess]) -> FailureProcess | None:
    """The first of some processes that doesn't support joint distributions of availabilities; ``None`` if all do."""
    return next((name for name in names if not process_of(name).joint), None)


def route_value(incentives: Sequence[float], availability: float, process: FailureProcess) -> float:
    """Expected incentive of one route, under a process that doesn't depend on driving times.

    Args:
        incentives: Incentive of each POI in the order of the route.
        availability: Probability ``p`` (mission) or survival probability ``s`` before each POI (per leg).
        process: The failure process.

    Raises:
        ValueError: If the process depends on driving times.
    """
    return process_of(process).route_value(
        RouteProfile(incentives=tuple(incentives)), Reliability(availability=availability))


def draw_failures(
    seed: int, vehicles: Sequence[str], availability: Mapping[str, float], process: FailureProcess, *,
    trials: int, pois: int, first: int = 0, joint: Sequence[JointState] | None = None,
) -> IntArray:
    """POI number before which each robot fails in each trial (``Failures.before_poi``), shape (trials, vehicles).

    Only availabilities are given; arguments as in ``FailureDraw``.
    """
    return process_of(process).draw(FailureDraw(
        seed=seed, vehicles=tuple(vehicles), trials=trials, first=first, pois=pois,
        reliability=tuple(Reliability(availability=availability[name]) for name in vehicles),
        joint=None if joint is None else tuple(joint))).before_poi
