"""What a route comes to under each noise draw if nobody fails by draw, and what it is worth on average if they do.

The same rules as of ``rules``, for all draws at once: tests hold the two together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.execution.margins import Margins
from sva_bench.mission.failures import PlanningTerms
from sva_bench.mission.instance import TOLERANCE_S


class RouteJudged(NamedTuple):
    """One robot's route, draw by draw.

    Attributes:
        bad: Whether the robot runs out of fuel, is late or gets stuck where it doesn't fail, shape (draws,).
        value: Mean value over failures, shape (draws,).
    """

    bad: BoolArray
    value: FloatArray


def judge_route(route: Margins, terms: PlanningTerms) -> RouteJudged:
    """A robot's route under each noise draw.

    Args:
        route: What is left of fuel and time at each stop, draw by draw.
        terms: The expected rewards under the failure process, which a leg's time under noise takes part in.
    """
    # A comparison with NaN is false: from a leg on that it got stuck on, no stop is reached.
    reached = np.logical_and.accumulate(route.fuel_s >= -TOLERANCE_S, axis=1)
    on_time = np.logical_and.accumulate(route.time_s >= -TOLERANCE_S, axis=1)
    home = reached[:, -1]
    survives = _survival(route, terms)
    earned = np.where(reached & on_time & route.is_poi, survives * route.worth, 0.0).sum(axis=1)
    kept = np.where(home, survives[:, -1], 0.0)
    value: FloatArray = earned - route.loss_cost * (float(terms.share[route.robot]) - kept)
    return RouteJudged(bad=~(home & on_time[:, -1]), value=value)


def _survival(route: Margins, terms: PlanningTerms) -> FloatArray:
    """Probability that the robot gets to each stop as far as failures go, shape (draws, stops)."""
    robot = route.robot
    tried = np.cumsum(route.is_poi)
    alive = float(terms.share[robot]) * (1.0 if terms.survival is None else terms.survival[robot] ** tried)
    rate = terms.rate_of(robot)
    if rate == 0:
        return np.broadcast_to(alive, route.leg_s.shape)
    driven = np.cumsum(np.nan_to_num(route.leg_s), axis=1)
    survives: FloatArray = alive * (np.zeros_like(driven) if np.isinf(rate) else np.exp(-rate * driven))
    return survives
