"""Costs at quantiles of what legs take."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from sva_bench.travel.leg_costs import NOMINAL_RUNG, LegSamples, Rung, costs_at, typical_excess

DRAWS = 10


def samples(seed: int, n: int = 4) -> LegSamples:
    rng = np.random.default_rng(seed)
    return LegSamples(driving_s=rng.uniform(1.0, 9.0, (DRAWS, n, n)), waits_s=rng.uniform(0.0, 3.0, (DRAWS, n, n)),
                      capacity=rng.uniform(0.7, 1.1, DRAWS))


def test_a_wait_takes_clock_and_its_idle_share_of_fuel_and_a_small_tank_fuel_alone() -> None:
    # Two sites. On the clock, out: 1 + 1 = 2, 3 + 1 = 4; back: 2, 4. Fuel, out: 1 / 1 = 1, 3 / 0.5 = 6; back: 2 and
    # 4 / 0.5 = 8; with an idle share of 1/2, out: 1.5 / 1, 3.5 / 0.5 = 7. The median of two is the lower.
    found = LegSamples(driving_s=np.array([[[0, 1], [2, 0]], [[0, 3], [4, 0]]], dtype=float),
                       waits_s=np.array([[[0, 1], [0, 0]], [[0, 1], [0, 0]]], dtype=float),
                       capacity=np.array([1.0, 0.5]))
    for rung, margin, idle, fuel, clock in (
            (Rung(quantile=0.5), 0.0, 0.0, [[0, 1], [2, 0]], [[0, 2], [2, 0]]),
            (Rung(quantile=0.9), 0.0, 0.0, [[0, 6], [8, 0]], [[0, 4], [4, 0]]),
            (Rung(quantile=0.9), 0.0, 0.5, [[0, 7], [8, 0]], [[0, 4], [4, 0]]),
            (Rung(quantile=0.5, factor=1.5), 0.1, 0.0, [[0, 1.65], [3.3, 0]], [[0, 3.3], [3.3, 0]])):
        cost = costs_at(found, rung, margin, idle)
        assert_array_equal(cost.fuel_s, fuel)
        assert_array_equal(cost.time_s, clock)
    assert typical_excess(found, 0.9) == 4.0


@given(st.integers(0, 1000), st.floats(0.05, 0.99), st.floats(1.0, 3.0))
def test_costs_are_metric_and_grow_with_quantile_and_factor(seed: int, quantile: float, factor: float) -> None:
    found = samples(seed)
    for kind in ("fuel_s", "time_s"):
        cost, lower, higher = (getattr(costs_at(found, rung, 0.01), kind) for rung in (
            Rung(quantile=quantile, factor=factor), Rung(quantile=quantile),
            Rung(quantile=min(quantile + 0.01, 1.0), factor=factor)))
        assert (cost[:, :, None] + cost[None, :, :] >= cost[:, None, :] - 1e-8).all()
        assert (lower <= cost + 0.002).all()  # a millisecond of rounding a leg
        assert (higher >= cost).all()


def test_a_leg_that_robots_get_stuck_on_is_gone_round_or_costs_without_end() -> None:
    driving = np.ones((DRAWS, 3, 3))
    driving[:, 0, 1] = np.inf
    driving[:, :2, 2] = driving[:, 2, 1] = np.inf
    cost = costs_at(LegSamples(driving_s=driving, waits_s=np.zeros_like(driving), capacity=np.ones(DRAWS)),
                    Rung(quantile=0.5), 0.0)
    for matrix in (cost.fuel_s, cost.time_s):
        assert matrix[0, 1] == matrix[0, 2] == np.inf
        assert matrix[1, 0] == 1.0


def test_nominal_costs_are_no_quantile() -> None:
    with pytest.raises(ValueError, match="no quantile"):
        costs_at(samples(0), NOMINAL_RUNG, 0.0)
