"""No reaction: every robot keeps its plan."""

from __future__ import annotations

from sva_bench.execution.policies.policy import Orders, TeamState


def none(state: TeamState) -> Orders:
    """What was left anyway."""
    return {robot.robot: robot.remaining for robot in state.robots if robot.reached}
