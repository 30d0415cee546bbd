"""What a recording shows of what robots meet: contacts, waits, passages that are shut or open, slippery floors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray, frozen
from sva_bench.execution.outcome import Event, Trace
from sva_bench.recording.colors import Color
from sva_bench.world.noise import Passage

_GRIPS = 0.8  # friction from which on a floor is shown as any other
_ICE: Color = (150, 205, 235)
_FLOOR: Color = (232, 232, 232)
_APART_S = 3.0  # contact with the same obstacle is named again after so long


@dataclass(frozen=True, eq=False, kw_only=True)
class Touched:
    """The contacts of one robot.

    Attributes:
        robot: The robot.
        time_s: When each began [s on the mission clock], shape (n,).
        at_m: Where [m], shape (n, 2).
        what: What was touched, length n; nothing where it is the same as just before.
    """

    robot: str
    time_s: FloatArray
    at_m: FloatArray
    what: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "time_s", frozen(self.time_s, (len(self.what),)))
        object.__setattr__(self, "at_m", frozen(self.at_m, (len(self.what), 2)))


@dataclass(frozen=True, kw_only=True)
class Waiting:
    """A wait: whose, from when to when [s on the mission clock], where [m], and for what."""

    robot: str
    since_s: float
    until_s: float
    at_m: tuple[float, float]
    what: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Gate:
    """A passage that may be shut.

    Attributes:
        name: Its name.
        ends_m: Both ends [m], shape (2, 2).
        time_s: When it is found shut or is open again, ascending from 0 [s on the mission clock], shape (n,).
        shut: Whether a robot stands before it from then on, length n.
    """

    name: str
    ends_m: FloatArray
    time_s: FloatArray
    shut: tuple[bool, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "ends_m", frozen(self.ends_m, (2, 2)))
        object.__setattr__(self, "time_s", frozen(self.time_s, (len(self.shut),)))


@dataclass(frozen=True, kw_only=True)
class Floor:
    """A patch of floor: centre x, y, half length, half width [m], yaw [rad], friction, and a colour by that."""

    box: tuple[float, float, float, float, float]
    friction: float
    color: Color


def touched_of(traces: Sequence[Trace]) -> tuple[Touched, ...]:
    """Contacts robot by robot."""
    found = []
    for trace in traces:
        events = _told(trace, "touches")
        if events:
            what = [event.what if k == 0 or event.what != events[k - 1].what
                    or event.time_s > events[k - 1].time_s + events[k - 1].lasts_s + _APART_S else ""
                    for k, event in enumerate(events)]
            found.append(Touched(robot=trace.orders.robot, time_s=np.array([event.time_s for event in events]),
                                 at_m=np.array([event.at_m for event in events]), what=tuple(what)))
    return tuple(found)


def waiting_of(traces: Sequence[Trace]) -> tuple[Waiting, ...]:
    """Waits, in order of time."""
    return tuple(sorted((Waiting(robot=trace.orders.robot, since_s=event.time_s,
                                 until_s=min(event.time_s + event.lasts_s, trace.outcome.end_time_s),
                                 at_m=event.at_m or (0.0, 0.0), what=event.what)
                         for trace in traces for event in _told(trace, "waits")), key=lambda wait: wait.since_s))


def gates_of(passages: Sequence[Passage], traces: Sequence[Trace]) -> tuple[Gate, ...]:
    """Passages, shut as long as a robot waits before them: nobody knows what they are else."""
    waits = waiting_of(traces)
    gates = []
    for passage in passages:
        mine = [wait for wait in waits if wait.what == passage.name]
        times = sorted({0.0, *(time for wait in mine for time in (wait.since_s, wait.until_s))})
        ax, ay, bx, by = passage.ends_m
        gates.append(Gate(name=passage.name, ends_m=np.array([[ax, ay], [bx, by]]), time_s=np.array(times), shut=tuple(
            any(wait.since_s <= time < wait.until_s for wait in mine) for time in times)))
    return tuple(gates)


def floors_of(floors: FloatArray) -> tuple[Floor, ...]:
    """Patches of floor, the more like ice the less they grip."""
    return tuple(Floor(box=(x, y, hx, hy, yaw), friction=friction, color=tinted(friction))
                 for x, y, hx, hy, yaw, friction in floors.tolist())


def tinted(friction: float) -> Color:
    """The colour of a floor: ice without friction, and as any other from 0.8 on."""
    share = 1 - min(friction / _GRIPS, 1.0)
    r, g, b = (round(plain + share * (ice - plain)) for plain, ice in zip(_FLOOR, _ICE, strict=True))
    return r, g, b


def _told(trace: Trace, kind: str) -> list[Event]:
    return [event for event in trace.outcome.events if event.kind == kind]
