"""Staggered departures: a robot that is planned to wait on its first leg leaves its berth later instead."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from sva_bench.execution.shared.crossings import foresee
from sva_bench.execution.shared.earliest import SPARE_S
from sva_bench.execution.shared.lanes import Order

EARLY_S = 3.0
"""How much before the latest a robot leaves [s]: others may be earlier than planned, and it may be later,"""
SLOWER = 0.05
"""by so much of the time that it is planned to take until then."""


def staggered(order: Order) -> tuple[float, ...]:
    """When each robot leaves its berth [s on the mission clock], from 0 on.

    It leaves so late that it is planned to reach its first stop, and to leave everything that others wait for, no later
    than if it left at once, less what keeps it from coming late: ``EARLY_S``, and ``SLOWER`` of the time until then. So
    nobody's planned times depend on when others leave.

    Args:
        order: The plan in space and time of a whole mission.
    """
    crossings = order.crossings
    first, stay_s, needs = crossings.first, crossings.stay_s, crossings.needs(crossings.second)
    robots, leaving = len(first) - 1, first[:-1]
    enter_s = np.full(len(stay_s), -math.inf)
    foresee(first, stay_s, needs, np.zeros(robots, dtype=np.int64), stay_s[leaving], np.zeros(robots, dtype=np.bool_),
            SPARE_S, enter_s)
    departs = []
    for robot, (lane, (begin, end)) in enumerate(zip(order.lanes, pairwise(first.tolist()), strict=True)):
        if not lane.cuts:
            departs.append(0.0)
            continue
        latest = np.full(end - begin, math.inf)  # of entering its cells
        latest[lane.first_cell[1:] - 1] = enter_s[begin + lane.first_cell[1:] - 1]
        waiting = np.flatnonzero(needs[:, robot] > 0)  # cells of others
        np.minimum.at(latest, needs[waiting, robot], enter_s[waiting] - SPARE_S)
        driven_s = np.concatenate([[0.0], np.cumsum(stay_s[begin:end - 1])])
        departs.append(max(float((latest - (1 + SLOWER) * driven_s)[1:].min(initial=math.inf)) - EARLY_S, 0.0))
    return tuple(d if math.isfinite(d) else 0.0 for d in departs)
