"""When a run that was asked for precision ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sva_bench.analysis.moments import figure_of
from sva_bench.analysis.precision import Precision, half_width_pct, precision_of
from sva_bench.analysis.statistics import estimate
from sva_bench.errors import BadInput
from tests.cli.test_commands import sva_bench
from tests.results_for_tests import Interval, summary


def pct_of(ci95: Interval | None, mean: float) -> float | None:
    return half_width_pct(summary(ci95, mean).scenarios)


def test_precision_is_per_cent_of_the_stochastic_plan_by_hand() -> None:
    # Half of 4 is 2: 1 % of 200.
    assert pct_of((8.0, 12.0), 200.0) == 1.0
    assert pct_of((0.0, 0.0), 0.0) == 0.0  # plans that are worth nothing, alike in every trial
    assert pct_of((-1.0, 1.0), 0.0) is None
    assert pct_of(None, 200.0) is None


def test_trials_and_noise_draws_double_until_they_are_enough() -> None:
    asked = Precision(pct=1.0, max_trials=500)
    assert asked.next_size(summary((8.0, 12.0), 200.0)) is None
    assert asked.next_size(summary((8.0, 12.1), 200.0)) == (200, 16)
    assert asked.next_size(summary((8.0, 12.1), 200.0, 400, 32)) == (500, 40)
    assert asked.next_size(summary((8.0, 12.1), 200.0, 500, 40)) is None


@pytest.mark.parametrize("text", ["1", "0%", "-1%", "nan%", "inf%", "one%", "%", ""])
def test_what_is_no_precision_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match="such as 1%"):
        precision_of(text, 1000, 100, 8)


def test_a_precision_that_can_never_be_met_is_refused() -> None:
    assert precision_of(" 1.5 %", 1000, 100, 8) == Precision(pct=1.5, max_trials=1000)
    with pytest.raises(BadInput, match="--max-trials 50 is less than --trials 100"):
        precision_of("1%", 50, 100, 8)
    with pytest.raises(BadInput, match="at least 2"):
        precision_of("1%", 1000, 1, 8)


def test_stopping_when_precise_enough_costs_little_coverage() -> None:
    # Ten trials a draw; one draw in four costs an available robot half of its 100.
    # From 8 draws on to 128 at most. A lucky first look ends a run too early, by no more than a few per cent.
    rng, rounds = np.random.default_rng(7), 1000
    truth, held, sizes = 0.75 * (100 - 0.25 * 50), 0, []
    for _ in range(rounds):
        there, dry = rng.random(1280) < 0.75, rng.random(128) < 0.25
        for k in (8, 16, 32, 64, 128):
            kept, rollout = there[: 10 * k], np.repeat(np.arange(k), 10)
            found = estimate(figure_of(np.where(kept, 100.0, 0.0), (0.0, 100.0), np.where(
                kept & dry[rollout], 50.0, 0.0), (0.0, 75.0), rollout, noisy=True))
            if (found.half_width or 0) <= 12:
                break
        assert found.ci95 is not None
        held += found.ci95[0] <= truth <= found.ci95[1]
        sizes.append(k)
    assert held / rounds >= 0.92
    assert min(sizes) < np.median(sizes)


def test_most_trials_without_a_precision_are_refused(tmp_path: Path) -> None:
    done = sva_bench("run", "w.yaml", "--max-trials", 5, cwd=tmp_path)
    assert done.returncode == 2
    assert "--max-trials belongs to --precision" in done.stderr
