"""What a recording shows of failures and reactions: who was lost and where, who learned of it when, and new orders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray, frozen
from sva_bench.choices import End
from sva_bench.execution.outcome import Trace
from sva_bench.execution.team_trace import NewsHeard
from sva_bench.recording.colors import Color
from sva_bench.world.model import Site

_FAULTS: Mapping[str, str] = {
    "tipped over": "it fell on its side", "physics failed": "physics failed, which gave no finite pose of it"}
LOST: Mapping[End, str] = {"failed": "failed", "out_of_fuel": "out of fuel", "stuck": "stuck"}
"""Ends of robots that don't come home, as they are labelled."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Lost:
    """A robot that failed, ran out of fuel or got stuck: when [s], where [m], shape (2,), and what happened."""

    robot: str
    radius_m: float
    time_s: float
    at_m: FloatArray
    what: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "at_m", frozen(self.at_m, (2,)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Change:
    """The orders of one robot as news changes them.

    Attributes:
        robot, color: The robot, and its colour.
        time_s: When its orders change, shape (n,).
        old, new: From each of these times on: the path that was left before, and that which is now [m], each (k, 2).
    """

    robot: str
    color: Color
    time_s: FloatArray
    old: tuple[FloatArray, ...]
    new: tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Lane:
    """One robot in the chart of news: its height there, when it was lost, and when it learned of others' failures."""

    robot: str
    color: Color
    height: float
    lost_s: FloatArray
    learned_s: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Forgone:
    """POIs that a robot was to visit and that nobody collected: from when on that is so [s], and where, (n, 2) [m]."""

    robot: str
    color: Color
    time_s: float
    names: tuple[str, ...]
    at_m: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "at_m", frozen(self.at_m, (len(self.names), 2)))


def forgone_of(pois: Sequence[Site], traces: Sequence[Trace], colors: Mapping[str, Color],
               routes: Mapping[str, Sequence[str]] | None) -> tuple[Forgone, ...]:
    """What lost and late robots left, robot by robot; what another took over and collected isn't.

    Args:
        pois: The POIs.
        traces: What robots did.
        colors: Their colours.
        routes: Stops of each robot as planned; ``None`` = those of its orders.
    """
    collected = {event.site for trace in traces for event in trace.outcome.events if event.kind == "collected"}
    found = []
    for trace in traces:
        name, outcome = trace.orders.robot, trace.outcome
        planned = set(trace.orders.route if routes is None else routes.get(name, ()))
        mine = [site for site in pois if site.name in planned - collected]
        late = [event.time_s for event in outcome.events if event.kind == "late"]
        if mine and (outcome.end in LOST or late):
            found.append(Forgone(robot=name, color=colors[name], time_s=min([*late, outcome.end_time_s]),
                                 names=tuple(site.name for site in mine),
                                 at_m=np.array([[site.x_m, site.y_m] for site in mine])))
    return tuple(found)


def lost_of(trace: Trace, radius_m: float) -> Lost:
    """Where a robot was lost."""
    outcome, robot = trace.outcome, trace.orders.robot
    held = f" ({held_told(outcome.events[-1].what)})" if outcome.events and outcome.events[-1].what else ""
    return Lost(robot=robot, radius_m=radius_m, time_s=outcome.end_time_s, at_m=trace.pose[-1, :2],
                what=f"{robot} {LOST[outcome.end]}{held} at {outcome.end_time_s:.0f} s")


def held_told(what: str) -> str:
    """What a stuck robot is held by, in a few words."""
    return _FAULTS.get(what, f"held by {what}")


def changes_of(news: Sequence[NewsHeard], colors: Mapping[str, Color]) -> tuple[Change, ...]:
    """Robots whose orders changed, in order of the first time."""
    changed = dict.fromkeys(robot.robot for heard in news for robot in heard.rerouted)
    found = []
    for name in changed:
        mine = [(heard.time_s, robot) for heard in news for robot in heard.rerouted if robot.robot == name]
        found.append(Change(robot=name, color=colors[name], time_s=np.array([time_s for time_s, _ in mine]),
                            old=tuple(robot.old for _, robot in mine), new=tuple(robot.new for _, robot in mine)))
    return tuple(found)


def lanes_of(traces: Sequence[Trace], news: Sequence[NewsHeard], colors: Mapping[str, Color]) -> tuple[Lane, ...]:
    """A lane for each robot, the first at the top; none if no news came."""
    return tuple(Lane(
        robot=robot, color=colors[robot], height=-float(number),
        lost_s=np.array([trace.outcome.end_time_s] if trace.outcome.end in LOST else []),
        learned_s=np.array([heard.time_s for heard in news if robot in heard.learned]))
        for number, trace in enumerate(traces) for robot in [trace.orders.robot]) if news else ()


def sentences_of(heard: NewsHeard) -> list[tuple[str, str | None]]:
    """What a team hears, and what each robot is told to do: sentences, and whom they are about alone."""
    failed = ", ".join(heard.failed)
    said: list[tuple[str, str | None]] = [(
        f"{', '.join(heard.learned)} learned that {failed} failed" if heard.learned else
        f"it is known that {failed} failed, and nobody is left to be told", None)]
    for robot in heard.rerouted:
        parts = [f"{verb} {', '.join(sites)}" for verb, sites in (
            ("takes over", robot.taken), ("leaves out", robot.dropped)) if sites]
        said.append((f"{robot.robot} {' and '.join(parts) or 'goes on in another order'}", robot.robot))
    return said
