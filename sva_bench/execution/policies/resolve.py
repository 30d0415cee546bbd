"""The rest of the mission planned again, exactly, whenever a failure is heard of."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from sva_bench.execution.policies.policy import Orders, RobotState, TeamState
from sva_bench.mission.failures import process_of
from sva_bench.mission.instance import Instance
from sva_bench.mission.rest import Afield, Rest

PlansRest = Callable[[Rest], Mapping[str, tuple[str, ...] | None]]
"""Plans the rest of a mission: each vehicle's sites from where it is, the base last; ``None``: no safe way on."""


class Resolve:
    """Orders that maximise the expected value of what is left, under the failure process executed.

    Robots that can't be told keep their orders and their POIs. Answers are kept by state.

    Args:
        instance: The whole mission, under the failure process executed.
        plans_rest: What plans the rest.
    """

    def __init__(self, instance: Instance, plans_rest: PlansRest) -> None:
        self._instance, self._plans_rest = instance, plans_rest
        self._kept: dict[tuple[object, ...], Orders] = {}

    def __call__(self, state: TeamState) -> Orders:
        """The orders of robots that are reached and have a safe way on."""
        key = (state.robots, state.open_pois)
        if key not in self._kept:
            self._kept[key] = self._resolved(state)
        return self._kept[key]

    def _resolved(self, state: TeamState) -> Orders:
        reached = [robot for robot in state.robots if robot.reached]
        claimed = {site for robot in state.robots if not robot.reached and robot.standing != "dead"
                   for site in robot.remaining}
        found = self._plans_rest(Rest(
            instance=self._instance, open_pois=state.open_pois - claimed,
            vehicles=tuple(Afield(name=robot.robot, site=robot.site, ready_s=robot.ready_s, burnt_s=robot.burnt_s,
                                  availability=self._availability(robot, state), orders=robot.remaining)
                           for robot in reached)))
        return {name: orders for name, orders in found.items() if orders is not None}

    def _availability(self, robot: RobotState, state: TeamState) -> float:
        """Probability that a robot is alive, of whole missions given what is known of the others; else unchanged."""
        if not process_of(self._instance.failure).collapses:
            return self._instance.vehicle(robot.robot).availability
        if robot.standing == "alive":
            return 1.0
        if self._instance.joint is None:
            return self._instance.vehicle(robot.robot).availability
        dead = {other.robot for other in state.robots if other.standing == "dead"}
        alive = {other.robot for other in state.robots if other.standing in ("alive", "home")}
        possible = [s for s in self._instance.joint if alive <= s.available and not dead & s.available]
        total = sum(s.probability for s in possible)
        able = sum(s.probability for s in possible if robot.robot in s.available)
        return able / total if total > 0 else 1.0
