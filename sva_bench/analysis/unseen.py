"""Bounds on losses in noise draws that were not observed, from the margins of those that were.

A robot that ran out of fuel in none of K draws may do so in another: with nothing else known, in a share of them up to
about 3 / K. But the draws also show how much fuel and time was left: where that is many standard deviations, the share
is far less. So the share of each such end is bounded by the smaller of both.
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

EXECUTION_LOSSES: tuple[End, ...] = ("out_of_fuel", "late", "stuck")
"""The ends that lose value by the execution, not by a failure drawn."""

_TAIL = 0.025  # one side of a 95 % interval
_STUCK_S = 10.0  # least delay of a robot that gets stuck: that long without progress defines it
_NEVER = 1e-9  # a smaller share counts as 0
_NODES = 100  # of the quadrature over the standard deviation's distribution


@dataclass(frozen=True, eq=False, kw_only=True)
class Exposure:
    """Bounds on what each robot may lose in noise draws that were not observed.

    Shares are relative to the upper limit of an unobserved event: 1 = all that 3 / K allows, 0 = impossible.

    Attributes:
        value: Incentive of each robot's POIs and the cost of its loss, each weighted by that share, shape (robots,).
        ends: Such share of each end in ``EXECUTION_LOSSES``, shape (robots, 3).
    """

    value: FloatArray
    ends: FloatArray


def exposure_of(margins: Sequence[Margins], robots: int, *, noisy: bool) -> Exposure:
    """The exposure of each robot; of several routes of a robot the greatest, of one that was never driven all of it.

    Args:
        margins: Margins of the routes that are driven.
        robots: Number of robots.
        noisy: Whether noise draws differ; without noise the observed one determines all.
    """
    value, ends = np.zeros(robots), np.zeros((robots, len(EXECUTION_LOSSES)))
    for route in margins:
        nothing_known = (np.ones(len(route.worth)),) * 3
        fuel, late, stuck = _shares(route, noisy=noisy) if len(route.leg_s) else nothing_known
        lost = np.minimum(fuel + late + stuck, 1.0)
        m = route.robot
        never_home = min(float(fuel[-1] + stuck[-1]), 1.0)
        value[m] = max(value[m], float(route.worth @ lost) + route.loss_cost * never_home)
        ends[m] = np.maximum(ends[m], [fuel[-1], late[-1], stuck[-1]])
    return Exposure(value=value, ends=ends)


def _shares(route: Margins, *, noisy: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Share of draws in which the robot is out of fuel, late, stuck by each stop, relative to an unobserved event's."""
    median_s = np.nanmedian(np.where(np.isnan(route.leg_s).all(axis=0), 0.0, route.leg_s), axis=0)
    stuck_margin = np.where(np.isnan(route.leg_s), -1.0, _STUCK_S - (route.leg_s - median_s))
    if noisy:
        unseen_share = 1 - _TAIL ** (1 / len(route.leg_s))
        fuel, late, stuck = (
            share_below(values) / unseen_share for values in (route.fuel_s, route.time_s, stuck_margin))
    else:
        fuel, late, stuck = (
            _ever_exhausted(values).astype(np.float64) for values in (route.fuel_s, route.time_s, stuck_margin))
    # Fuel only decreases between refuels, so each refuel interval is judged by its last stop; intervals add up.
    filled = fuel + np.concatenate([[0.0], np.cumsum(np.where(route.fills, fuel, 0.0))[:-1]])
    return (np.minimum(np.maximum.accumulate(filled), 1.0), np.minimum(np.maximum.accumulate(late), 1.0),
            np.minimum(np.cumsum(stuck), 1.0))


def share_below(left: FloatArray) -> FloatArray:
    """97.5 % upper limit of the share of draws in which nothing is left; at most that of an unobserved event.

    Fuel and time used are sums of many small effects, so what is left is assumed to be normal over draws. Its distance
    from zero in standard deviations is bounded from below by its noncentral t distribution.

    Args:
        left: Fuel or time left in each draw [s], shape (draws, n); NaN = the robot did not get there.

    Returns:
        Shape (n,); 1 where nothing was left in an observed draw.

    Source:
        Odeh & Owen (1980), "Tables for normal tolerance limits, sampling plans, and screening".
    """
    draws = len(left)
    found = _ever_exhausted(left).astype(np.float64)
    judged = (found == 0) & np.isfinite(left).all(axis=0)
    unseen_share = 1 - _TAIL ** (1 / draws)
    if draws < 2:
        return np.where(judged, unseen_share, found)
    mean, sd = left[:, judged].mean(axis=0), left[:, judged].std(axis=0, ddof=1)
    spread = sd > 1e-9 * mean
    shares = np.zeros(len(mean))
    shares[spread] = ndtr(-_least_distance(mean[spread] / sd[spread], draws))
    found[judged] = np.where(shares < _NEVER, 0.0, np.minimum(shares, unseen_share))
    return found


def _least_distance(seen: FloatArray, draws: int) -> FloatArray:
    """97.5 % lower limit of a normal mean in standard deviations, from a sample's, shape as ``seen``."""
    ratios = np.sqrt(chdtri(draws - 1, (np.arange(_NODES) + 0.5) / _NODES) / (draws - 1))  # of the sample's sd
    low, high = np.full(len(seen), -40.0), seen.copy()
    for _ in range(30):  # halves them to less than a millionth
        middle = (low + high) / 2
        share = ndtr(np.sqrt(draws) * (seen[:, None] * ratios - middle[:, None])).mean(axis=1)
        low, high = np.where(share > 1 - _TAIL, middle, low), np.where(share > 1 - _TAIL, high, middle)
    return low


def _ever_exhausted(left: FloatArray) -> BoolArray:
    crossed: BoolArray = np.any(np.isnan(left) | (left < -TOLERANCE_S), axis=0)
    return crossed
