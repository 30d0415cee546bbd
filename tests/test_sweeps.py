"""Sweeps: from the command line, from a file, and what is wrong with either."""

from __future__ import annotations

from pathlib import Path

import pytest

from sva_bench.batch.cache import Cache
from sva_bench.batch.estimates import estimates
from sva_bench.batch.folder import begin, settings_in
from sva_bench.batch.grid import grid_of as grid_from
from sva_bench.errors import BadFile, BadInput
from sva_bench.sweeps import Sweep, grid_of, planners_of, seeds_of, sweep_of, varied
from tests.test_cli import sva_bench
from tests.worlds_for_tests import SMALL

SWEEP = """\
format: sva-bench/sweep@1
worlds: ["*.world.yaml"]
seeds: 0-2
trials: 50
fidelity: kinematic
scenarios: [half]
planners: [prmstar]
set:
  robots.uv2.fuel_capacity_s: [50, 60]
"""


def world(folder: Path, name: str = "small") -> Path:
    path = folder / f"{name}.world.yaml"
    path.write_text(SMALL.replace("name: small", f"name: {name}"), encoding="utf-8")
    return path


def test_seeds_are_numbers_and_ranges() -> None:
    assert seeds_of(["3", "0-2", "2,7"]) == (3, 0, 1, 2, 7)


@pytest.mark.parametrize("word", ["", "x", "-1", "5-3", "1-2-3", "0-999999999", "1.5"])
def test_what_is_no_seed_is_refused(word: str) -> None:
    with pytest.raises(BadInput, match="--seed"):
        seeds_of([word])


def test_values_are_those_of_a_world_file() -> None:
    assert varied(["a.b=1,2.5,per_leg", "c=[1, 2],[3, 4]", "d=null"]) == {
        "a.b": [1, 2.5, "per_leg"], "c": [[1, 2], [3, 4]], "d": [None]}


@pytest.mark.parametrize("word", ["a", "a=", "=1", "a=]", "a=1,*x"])
def test_what_sets_nothing_is_refused(word: str) -> None:
    with pytest.raises((BadInput, BadFile), match="--set"):
        varied([word])


def test_planners_are_known_ones() -> None:
    assert planners_of(["rrtconnect", "prmstar", "prmstar"]) == ("prmstar", "rrtconnect")
    with pytest.raises(BadInput, match="prmstar"):
        planners_of(["prm"])


def test_a_sweep_file_is_the_same_as_its_options_and_options_come_first(tmp_path: Path) -> None:
    path = world(tmp_path)
    world(tmp_path, "other")
    (tmp_path / "sweep.yaml").write_text(SWEEP, encoding="utf-8")
    held = grid_of(sweep_of([tmp_path / "sweep.yaml"], Sweep()))
    told = grid_of(sweep_of([path.with_name("*.world.yaml")], Sweep(
        seeds=(0, 1, 2), trials=50, fidelity="kinematic", scenarios=("half",),
        vary=varied(["robots.uv2.fuel_capacity_s=50,60"]))))
    assert held.settings() == told.settings()
    assert len(held.units()) == 2 * 2 * 3
    assert [point.world.robots[1].fuel_capacity_s for point in held.points] == [50, 60, 50, 60]
    assert grid_of(sweep_of([tmp_path / "sweep.yaml"], Sweep(trials=7))).options.trials == 7


def test_settings_give_the_same_grid_again(tmp_path: Path) -> None:
    grid = grid_of(Sweep(worlds=(world(tmp_path),), vary={"noise.wheel_gain_sd": [0.0, 0.02]}))
    (tmp_path / "out").mkdir()
    begin(tmp_path / "out", grid.settings(), resume=False)
    again = grid_from(*settings_in(tmp_path / "out"))
    assert again.settings() == grid.settings()
    assert again.units() == grid.units()


@pytest.mark.parametrize(("key", "told"), [
    ("robots.uv9.fuel_capacity_s", "robots.uv9"), ("robot.uv1.fuel_capacity_s", "did you mean 'robots'"),
    ("robots.uv1.fuel_capacity_s.x", "nothing called"), ("map.shapes.obstacles.7.radius_m", "3 items")])
def test_a_key_that_no_world_has_is_refused_with_the_file(key: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"small\.world\.yaml") as caught:
        grid_of(Sweep(worlds=(world(tmp_path),), vary={key: [1]}))
    assert told in str(caught.value)


def test_noise_that_no_trial_has_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    vary = {"noise.wheel_gain_sd": [0.0, 0.02]}
    grid_of(Sweep(worlds=(world(tmp_path),), vary=vary, fidelity="rollout"))
    assert caplog.messages == []
    grid_of(Sweep(worlds=(world(tmp_path),), vary=vary, fidelity="kinematic"))
    assert caplog.messages == ["noise is varied to no effect: kinematic trials have none"]


def test_a_wrong_sweep_file_is_told_by_line_and_key(tmp_path: Path) -> None:
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP.replace("trials: 50", "trails: 50"), encoding="utf-8")
    with pytest.raises(BadFile, match=r"sweep\.yaml:4: trails"):
        sweep_of([path], Sweep())


def test_trials_are_cut_into_units_that_cover_each_once(tmp_path: Path) -> None:
    grid = grid_of(Sweep(worlds=(world(tmp_path),), trials=25, unit_trials=10))
    assert grid.ranges() == [(0, 10), (10, 10), (20, 5)]
    assert grid.units() == ["small-seed0-t00000000", "small-seed0-t00000010", "small-seed0-t00000020"]


def test_a_dry_run_counts_what_is_left(tmp_path: Path) -> None:
    grid = grid_of(Sweep(worlds=(world(tmp_path),), trials=25, unit_trials=10, seeds=(0, 1)))
    listed = estimates(grid, Cache(folder=tmp_path / "cache"), tmp_path / "out")
    assert [(e.units, e.rows) for e in listed] == [(3, 25 * 2 * 2 * 2)] * 2
    assert listed[0].processor_s > 0
    done = sva_bench("batch", world(tmp_path), "--trials", 25, "--dry-run", "--cache", "cache", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "1 units, 200 rows" in done.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["small.world.yaml"]
