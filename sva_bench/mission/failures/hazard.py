"""The process ``hazard``: an exponential lifetime in driven seconds, which may end on any leg, also on the way home."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.choices import FailureProcess
from sva_bench.mission.failures.process import (
    FailureDraw,
    Failures,
    PlanningTerms,
    Reliability,
    RouteProfile,
    failure_uniforms,
    loss_costs,
    no_failures,
)


@dataclass(frozen=True, kw_only=True)
class HazardFailure:
    """Failures at a constant rate while driving; robots fail independently."""

    name: FailureProcess = "hazard"
    how: str = "after exponential lifetimes"
    collapses: bool = False
    joint: bool = False

    def draw(self, request: FailureDraw) -> Failures:
        """Lifetimes ``-MTBF ln U`` by one uniform per robot and trial, the one that decides ``mission`` failures."""
        fails = no_failures(request.trials, len(request.vehicles))
        for column, vehicle in enumerate(request.reliability):
            mtbf = mtbf_s(vehicle)
            if mtbf == math.inf:
                continue
            u = failure_uniforms(request.seed, column, 1, request.trials, request.first)
            fails.lifetime_s[:, column] = mtbf * -np.log1p(-u)  # 1 - u is in (0, 1]: a lifetime is finite
        return fails

    def route_value(self, route: RouteProfile, reliability: Reliability) -> float:
        """``sum_k exp(-T_k / MTBF) e_k - c (1 - exp(-T_home / MTBF))``.

        Raises:
            ValueError: If driving times aren't known.
        """
        if route.arrival_s is None or route.home_s is None:
            raise ValueError("the value of a route under hazard depends on its driving times")
        mtbf = mtbf_s(reliability)
        earned = float(sum(survival(t, mtbf) * e for t, e in zip(route.arrival_s, route.incentives, strict=True)))
        if not reliability.loss_cost or route.home_s == 0:
            return earned
        return earned - reliability.loss_cost * (1 - survival(route.home_s, mtbf))

    def terms(self, reliability: Sequence[Reliability]) -> PlanningTerms:
        """All of an incentive is earned if the vehicle gets there, which fails at a constant rate."""
        mean = [mtbf_s(vehicle) for vehicle in reliability]
        return PlanningTerms(share=np.ones(len(mean)), loss_cost=loss_costs(reliability),
                             rate=np.array([1 / mtbf if mtbf > 0 else math.inf for mtbf in mean]))

    def can_leave(self, reliability: Reliability) -> bool:  # noqa: ARG002
        """Always ``True``: it fails while driving."""
        return True


def mtbf_s(reliability: Reliability) -> float:
    """Mean driving time to failure [s]: 0 = fails at once, ``inf`` = never.

    Raises:
        ValueError: If it is not given, and availability and mission limit don't say it.
    """
    if reliability.mtbf_s is not None:
        return reliability.mtbf_s
    if reliability.availability in (0.0, 1.0):
        return math.inf if reliability.availability else 0.0
    if math.isinf(reliability.mission_limit_s):
        raise ValueError(f"an availability of {reliability.availability:g} is the probability to survive driving for "
                         "the whole mission limit, and there is none; set mission_limit_s or mtbf_s")
    return -reliability.mission_limit_s / math.log(reliability.availability)


def availability_by(mtbf: float | None, mission_limit_s: float) -> float:
    """Availability of a robot for which none is given: the probability to survive driving for its mission limit.

    1 without a limit, or if nothing is known of failures.
    """
    return 1.0 if mtbf is None or math.isinf(mission_limit_s) else survival(mission_limit_s, mtbf)


def survival(driven_s: float, mtbf: float) -> float:
    """Probability to survive a driving time."""
    return math.exp(-driven_s / mtbf) if mtbf > 0 else float(driven_s <= 0)
