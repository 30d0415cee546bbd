from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import t as student_t

from sva_bench.analysis.statistics import Estimate, estimate
from sva_bench.arrays import FloatArray, IntArray


def interval_of(found: Estimate) -> tuple[float, float]:
    assert found.interval is not None
    return found.interval


def test_independent_trials_have_the_textbook_interval() -> None:
    # 1, 2, 3, 6: mean 3, squares 4 + 1 + 0 + 9 = 14, variance 14 / 3, of the mean 14 / 12; t(0.975, 3) = 3.1824.
    found = estimate(np.array([1.0, 2, 3, 6]), np.array([0, 1, 0, 1]), noisy=False)
    half = 3.182446305284263 * math.sqrt(14 / 12)
    assert found.mean == 3.0
    assert interval_of(found) == pytest.approx((3 - half, 3 + half))


def test_trials_that_share_their_noise_count_as_one_sample_by_hand() -> None:
    # Two rollouts: 1, 3 and 2, 6. About the mean of 3 their sums are -2 and 2: variance of the mean
    # 2 / 1 x (4 + 4) / 16 = 1; one degree of freedom: t(0.975, 1) = 12.706.
    found = estimate(np.array([1.0, 2, 3, 6]), np.array([0, 1, 0, 1]), noisy=True)
    assert found.mean == 3.0
    assert interval_of(found) == pytest.approx((3 - 12.706204736174698, 3 + 12.706204736174698))


def test_with_equal_clusters_it_is_the_interval_of_their_means() -> None:
    values, rollout = np.random.default_rng(0).normal(size=60), np.arange(60) % 6
    means = np.array([values[rollout == k].mean() for k in range(6)])
    half = student_t.ppf(0.975, 5) * means.std(ddof=1) / math.sqrt(6)
    assert interval_of(estimate(values, rollout, noisy=True)) == pytest.approx(
        (means.mean() - half, means.mean() + half))


@pytest.mark.parametrize(("trials", "noisy"), [(1, False), (1, True), (5, True)])
def test_one_sample_carries_no_interval(trials: int, noisy: bool) -> None:
    found = estimate(np.arange(float(trials)), np.zeros(trials, dtype=np.int64), noisy=noisy)
    assert found.interval is None
    assert not found.distinguishable
    assert found.as_dict() == {"mean": (trials - 1) / 2, "ci95": None}


def test_differences_that_are_all_zero_are_not_distinguishable_from_zero() -> None:
    found = estimate(np.zeros(50), np.arange(50) % 8, noisy=True)
    assert found.interval == (0.0, 0.0)
    assert not found.distinguishable


def test_an_interval_that_leaves_zero_out_is_distinguishable() -> None:
    assert Estimate(mean=1.0, interval=(0.1, 1.9)).distinguishable
    assert Estimate(mean=-1.0, interval=(-1.9, -0.1)).distinguishable
    assert not Estimate(mean=1.0, interval=(0.0, 2.0)).distinguishable
    assert not Estimate(mean=1.0, interval=(-0.1, 2.1)).distinguishable


def test_no_figure_is_written_as_minus_zero() -> None:
    assert str(Estimate(mean=-0.0, interval=(-0.0, -0.0)).as_dict()) == "{'mean': 0.0, 'ci95': [0.0, 0.0]}"


samples = st.integers(2, 40).flatmap(lambda n: st.tuples(
    arrays(np.float64, n, elements=st.floats(-1e3, 1e3)), arrays(np.int64, n, elements=st.integers(0, 4))))


@given(samples, st.floats(-100, 100), st.floats(-10, 10))
def test_interval_moves_and_scales_with_the_figures(sample: tuple[FloatArray, IntArray], shift: float, scale: float
                                                    ) -> None:
    values, rollout = sample
    plain, moved = (estimate(v, rollout, noisy=True) for v in (values, scale * values + shift))
    assert moved.mean == pytest.approx(scale * plain.mean + shift, abs=1e-8)
    if plain.interval is None:
        assert moved.interval is None
        return
    width, stretched = np.ptp(plain.interval), np.ptp(interval_of(moved))
    assert stretched == pytest.approx(abs(scale) * width, abs=1e-6)  # of t up to 12.7 times figures up to 1e4


def coverage(trials: int, rollouts: int, *, shared_sd: float, noisy: bool, seed: int, rounds: int) -> float:
    """How often the interval holds the true mean, 0, of trials with so much noise of their rollout in common."""
    rng = np.random.default_rng(seed)
    rollout = np.arange(trials) % rollouts
    values = rng.normal(size=(rounds, trials)) + shared_sd * rng.normal(size=(rounds, rollouts))[:, rollout]
    held = [low <= 0 <= high for low, high in (interval_of(estimate(row, rollout, noisy=noisy)) for row in values)]
    return float(np.mean(held))


@pytest.mark.parametrize(("trials", "rollouts", "shared_sd"), [(80, 8, 1.0), (80, 8, 0.0), (81, 8, 0.5), (30, 4, 2.0)])
def test_nominal_95_per_cent_holds_the_truth_about_as_often(trials: int, rollouts: int, shared_sd: float) -> None:
    # Four standard deviations of a frequency of 0.95 in 3000 rounds: 0.016. From 92 to 98 % leaves some for trials
    # that don't divide by the number of rollouts.
    assert 0.92 <= coverage(trials, rollouts, shared_sd=shared_sd, noisy=True, seed=1, rounds=3000) <= 0.98


def test_without_noise_trials_are_independent_samples() -> None:
    assert 0.92 <= coverage(40, 8, shared_sd=0.0, noisy=False, seed=2, rounds=3000) <= 0.98


def test_clusters_taken_for_independent_trials_would_be_wrong() -> None:
    # The reason for clustering: shared noise as strong as the trials' own leaves half of the intervals wrong.
    assert coverage(80, 8, shared_sd=1.0, noisy=False, seed=3, rounds=1000) < 0.75
