"""When a run that was asked for precision ends."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import sva_bench as sb
from sva_bench.analysis.moments import Figure, figure_of
from sva_bench.analysis.precision import Precision, half_width_pct, precision_of
from sva_bench.analysis.statistics import estimate
from sva_bench.errors import BadInput
from tests.commands_for_tests import sva_bench
from tests.results_for_tests import Interval, summary
from tests.worlds_for_tests import SMALL


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


# Half of the trials earn 40, half nothing; one draw in twenty costs 100 where something was earned.
def look_at(rng: np.random.Generator, most: int) -> list[Figure]:
    """One run: the figure of a difference at each doubling of its draws."""
    there, bad = rng.random(10 * most) < 0.5, rng.random(most) < 0.05
    rollout = np.repeat(np.arange(most), 10)
    drawn, taken = np.where(there, 40.0, 0.0), np.where(there & bad[rollout], 100.0, 0.0)
    return [figure_of(drawn[: 10 * k], (0.0, 40.0), taken[: 10 * k], (0.0, 100.0), rollout[: 10 * k], noisy=True)
            for k in (8, 16, 32, 64, 128, 256) if k <= most]


def test_intervals_of_anytime_hold_at_all_looks_together_and_those_of_fixed_samples_do_not() -> None:
    rng, rounds = np.random.default_rng(18), 400
    truth = 0.5 * (40 - 0.05 * 100)
    asked = Precision(pct=1.0, max_trials=2560, anytime=True)
    held = {"anytime": 0, "fixed": 0}
    for _ in range(rounds):
        rule, holds = asked, {"anytime": True, "fixed": True}
        for figure in look_at(rng, 256):
            for name, comparisons in (("anytime", rule.comparisons), ("fixed", 1)):
                found = estimate(figure, comparisons=comparisons).ci95
                assert found is not None
                holds[name] &= found[0] <= truth <= found[1]
            rule = rule.after_look()
        for name in held:
            held[name] += holds[name]
    assert held["anytime"] / rounds >= 0.95
    assert held["fixed"] / rounds < 0.93


def test_what_may_go_wrong_is_divided_among_looks_without_end() -> None:
    rule, spent = Precision(pct=1.0, max_trials=10, anytime=True), 0.0
    for k in range(1000):
        spent += 1 / rule.comparisons
        assert spent < 1
        assert rule.look == k
        rule = rule.after_look()
    assert spent > 0.99
    assert Precision(pct=1.0, max_trials=10, look=7).comparisons == 1


@pytest.mark.long
def test_a_run_that_stops_at_any_time_says_by_which_intervals(tmp_path: Path) -> None:
    (tmp_path / "w.yaml").write_text(SMALL)
    done = sva_bench("run", "w.yaml", "--trials", 20, "--rollouts", 4, "--fidelity", "kinematic", "--precision", "12%",
                     "--anytime", "--max-trials", 640, "--workers", 1, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    reached = summary["precision"]
    assert set(reached["anytime"]) == {scenario["name"] for scenario in summary["scenarios"]}
    for scenario in summary["scenarios"]:
        low, high = scenario["vss"]["executed"]["ci95"]
        wide = reached["anytime"][scenario["name"]]
        assert wide[0] <= low <= high <= wide[1]
        half = 100 * (wide[1] - wide[0]) / 2 / scenario["plans"]["stochastic"]["executed"]["mean"]
        assert half <= reached["reached_pct"] + 1e-9
    assert reached["met"] == (reached["reached_pct"] <= 12)
    manifest = json.loads(next(tmp_path.glob("runs/*/manifest.json")).read_text())
    assert manifest["options"]["anytime"] is True
    without = sva_bench("run", "w.yaml", "--trials", 20, "--rollouts", 4, "--fidelity", "kinematic", "--precision",
                        "12%", "--max-trials", 640, "--workers", 1, "--json", cwd=tmp_path)
    assert "anytime" not in json.loads(without.stdout)["precision"]
    assert json.loads(without.stdout)["trials"] <= summary["trials"]


def test_anytime_without_a_precision_is_refused(tmp_path: Path) -> None:
    done = sva_bench("run", "w.yaml", "--anytime", cwd=tmp_path)
    assert done.returncode == 2
    assert "--anytime belongs to --precision" in done.stderr
    with pytest.raises(BadInput, match="anytime belongs to precision"):
        sb.run(tmp_path / "w.yaml", anytime=True)
