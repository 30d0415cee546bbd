"""Where a team is in its motion, as arrays that compiled code changes in place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.execution.shared.driver import Member
from sva_bench.robot.follower import new_state

STANDS, READY, DRIVES, DRAINS = 0, 1, 2, 3
"""What a robot does: it has nothing to do; it is to set off; it drives; it obeys what is under way at a stop."""

BRAKED = -1
"""Cause of a wait for nobody but the team's brake; holds count down from -2, robots are their numbers."""

_WAITS, _POSES, _HOLDS = 32, 512, 4  # room to begin with


class Figures(NamedTuple):
    """What robots are, as ``robot.model`` and ``robot.disturbance`` have it; the first axis is the robot.

    Attributes:
        limits: ``RobotModel.limits``, shape (n, 4).
        track, radius: Distance between the wheels and radius of the hull [m].
        gains: Of the left and the right wheel, shape (n, 2).
        track_gain: Factor on the track.
        waves: Waves of the error fields, shape (n, 8, waves); zeros add nothing.
        delay: Control steps until a command is obeyed.
    """

    limits: FloatArray
    track: FloatArray
    radius: FloatArray
    gains: FloatArray
    track_gain: FloatArray
    waves: FloatArray
    delay: IntArray


class State(NamedTuple):
    """All that changes; the first axis is the robot.

    Attributes:
        pose: x, y [m], yaw [rad], shape (n, 3).
        follow: The follower's states, shape (n, 5).
        queue: Commands under way, the first first, shape (n, delay, 2).
        wheels: Speeds along the floor that the left and the right wheel are commanded [m/s], shape (n, 2).
        doing: ``STANDS`` and so on.
        commanded: Whether it has its command of this control step.
        at_rest: Whether that leaves it where it is, with nothing under way, until others move or time passes.
        leg, stretch: Those that it is on; -1 = before the first leg.
        taken: Control steps on its stretch.
        steps: Control steps of driving on its hop.
        drained: Commands under way that were obeyed at the stop.
        elapsed: Control steps since its leg was to begin.
        cell: Its cell.
        open_to: The first of its cells that is closed, or that was not looked at.
        dropped: Whether nobody waits for it any more.
        hold, hold_left: The next of its holds, and the control steps that it lasts yet; -1 = not begun.
        holds: Where they are [m] and how long they last [control steps], shape (n, holds, 2).
        hold_count: How many.
        clock_s: When its leg is to begin; driving time of finished hops; its driving time and its fuel [s]; share of
            fuel that it burns waiting; shape (n, 5).
        waited: Control steps of waiting on its leg.
        waits: Cause, driving time when it began [s], control steps, x, y [m], driving time when it last held the robot;
            shape (n, waits, 6).
        wait_count: How many.
        poses: Control steps since the leg was to begin, x, y [m], yaw [rad], shape (n, poses, 4).
        pose_count: How many.
        checked: Arc [m] and yaw [rad] at the last check for being stuck, steps on the way since, shape (n, 3).
        near: Pairs whose hulls touch, shape (n, n).
        event: What happened to a robot, 0 = nothing.
        touched: Pairs that came to touch, to be told, shape (n, n).
        team: The control step; whether the team brakes; whether poses are kept; whether stuck robots are looked for.
    """

    pose: FloatArray
    follow: FloatArray
    queue: FloatArray
    wheels: FloatArray
    doing: IntArray
    commanded: BoolArray
    at_rest: BoolArray
    leg: IntArray
    stretch: IntArray
    taken: IntArray
    steps: IntArray
    drained: IntArray
    elapsed: IntArray
    cell: IntArray
    open_to: IntArray
    dropped: BoolArray
    hold: IntArray
    hold_left: IntArray
    holds: FloatArray
    hold_count: IntArray
    clock_s: FloatArray
    waited: IntArray
    waits: FloatArray
    wait_count: IntArray
    poses: FloatArray
    pose_count: IntArray
    checked: FloatArray
    near: BoolArray
    event: IntArray
    touched: BoolArray
    team: IntArray


NOW, BRAKING, TRACED, CHECKED = 0, 1, 2, 3
"""Places in ``State.team``."""
READY_S, HOPS_S, DRIVING_S, FUEL_S, IDLE = 0, 1, 2, 3, 4
"""Places in ``State.clock_s``."""
CAUSE, SINCE_S, LASTS, WAIT_X, WAIT_Y, LAST_S = 0, 1, 2, 3, 4, 5
"""Places in ``State.waits``."""


def figures_of(members: Sequence[Member]) -> Figures:
    """What the robots of a team are."""
    waves = [member.disturbance.waves for member in members]
    most = max(wave.shape[1] for wave in waves)
    return Figures(
        limits=np.array([member.model.limits for member in members]),
        track=np.array([member.model.track_m for member in members]),
        radius=np.array([member.model.radius_m for member in members]),
        gains=np.array([member.disturbance.wheel_gains for member in members]),
        track_gain=np.array([member.disturbance.track_gain for member in members]),
        waves=np.stack([np.pad(wave, ((0, 0), (0, most - wave.shape[1]))) for wave in waves]),
        delay=np.array([member.disturbance.delay_steps for member in members], dtype=np.int64))


def at_rest(members: Sequence[Member], *, traced: bool, checked: bool) -> State:
    """A team at rest at the start of a mission."""
    n, delay = len(members), max(member.disturbance.delay_steps for member in members)

    def counts(value: int = 0) -> IntArray:
        return np.full(n, value, dtype=np.int64)

    def flags(*shape: int) -> BoolArray:
        return np.zeros(shape, dtype=np.bool_)

    return State(
        pose=np.array([member.start for member in members], dtype=np.float64),
        follow=np.tile(new_state(), (n, 1)), queue=np.zeros((n, delay, 2)), wheels=np.zeros((n, 2)), doing=counts(),
        commanded=flags(n), at_rest=flags(n), leg=counts(-1), stretch=counts(), taken=counts(), steps=counts(),
        drained=counts(), elapsed=counts(), cell=counts(), open_to=counts(), dropped=flags(n), hold=counts(),
        hold_left=counts(-1), holds=np.zeros((n, _HOLDS, 2)), hold_count=counts(), clock_s=np.zeros((n, 5)),
        waited=counts(), waits=np.zeros((n, _WAITS, 6)), wait_count=counts(),
        poses=np.zeros((n, _POSES if traced else 1, 4)), pose_count=counts(), checked=np.zeros((n, 3)),
        near=flags(n, n), event=counts(), touched=flags(n, n),
        team=np.array([0, 0, traced, checked], dtype=np.int64))


def longer(array: FloatArray, least: int) -> FloatArray:
    """The same with room for at least so many entries a robot, and for twice as many as now."""
    more = np.zeros((len(array), max(least, 2 * array.shape[1]), *array.shape[2:]))
    more[:, :array.shape[1]] = array
    return more
