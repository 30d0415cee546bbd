"""Discounts: what failures along the route leave of its rewards, and what the loss of a vehicle costs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray


class Discount(NamedTuple):
    """The discount of one vehicle.

    The k-th POI of its route, reached after ``T`` seconds of driving, earns ``D = survival**k * exp(-rate * T)`` times
    its reward. A vehicle that leaves pays ``departure``, and receives ``home`` times its ``D`` on return; one that
    stays has value 0. Neither is negative, and no route without a POI may be worth more than 0.

    Attributes:
        survival: Probability to get to the next POI.
        rate: Failures in a second of driving; ``inf`` = nothing is ever reached.
        departure: Cost of leaving.
        home: Reward of the return.
    """

    survival: float = 1.0
    rate: float = 0.0
    departure: float = 0.0
    home: float = 0.0

    @property
    def is_plain(self) -> bool:
        """Whether it changes no route's value."""
        return self.survival == 1.0 and self.rate == 0.0 and self.departure == self.home

    @property
    def is_hopeless(self) -> bool:
        """Whether the vehicle never reaches anything."""
        return self.survival == 0.0 or math.isinf(self.rate)

    def chance(self, visits: int, driven_s: float) -> float:
        """``D``: probability to survive some visits and some driving time."""
        if math.isinf(self.rate):
            return float(driven_s <= 0)
        return self.survival**visits * math.exp(-self.rate * driven_s)


NO_DISCOUNT = Discount()


@dataclass(frozen=True, eq=False, kw_only=True)
class Discounts:
    """The discounts of all vehicles; attributes as of ``Discount``, shape (M,) each."""

    survival: FloatArray
    rate: FloatArray
    departure: FloatArray
    home: FloatArray

    def __post_init__(self) -> None:
        if not (np.all(self.departure >= 0) and np.all(self.home >= 0) and np.all(self.rate >= 0)):
            raise ValueError("rates and costs of a discount can't be negative")

    def of(self, vehicle: int) -> Discount:
        """The discount of one vehicle."""
        return Discount(survival=float(self.survival[vehicle]), rate=float(self.rate[vehicle]),
                        departure=float(self.departure[vehicle]), home=float(self.home[vehicle]))

    def times(self, factor: float) -> Discounts:
        """The same discounts, with costs in another unit."""
        return replace(self, departure=self.departure * factor, home=self.home * factor)


def leg_survival(driven_s: FloatArray, pois: BoolArray, discount: Discount) -> FloatArray:
    """Probability to survive the leg from site i to site j, shape (n, n); 0 where there is no leg.

    Args:
        driven_s: Driving time of a leg [s], shape (n, n); ``inf`` = no leg.
        pois: Which sites are POIs, shape (n,).
        discount: The vehicle's discount.
    """
    if math.isinf(discount.rate):
        return np.zeros_like(driven_s)
    there = np.isfinite(driven_s)
    driving: FloatArray = np.where(there, np.exp(-discount.rate * np.where(there, driven_s, 0.0)), 0.0)
    return driving * np.where(pois, discount.survival, 1.0)[None, :]


def greatest_survival(legs: FloatArray, base: int) -> FloatArray:
    """Greatest probability to get to a site, from the base over legs of given survival, shape (n,); of base: and back.

    Args:
        legs: Probability to survive a leg, shape (n, n); 0 = no leg.
        base: The base.
    """
    greatest: FloatArray = legs[base].copy()
    greatest[base] = 0.0
    while True:
        through = (greatest[:, None] * legs).max(axis=0)
        through[base] = 0.0
        if not (through > greatest).any():
            break
        greatest = np.maximum(greatest, through)
    greatest[base] = (greatest * legs[:, base]).max(initial=0.0)
    return greatest
