"""A team in motion in physics: all its robots among the obstacles of one PyBullet world."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import TracebackType

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import Fault
from sva_bench.execution.engines.bullet import BulletTeam
from sva_bench.execution.shared.driver import LegSoFar, Member
from sva_bench.execution.shared.motion import TeamMotion
from sva_bench.execution.shared.state import STANDS
from sva_bench.execution.shared.ticks import FREE_M, GO, IS_STUCK, TOUCH, drive_on, moved, stop_robot
from sva_bench.execution.shared.ways import Ways
from sva_bench.execution.touch import Touch, solid_at
from sva_bench.geometry.obstacles import Obstacles


class TeamBullet(TeamMotion):
    """Robots in one world, which touch obstacles and each other, get stuck and tip over.

    Time in which all stand is passed over, in physics too.
    """

    def __init__(self, obstacles: Obstacles, members: Sequence[Member], *, traced: bool = False) -> None:
        """The robots at rest, at 0 on the mission clock.

        Args:
            obstacles: What they can hit, besides each other.
            members: The robots.
            traced: Whether poses are kept.
        """
        super().__init__(members, traced=traced, checked=True)
        self._obstacles = obstacles
        self._met_s: list[list[float]] = [[] for _ in members]  # driving time of the leg at each touch
        self._before = [0] * len(members)  # touches before the leg
        self._encounters: set[tuple[int, int]] = set()  # pairs that touch, or are hardly apart again
        self._world = BulletTeam(obstacles, [(member.model, member.start, member.disturbance) for member in members])

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Give the world back."""
        self._world.__exit__(kind, error, trace)

    def leg(self, robot: int) -> LegSoFar:
        """A robot's present leg, with what it touched on it."""
        first = self._before[robot]
        touches = zip(self._world.touches(robot)[first:], self._met_s[robot][first:], strict=True)
        return replace(super().leg(robot), touches=tuple(
            self._seen(touch, driven_s) for touch, driven_s in touches))

    def fault(self, robot: int) -> Fault | None:
        """Why a robot drives no more though nothing holds it."""
        return self._world.faults().get(robot)

    def _seen(self, touch: Touch, driven_s: float) -> Touch:
        solid = "" if touch.robot is not None else solid_at(self._obstacles, touch.x_m, touch.y_m)
        return replace(touch, since_s=driven_s, solid=solid)

    def _clear_leg(self, robot: int, ready_s: float) -> None:
        super()._clear_leg(robot, ready_s)
        self._before[robot] = len(self._met_s[robot])

    def _until_something(self, ways: Ways) -> int:
        robots, teams, notes, world = self._robots, self._teams, self._notes, self._world
        left, right, poses = robots["left"], robots["right"], np.zeros((len(robots), 3))
        while True:
            code: int = drive_on(robots, teams, ways, notes, self._parts, False)
            if code != GO:
                return code
            met = world.step(list(zip(left.tolist(), right.tolist(), strict=True)), poses)
            moved(robots, teams, notes, poses)
            self._note_touches()
            for robot in world.faults():
                if robots["doing"][robot] != STANDS:
                    stop_robot(robots, robot, IS_STUCK)
            if self._encountered(met, poses):
                return TOUCH

    def _encountered(self, met: Sequence[tuple[int, int]], poses: FloatArray) -> bool:
        """Note pairs that came to touch, once for an encounter however often they lose touch; whether there are any."""
        near = self._notes.near
        came = False
        for robot, other in self._encounters:
            hulls = self._members[robot].model.radius_m + self._members[other].model.radius_m
            if math.dist(poses[robot, :2], poses[other, :2]) > hulls + FREE_M:
                near[robot, other] = False
        for pair in met:
            came = came or not near[pair]
            self._notes.touched[pair] = self._notes.touched[pair] or not near[pair]
            near[pair] = True
            self._encounters.add(pair)
        self._encounters = {pair for pair in self._encounters if near[pair]}
        return came

    def _note_touches(self) -> None:
        """Note the driving time of touches that are new."""
        for robot, met_s in enumerate(self._met_s):
            while len(met_s) < len(self._world.touches(robot)):
                met_s.append(self._driven_s(robot))
