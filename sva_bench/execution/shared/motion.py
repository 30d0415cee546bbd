"""A team in motion: what its drivers have in common, around the compiled control step."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Self

import numpy as np

from sva_bench.arrays import IntArray
from sva_bench.choices import Fault, HappeningKind
from sva_bench.execution.engines.engine import Pose
from sva_bench.execution.shared.driver import Happening, Hold, LegSoFar, LegWait, Member
from sva_bench.execution.shared.lanes import Lane
from sva_bench.execution.shared.state import (
    BRAKED,
    NO_END,
    READY,
    STANDS,
    longer,
    nothing_noted,
    robots_at_rest,
    team_of,
)
from sva_bench.execution.shared.switching import Standing
from sva_bench.execution.shared.ticks import (
    ASKS,
    DEADLOCK,
    FULL,
    HAS_ARRIVED,
    HAS_ENDED,
    IS_STUCK,
    NOBODY,
    REST,
    TIME,
    begin_leg,
    stop_robot,
)
from sva_bench.execution.shared.ways import Places, Ways, ways_of
from sva_bench.robot.disturbance import FEATURES
from sva_bench.robot.follower import BEFORE_LINE_M, CONTROL_HZ

_DT = 1.0 / CONTROL_HZ
_BRAKING = 0.7  # share of its acceleration that a robot is sure to brake with: 0.85 at a line, less noise of gains
_SPARE_M = 0.1  # beyond its braking distance: slip
_OF_A_ROBOT: Mapping[int, HappeningKind] = {HAS_ARRIVED: "arrived", HAS_ENDED: "ended", IS_STUCK: "stuck",
                                              ASKS: "waits"}
_OF_ALL: Mapping[int, HappeningKind] = {REST: "rest", TIME: "time", NOBODY: "idle", DEADLOCK: "deadlock"}
_SAME = 1e-6  # of a control step: rounding of clocks


class TeamMotion(ABC):
    """A team in motion, as of ``TeamDriver``, but for what moves it."""

    def __init__(self, members: Sequence[Member], *, traced: bool = False, checked: bool = False) -> None:
        """The robots at rest, at 0 on the mission clock.

        Args:
            members: The robots.
            traced: Whether poses are kept.
            checked: Whether robots that hardly move are looked for, as in physics.
        """
        count = len(members)
        self._members, self._traced = tuple(members), traced
        self._robots, self._teams = robots_at_rest(members), team_of(traced=traced, checked=checked)
        self._notes = nothing_noted(count, traced=traced)
        self._parts = np.empty((3, FEATURES))
        self._lanes: list[Lane | None] = [None] * count
        self._needs: list[Sequence[IntArray] | None] = [None] * count
        self._holds: list[tuple[Hold, ...]] = [()] * count
        self._known: tuple[Ways, Places] | None = None

    @property
    def clock_s(self) -> float:
        """The mission clock [s], a multiple of the control step."""
        return float(self._teams["now"][0]) * _DT

    def assign(self, robot: int, lane: Lane | None, needs: Sequence[IntArray] | None) -> None:
        """Give a robot that stands at rest another lane; what it was driving is over."""
        self._lanes[robot], self._needs[robot], self._known = lane, needs, None
        stop_robot(self._robots, robot, 0)
        record = self._robots[robot]
        record["leg"], record["cell"], record["open_to"], record["dropped"] = -1, 0, 0, False
        self._clear_leg(robot, self.clock_s)

    def start_leg(self, robot: int, ready_s: float, driving_s: float, holds: Sequence[Hold] = (), *,
                  fuel_s: float = math.inf, idle_share: float = 0.0) -> None:
        """Let a robot drive the next leg of its lane.

        Raises:
            ValueError: If its lane has no leg left, or it drives one yet.
        """
        record, lane = self._robots[robot], self._lanes[robot]
        number = int(record["leg"]) + 1
        if lane is None or number >= len(lane.cuts) or record["doing"]:
            raise ValueError(f"robot {robot} has no leg left to start, or drives one yet")
        self._clear_leg(robot, ready_s)
        record["leg"], record["doing"], record["hold_count"] = number, READY, len(holds)
        record["first_cell"], record["end_cell"] = lane.first_cell[number:number + 2]
        record["driving_s"], record["fuel_s"], record["idle"] = driving_s, fuel_s, idle_share
        self._holds[robot] = tuple(holds)
        if len(holds) > self._notes.holds.shape[1]:
            self._notes = self._notes._replace(holds=longer(self._notes.holds, len(holds)))
        for k, hold in enumerate(holds):
            self._notes.holds[robot, k] = hold.along_m, round(hold.lasts_s * CONTROL_HZ)
        begin_leg(self._robots, robot, self._placed[1].first_stretch[robot][number])

    def regate(self, robot: int, needs: Sequence[IntArray]) -> None:
        """Give a robot in motion other gates on its lane."""
        self._needs[robot] = needs
        (ways, places), record = self._placed, self._robots[robot]
        first = places.need_row[robot]
        ways.need[first:first + places.cells[robot]] = np.column_stack(needs)
        record["open_to"] = min(int(record["open_to"]), int(record["cell"]))

    def ask(self, every_s: float) -> None:
        """Let robots that wait for others ask after each so much of waiting [s]; 0 = never."""
        self._teams["asks"] = round(every_s * CONTROL_HZ)

    def drop(self, robot: int) -> None:
        """A robot failed: it stands where it is, and nobody waits for it any more."""
        stop_robot(self._robots, robot, 0)
        self._robots[robot]["dropped"] = True

    def brake(self, on: bool) -> None:
        """Let all robots brake, or let them go on."""
        self._teams["braking"] = on

    def run(self, until_s: float = math.inf) -> Happening:
        """Drive until something happens, or until the first control step at or after ``until_s``."""
        self._teams["until"] = NO_END if math.isinf(until_s) else math.ceil(until_s * CONTROL_HZ - _SAME)
        while (happened := self._told()) is None:
            code = self._until_something(self._placed[0])
            if code == FULL:
                notes = self._notes
                self._notes = notes._replace(waits=longer(notes.waits, 0), poses=longer(
                    notes.poses, 0) if self._traced else notes.poses)
            elif code in _OF_ALL:
                return Happening(kind=_OF_ALL[code], clock_s=self.clock_s)
        return happened

    def leg(self, robot: int) -> LegSoFar:
        """A robot's present leg."""
        record, notes = self._robots[robot], self._notes
        waited_s = float(record["waited"]) * _DT
        # Its last control step may go beyond what it had.
        driving_s = min(self._driven_s(robot), float(record["driving_s"]),
                        max(float(record["fuel_s"] - record["idle"] * waited_s), 0.0))
        kept, elapsed = notes.poses[robot, :record["pose_count"]], float(record["elapsed"])
        if self._traced and (not len(kept) or kept[-1, 0] != elapsed):
            kept = np.concatenate([kept, [[elapsed, *record["pose"]]]])
        return LegSoFar(
            driving_s=driving_s, clock_s=float(record["ready_s"]) + driving_s + waited_s,
            waits=tuple(self._wait(robot, entry) for entry in notes.waits[robot, :record["wait_count"]].tolist()),
            since_s=kept[:, 0] * _DT, pose=kept[:, 1:].copy(), at=self.pose(robot), holds_over=int(record["hold"]),
            hold_left_s=float(record["hold_left"]) * _DT if record["hold_left"] >= 0 else None)

    def pose(self, robot: int) -> Pose:
        """Where a robot is."""
        x, y, yaw = self._robots[robot]["pose"].tolist()
        return x, y, yaw

    def arc_m(self, robot: int) -> float:
        """How far a robot is on its leg [m]."""
        record = self._robots[robot]
        if record["leg"] < 0:
            return 0.0
        return float(self._placed[0].stretches["before_m"][record["stretch"]] + record["follow"][1])

    def cell(self, robot: int) -> int:
        """The cell of its lane that a robot is in."""
        return int(self._robots[robot]["cell"])

    def standing(self, robot: int) -> Standing:
        """Where a robot is on its lane."""
        record, now_s = self._robots[robot], self.clock_s
        if record["doing"] in (STANDS, READY):
            ready_s = float(record["ready_s"]) if record["doing"] == READY else now_s
            return Standing(cell=int(record["cell"]), free_s=max(ready_s, now_s), drives=False, stops_m=0.0)
        acceleration, delay = float(record["limits"][2]), int(record["delay"])
        under_way = [float(record["follow"][2]), *record["queue"][:delay, 0].tolist()]
        # A control step at its fastest, and what its stop line is kept off by.
        speed = max(under_way) + acceleration * _DT
        stops_m = speed ** 2 / (2 * _BRAKING * acceleration) + speed * (delay + 1) * _DT + BEFORE_LINE_M
        return Standing(cell=int(record["cell"]), free_s=now_s + max(int(record["hold_left"]), 0) * _DT, drives=True,
                        stops_m=stops_m + (_SPARE_M if max(under_way) > 0 else 0.0))

    def fault(self, robot: int) -> Fault | None:  # noqa: ARG002 - twins have none
        """Why a robot drives no more though nothing holds it."""
        return None

    def __enter__(self) -> Self:
        return self

    def __exit__(  # noqa: B027 - there is nothing to close
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing to close."""

    @abstractmethod
    def _until_something(self, ways: Ways) -> int:
        """Drive until something happens; why compiled code came back, as of ``ticks``."""

    @property
    def _placed(self) -> tuple[Ways, Places]:
        """The lanes as arrays; the records know where theirs are."""
        if self._known is None:
            models = [member.model for member in self._members]
            self._known = _, places = ways_of(models, self._lanes, self._needs)
            self._robots["cells"], self._robots["need_row"] = places.cells, places.need_row
            for record, first in zip(self._robots, places.first_stretch, strict=True):
                record["stretch"] += first[0] - record["lane_stretch"]
                record["lane_stretch"] = first[0]
        return self._known

    def _driven_s(self, robot: int) -> float:
        record = self._robots[robot]
        return float(record["hops_s"] + record["steps"] * _DT)

    def _clear_leg(self, robot: int, ready_s: float) -> None:
        """Nothing of a leg yet."""
        record = self._robots[robot]
        for name in ("elapsed", "waited", "wait_count", "pose_count", "steps", "hold", "hold_count"):
            record[name] = 0
        record["hold_left"], record["commanded"] = -1, False
        record["ready_s"], record["hops_s"], record["idle"] = ready_s, 0.0, 0.0
        record["driving_s"] = record["fuel_s"] = math.inf

    def _told(self) -> Happening | None:
        """What happened and was not told yet: robots before pairs, by their numbers."""
        events, touched = self._robots["event"], self._notes.touched
        for robot in np.flatnonzero(events).tolist():
            kind = _OF_A_ROBOT[int(events[robot])]
            events[robot] = 0
            clock_s = self.clock_s if kind == "waits" else self.leg(robot).clock_s
            return Happening(kind=kind, clock_s=clock_s, robot=robot)
        for robot, other in np.argwhere(touched).tolist():
            touched[robot, other] = False
            return Happening(kind="touch", clock_s=self.clock_s, robot=robot, other=other)
        return None

    def _wait(self, robot: int, entry: Sequence[float]) -> LegWait:
        cause, since_s, steps, x_m, y_m, _ = entry
        number = int(cause)
        return LegWait(since_s=since_s, lasts_s=steps * _DT, x_m=x_m, y_m=y_m, robot=number if number >= 0 else None,
                       hold=self._holds[robot][-2 - number].cause if number < BRAKED else "")
