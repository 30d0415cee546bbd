"""Scaling of incentives, so that plans don't depend on the unit in which an instance states them.

Two steps. First an instance's incentives become multiples of its own largest one, rounding undone
(``in_own_units``): a common factor on all of them has no effect. Then each goal is multiplied by
the power of two that brings the most that one visit can earn near ``LARGEST`` (``factor_of``), which is exact.
Absolute tolerances anywhere in the solver are in these units, in which the best plan of a goal
without negative weights is worth ``LARGEST / 2`` at least.

What a visit can earn includes all factors on its incentive: availability, the probability to get there, its share in
a measure of risk (``Goal.rates``). So what is guaranteed of an optimal plan is relative to what the goal can pay, not
to its incentives: no plan is better by more than the gap, or by ``ROUNDING`` of the most that one visit can earn. The
latter is less than the gap but for goals with negative weights, and for measures of risk whose best plan is worth less
than a thousandth of what one of its visits could earn: a ``cvar`` of 0, say, that no plan can raise.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.mission.instance import Instance
from sva_bench.solver.goal import Goal

LARGEST = 128.0
"""Least power of two above the largest incentive."""
ROUNDING = 1e-9
"""Share of the most that one visit can earn, up to which two values, or a value and a bound, count as equal."""
MOST_UNITS = 1_000_000
_MULTIPLE = 1e-9  # how far from an integer a multiple of the common unit may be
_BITS = 36  # of a mantissa that are kept; the rest is noise of scaling and unscaling


def common_unit(values: Iterable[float]) -> float:
    """The greatest number of which all values are multiples, but for rounding; 0 if there is none.

    Units below a millionth of the largest value are not looked for.
    """
    distinct = sorted({abs(float(value)) for value in values} - {0.0}, reverse=True)
    if not distinct:
        return 0.0
    largest, units = distinct[0], 1
    for value in distinct:
        units = math.lcm(units, Fraction(value / largest).limit_denominator(MOST_UNITS).denominator)
        if units > MOST_UNITS:
            return 0.0
    counts = [value / largest * units for value in distinct]
    if any(round(count) == 0 or abs(count - round(count)) > _MULTIPLE for count in counts):
        return 0.0
    return largest / units


def in_own_units(instance: Instance) -> tuple[Instance, float]:
    """The instance with incentives below ``LARGEST``, and the unit: the instance's own value of 1 in them.

    Where all incentives are multiples of one number they become exact multiples of a power of two, so sums that are
    equal in decimals are equal; else they are rounded to 11 digits.
    """
    incentives = np.array([v.incentives for v in instance.vehicles])
    largest = float(incentives.max(initial=0.0))
    if largest == 0.0:
        return instance, 1.0
    step = common_unit(incentives.ravel())
    relative = incentives / largest
    if step > 0.0:
        units = round(largest / step)
        scaled, top = np.rint(relative * units), float(units)
    else:
        scaled, top = _without_noise(relative), 1.0
    factor = _power_below(top)
    own = replace(instance, vehicles=tuple(
        replace(v, incentives=row) for v, row in zip(instance.vehicles, scaled * factor, strict=True)))
    return own, max(largest / (top * factor), math.ulp(0.0))


def in_unit(values: FloatArray, unit: float) -> FloatArray:
    """Quantities that are compared with incentives, such as targets and costs, in another unit, shape as given."""
    return _without_noise(values / unit)


def _without_noise(values: FloatArray) -> FloatArray:
    """Values rounded to 11 digits, shape as given."""
    mantissa, exponent = np.frexp(values)
    rounded: FloatArray = np.ldexp(np.rint(np.ldexp(mantissa, _BITS)), exponent - _BITS)
    return rounded


def factor_of(goal: Goal) -> float:
    """The power of two that brings the most one visit can earn under a goal to ``LARGEST / 2`` or more, but below
    ``LARGEST``; 1 where nothing is earned."""
    most = most_of_a_visit(goal)
    return _power_below(most) if most > 0.0 else 1.0


def most_of_a_visit(goal: Goal) -> float:
    """The most that one visit can earn, or cost."""
    return float(goal.rates().max(initial=0.0))


def _power_below(most: float) -> float:
    """The power of two that brings a number to ``LARGEST / 2`` or more, but below ``LARGEST``."""
    return LARGEST * 2.0 ** -math.frexp(most)[1]
