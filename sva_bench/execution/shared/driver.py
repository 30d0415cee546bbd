"""What drives a team: its robots in one world, moved together until something happens.

A driver knows no mission and no failure: whoever asks it hands out lanes and legs, and decides what a happening means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.choices import Fault, HappeningKind
from sva_bench.execution.engines.engine import Pose
from sva_bench.execution.shared.lanes import Lane
from sva_bench.execution.shared.switching import Standing
from sva_bench.execution.touch import Touch
from sva_bench.robot.disturbance import UNDISTURBED, Disturbance
from sva_bench.robot.model import RobotModel


@dataclass(frozen=True, kw_only=True)
class Member:
    """A robot of the team.

    Attributes:
        model: Its figures.
        start: Where it stands at rest: x, y [m], yaw [rad]; where it is, not where it believes to be.
        disturbance: How it differs from its model.
    """

    model: RobotModel
    start: Pose
    disturbance: Disturbance = UNDISTURBED


@dataclass(frozen=True, kw_only=True)
class Hold:
    """A wait on the way: for a passage that is shut, for people.

    Attributes:
        along_m: How far along the leg [m].
        lasts_s: How long it stands there [s].
        cause: As of ``outcome.Wait``.
    """

    along_m: float
    lasts_s: float
    cause: str


@dataclass(frozen=True, kw_only=True)
class LegWait:
    """A wait on a leg: the robot was slower than it would have been, or stood.

    Attributes:
        since_s: When it began [s of driving since the leg began].
        lasts_s: How long [s].
        x_m, y_m: Where it began [m].
        robot: For whom; ``None`` = for no robot.
        hold: Cause of the hold; empty if there was none. Without a robot and a hold, the team was braked.
    """

    since_s: float
    lasts_s: float
    x_m: float
    y_m: float
    robot: int | None = None
    hold: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class LegSoFar:
    """A robot's present leg, or its last one until the next is started.

    Attributes:
        driving_s: Time that it drove on it [s].
        clock_s: The mission clock when it had got so far [s]: when it was to begin, driving and waits together.
        waits: Its waits, in order.
        since_s: Time since the leg was to begin, of each pose [s], shape (k,).
        pose: x, y [m], yaw [rad], shape (k, 3); only of drivers that trace.
        at: Where the robot is.
        holds_over: How many of its holds are over.
        hold_left_s: How long the one at which it stands lasts yet [s]; ``None`` = it stands at none.
        touches: What its hull touched on it, in physics.
    """

    driving_s: float
    clock_s: float
    waits: tuple[LegWait, ...]
    since_s: FloatArray
    pose: FloatArray
    at: Pose
    holds_over: int = 0
    hold_left_s: float | None = None
    touches: tuple[Touch, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Happening:
    """What a team was stopped for.

    Attributes:
        kind: ``arrived``: a robot ended its leg; ``ended``: its driving time or its fuel is used up; ``stuck``;
            ``touch``: two robots touch; ``waits``: a robot asks to go first; ``rest``: all stand that were to brake;
            ``time``: it is as late as was asked for; ``idle``: nobody has a leg to drive; ``deadlock``: robots wait for
            each other for good, which is a fault of the order.
        clock_s: When [s].
        robot: Its number; of ``rest``, ``time``, ``idle`` and ``deadlock`` -1.
        other: The other robot of a touch.
    """

    kind: HappeningKind
    clock_s: float
    robot: int = -1
    other: int = -1


class TeamDriver(Protocol):
    """Robots in one world. A context manager; each mission wants a fresh one, which repeats bit for bit."""

    @property
    def clock_s(self) -> float:
        """The mission clock [s], a multiple of the control step."""
        ...

    def assign(self, robot: int, lane: Lane | None, needs: Sequence[IntArray] | None) -> None:
        """Give a robot that stands at rest another lane; what it was driving is over.

        Args:
            robot: Its number.
            lane: The lane; ``None`` = it stays where it is for good.
            needs: For each robot, the cell that it must have reached before each of the lane's cells may be entered;
                ``None`` = no gates.
        """
        ...

    def start_leg(self, robot: int, ready_s: float, driving_s: float, holds: Sequence[Hold], *,
                  fuel_s: float = ..., idle_share: float = ...) -> None:
        """Let a robot drive the next leg of its lane.

        Args:
            robot: Its number.
            ready_s: When it may set off [s on the mission clock].
            driving_s: After so much driving on it it stops for good [s].
            holds: Where it waits on it, in order.
            fuel_s: It stops for good as well when driving and the idle share of waiting come to so much [s].
            idle_share: Share of the fuel of driving that it burns while it waits.
        """
        ...

    def regate(self, robot: int, needs: Sequence[IntArray]) -> None:
        """Give a robot in motion other gates; those that it has passed, or can't brake before, are no other."""
        ...

    def ask(self, every_s: float) -> None:
        """Let robots that wait for others ask after each so much of waiting [s]; 0 = never."""
        ...

    def standing(self, robot: int) -> Standing:
        """Where a robot is on its lane."""
        ...

    def drop(self, robot: int) -> None:
        """A robot failed: it stands where it is, and nobody waits for it any more."""
        ...

    def brake(self, on: bool) -> None:
        """Let all robots brake, or let them go on."""
        ...

    def run(self, until_s: float = ...) -> Happening:
        """Drive until something happens, or until the first control step at or after ``until_s``."""
        ...

    def leg(self, robot: int) -> LegSoFar:
        """A robot's present leg."""
        ...

    def pose(self, robot: int) -> Pose:
        """Where a robot is."""
        ...

    def arc_m(self, robot: int) -> float:
        """How far a robot is on its leg [m]."""
        ...

    def cell(self, robot: int) -> int:
        """The cell of its lane that a robot is in."""
        ...

    def fault(self, robot: int) -> Fault | None:
        """Why a robot drives no more though nothing holds it."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None: ...
