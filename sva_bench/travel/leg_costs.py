"""Calibrated costs: what legs cost at a quantile of noise draws, in place of what the ideal robot takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import floyd_warshall

from sva_bench.arrays import FloatArray, frozen

MEDIAN = 0.5


@dataclass(frozen=True, kw_only=True)
class Rung:
    """Costs to plan with: a quantile of what legs take under noise, times a factor.

    Attributes:
        quantile: The quantile over noise draws; ``None`` = the nominal costs.
        factor: The factor on it.
    """

    quantile: float | None = None
    factor: float = 1.0


NOMINAL_RUNG = Rung()
"""The costs of the ideal robot."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LegSamples:
    """What each leg between sites takes a robot model, draw by draw.

    Attributes:
        driving_s: Driving time from site i to site j [s]; ``inf`` where it got stuck; shape (draws, n, n).
        waits_s: How long it waits on the way [s], shape (draws, n, n).
        capacity: Factor on what its tank holds, shape (draws,).
    """

    driving_s: FloatArray
    waits_s: FloatArray
    capacity: FloatArray

    def __post_init__(self) -> None:
        draws, n, _ = self.driving_s.shape
        object.__setattr__(self, "driving_s", frozen(self.driving_s, (draws, n, n)))
        object.__setattr__(self, "waits_s", frozen(self.waits_s, (draws, n, n)))
        object.__setattr__(self, "capacity", frozen(self.capacity, (draws,)))

    def fuel_s(self, idle_share: float) -> FloatArray:
        """What each leg takes of a nominal tank, draw by draw [s of driving], shape (draws, n, n).

        Args:
            idle_share: Share of the fuel of driving that the robot burns while it waits.
        """
        fuel: FloatArray = (self.driving_s + idle_share * self.waits_s) / self.capacity[:, None, None]
        return fuel

    def clock_s(self) -> FloatArray:
        """What each leg takes of the mission limit, draw by draw [s], shape (draws, n, n)."""
        return self.driving_s + self.waits_s


@dataclass(frozen=True, eq=False, kw_only=True)
class LegCosts:
    """Planning costs from site i to site j, both metric; ``inf`` where no robot gets through.

    Attributes:
        fuel_s: Fuel [s of driving], shape (n, n).
        time_s: Time on the mission clock [s], shape (n, n).
    """

    fuel_s: FloatArray
    time_s: FloatArray


def costs_at(samples: LegSamples, rung: Rung, margin: float, idle_share: float = 0.0) -> LegCosts:
    """Planning costs of a rung.

    A wait takes clock, and fuel by the idle share alone; a small tank takes fuel alone. Quantiles of legs may violate
    the triangle inequality, so both are repaired as nominal times are, and rounded alike: samples that are all the
    nominal time give the nominal costs to the bit.

    Args:
        samples: What each leg takes.
        rung: The quantile, an observed one, and the factor; not the nominal rung, which needs no samples.
        margin: Relative safety margin, as on nominal costs.
        idle_share: Share of the fuel of driving that the robot burns while it waits.
    """
    if rung.quantile is None:
        raise ValueError("the nominal costs are no quantile")
    return LegCosts(fuel_s=_metric_at(samples.fuel_s(idle_share), rung.quantile, rung.factor, margin),
                    time_s=_metric_at(samples.clock_s(), rung.quantile, rung.factor, margin))


def _metric_at(samples: FloatArray, quantile: float, factor: float, margin: float) -> FloatArray:
    cost_ms = 1000.0 * factor * np.quantile(samples, quantile, axis=0, method="inverted_cdf")
    n = len(cost_ms)
    cost_ms = np.where(np.eye(n, dtype=np.bool_), 0.0, np.maximum(np.rint(cost_ms), 1.0))
    # Doubles hold integer milliseconds exactly, so the closure is metric to the bit.
    repaired: FloatArray = floyd_warshall(cost_ms) if n > 1 else cost_ms
    rounded: FloatArray = np.round(repaired * (1.0 + margin) / 1000.0, 9)
    return rounded


def typical_excess(samples: LegSamples, quantile: float) -> float:
    """How many times its median a leg takes at a quantile, on average over legs that can be driven; of fuel or time."""
    return max(_excess(cost, quantile) for cost in (samples.fuel_s(1.0), samples.clock_s()))


def _excess(cost_s: FloatArray, quantile: float) -> float:
    at, median = (np.quantile(cost_s, q, axis=0, method="inverted_cdf") for q in (quantile, MEDIAN))
    told = (median > 0) & np.isfinite(at)
    return float(np.mean(at[told] / median[told])) if told.any() else 1.0
