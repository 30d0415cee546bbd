"""Failure processes: how they are drawn, and what a route is worth under them in closed form.

A new process is a file here with a class as ``process.Process`` says, its name in ``choices.FailureProcess`` and a line
in ``PROCESSES``. Nothing else in the package compares names of processes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from sva_bench.arrays import IntArray
from sva_bench.choices import FailureProcess
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
    "draw_failures",
    "failure_uniforms",
    "marginals",
    "process_of",
    "route_value",
    "without_joint",
]

_ALL: tuple[Process, ...] = (
    MissionFailure(),
    PerLegFailure(),
)
PROCESSES: Mapping[FailureProcess, Process] = {process.name: process for process in _ALL}
"""The processes by name, in the order in which results list them."""

MODEL: FailureProcess = MissionFailure().name
"""The process of the two-stage model: ties, wait-and-see and the value of perfect information are those under it."""


def process_of(name: FailureProcess) -> Process:
    """The process of that name."""
    return PROCESSES[name]


def without_joint(names: Iterable[FailureProcess]) -> FailureProcess | None:
    """The first of some processes under which availabilities can't have a joint distribution."""
    return next((name for name in names if not process_of(name).joint), None)


def route_value(incentives: Sequence[float], availability: float, process: FailureProcess) -> float:
    """Expected incentive of one route, for processes that take no account of driving times.

    Args:
        incentives: Incentive of each POI in the order of the route.
        availability: Probability ``p`` (mission) or survival probability ``s`` before each POI (per leg).
        process: The failure process.

    Raises:
        ValueError: If driving times matter under it.
    """
    return process_of(process).route_value(
        RouteProfile(incentives=tuple(incentives)), Reliability(availability=availability))


def draw_failures(
    seed: int, vehicles: Sequence[str], availability: Mapping[str, float], process: FailureProcess, *,
    trials: int, pois: int, first: int = 0, joint: Sequence[JointState] | None = None,
) -> IntArray:
    """Number of the POI before which each robot fails in each trial (``Failures.before_poi``), for vehicles of which
    nothing but the availability is known; arguments as in ``FailureDraw``."""
    return process_of(process).draw(FailureDraw(
        seed=seed, vehicles=tuple(vehicles), trials=trials, first=first, pois=pois,
        reliability=tuple(Reliability(availability=availability[name]) for name in vehicles),
        joint=None if joint is None else tuple(joint))).before_poi
