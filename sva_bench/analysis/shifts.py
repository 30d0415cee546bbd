"""What noise in driving times changes where robots fail at a constant rate: a robot that takes longer fails more often.

Under such a process, the value under the failures drawn alone holds for planned times. In a noise draw the times are
others, so the mean over lifetimes shifts, to either side. It is known in closed form for each draw observed; a draw
that was not is taken to be beyond those by at most as much as they range.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from sva_bench.analysis.moments import Bounds
from sva_bench.arrays import FloatArray
from sva_bench.execution.margins import Margins


def value_shift(margins: Sequence[Margins], rate: float, *, noisy: bool) -> Bounds:
    """Bounds on what a robot's mean value over lifetimes loses by the times of a noise draw.

    Args:
        margins: Margins of the robot's routes.
        rate: Its failures in a second of driving.
        noisy: Whether noise draws differ.
    """
    def value(route: Margins, survival: FloatArray) -> FloatArray:
        return survival @ route.worth - route.loss_cost * (1 - survival[..., -1])

    return _shift(margins, rate, value, noisy=noisy)


def home_shift(margins: Sequence[Margins], rate: float, *, noisy: bool) -> Bounds:
    """Bounds on what its probability to come home loses so; arguments as for ``value_shift``."""
    return _shift(margins, rate, lambda _, survival: survival[..., -1], noisy=noisy)


def _shift(margins: Sequence[Margins], rate: float, figure: Callable[[Margins, FloatArray], FloatArray], *,
           noisy: bool) -> Bounds:
    if not 0 < rate < np.inf:
        return 0.0, 0.0
    low = high = 0.0
    for route in margins:
        if not len(route.leg_s) or not len(route.planned_s):
            continue
        driven_s = np.where(np.isnan(route.leg_s), route.planned_s, route.leg_s)  # what a stuck robot loses is apart
        lost = figure(route, np.exp(-rate * np.cumsum(route.planned_s))) - figure(
            route, np.exp(-rate * np.cumsum(driven_s, axis=1)))
        beyond = float(np.ptp(lost)) if noisy else 0.0
        low, high = min(low, float(lost.min()) - beyond), max(high, float(lost.max()) + beyond)
    return low, high
