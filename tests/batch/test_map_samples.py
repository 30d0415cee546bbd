"""Intervals over maps: by hand, and whether they hold the truth where all maps meet the same draws."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sva_bench.analysis.moments import figure_of
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.statistics import estimate, sample_mean
from sva_bench.arrays import FloatArray
from sva_bench.batch.map_samples import in_per_cent, over_maps, percentage_over_maps

BETWEEN = sample_mean([1.0, 3.0, 8.0])


def known(mean: float, below: float, above: float) -> Estimate:
    return Estimate(mean=mean, ci95=(mean - below, mean + above))


def halves(found: Estimate) -> tuple[float, float]:
    assert found.ci95 is not None
    return found.mean - found.ci95[0], found.ci95[1] - found.mean


def test_the_maps_own_intervals_widen_that_of_how_they_differ_by_hand() -> None:
    # Own halves: of two seeds, 3 and 4 below are sqrt(9 + 16) / 2 = 2.5; over the maps (2.5 + 1 + 5.5) / 3 = 3 below.
    found = over_maps([[known(0.0, 3.0, 0.0), known(2.0, 4.0, 0.0)], [known(3.0, 1.0, 0.0)], [known(8.0, 5.5, 12.0)]],
                      sure=False)
    below, above = halves(BETWEEN)
    assert found.mean == 4.0
    np.testing.assert_allclose(halves(found), [math.hypot(below, 3.0), math.hypot(above, 4.0)])


@pytest.mark.parametrize("own", [None, (1.0, 1.0)])
def test_what_is_unknown_or_certain_of_a_map_leaves_the_interval_of_how_maps_differ(
        own: tuple[float, float] | None) -> None:
    alone = Estimate(mean=1.0, ci95=own)
    assert over_maps([[alone], [known(3.0, 0.0, 0.0)], [known(8.0, 0.0, 0.0)]], sure=False) == BETWEEN


def test_maps_that_agree_tell_nothing_unless_they_must() -> None:
    alike = [[known(2.0, 1.0, 1.0)], [known(2.0, 1.0, 1.0)]]
    assert over_maps(alike, sure=False).ci95 is None
    assert over_maps(alike, sure=True).ci95 == (2.0, 2.0)
    assert over_maps(alike[:1], sure=True).ci95 is None


def test_percentages_are_of_the_maps_that_have_one() -> None:
    value = known(5.0, 1.0, 2.0)
    share = in_per_cent(value, 10.0, 50.0)
    assert share == known(10.0, 2.0, 4.0)
    assert in_per_cent(value, None, 50.0) is None
    assert in_per_cent(value, 10.0, 0.0) is None
    assert in_per_cent(Estimate(mean=5.0, ci95=None), 10.0, 50.0) == Estimate(mean=10.0, ci95=None)
    found = percentage_over_maps([[share], [None, known(20.0, 0.0, 0.0)], [None]], sure=False)
    assert (found.mean, found.maps) == (15.0, 2)
    assert percentage_over_maps([[None]], sure=False).mean is None


def trials_of(shares: FloatArray, trials: int, rng: np.random.Generator) -> FloatArray:
    """Differences of maps in trials whose failures all maps share, shape (maps, trials)."""
    drawn: FloatArray = shares @ (rng.random((2, trials)) < np.array([[0.75], [0.6]]))
    return drawn


@pytest.mark.spread(1)
@pytest.mark.parametrize("trials", [40, 400])
def test_intervals_over_maps_hold_the_truth_though_all_maps_meet_the_same_draws(trials: int) -> None:
    rng, rounds, maps = np.random.default_rng(trials), 300, 12
    truth = np.array([30.0, -40.0]) @ np.array([0.75, 0.6])
    held = plain = 0
    for _ in range(rounds):
        # What both plans have on each of two robots differs from map to map, and alike in kind.
        met = trials_of(np.array([30.0, -40.0]) + rng.normal(scale=1.0, size=(maps, 2)), trials, rng)
        own = [estimate(figure_of(each, (-100.0, 100.0), np.zeros(trials), (0.0, 0.0), np.zeros(trials, dtype=np.int64),
                                  noisy=False)) for each in met]
        found, before = over_maps([[each] for each in own], sure=False), sample_mean([each.mean for each in own])
        assert found.ci95 is not None
        assert before.ci95 is not None
        held += found.ci95[0] <= truth <= found.ci95[1]
        plain += before.ci95[0] <= truth <= before.ci95[1]
    assert held >= 0.94 * rounds
    assert plain < 0.85 * rounds  # of maps alone: what chance did to all alike is missing
