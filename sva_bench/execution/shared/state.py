"""Where a team is in its motion, as records that compiled code changes in place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, get_type_hints

import numpy as np
from numpy.typing import NDArray

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.execution.shared.driver import Member
from sva_bench.robot.disturbance import FEATURES

STANDS, READY, DRIVES, DRAINS = 0, 1, 2, 3
"""What a robot does: it has nothing to do; it is to set off; it drives; it obeys what is under way at a stop."""

BRAKED = -1
"""Cause of a wait for nobody but the team's brake; holds count down from -2, robots are their numbers."""

MOST_DELAY = 30
"""Commands that may be under way: half a second's."""
_WAITS, _POSES, _HOLDS = 32, 512, 4  # room to begin with

NO_END = 1 << 60
"""A control step that never comes."""

Records = NDArray[Any]
"""An array of records."""


class Robot(Protocol):
    """A record of what a robot is, what it drives and how far it is; compiled code passes records without a cost.

    Attributes:
        radius, track, track_gain, gain_left, gain_right, limits, delay, lost, waves: What it is, as of ``robot.model``
            and ``robot.disturbance``; ``lost`` tells whether there is an error field.
        pose: x, y [m], yaw [rad].
        follow: The follower's state.
        queue: Commands under way, the first first.
        left, right: Speeds along the floor that its wheels are commanded [m/s].
        doing: ``STANDS`` and so on.
        commanded: Whether it has its command of this control step.
        at_rest: Whether that leaves it where it is, with nothing under way, until others move or time passes.
        event: What happened to it, 0 = nothing.
        leg: The leg that it is on; -1 = before the first.
        first_cell, end_cell: First cell of its leg, and of the next one.
        stretch: Its stretch.
        taken: Control steps on its stretch.
        steps: Control steps of driving on its hop.
        drained: Commands under way that were obeyed at the stop.
        elapsed: Control steps since its leg was to begin.
        cell: Its cell.
        cells: Number of its cells that have gates.
        need_row: Row of its first cell in ``Ways.need``.
        lane_stretch: First stretch of its lane.
        open_to: The first of its cells that is closed, or that was not looked at.
        dropped: Whether nobody waits for it any more.
        hold, hold_count: The next of its holds, and how many there are.
        hold_left: Control steps that the hold lasts yet; -1 = not begun.
        ready_s: When its leg is to begin.
        hops_s: Driving time of the leg's finished hops.
        driving_s, fuel_s: Driving time, and fuel, after which it ends.
        idle: Share of fuel that it burns waiting.
        waited: Control steps of waiting on its leg.
        asked: Control steps of waiting for other robots since it last asked to go first.
        wait_count, pose_count: How many waits and poses were kept.
        checked_m, checked_rad, checked_steps: Arc and yaw when it was last checked for being stuck, and steps on the
            way since.
    """

    radius: float
    track: float
    track_gain: float
    gain_left: float
    gain_right: float
    limits: FloatArray
    delay: int
    lost: bool
    waves: FloatArray
    pose: FloatArray
    follow: FloatArray
    queue: FloatArray
    left: float
    right: float
    doing: int
    commanded: bool
    at_rest: bool
    event: int
    leg: int
    first_cell: int
    end_cell: int
    stretch: int
    taken: int
    steps: int
    drained: int
    elapsed: int
    cell: int
    cells: int
    need_row: int
    lane_stretch: int
    open_to: int
    dropped: bool
    hold: int
    hold_count: int
    hold_left: int
    ready_s: float
    hops_s: float
    driving_s: float
    fuel_s: float
    idle: float
    waited: int
    asked: int
    wait_count: int
    pose_count: int
    checked_m: float
    checked_rad: float
    checked_steps: int


class Team(Protocol):
    """A record of what holds for all robots.

    Attributes:
        now: The control step.
        braking: Whether all are to brake.
        traced: Whether poses are kept.
        checked: Whether stuck robots are looked for.
        asks: Control steps of waiting for other robots after which one asks to go first; 0 = none does.
        until: The control step before which it comes back at the latest.
    """

    now: int
    braking: bool
    traced: bool
    checked: bool
    asks: int
    until: int


_SHAPES = {"limits": (4,), "waves": (8, FEATURES), "pose": (3,), "follow": (5,), "queue": (MOST_DELAY, 2)}
_TYPES = {int: np.int64, bool: np.bool_}


def _record_of(kind: type) -> np.dtype[Any]:
    return np.dtype([(name, _TYPES.get(of, np.float64), _SHAPES.get(name, ()))
                     for name, of in get_type_hints(kind).items()], align=True)


ROBOT, TEAM = _record_of(Robot), _record_of(Team)


class Notes(NamedTuple):
    """What is noted of a team; the first axis is the robot.

    Attributes:
        holds: Where its holds are [m] and how long they last [control steps], shape (n, holds, 2).
        waits: Cause, driving time when it began [s], control steps, x, y [m], driving time when it last held the robot;
            shape (n, waits, 6).
        poses: Control steps since the leg was to begin, x, y [m], yaw [rad], shape (n, poses, 4).
        near: Pairs whose hulls touch, shape (n, n).
        touched: Pairs that came to touch, to be told, shape (n, n).
    """

    holds: FloatArray
    waits: FloatArray
    poses: FloatArray
    near: BoolArray
    touched: BoolArray


def robots_at_rest(members: Sequence[Member]) -> Records:
    """A record of each robot, at rest at the start of a mission.

    Raises:
        ValueError: If commands are under way for longer than there is room for.
    """
    robots = np.zeros(len(members), dtype=ROBOT)
    for robot, member in zip(robots, members, strict=True):
        model, disturbance, waves = member.model, member.disturbance, member.disturbance.waves
        if disturbance.delay_steps > MOST_DELAY:
            raise ValueError(f"a delay of {disturbance.delay_s:g} s is longer than half a second")
        robot["radius"], robot["track"], robot["track_gain"] = model.radius_m, model.track_m, disturbance.track_gain
        robot["gain_left"], robot["gain_right"] = disturbance.wheel_gains
        robot["limits"], robot["delay"], robot["pose"] = model.limits, disturbance.delay_steps, member.start
        robot["lost"] = waves.shape[1] > 0
        if waves.shape[1]:
            robot["waves"] = waves
        robot["leg"] = robot["hold_left"] = -1
    return robots


def team_of(*, traced: bool, checked: bool) -> Records:
    """The record of a team at the start of a mission, shape (1,)."""
    return np.array([(0, False, traced, checked, 0, NO_END)], dtype=TEAM)


def nothing_noted(robots: int, *, traced: bool) -> Notes:
    """Notes of a team of which nothing is noted."""
    return Notes(holds=np.zeros((robots, _HOLDS, 2)), waits=np.zeros((robots, _WAITS, 6)),
                 poses=np.zeros((robots, _POSES if traced else 1, 4)), near=np.zeros((robots, robots), dtype=np.bool_),
                 touched=np.zeros((robots, robots), dtype=np.bool_))


CAUSE, SINCE_S, LASTS, WAIT_X, WAIT_Y, LAST_S = 0, 1, 2, 3, 4, 5
"""Places in ``Notes.waits``."""


def longer(array: FloatArray, least: int) -> FloatArray:
    """The same with room for at least so many entries a robot, and for twice as many as now."""
    more = np.zeros((len(array), max(least, 2 * array.shape[1]), *array.shape[2:]))
    more[:, :array.shape[1]] = array
    return more
