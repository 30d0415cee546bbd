"""Itineraries for tests: legs of straight or bent ways, driven by a built-in robot, or cells with made-up times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sva_bench.execution.shared.lanes import Cut, Itinerary, cut
from sva_bench.robot.follower import stretches
from sva_bench.robot.model import BUILT_IN, RobotModel

MODEL = BUILT_IN["turtlebot2"]
GAP_M = 0.2

Way = Sequence[tuple[float, float]]


def itinerary(
    *legs: Way | Sequence[Way], ready_s: float = 0.0, stop_s: float = 2.0, model: RobotModel = MODEL
) -> Itinerary:
    """Of a robot that drives these legs; each is one way, or several to choose from."""
    chosen: list[tuple[Cut, ...]] = []
    start: tuple[float, float] | None = None
    at = (0.0, 0.0)
    for leg in legs:
        ways = [np.array(way, dtype=np.float64) for way in (leg if np.ndim(leg[0]) == 2 else [leg])]
        at = (float(ways[0][0, 0]), float(ways[0][0, 1]))
        start = at if start is None else start
        chosen.append(tuple(cut(model, (stretches(way, 0.0),), (*at, 0.0)) for way in ways))
    assert start is not None
    return Itinerary(radius_m=model.radius_m, legs=tuple(chosen), stop_s=(stop_s,) * len(chosen), ready_s=ready_s,
                     place_m=start)


def standing(x_m: float, y_m: float, model: RobotModel = MODEL) -> Itinerary:
    """Of a robot that stands there for good."""
    return Itinerary(radius_m=model.radius_m, legs=(), stop_s=(), ready_s=0.0, place_m=(x_m, y_m))


def made_up(places: Sequence[tuple[float, float]], lasts_s: Sequence[float]) -> Cut:
    """A way over cells in some places, with the shortest stay in each."""
    enter = np.concatenate([[0.0], np.cumsum(lasts_s)])
    return Cut(leg=(), place_m=np.array(places), enter_s=enter[:-1], lasts_s=float(enter[-1]))
