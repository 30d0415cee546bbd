"""The process ``mission``: one draw per vehicle and mission; a failed vehicle never leaves and collects nothing."""

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
    no_failures,
)
from sva_bench.seeds import Stream, uniforms


@dataclass(frozen=True, kw_only=True)
class MissionFailure:
    """Failures of the two-stage model; availabilities may have a joint distribution."""

    name: FailureProcess = "mission"
    how: str = "for whole missions"
    collapses: bool = True
    joint: bool = True

    def draw(self, request: FailureDraw) -> Failures:
        """Failures by one uniform per robot and trial; under a joint distribution, one per trial for all robots."""
        fails = no_failures(request.trials, len(request.vehicles))
        if request.joint is not None:
            edges = np.cumsum([state.probability for state in request.joint])
            u = uniforms(request.seed, Stream.JOINT_FAILURE, first=request.first, count=request.trials)
            state = np.minimum(np.searchsorted(edges, u, side="right"), len(request.joint) - 1)
            for column, name in enumerate(request.vehicles):
                available = np.array([name in s.available for s in request.joint])
                fails.before_poi[~available[state], column] = 0
            return fails
        for column, p in enumerate(availabilities(request.reliability)):
            fails.before_poi[failure_uniforms(request.seed, column, 1, request.trials, request.first) >= p, column] = 0
        return fails

    def route_value(self, route: RouteProfile, reliability: Reliability) -> float:
        """``p sum_k e_k``.

        Source:
            The collapsed model, ``docs/model.md``.
        """
        return reliability.availability * float(sum(route.incentives))

    def terms(self, reliability: Sequence[Reliability]) -> PlanningTerms:
        """A vehicle earns the share ``p`` of every incentive on average."""
        return PlanningTerms(share=availabilities(reliability))

    def can_leave(self, reliability: Reliability) -> bool:
        """Whether its availability is above 0."""
        return reliability.availability > 0
