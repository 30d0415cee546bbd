"""What a noise draw that was not met could do, judged by how near those that were met came to it.

A robot that no draw had run dry may still run dry in the next. With nothing else known, its share may be up to about
3 / K after K draws. But each draw also tells how much fuel and time was left: where that is many standard deviations,
the share is far less. So the share of each unhappy end is bounded by the lesser of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, ndtr

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.choices import End
from sva_bench.execution.margins import Margins
from sva_bench.mission.instance import TOLERANCE_S

UNHAPPY: tuple[End, ...] = ("out_of_fuel", "late", "stuck")

_TAIL = 0.025  # one side of a 95 % interval
_STUCK_S = 10.0  # a robot that gets stuck is later than usual by this at least: it is told by standing still so long
_NEVER = 1e-9  # a smaller share is none
_NODES = 100  # of the quadrature over the standard deviation's distribution


@dataclass(frozen=True, eq=False, kw_only=True)
class Exposure:
    """What each robot might lose to draws that were not met.

    Shares are relative to the greatest that an unseen event may have: 1 = all that 3 / K allows, 0 = out of reach.

    Attributes:
        incentive: Incentive of each robot's POIs, each weighted by that share, shape (robots,).
        ends: Such shares of the ends in ``UNHAPPY``, shape (robots, 3).
    """

    incentive: FloatArray
    ends: FloatArray


def exposure_of(margins: Sequence[Margins], robots: int, *, noisy: bool) -> Exposure:
    """What each robot might lose; of several routes of one robot, the most; of one that was never driven, all of it.

    Args:
        margins: Margins of the routes that are driven.
        robots: Number of robots.
        noisy: Whether draws differ; without noise the one that was met tells all.
    """
    incentive, ends = np.zeros(robots), np.zeros((robots, len(UNHAPPY)))
    for route in margins:
        nothing_known = (np.ones(len(route.worth)),) * 3
        fuel, late, stuck = _shares(route, noisy=noisy) if len(route.leg_s) else nothing_known
        lost = np.minimum(fuel + late + stuck, 1.0)
        m = route.robot
        incentive[m] = max(incentive[m], float(route.worth @ lost))
        ends[m] = np.maximum(ends[m], [fuel[-1], late[-1], stuck[-1]])
    return Exposure(incentive=incentive, ends=ends)


def _shares(route: Margins, *, noisy: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """By each stop: share of draws in which the robot is dry, late, stuck before it, relative to an unseen one's."""
    usual = np.nanmedian(np.where(np.isnan(route.leg_s).all(axis=0), 0.0, route.leg_s), axis=0)
    standing = np.where(np.isnan(route.leg_s), -1.0, _STUCK_S - (route.leg_s - usual))
    if noisy:
        most = 1 - _TAIL ** (1 / len(route.leg_s))
        fuel, late, stuck = (share_below(values) / most for values in (route.fuel_s, route.time_s, standing))
    else:
        fuel, late, stuck = (_crossed(values).astype(np.float64) for values in (route.fuel_s, route.time_s, standing))
    # The tank only empties until it is filled, so each filling is judged by its last stop; fillings add up.
    filled = fuel + np.concatenate([[0.0], np.cumsum(np.where(route.fills, fuel, 0.0))[:-1]])
    return (np.minimum(np.maximum.accumulate(filled), 1.0), np.minimum(np.maximum.accumulate(late), 1.0),
            np.minimum(np.cumsum(stuck), 1.0))


def share_below(left: FloatArray) -> FloatArray:
    """Upper limit, sure to 97.5 %, of the share of draws in which nothing is left; at most that of an unseen event.

    Fuel and time burnt are sums of many small effects, so what is left is taken as roughly normal over draws. Its
    distance from zero in standard deviations is bounded from below by its noncentral t distribution.

    Args:
        left: What each draw left, shape (draws, n); NaN = the robot never came there.

    Returns:
        Shape (n,); 1 where a draw was met in which nothing was left.

    Source:
        Odeh & Owen (1980), Tables for Normal Tolerance Limits, Sampling Plans, and Screening: a share below a limit.
    """
    draws = len(left)
    found = _crossed(left).astype(np.float64)
    judged = (found == 0) & np.isfinite(left).all(axis=0)
    most = 1 - _TAIL ** (1 / draws)
    if draws < 2:
        return np.where(judged, most, found)
    mean, sd = left[:, judged].mean(axis=0), left[:, judged].std(axis=0, ddof=1)
    spread = sd > 1e-9 * mean
    shares = np.zeros(len(mean))
    shares[spread] = ndtr(-_least_distance(mean[spread] / sd[spread], draws))
    found[judged] = np.where(shares < _NEVER, 0.0, np.minimum(shares, most))
    return found


def _least_distance(seen: FloatArray, draws: int) -> FloatArray:
    """Least distance of a normal mean from zero, in standard deviations, that goes with a sample's at 97.5 %."""
    ratios = np.sqrt(chdtri(draws - 1, (np.arange(_NODES) + 0.5) / _NODES) / (draws - 1))  # of the sample's sd
    low, high = np.full(len(seen), -40.0), seen.copy()
    for _ in range(30):  # halves them to less than a millionth
        middle = (low + high) / 2
        share = ndtr(np.sqrt(draws) * (seen[:, None] * ratios - middle[:, None])).mean(axis=1)
        low, high = np.where(share > 1 - _TAIL, middle, low), np.where(share > 1 - _TAIL, high, middle)
    return low


def _crossed(left: FloatArray) -> BoolArray:
    crossed: BoolArray = np.any(np.isnan(left) | (left < -TOLERANCE_S), axis=0)
    return crossed
