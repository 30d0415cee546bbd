"""A team in motion: what its drivers have in common, around the compiled control step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Self

import numpy as np

from sva_bench.arrays import IntArray
from sva_bench.choices import HappeningKind
from sva_bench.execution.engines.engine import Pose
from sva_bench.execution.shared.driver import Happening, Hold, LegSoFar, LegWait, Member
from sva_bench.execution.shared.lanes import Lane
from sva_bench.execution.shared.state import (
    BRAKED,
    BRAKING,
    HOPS_S,
    NOW,
    READY,
    READY_S,
    TRACED,
    at_rest,
    figures_of,
    longer,
)
from sva_bench.execution.shared.ticks import (
    DEADLOCK,
    FULL,
    HAS_ARRIVED,
    HAS_ENDED,
    IS_STUCK,
    NOBODY,
    REST,
    begin_stretch,
    stop,
)
from sva_bench.execution.shared.ways import Ways, ways_of
from sva_bench.execution.touch import Touch
from sva_bench.robot.follower import CONTROL_HZ

_DT = 1.0 / CONTROL_HZ
_OF_A_ROBOT: Mapping[int, HappeningKind] = {HAS_ARRIVED: "arrived", HAS_ENDED: "ended", IS_STUCK: "stuck"}
_OF_ALL: Mapping[int, HappeningKind] = {REST: "rest", NOBODY: "idle", DEADLOCK: "deadlock"}


class TeamMotion:
    """A team in motion, as of ``TeamDriver``, but for what moves it."""

    def __init__(self, members: Sequence[Member], *, traced: bool = False, checked: bool = False) -> None:
        """The robots at rest, at 0 on the mission clock.

        Args:
            members: The robots.
            traced: Whether poses are kept.
            checked: Whether robots that hardly move are looked for, as in physics.
        """
        count = len(members)
        self._members = tuple(members)
        self._figures = figures_of(members)
        self._state = at_rest(members, traced=traced, checked=checked)
        self._parts = np.empty((3, self._figures.waves.shape[2]))
        self._lanes: list[Lane | None] = [None] * count
        self._needs: list[Sequence[IntArray] | None] = [None] * count
        self._holds: list[tuple[Hold, ...]] = [()] * count
        self._ended_s = [math.inf] * count
        self._touches: list[list[Touch]] = [[] for _ in members]  # on their legs; of what moves them
        self._known_ways: Ways | None = None

    @property
    def clock_s(self) -> float:
        """The mission clock [s], a multiple of the control step."""
        return float(self._state.team[NOW] * _DT)

    def assign(self, robot: int, lane: Lane | None, needs: Sequence[IntArray] | None) -> None:
        """Give a robot that stands at rest another lane; what it was driving is over."""
        self._lanes[robot], self._needs[robot], self._known_ways = lane, needs, None
        state = self._state
        self._stand(robot)
        state.leg[robot], state.cell[robot], state.open_to[robot], state.dropped[robot] = -1, 0, 0, False
        self._clear_leg(robot, self.clock_s)

    def start_leg(self, robot: int, ready_s: float, driving_s: float, holds: Sequence[Hold] = (), *,
                  fuel_s: float = math.inf, idle_share: float = 0.0) -> None:
        """Let a robot drive the next leg of its lane.

        Raises:
            ValueError: If its lane has no leg left, or it drives one yet.
        """
        state, lane = self._state, self._lanes[robot]
        number = int(state.leg[robot]) + 1
        if lane is None or number >= len(lane.cuts) or state.doing[robot]:
            raise ValueError(f"robot {robot} has no leg left to start, or drives one yet")
        self._clear_leg(robot, ready_s)
        state.leg[robot], state.doing[robot] = number, READY
        state.clock_s[robot] = ready_s, 0.0, driving_s, fuel_s, idle_share
        self._holds[robot], self._ended_s[robot] = tuple(holds), math.inf
        if len(holds) > state.holds.shape[1]:
            self._state = state = state._replace(holds=longer(state.holds, len(holds)))
        state.hold_count[robot] = len(holds)
        for k, hold in enumerate(holds):
            state.holds[robot, k] = hold.along_m, max(round(hold.lasts_s * CONTROL_HZ), 0)
        begin_stretch(state, robot, self._ways.leg_stretch[robot, number])

    def drop(self, robot: int) -> None:
        """A robot failed: it stands where it is, and nobody waits for it any more."""
        self._stand(robot)
        self._state.dropped[robot] = True

    def brake(self, on: bool) -> None:
        """Let all robots brake, or let them go on."""
        self._state.team[BRAKING] = on

    def run(self) -> Happening:
        """Drive until something happens."""
        while (happened := self._told()) is None:
            code = self._until_something(self._ways)
            if code == FULL:
                state = self._state
                self._state = state._replace(waits=longer(state.waits, 0), poses=longer(
                    state.poses, 0) if state.team[TRACED] else state.poses)
            elif code in _OF_ALL:
                return Happening(kind=_OF_ALL[code], clock_s=self.clock_s)
        return happened

    def leg(self, robot: int) -> LegSoFar:
        """A robot's present leg."""
        state = self._state
        kept = state.poses[robot, :state.pose_count[robot]]
        if state.team[TRACED] and (not len(kept) or kept[-1, 0] != state.elapsed[robot]):
            kept = np.concatenate([kept, [[state.elapsed[robot], *state.pose[robot]]]])
        driving_s = min(float(state.clock_s[robot, HOPS_S] + state.steps[robot] * _DT), self._ended_s[robot])
        return LegSoFar(
            driving_s=driving_s, clock_s=float(state.clock_s[robot, READY_S] + driving_s + state.waited[robot] * _DT),
            waits=tuple(self._wait(robot, entry) for entry in state.waits[robot, :state.wait_count[robot]].tolist()),
            since_s=kept[:, 0] * _DT, pose=kept[:, 1:].copy(), touches=tuple(self._touches[robot]))

    def pose(self, robot: int) -> Pose:
        """Where a robot is."""
        x, y, yaw = self._state.pose[robot].tolist()
        return x, y, yaw

    def arc_m(self, robot: int) -> float:
        """How far a robot is on its leg [m]."""
        state = self._state
        if state.leg[robot] < 0:
            return 0.0
        return float(self._ways.before_m[state.stretch[robot]] + state.follow[robot, 1])

    def cell(self, robot: int) -> int:
        """The cell of its lane that a robot is in."""
        return int(self._state.cell[robot])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Nothing to close."""

    def _until_something(self, ways: Ways) -> int:
        """Drive until something happens; why compiled code came back, as of ``ticks``."""
        raise NotImplementedError

    @property
    def _ways(self) -> Ways:
        if self._known_ways is None:
            self._known_ways = ways_of([member.model for member in self._members], self._lanes, self._needs)
        return self._known_ways

    def _stand(self, robot: int) -> None:
        stop(self._state, robot, 0)
        self._state.commanded[robot] = False

    def _clear_leg(self, robot: int, ready_s: float) -> None:
        state = self._state
        for counter in (state.elapsed, state.waited, state.wait_count, state.pose_count, state.steps, state.hold,
                        state.hold_count):
            counter[robot] = 0
        self._touches[robot] = []
        state.hold_left[robot], state.commanded[robot] = -1, False
        state.clock_s[robot] = ready_s, 0.0, math.inf, math.inf, 0.0

    def _told(self) -> Happening | None:
        """What happened and was not told yet: robots before pairs, by their numbers."""
        state = self._state
        for robot in np.flatnonzero(state.event).tolist():
            kind = _OF_A_ROBOT[int(state.event[robot])]
            state.event[robot] = 0
            if kind == "ended":
                _, _, driving_s, fuel_s, idle = state.clock_s[robot].tolist()
                self._ended_s[robot] = min(driving_s, max(fuel_s - idle * float(state.waited[robot]) * _DT, 0.0))
            return Happening(kind=kind, clock_s=self.leg(robot).clock_s, robot=robot)
        for robot, other in np.argwhere(state.touched).tolist():
            state.touched[robot, other] = False
            return Happening(kind="touch", clock_s=self.clock_s, robot=robot, other=other)
        return None

    def _wait(self, robot: int, entry: Sequence[float]) -> LegWait:
        cause, since_s, steps, x_m, y_m, _ = entry
        number = int(cause)
        return LegWait(since_s=since_s, lasts_s=steps * _DT, x_m=x_m, y_m=y_m, robot=number if number >= 0 else None,
                       hold=self._holds[robot][-2 - number].cause if number < BRAKED else "")
