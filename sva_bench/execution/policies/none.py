"""No reaction: every robot keeps its plan."""

from __future__ import annotations

from collections.abc import Mapping

from sva_bench.execution.policies.policy import TeamState


def none(state: TeamState) -> Mapping[str, tuple[str, ...]]:
    """What was left anyway."""
    return {robot.robot: robot.remaining for robot in state.robots}
