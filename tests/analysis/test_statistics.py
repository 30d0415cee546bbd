from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import t as student_t

from sva_bench.analysis.statistics import Estimate, controlled, distribution, estimate, share, tail_mean
from sva_bench.arrays import FloatArray, IntArray
from sva_bench.mission.failures import NEVER, FailureProcess, draw_failures, route_value


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


def test_intervals_that_are_to_hold_together_are_wider_by_hand() -> None:
    # As above for four independent trials; three comparisons at 95 % together ask for t at 1 - 0.05 / 6 of 3 degrees.
    found = estimate(np.array([1.0, 2, 3, 6]), np.array([0, 1, 0, 1]), noisy=False, comparisons=3)
    assert interval_of(found)[1] - 3 == pytest.approx(student_t.ppf(1 - 0.05 / 6, 3) * math.sqrt(14 / 12))


def test_three_comparisons_hold_together_in_95_per_cent_and_would_not_unadjusted() -> None:
    rng, rollout = np.random.default_rng(4), np.arange(40)
    plans = rng.normal(size=(1500, 3, 40))
    pairs = [(0, 1), (0, 2), (1, 2)]

    def all_hold(comparisons: int) -> float:
        return float(np.mean([all(not estimate(trials[a] - trials[b], rollout, noisy=False, comparisons=comparisons)
                                  .distinguishable for a, b in pairs) for trials in plans]))

    assert all_hold(3) >= 0.94  # Bonferroni's errs on the safe side
    assert all_hold(1) < 0.92


def test_wilsons_interval_by_hand() -> None:
    # 3 of 10: (0.3 + z2 / 20 -+ sqrt(z2 (0.21 + z2 / 40) / 10)) / (1 + z2 / 10), z = t(0.975, 9) = 2.26216.
    happened = np.array([1.0, 1, 1, 0, 0, 0, 0, 0, 0, 0])
    found = share(happened, np.zeros(10, dtype=np.int64), noisy=False)
    # Their variance, 0.21 x 10 / 9 / 10, makes them worth nine trials: 0.21 / 0.02333 = 9.
    z2, n = 2.2621571627409915**2, 9.0
    half = math.sqrt(z2 * (0.21 + z2 / (4 * n)) / n) / (1 + z2 / n)
    middle = (0.3 + z2 / (2 * n)) / (1 + z2 / n)
    assert found.mean == pytest.approx(0.3)
    assert interval_of(found) == pytest.approx((middle - half, middle + half))


def test_what_never_happened_in_eight_noise_draws_may_still_happen() -> None:
    # 8 / (8 + t2) of t(0.975, 7) = 2.36462: not one in 8 draws leaves up to 41 %, in however many trials.
    found = share(np.zeros(8000), np.arange(8000) % 8, noisy=True)
    assert interval_of(found) == pytest.approx((0.0, 1 - 8 / (8 + 2.364624251592785**2)))
    assert share(np.zeros(1), np.zeros(1, dtype=np.int64), noisy=False).interval is None


@pytest.mark.parametrize(("p", "shared"), [(0.5, 0.0), (0.1, 0.0), (0.3, 0.5)])
def test_wilsons_interval_covers_too(p: float, shared: float) -> None:
    # Trials of a rollout fail together with the chance ``shared``, each by itself otherwise.
    rng, rollout = np.random.default_rng(5), np.arange(320) % 16
    held = 0
    for _ in range(1500):
        together = rng.random(16) < shared
        one, own = rng.random(16) < p, rng.random(320) < p
        low, high = interval_of(share(np.where(together[rollout], one[rollout], own).astype(float), rollout,
                                      noisy=True))
        held += low <= p <= high
    assert 0.92 <= held / 1500 <= 0.985  # four standard deviations of 1500 rounds: 0.023


def test_the_worst_tenth_by_hand() -> None:
    # 15 trials 1 .. 15: the worst tenth is one and a half of them: (1 + 0.5 x 2) / 1.5.
    assert tail_mean(np.arange(15.0, 0, -1), 0.1) == pytest.approx(2 / 1.5)
    assert tail_mean(np.array([7.0]), 0.1) == 7.0
    found = distribution(np.arange(1.0, 101))
    assert found == {"least": 1.0, "q05": 5.0, "q25": 25.0, "q50": 50.0, "q75": 75.0, "q95": 95.0, "greatest": 100.0,
                     "cvar10": pytest.approx(5.5)}


@pytest.mark.parametrize("process", ["mission", "per_leg"])
def test_draws_come_to_the_closed_form_of_their_process(process: FailureProcess) -> None:
    # POIs of 10, 20 and 30 at 0.8: 48 under mission; 8 + 12.8 + 15.36 = 36.16 per leg.
    incentives, left = [10.0, 20.0, 30.0], np.array([0.0, 10.0, 30.0, 60.0])
    expected = route_value(incentives, 0.8, process)
    assert expected == pytest.approx({"mission": 48.0, "per_leg": 36.16}[process])
    fails = draw_failures(0, ["uv1"], {"uv1": 0.8}, process, trials=100_000, pois=3)[:, 0]
    drawn = left[np.where(fails == NEVER, 3, np.maximum(fails - 1, 0))]
    low, high = interval_of(estimate(drawn, np.arange(100_000), noisy=False))
    assert low <= expected <= high
    assert high - low < 0.4


@pytest.mark.parametrize("process", ["mission", "per_leg"])
def test_a_control_from_the_closed_form_shrinks_the_interval_and_keeps_its_coverage(process: FailureProcess) -> None:
    # What is driven: a rollout in four loses a tenth of what the draws leave, and a bit of noise on top.
    incentives, left = [10.0, 20.0, 30.0], np.array([0.0, 10.0, 30.0, 60.0])
    expected = route_value(incentives, 0.8, process)
    truth, rollout, rng = expected * (1 - 0.1 * 0.25), np.arange(160) % 16, np.random.default_rng(6)
    held, widths = 0, []
    for seed in range(600):
        fails = draw_failures(seed, ["uv1"], {"uv1": 0.8}, process, trials=160, pois=3)[:, 0]
        drawn = left[np.where(fails == NEVER, 3, np.maximum(fails - 1, 0))]
        driven = drawn * (1 - 0.1 * (rng.random(16) < 0.25)[rollout])
        plain = estimate(driven, rollout, noisy=True)
        found = controlled(driven, drawn, expected, rollout, noisy=True)
        low, high = interval_of(found)
        held += low <= truth <= high
        widths.append((found.half_width or 0.0) / (plain.half_width or 1.0))
    assert 0.92 <= held / 600 <= 0.985
    assert np.mean(widths) < 0.5


def test_where_all_went_as_drawn_the_control_leaves_the_closed_form() -> None:
    drawn = np.array([0.0, 60.0, 60.0, 60.0, 0.0, 60.0])
    found = controlled(drawn, drawn, 48.0, np.arange(6), noisy=False)
    assert found.mean == pytest.approx(48.0)
    assert found.half_width == pytest.approx(0.0, abs=1e-12)


def test_a_control_that_never_varies_takes_nothing_out() -> None:
    values, constant = np.array([1.0, 2, 3, 6]), np.full(4, 8.0)
    assert controlled(values, constant, 8.0, np.arange(4), noisy=False) == estimate(values, np.arange(4), noisy=False)
    assert controlled(values[:1], constant[:1], 8.0, np.zeros(1, dtype=np.int64), noisy=False).interval is None
