"""What each robot is doing when: driving, waiting, refuelling, lost or home, as a lane over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray, frozen
from sva_bench.choices import RobotState
from sva_bench.execution.outcome import Trace
from sva_bench.recording.colors import ALARM, BLUE, GREEN, ORANGE, PURPLE, Color

STATE_COLORS: Mapping[RobotState, Color] = {
    "at the base": (120, 120, 120), "driving": BLUE, "waiting": ORANGE, "at a POI": PURPLE, "refuelling": GREEN,
    "failed": ALARM, "out of fuel": ALARM, "stuck": ALARM, "home": (70, 70, 70), "home late": (140, 60, 60)}
"""Colours of states, in the order in which they are listed."""
_SHORTEST_S = 0.05  # a stop shorter than a pose is none
_SPEED_STEP_S = 0.5
_BLOCK = 256  # poses that are looked through at a time


@dataclass(frozen=True, eq=False, kw_only=True)
class StateLane:
    """States of one robot: what it does from each time [s on the mission clock] on, which are ascending."""

    robot: str
    time_s: FloatArray
    states: tuple[RobotState, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "time_s", frozen(self.time_s, (len(self.states),)))

    def at(self, time_s: float) -> RobotState:
        """What the robot does at a time."""
        return self.states[max(int(np.searchsorted(self.time_s, time_s + 1e-9, side="right")) - 1, 0)]


def state_lanes_of(traces: Sequence[Trace]) -> tuple[StateLane, ...]:
    """A lane for each robot."""
    return tuple(_lane(trace) for trace in traces)


def _lane(trace: Trace) -> StateLane:
    changes: list[tuple[float, RobotState]] = [(0.0, "at the base")]
    events, orders = trace.outcome.events, trace.orders
    for event in events:
        match event.kind:
            case "departed":
                changes.append((event.time_s, "driving"))
            case "waits":
                changes += [(event.time_s, "waiting"), (event.time_s + event.lasts_s, "driving")]
            case "arrived" if (leaves_s := _leaves_s(trace, event.time_s)) > event.time_s + _SHORTEST_S:
                at: RobotState = "refuelling" if event.site in orders.stations else "at a POI"
                changes += [(event.time_s, at), (leaves_s, "driving")]
            case _:
                pass
    end_s = trace.outcome.end_time_s
    ends: Mapping[str, RobotState] = {"home": "home", "failed": "failed", "out_of_fuel": "out of fuel",
                                      "stuck": "stuck", "late": "home late"}
    changes = [(time_s, state) for time_s, state in changes if time_s < end_s]
    if events or trace.outcome.end != "home":
        changes.append((end_s, ends[trace.outcome.end]))
    return _merged(orders.robot, changes or [(0.0, "at the base")])


def _merged(robot: str, changes: Sequence[tuple[float, RobotState]]) -> StateLane:
    """States one after the other: of the same moment the last counts, and none follows itself."""
    times: list[float] = []
    states: list[RobotState] = []
    for time_s, state in sorted(changes, key=lambda change: change[0]):
        if times and time_s <= times[-1] + 1e-9:
            states[-1] = state
        else:
            times.append(time_s)
            states.append(state)
    kept = [k for k in range(len(times)) if k == 0 or states[k] != states[k - 1]]
    return StateLane(robot=robot, time_s=np.array([times[k] for k in kept]), states=tuple(states[k] for k in kept))


def _leaves_s(trace: Trace, since_s: float) -> float:
    """When a robot that stands since some time moves again [s]."""
    first = int(np.searchsorted(trace.time_s, since_s + 1e-6, side="right"))
    before = max(first - 1, 0)
    # It seldom stands for long: the poses of the whole rest of the mission are not gone through for each stop.
    for block in range(first, len(trace.pose), _BLOCK):
        moved = np.flatnonzero(np.abs(trace.pose[block:block + _BLOCK] - trace.pose[before]).max(axis=1) > 1e-3)
        if len(moved):
            return max(float(trace.time_s[block + moved[0] - 1]), since_s)
    return float(trace.time_s[-1])


def speed_of(trace: Trace) -> tuple[FloatArray, FloatArray]:
    """Speed over ground in steps of half a second: time [s], speed [m/s]; both of shape (n,)."""
    end_s = float(trace.time_s[-1])
    time_s = np.append(np.arange(0.0, end_s, _SPEED_STEP_S), end_s) if end_s > 0 else np.zeros(1)
    at = np.column_stack([np.interp(time_s, trace.time_s, trace.pose[:, axis]) for axis in (0, 1)])
    steps = np.diff(time_s)
    speed = np.hypot(*np.diff(at, axis=0).T) / np.maximum(steps, _SHORTEST_S)
    return time_s, np.append(0.0, speed)  # that of the half second before
