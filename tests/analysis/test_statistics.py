"""Intervals by hand, and how often they hold the truth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import beta
from scipy.stats import t as student_t

from sva_bench.analysis.moments import Bounds, Figure, figure_of, joined
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.statistics import (
    bounded_mean,
    controlled,
    detectable,
    distribution,
    estimate,
    sample_mean,
    tail_mean,
)
from sva_bench.arrays import FloatArray
from sva_bench.choices import FailureProcess
from sva_bench.files.records import as_dict
from sva_bench.mission.failures import NEVER, draw_failures, route_value


def interval_of(found: Estimate) -> tuple[float, float]:
    assert found.ci95 is not None
    return found.ci95


def drawn_only(values: FloatArray, bounds: Bounds) -> Figure:
    """Trials that noise takes nothing of."""
    return figure_of(values, bounds, np.zeros(len(values)), (0.0, 0.0), np.zeros(len(values), dtype=np.int64),
                     noisy=False)


def taken_only(values: FloatArray, most: float, draws: int) -> Figure:
    """Trials of which noise takes so much; failures leave 0 of them."""
    return figure_of(np.zeros(len(values)), (0.0, 0.0), values, (0.0, most), np.arange(len(values)) % draws, noisy=True)


def test_a_share_has_clopper_and_pearsons_interval_by_hand() -> None:
    # 3 of 10: beta quantiles B(0.025; 3, 8) and B(0.975; 4, 7) = 0.0667 and 0.6525, as in any table.
    found = estimate(drawn_only(np.array([1.0] * 3 + [0.0] * 7), (0.0, 1.0)))
    assert found.mean == pytest.approx(0.3)
    assert interval_of(found) == pytest.approx((beta.ppf(0.025, 3, 8), beta.ppf(0.975, 4, 7)))
    assert interval_of(found) == pytest.approx((0.0667, 0.6525), abs=1e-4)


def test_what_eight_noise_draws_did_not_show_may_have_a_share_of_a_third() -> None:
    # Nothing seen in 8 draws, and up to 100 to lose: 1 - 0.025^(1/8) = 0.3694 of it, in however many trials.
    low, high = interval_of(estimate(taken_only(np.zeros(8000), 100.0, 8)))
    assert low == pytest.approx(-100 * (1 - 0.025 ** (1 / 8)))
    assert high == 0.0


def test_what_noise_cannot_take_leaves_certainty() -> None:
    assert interval_of(estimate(taken_only(np.zeros(8000), 0.0, 8))) == (0.0, 0.0)


def test_an_interval_is_cut_off_where_the_mean_certainly_is_not() -> None:
    # Failures leave 0 or 10, in few trials; noise took nothing in two draws, and might take 10 in another.
    drawn, draws = np.array([0.0, 10.0, 0.0, 0.0]), np.arange(4) % 2

    def figure(certain: Bounds | None) -> Figure:
        return figure_of(drawn, (0.0, 10.0), np.zeros(4), (0.0, 10.0), draws, noisy=True, certain=certain)

    low, high = interval_of(estimate(figure(None)))
    assert low < 0 < high < 10
    assert interval_of(estimate(figure((0.0, 10.0)))) == (0.0, high)
    assert interval_of(estimate(figure((-100.0, 100.0)))) == (low, high)
    assert interval_of(estimate(joined(figure((0.0, 10.0)), figure((0.0, 10.0)))))[0] == 0.0
    # The closed form says 2.5; its mean may lie beyond by chance, and is within its interval all the same.
    assert interval_of(controlled(figure(None), 2.5))[0] < 0.0
    assert interval_of(controlled(figure((0.0, 10.0)), 2.5)) == (0.0, 2.5)
    assert interval_of(controlled(figure((0.0, 10.0)), -1.0)) == (-1.0, -1.0)


def test_many_trials_far_from_their_bounds_have_the_normal_interval() -> None:
    values = np.random.default_rng(0).uniform(40, 60, size=10_000)
    low, high = interval_of(estimate(drawn_only(values, (0.0, 100.0))))
    half = 1.96 * values.std() / 100
    # One more observation on the bound, 50 away, moves each end by 50 / 10 000.
    assert (low, high) == pytest.approx((values.mean() - half, values.mean() + half), abs=0.02)


def test_failures_and_noise_each_widen_the_interval_by_hand() -> None:
    # Ten trials of 1 or 0 under two draws; noise takes 0.5 from the first draw's. Parts as above and for two draws.
    drawn, rollout = np.array([1.0] * 3 + [0.0] * 7), np.arange(10) % 2
    figure = figure_of(drawn, (0.0, 1.0), np.where(rollout == 0, 0.5, 0.0), (0.0, 0.5), rollout, noisy=True)
    low, high = interval_of(estimate(figure))
    below, above = 0.3 - beta.ppf(0.025, 3, 8), beta.ppf(0.975, 4, 7) - 0.3
    # One of two draws: B(0.025; 1, 2) and B(0.975; 2, 1) of 0.5.
    least, most = 0.5 * beta.ppf(0.025, 1, 2), 0.5 * beta.ppf(0.975, 2, 1)
    assert figure.mean == pytest.approx(0.05)
    assert (low, high) == pytest.approx((0.05 - math.hypot(below, most - 0.25), 0.05 + math.hypot(above, 0.25 - least)))


@pytest.mark.parametrize(("trials", "draws"), [(1, 1), (5, 1)])
def test_one_sample_carries_no_interval(trials: int, draws: int) -> None:
    found = estimate(taken_only(np.arange(float(trials)), 10.0, draws))
    assert found.ci95 is None
    assert not found.excludes_zero
    assert as_dict(found) == {"mean": -(trials - 1) / 2 + 0.0, "ci95": None}
    assert controlled(taken_only(np.arange(float(trials)), 10.0, draws), 0.0).ci95 is None


def test_an_interval_that_leaves_zero_out_is_distinguishable() -> None:
    assert Estimate(mean=1.0, ci95=(0.1, 1.9)).excludes_zero
    assert Estimate(mean=-1.0, ci95=(-1.9, -0.1)).excludes_zero
    assert not Estimate(mean=1.0, ci95=(0.0, 2.0)).excludes_zero
    assert not Estimate(mean=1.0, ci95=(-0.1, 2.1)).excludes_zero


def test_no_figure_is_written_as_minus_zero() -> None:
    assert str(as_dict(Estimate(mean=-0.0, ci95=(-0.0, -0.0)))) == "{'mean': 0.0, 'ci95': [0.0, 0.0]}"


observations = st.integers(1, 40).flatmap(lambda n: arrays(np.float64, n, elements=st.floats(0, 1)))


@given(observations, st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))
def test_an_interval_moves_and_scales_with_what_it_is_of(values: FloatArray, shift: float, scale: float) -> None:
    def interval(moved: FloatArray, low: float, high: float) -> tuple[float, float]:
        mean = float(moved.mean())
        return bounded_mean(len(moved), mean, float(np.sum((moved - mean) ** 2)), (low, high))

    plain, moved = interval(values, 0, 1), interval(scale * values + shift, shift, scale + shift)
    # Bounds of 1e3 that lie 1e-3 apart leave a relative error of 1e-10 in the spread.
    assert moved == pytest.approx([scale * x + shift for x in plain], abs=1e-6 * scale + 1e-9)
    mirrored = interval(-values, -1, 0)
    assert mirrored == pytest.approx((-plain[1], -plain[0]), abs=1e-9)


@given(observations)
def test_an_interval_lies_within_its_bounds_and_holds_the_mean(values: FloatArray) -> None:
    mean = float(values.mean())
    low, high = bounded_mean(len(values), mean, float(np.sum((values - mean) ** 2)), (0.0, 1.0))
    assert -1e-12 <= low <= mean + 1e-12
    assert mean - 1e-12 <= high <= 1 + 1e-12


def coverage(probability: float, draws: int, trials: int, availability: float, rounds: int) -> float:
    """How often the interval holds the truth where a noise draw costs an available robot 60 of its 100."""
    rng, held = np.random.default_rng([draws, trials]), 0
    rollout = np.arange(trials) % draws
    truth = availability * (100 - 60 * probability)
    for _ in range(rounds):
        dry, there = rng.random(draws) < probability, rng.random(trials) < availability
        figure = figure_of(np.where(there, 100.0, 0.0), (0.0, 100.0) if availability < 1 else (100.0, 100.0),
                           np.where(there & dry[rollout], 60.0, 0.0), (0.0, 60.0 * availability), rollout, noisy=True)
        low, high = interval_of(estimate(figure))
        held += low <= truth <= high
    return held / rounds


@pytest.mark.spread(8)
@pytest.mark.parametrize("probability", [0.0, 1 / 20, 1 / 8, 0.5])
@pytest.mark.parametrize(("draws", "trials"), [(4, 100), (8, 1000), (32, 1000)])
@pytest.mark.parametrize("availability", [0.25, 1.0])
def test_intervals_hold_the_truth_though_bad_draws_are_rare(
        probability: float, draws: int, trials: int, availability: float) -> None:
    # Four standard deviations of a frequency of 0.95 in 800 rounds: 0.03.
    assert coverage(probability, draws, trials, availability, 800) >= 0.93


def test_students_t_would_miss_rare_bad_draws() -> None:
    # The reason for all this: one draw in 8 that costs 60, and t of K - 1 degrees of freedom holds the truth in 67 %.
    rng, held = np.random.default_rng(0), 0
    for _ in range(2000):
        drawn = 100 - 60.0 * (rng.random(8) < 1 / 8)
        held += abs(drawn.mean() - (100 - 60 / 8)) <= student_t.ppf(0.975, 7) * drawn.std(ddof=1) / math.sqrt(8)
    assert held / 2000 < 0.7


def test_intervals_that_are_to_hold_together_are_wider_by_hand() -> None:
    # Three at 95 % together: beta quantiles at 0.05 / 6 to each side.
    found = estimate(drawn_only(np.array([1.0] * 3 + [0.0] * 7), (0.0, 1.0)), comparisons=3)
    assert interval_of(found) == pytest.approx((beta.ppf(0.05 / 6, 3, 8), beta.ppf(1 - 0.05 / 6, 4, 7)))


def test_a_sample_of_maps_has_at_least_students_interval_by_hand() -> None:
    # 1, 2, 3, 6: mean 3, squares 4 + 1 + 0 + 9 = 14, variance 14 / 3, of the mean 14 / 12; t(0.975, 3) = 3.1824.
    half = float(student_t.ppf(0.975, 3)) * math.sqrt(14 / 12)
    assert interval_of(sample_mean([1.0, 2.0, 3.0, 6.0])) == pytest.approx((3 - half, 3 + half))
    # 19 times 0 and once 20: mean 1, t gives 1 - 2.09 to 1 + 2.09; another map may have 20 / sqrt(20) more.
    rare = [0.0] * 19 + [20.0]
    low, high = interval_of(sample_mean(rare))
    half = float(student_t.ppf(0.975, 19)) * 1.0
    assert low == pytest.approx(1 - half)
    assert high == pytest.approx(bounded_mean(20, 1.0, 380.0, (-math.sqrt(20), 20 + math.sqrt(20)))[1])
    assert high > 1 + half


@pytest.mark.parametrize("figures", [[7.0], [0.0, 0.0, 0.0]])
def test_one_map_or_maps_that_agree_leave_open_how_maps_differ(figures: list[float]) -> None:
    assert sample_mean(figures).ci95 is None


def test_an_empty_sample_is_refused() -> None:
    with pytest.raises(ValueError, match="sample is empty"):
        sample_mean([])


def test_the_worst_tenth_by_hand() -> None:
    # 15 trials 1 .. 15: the worst tenth is one and a half of them: (1 + 0.5 x 2) / 1.5.
    assert tail_mean(np.arange(15.0, 0, -1), 0.1) == pytest.approx(2 / 1.5)
    assert tail_mean(np.array([7.0]), 0.1) == 7.0
    found = distribution(np.arange(1.0, 101))
    assert as_dict(found) == {"least": 1.0, "q05": 5.0, "q25": 25.0, "q50": 50.0, "q75": 75.0, "q95": 95.0,
                              "greatest": 100.0, "cvar10": pytest.approx(5.5)}


@pytest.mark.parametrize("process", ["mission", "per_leg"])
def test_draws_come_to_the_closed_form_of_their_process(process: FailureProcess) -> None:
    # POIs of 10, 20 and 30 at 0.8: 48 under mission; 8 + 12.8 + 15.36 = 36.16 per leg.
    incentives, left = [10.0, 20.0, 30.0], np.array([0.0, 10.0, 30.0, 60.0])
    expected = route_value(incentives, 0.8, process)
    assert expected == pytest.approx({"mission": 48.0, "per_leg": 36.16}[process])
    fails = draw_failures(0, ["uv1"], {"uv1": 0.8}, process, trials=100_000, pois=3)[:, 0]
    drawn = left[np.where(fails == NEVER, 3, np.maximum(fails - 1, 0))]
    low, high = interval_of(estimate(drawn_only(drawn, (0.0, 60.0))))
    assert low <= expected <= high
    assert high - low < 0.4


@pytest.mark.parametrize("process", ["mission", "per_leg"])
def test_the_closed_form_shrinks_the_interval_and_keeps_its_coverage(process: FailureProcess) -> None:
    # What is driven: a draw in four loses a tenth of what the failures leave.
    incentives, left = [10.0, 20.0, 30.0], np.array([0.0, 10.0, 30.0, 60.0])
    expected = route_value(incentives, 0.8, process)
    truth, rollout, rng = expected * (1 - 0.1 * 0.25), np.arange(160) % 16, np.random.default_rng(6)
    held, narrower = 0, []
    for seed in range(600):
        fails = draw_failures(seed, ["uv1"], {"uv1": 0.8}, process, trials=160, pois=3)[:, 0]
        drawn = left[np.where(fails == NEVER, 3, np.maximum(fails - 1, 0))]
        taken = drawn * 0.1 * (rng.random(16) < 0.25)[rollout]
        figure = figure_of(drawn, (0.0, 60.0), taken, (0.0, 6.0), rollout, noisy=True)
        low, high = interval_of(controlled(figure, expected))
        held += low <= truth <= high
        narrower.append((high - low) / (2 * (estimate(figure).half_width or 1.0)))
    assert held / 600 >= 0.92  # four standard deviations of 600 rounds: 0.036
    assert np.mean(narrower) < 0.6


def test_without_noise_the_control_is_the_plain_figure() -> None:
    # What a robot loses by the rules depends on the draw, and has no closed form here.
    figure = drawn_only(np.array([0.0, 60.0, 60.0, 60.0]), (0.0, 60.0))
    assert controlled(figure, 48.0) == estimate(figure)


def test_a_difference_that_counts_as_detectable_is_told_from_zero_in_four_runs_of_five() -> None:
    # Value of a POI worth 10 that is reached or not, less a constant, in 400 trials: +-10 and 0 as plans differ.
    rng = np.random.default_rng(5)

    def run(gain: float) -> Estimate:
        values = rng.choice([10.0, 0.0, -10.0], 400, p=[0.2 + gain / 20, 0.6, 0.2 - gain / 20])
        return estimate(drawn_only(values, (-10.0, 10.0)))

    smallest = float(np.mean([detectable(run(0.0)) or 0.0 for _ in range(50)]))
    told = sum(run(smallest).excludes_zero for _ in range(600)) / 600
    assert 0.74 < told < 0.88  # 0.8, with three standard errors


def test_without_an_interval_nothing_is_known_to_be_detectable() -> None:
    assert detectable(Estimate(mean=1.0, ci95=None)) is None
    assert detectable(Estimate(mean=1.0, ci95=(-1.0, 2.0))) == pytest.approx(2 * (1 + 0.8416 / 1.96), abs=1e-3)
