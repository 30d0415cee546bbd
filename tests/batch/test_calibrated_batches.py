"""Calibrated plans in batches: those of a run, from a cache or not, by the command line or a sweep file."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import sva_bench as sb
from sva_bench.__main__ import run_command_line
from sva_bench.analysis.calibration import Calibration, PlanJudged, Tried
from sva_bench.analysis.over_maps import UnitSummary
from sva_bench.analysis.results import Estimate, Share
from sva_bench.batch.aggregates import map_rows
from sva_bench.batch.sweep import Sweep, grid_of, sweep_of
from sva_bench.errors import BadFile
from sva_bench.report.calibration_over_maps import calibrated_over_maps
from tests.results_for_tests import figures, unit
from tests.worlds_for_tests import SMALL

TIGHT = SMALL.replace("fuel_capacity_s: 60", "fuel_capacity_s: 30").replace("mission_limit_s: 120",
                                                                          "mission_limit_s: 45")
NOISY = TIGHT.replace("noise: {wheel_gain_sd: 0.01}", "noise: {speed_gain_sd: 0.05, capacity_sd: 0.05}")
QUICK = ("--trials", "30", "--rollouts", "3", "--fidelity", "kinematic", "--unit-trials", "15", "--workers", "1")


def summary_in(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "summary.json").read_text())
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("batch")
    (place / "world.yaml").write_text(NOISY, encoding="utf-8")
    assert run_command_line(["batch", str(place / "world.yaml"), *QUICK, "--seed", "0-1", "--calibrate", "5%", "--csv",
                             "--cache", str(place / "cache"), "--out", str(place / "done")]) == 0
    return place


@pytest.mark.long
def test_a_unit_has_the_calibrated_plan_of_a_run(folder: Path) -> None:
    run = sb.run(folder / "world.yaml", trials=30, rollouts=3, fidelity="kinematic", calibrate=5, workers=1)
    alone = {scenario["name"]: scenario for scenario in run.as_dict()["scenarios"]}
    for scenario in summary_in(folder / "done")["units"][0]["scenarios"]:
        assert list(scenario["plans"]) == ["stochastic", "deterministic", "calibrated"]
        assert scenario["calibration"] == alone[scenario["name"]]["calibration"]
        executed = scenario["plans"]["calibrated"]["executed"]["mean"]
        assert executed == pytest.approx(alone[scenario["name"]]["plans"]["calibrated"]["executed"]["mean"])


@pytest.mark.long
def test_seeds_share_the_plan_and_the_cache_has_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    units = summary_in(folder / "done")["units"]
    assert [s["calibration"] for s in units[0]["scenarios"]] == [s["calibration"] for s in units[1]["scenarios"]]
    assert len(list((folder / "cache").glob("*/plans/*/*"))) == 1
    before = {path: path.stat().st_mtime_ns for path in (folder / "cache").glob("*/plans/*/*")}
    assert run_command_line(["batch", str(folder / "world.yaml"), *QUICK, "--seed", "0-1", "--calibrate", "5%",
                             "--cache", str(folder / "cache"), "--out", str(folder / "again")]) == 0
    assert {path: path.stat().st_mtime_ns for path in (folder / "cache").glob("*/plans/*/*")} == before
    told = capsys.readouterr().out
    assert "Plans were calibrated for at most 5 % of missions" in told
    assert run_command_line(["batch", "status", str(folder / "done")]) == 0
    lines = [line for line in told.splitlines() if line.startswith(("Plans were calibrated", "half: "))]
    assert len(lines) == 2
    assert set(lines) <= set(capsys.readouterr().out.splitlines())
    assert (folder / "again" / "summary.json").read_bytes() == (folder / "done" / "summary.json").read_bytes()


@pytest.mark.long
def test_table_and_page_show_it(folder: Path) -> None:
    with (folder / "done" / "calibration.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["seed"] for row in rows} == {"0", "1"}
    assert {row["draws_for"] for row in rows} == {"choice", "report"}
    assert "Calibrated plans" in (folder / "done" / "report.html").read_text(encoding="utf-8")


@pytest.mark.long
def test_a_sweep_file_says_it_as_the_option_does(folder: Path) -> None:
    sweep = folder / "sweep.yaml"
    lines = f"format: sva-bench/sweep@1\nworlds: [{folder / 'world.yaml'}]\n"
    sweep.write_text(f"{lines}calibrate: 5%\n", encoding="utf-8")
    assert grid_of(sweep_of([sweep], Sweep())).options.calibrate == 0.05
    assert grid_of(sweep_of([sweep], Sweep(calibrate="best"))).options.calibrate == "best"
    sweep.write_text(f"{lines}calibrate: most\n", encoding="utf-8")
    with pytest.raises(BadFile, match=":3: calibrate: most: expected the share"):
        sweep_of([sweep], Sweep())


@pytest.mark.long
def test_an_option_that_is_no_share_ends_with_2(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("run", "batch"):
        assert run_command_line([command, str(folder / "world.yaml"), "--calibrate", "1"]) == 2
        assert "--calibrate 1: expected the share of missions" in capsys.readouterr().err


def calibrated(world: str, promised: float, *, reached: bool = True, share: float | None = 0.01) -> UnitSummary:
    """A map on which the nominal plan promises 100."""
    bad = Share(share=0.0, ci95=(0.0, 0.004))
    nominal, chosen = (PlanJudged(promised=value, executed=value, bad=bad) for value in (100.0, promised))
    found = Calibration(
        share=share, quantile=0.9, factor=1.0, **vars(chosen), nominal=nominal, reached=reached, draws=1000,
        curve=(Tried(**vars(chosen), quantile=0.9, factor=1.0, draws=1000),))
    whole = unit(world, 100.0)
    return replace(whole, scenarios=tuple(replace(
        scenario, calibration=found, plans={**scenario.plans, "calibrated": figures(promised)})
        for scenario in whole.scenarios))


def test_a_line_of_each_scenario_says_where_the_share_is_reached_and_the_price() -> None:
    # The price is of worlds that reach the share: (20 + 10) / 2; a seed more of one counts for nothing.
    assert calibrated_over_maps([calibrated("a", 80.0), calibrated("b", 90.0), calibrated("b", 90.0),
                                 calibrated("c", 10.0, reached=False)]) == [
        "Plans were calibrated for at most 1 % of missions that go wrong though nobody fails:",
        "S: reached in 2 of 3 worlds, where plans promise 15 % less than nominal ones on average. Not reached in c: "
        "the plans shown there are not calibrated."]
    _, line = calibrated_over_maps([calibrated("a", 80.0, reached=False)])
    assert "reached in 0 of 1 world. Not reached in a" in line
    assert calibrated_over_maps([calibrated("a", 100.0, share=None)]) == [
        "Plans were calibrated for the greatest executed value:",
        "S: 1 world, where plans promise as much as nominal ones."]
    assert calibrated_over_maps([unit("a", 100.0)]) == []


def test_variants_stand_map_by_map_in_the_order_of_the_grid() -> None:
    # Of words, x=100 would come before x=30, and differ from the table over maps.
    units = [replace(unit(world, 1.0), variant=variant) for world in ("b", "a") for variant in ("x=30", "x=100", "x=5")]
    rows = map_rows(units, {(one.variant, "S", one.world): Estimate(mean=1.0, ci95=None) for one in units})
    assert [(row.world, row.variant) for row in rows] == [(one.world, one.variant) for one in units]
