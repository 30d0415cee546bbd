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


def test_a_quantile_of_time_and_waits_over_what_the_tank_holds_is_the_cost() -> None:
    # Two sites. Out: (1 + 1) / 1 = 2, (3 + 1) / 0.5 = 8; back: 2 and 4 / 0.5 = 8. The median of two is the lower.
    found = LegSamples(driving_s=np.array([[[0, 1], [2, 0]], [[0, 3], [4, 0]]], dtype=float),
                       waits_s=np.array([[[0, 1], [0, 0]], [[0, 1], [0, 0]]], dtype=float),
                       capacity=np.array([1.0, 0.5]))
    assert_array_equal(costs_at(found, Rung(quantile=0.5), 0.0), [[0, 2], [2, 0]])
    assert_array_equal(costs_at(found, Rung(quantile=0.9), 0.0), [[0, 8], [8, 0]])
    assert_array_equal(costs_at(found, Rung(quantile=0.5, factor=1.5), 0.1), [[0, 3.3], [3.3, 0]])
    assert typical_excess(found, 0.9) == 4.0


@given(st.integers(0, 1000), st.floats(0.05, 0.99), st.floats(1.0, 3.0))
def test_costs_are_metric_and_grow_with_quantile_and_factor(seed: int, quantile: float, factor: float) -> None:
    found = samples(seed)
    cost = costs_at(found, Rung(quantile=quantile, factor=factor), 0.01)
    assert (cost[:, :, None] + cost[None, :, :] >= cost[:, None, :] - 1e-8).all()
    assert (costs_at(found, Rung(quantile=quantile), 0.01) <= cost + 0.002).all()  # a millisecond of rounding a leg
    assert (costs_at(found, Rung(quantile=min(quantile + 0.01, 1.0), factor=factor), 0.01) >= cost).all()


def test_a_leg_that_robots_get_stuck_on_is_gone_round_or_costs_without_end() -> None:
    driving = np.ones((DRAWS, 3, 3))
    driving[:, 0, 1] = np.inf
    driving[:, :2, 2] = driving[:, 2, 1] = np.inf
    cost = costs_at(LegSamples(driving_s=driving, waits_s=np.zeros_like(driving), capacity=np.ones(DRAWS)),
                    Rung(quantile=0.5), 0.0)
    assert cost[0, 1] == cost[0, 2] == np.inf
    assert cost[1, 0] == 1.0


def test_nominal_costs_are_no_quantile() -> None:
    with pytest.raises(ValueError, match="no quantile"):
        costs_at(samples(0), NOMINAL_RUNG, 0.0)
