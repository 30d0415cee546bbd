"""The process ``per_leg``: a draw before each next POI; what was collected before stays collected."""

from __future__ import annotations

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
    availabilities,
    failure_uniforms,
    loss_costs,
    no_failures,
)


@dataclass(frozen=True, kw_only=True)
class PerLegFailure:
    """Failures along the route, as in the paper's simulations; robots fail independently, by their marginals."""

    name: FailureProcess = "per_leg"
    how: str = "per leg"
    collapses: bool = False
    joint: bool = True

    def draw(self, request: FailureDraw) -> Failures:
        """Failures by one uniform per robot, trial and POI number; the first that reaches ``s`` is the failure."""
        fails = no_failures(request.trials, len(request.vehicles))
        for column, s in enumerate(availabilities(request.reliability)):
            for k in range(request.pois, 0, -1):  # downwards, so that the first failure overwrites later ones
                u = failure_uniforms(request.seed, column, k, request.trials, request.first)
                fails.before_poi[u >= s, column] = k
        return fails

    def route_value(self, route: RouteProfile, reliability: Reliability) -> float:
        """``sum_k s^k e_k - c (1 - s^n)``; stations and the way home are without risk.

        Source:
            Section 5.2 of the paper, without a cost of losses.
        """
        s, n = reliability.availability, len(route.incentives)
        earned = float(sum(s**k * e for k, e in enumerate(route.incentives, start=1)))
        return earned - reliability.loss_cost * (1 - s**n) if reliability.loss_cost else earned

    def terms(self, reliability: Sequence[Reliability]) -> PlanningTerms:
        """All of an incentive is earned if the vehicle gets there, with probability ``s`` from each POI to the next."""
        return PlanningTerms(share=np.ones(len(reliability)), survival=availabilities(reliability),
                             loss_cost=loss_costs(reliability))

    def can_leave(self, reliability: Reliability) -> bool:  # noqa: ARG002
        """Always ``True``: it fails on the way to a POI."""
        return True
