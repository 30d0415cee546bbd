"""Tallies of ranges, joined, are those of the whole."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sva_bench.analysis.statistics import estimate
from sva_bench.batch.tallies import estimate_of, joined, moments_of


def test_moments_of_two_halves_by_hand() -> None:
    # 1, 3 and 5, 7: mean 4, squares about it 9 + 1 + 1 + 9 = 20. Draws 0 (1 + 5) and 1 (3 + 7).
    halves = [moments_of(np.array(values), np.array([0, 1]), 2) for values in ([1.0, 3.0], [5.0, 7.0])]
    whole = joined(*halves)
    assert (whole.count, whole.mean, whole.squares) == (4, 4.0, 20.0)
    assert whole.sums.tolist() == [6.0, 10.0]


@given(arrays(np.float64, st.integers(2, 60), elements=st.floats(-1e3, 1e3)), st.integers(1, 59), st.booleans())
def test_a_joined_estimate_is_that_of_the_trials_themselves(values: np.ndarray, cut: int, noisy: bool) -> None:
    cut = min(cut, len(values) - 1)
    rollout = np.arange(len(values)) % 4
    rollouts = 4 if noisy else 0
    got = estimate_of(joined(moments_of(values[:cut], rollout[:cut], rollouts),
                             moments_of(values[cut:], rollout[cut:], rollouts)))
    want = estimate(values, rollout, noisy=noisy)
    # Sums of up to 60 figures of up to 1e3, in another order: 1e-9 is a thousand times their rounding.
    np.testing.assert_allclose(got.mean, want.mean, atol=1e-9)
    assert got.interval is not None
    assert want.interval is not None
    np.testing.assert_allclose(got.interval, want.interval, atol=1e-5)
