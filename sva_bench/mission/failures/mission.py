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
    """Failures of the two-stage model; robots may fail together."""

    name: FailureProcess = "mission"
    how: str = "for whole missions"
    collapses: bool = True
    joint: bool = True

    def draw(self, asked: FailureDraw) -> Failures:
        """The first uniform of a robot decides; one for all of them under a joint distribution."""
        fails = no_failures(asked.trials, len(asked.vehicles))
        if asked.joint is not None:
            edges = np.cumsum([state.probability for state in asked.joint])
            u = uniforms(asked.seed, Stream.JOINT_FAILURE, first=asked.first, count=asked.trials)
            state = np.minimum(np.searchsorted(edges, u, side="right"), len(asked.joint) - 1)
            for column, name in enumerate(asked.vehicles):
                available = np.array([name in s.available for s in asked.joint])
                fails.before_poi[~available[state], column] = 0
            return fails
        for column, p in enumerate(availabilities(asked.reliability)):
            fails.before_poi[failure_uniforms(asked.seed, column, 1, asked.trials, asked.first) >= p, column] = 0
        return fails

    def route_value(self, route: RouteProfile, reliability: Reliability) -> float:
        """``p sum_k e_k``.

        Source:
            The collapsed model, ``docs/model.md``.
        """
        return reliability.availability * float(sum(route.incentives))

    def terms(self, reliability: Sequence[Reliability]) -> PlanningTerms:
        """A vehicle earns the share ``p`` of every incentive."""
        return PlanningTerms(share=availabilities(reliability))

    def can_leave(self, reliability: Reliability) -> bool:
        """Unless it always fails."""
        return reliability.availability > 0
