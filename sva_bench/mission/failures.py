"""Failure processes: how they are drawn, and what a route is worth under them in closed form.

``mission``: one draw per vehicle and mission; a failed vehicle collects nothing.
``per_leg``: a draw before each next POI; what was collected before stays collected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.choices import FailureProcess
from sva_bench.seeds import Stream, uniforms

NEVER = np.iinfo(np.int64).max
"""Number of the POI before which a robot that doesn't fail would fail."""


@dataclass(frozen=True, kw_only=True)
class JointState:
    """One outcome of a joint distribution of availabilities.

    Attributes:
        probability: Its probability.
        available: Names of the vehicles that are available in it.
    """

    probability: float
    available: frozenset[str]


def route_value(incentives: Sequence[float], availability: float, process: FailureProcess) -> float:
    """Expected incentive of one route.

    Args:
        incentives: Incentive of each POI in the order of the route.
        availability: Probability ``p`` (mission) or survival probability ``s`` before each POI (per leg).
        process: The failure process.

    Source:
        ``mission``: the collapsed model, ``p sum e``. ``per_leg``: ``sum_k s^k e_k``, section 5.2 of the paper.
    """
    if process == "mission":
        return availability * float(sum(incentives))
    return float(sum(availability**k * e for k, e in enumerate(incentives, start=1)))


def marginals(joint: Sequence[JointState], vehicles: Sequence[str]) -> dict[str, float]:
    """Availability of each vehicle under a joint distribution."""
    return {name: min(1.0, sum(s.probability for s in joint if name in s.available)) for name in vehicles}


def draw_failures(
    seed: int,
    vehicles: Sequence[str],
    availability: Mapping[str, float],
    process: FailureProcess,
    *,
    trials: int,
    pois: int,
    first: int = 0,
    joint: Sequence[JointState] | None = None,
) -> IntArray:
    """Number of the POI before which each robot fails in each trial.

    Keyed by (seed, trial, robot, POI number), so plans, scenarios and failure processes meet the same draws:
    one uniform each, compared with the scenario's probability. Under ``mission`` the first one decides.

    Args:
        seed: Root seed.
        vehicles: Names; the position of a vehicle is its key.
        availability: Availability of each vehicle.
        process: The failure process.
        trials: Number of trials.
        pois: Greatest number of POIs on a route; per-leg draws are made for as many.
        first: Number of the first trial.
        joint: Joint distribution of the availabilities (``mission`` only); replaces the independent draws.

    Returns:
        Shape (trials, vehicles). 0: fails before leaving the base (``mission``); k >= 1: fails on its way to the
        k-th POI (``per_leg``); ``NEVER``: doesn't fail.
    """
    fails = np.full((trials, len(vehicles)), NEVER, dtype=np.int64)
    if joint is not None and process == "mission":
        edges = np.cumsum([state.probability for state in joint])
        u = uniforms(seed, Stream.JOINT_FAILURE, first=first, count=trials)
        state = np.minimum(np.searchsorted(edges, u, side="right"), len(joint) - 1)
        for column, name in enumerate(vehicles):
            there = np.array([name in s.available for s in joint])
            fails[~there[state], column] = 0
        return fails
    for column, name in enumerate(vehicles):
        p = availability[name]
        if process == "mission":
            fails[failure_uniforms(seed, column, 1, trials, first) >= p, column] = 0
            continue
        for k in range(pois, 0, -1):  # downwards, so that the first failure stands
            fails[failure_uniforms(seed, column, k, trials, first) >= p, column] = k
    return fails


def failure_uniforms(seed: int, vehicle: int, poi: int, trials: int, first: int = 0) -> FloatArray:
    """The uniform of each trial that decides on one vehicle before its ``poi``-th POI, shape (trials,)."""
    return uniforms(seed, Stream.FAILURE, vehicle, poi, first=first, count=trials)
