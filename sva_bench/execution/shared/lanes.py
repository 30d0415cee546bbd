"""Lanes: the way of each robot of a team, cut into cells, and the order in which the robots enter them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray, IntArray, frozen, frozen_int
from sva_bench.execution.engines.engine import Pose
from sva_bench.execution.legs import Leg
from sva_bench.execution.shared.crossings import Crossings
from sva_bench.robot.follower import ARRIVED, CONTROL_HZ, NO_LINE, control, new_state
from sva_bench.robot.model import RobotModel
from sva_bench.robot.twin import advance, patience_steps

CELL_M = 0.1
"""Length of a cell along the path [m]."""
_SHORTEST_M = 0.02  # a last cell shorter than twice what a stretch may end early by would never be seen entered


@dataclass(frozen=True, eq=False, kw_only=True)
class Cut:
    """One way to drive one leg, cut into cells.

    A cell is ``CELL_M`` of arc as the follower counts it; the last one is as long as what is left, and the site, where
    the robot turns and stands, belongs to it.

    Attributes:
        leg: The leg.
        place_m: Where the ideal twin is in the middle of each cell [m], shape (cells, 2); it cuts corners of the path.
        enter_s: Time at which the ideal twin enters each cell, from the leg's start [s], shape (cells,); the first 0.
        lasts_s: Ideal driving time of the leg [s].
    """

    leg: Leg
    place_m: FloatArray
    enter_s: FloatArray
    lasts_s: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "place_m", frozen(self.place_m, (None, 2)))
        object.__setattr__(self, "enter_s", frozen(self.enter_s, (len(self.place_m),)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Itinerary:
    """What one robot has yet to drive, from where it stands at rest.

    Attributes:
        radius_m: Radius of its hull [m].
        legs: Candidate ways of each leg, the preferred first; no legs = it stays where it is for good.
        stop_s: Planned length of the stop at the end of each leg [s].
        ready_s: When it may set off, on the mission's clock [s].
        place_m: x, y of where it stands [m]: its only cell if it has no legs.
    """

    radius_m: float
    legs: tuple[tuple[Cut, ...], ...]
    stop_s: tuple[float, ...]
    ready_s: float
    place_m: tuple[float, float]

    def __post_init__(self) -> None:
        if len(self.stop_s) != len(self.legs) or not all(self.legs):
            raise ValueError("expected at least one way and one stop for each leg")


@dataclass(frozen=True, eq=False, kw_only=True)
class Lane:
    """What was chosen for one robot.

    Attributes:
        cuts: The way chosen for each leg.
        first_cell: Number of the first cell of each leg, then the number of all cells; shape (legs + 1,).
        enter_s: Planned time of entering each cell on the mission's clock [s], shape (cells,). The robot holds its
            first cell from the beginning; what stands here is when it is ready to leave it.
        place_m: Where it is planned to be in the middle of each cell [m], shape (cells, 2).
    """

    cuts: tuple[Cut, ...]
    first_cell: IntArray
    enter_s: FloatArray
    place_m: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "first_cell", frozen_int(self.first_cell, (len(self.cuts) + 1,)))
        object.__setattr__(self, "enter_s", frozen(self.enter_s, (int(self.first_cell[-1]),)))
        object.__setattr__(self, "place_m", frozen(self.place_m, (len(self.enter_s), 2)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Order:
    """Who passes first, wherever two robots can't be at once.

    Attributes:
        lanes: The lane of each robot.
        needs: ``needs[i][j][a]``: the cell of its lane that robot j must have entered before robot i may enter its cell
            a; 0 = none. Never decreasing in a; shape (cells of i,) each.
        ends_s: Planned end of each robot's last stop on the mission's clock [s], shape (robots,).
        crossings: The groups of cells that ``needs`` follow from.
    """

    lanes: tuple[Lane, ...]
    needs: tuple[tuple[IntArray, ...], ...]
    ends_s: FloatArray
    crossings: Crossings

    def __post_init__(self) -> None:
        object.__setattr__(self, "ends_s", frozen(self.ends_s, (len(self.lanes),)))


def cells_of(length_m: float) -> int:
    """Number of cells of a leg of that length [m]."""
    return max(math.ceil((length_m - _SHORTEST_M) / CELL_M), 1)


@njit(cache=True)  # type: ignore[untyped-decorator]
def cell_at(arc_m: float, cells: int) -> int:
    """Number of the cell of a leg in which a robot is.

    Args:
        arc_m: Arc of the leg's stretches before, and of this one as its follower counts it [m].
        cells: Number of cells of the leg.
    """
    return min(int(arc_m / CELL_M), cells - 1)


def cut(model: RobotModel, leg: Leg, pose: Pose) -> Cut:
    """Cut a leg into cells by driving it with the ideal twin.

    Args:
        model: The robot.
        leg: What it drives.
        pose: Where it stands at rest before it.

    Raises:
        ValueError: If it never arrives.
    """
    course = [stretch for hop in leg for stretch in hop]
    length_m = sum(float(stretch.arc[-1]) for stretch in course)
    count = cells_of(length_m)
    ends = np.append(CELL_M * np.arange(1, count), length_m)  # the last is as long as what is left
    middles = 0.5 * (CELL_M * np.arange(count) + ends)
    enter, places, at = np.zeros(count), np.empty((count, 2)), np.array(pose, dtype=np.float64)
    seen, before_m, steps = np.array([1, 0]), 0.0, 0
    for stretch in course:
        state = new_state()
        steps = _drive_through(
            stretch.path, stretch.arc, stretch.heading_rad, model.limits, state, at, model.track_m, 1.0 / CONTROL_HZ,
            steps, steps + patience_steps(stretch, model), before_m, middles, enter, places, seen)
        if state[0] != ARRIVED:
            raise ValueError(f"robot model {model.name} never arrives at the end of a leg of {length_m:.1f} m")
        before_m += float(stretch.arc[-1])
    entered, passed = seen.tolist()
    enter[entered:] = steps / CONTROL_HZ
    places[passed:] = at[:2]
    return Cut(leg=leg, place_m=places, enter_s=enter, lasts_s=steps * (1.0 / CONTROL_HZ))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _drive_through(
    path: FloatArray, arc: FloatArray, heading: float, limits: FloatArray, state: FloatArray, pose: FloatArray,
    track: float, dt: float, first: int, last: int, before: float, middles: FloatArray, enter: FloatArray,
    places: FloatArray, seen: IntArray,
) -> int:
    """Drive one stretch as the ideal twin does, and note when cells are entered; the step of arrival, or ``last``.

    Args:
        path, arc, heading, limits, state, pose, track, dt: As ``robot.twin`` drives a stretch; ``state`` and ``pose``
            are changed in place.
        first, last: Step to begin with, and at which to give up.
        before: Arc of the stretches before [m].
        middles: Arc in the middle of each cell [m].
        enter, places: Time of entering each cell [s], and place in its middle [m]; filled in place.
        seen: Number of cells entered, and passed by half; changed in place.
    """
    for step in range(first, last):
        speed, rate = control(path, arc, heading, limits, state, pose[0], pose[1], pose[2], dt, NO_LINE)
        here = before + state[1]
        while seen[0] < len(enter) and cell_at(here, len(enter)) >= seen[0]:
            enter[seen[0]] = step * dt
            seen[0] += 1
        while seen[1] < len(middles) and here >= middles[seen[1]]:
            places[seen[1], 0], places[seen[1], 1] = pose[0], pose[1]
            seen[1] += 1
        if state[0] == ARRIVED:
            return step
        advance(pose, speed - 0.5 * track * rate, speed + 0.5 * track * rate, track, dt)
    return last
