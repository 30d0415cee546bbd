"""Batches and foreign plans, as a user runs them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sva_bench.analysis.over_maps import Percentage
from sva_bench.batch.aggregates import aggregate
from sva_bench.files.records import as_dict
from tests.cli.test_commands import world_file
from tests.commands_for_tests import sva_bench
from tests.results_for_tests import unit
from tests.worlds_for_tests import SMALL

QUICK = ("--trials", 60, "--rollouts", 2, "--fidelity", "kinematic")


def two_worlds(folder: Path) -> tuple[Path, Path]:
    other = folder / "other.yaml"
    other.write_text(SMALL.replace("name: small", "name: other").replace("p3: {at_m: [5.2, 5.2]}",
                                                                         "p3: {at_m: [5.2, 2.0]}"), encoding="utf-8")
    return world_file(folder), other


def rows_of(folder: Path) -> pa.Table:
    """All rows of a batch, in one order."""
    tables = [pq.read_table(path).replace_schema_metadata() for path in sorted(folder.glob("outcomes-*.parquet"))]
    return pa.concat_tables(tables).sort_by([(key, "ascending") for key in (
        "world", "seed", "scenario", "planner", "trial", "robot")])


def test_a_batch_gives_the_same_rows_on_one_worker_and_on_two_and_resumes(tmp_path: Path) -> None:
    small, other = two_worlds(tmp_path)
    command = ("batch", small, other, "--seed", 0, "--seed", 1, *QUICK, "--cache", tmp_path / "cache")
    one = sva_bench(*command, "--out", "one", "--workers", 1, "--json", cwd=tmp_path)
    assert one.returncode == 0, one.stderr
    two = sva_bench(*command, "--out", "two", "--workers", 2, "--json", cwd=tmp_path)
    assert two.returncode == 0, two.stderr
    assert rows_of(tmp_path / "one").equals(rows_of(tmp_path / "two"))
    assert one.stdout == two.stdout
    assert {path.name for path in (tmp_path / "one").iterdir()} == {
        "manifest.json", "summary.json", "report.html",
        *(f"outcomes-{w}-seed{s}.parquet" for w in ("small", "other") for s in (0, 1))}
    assert rows_of(tmp_path / "one").num_rows == 2 * 2 * 2 * 2 * 60 * 2

    # As after a crash: a shard and the summary are missing, and a draft is left over.
    (tmp_path / "two" / "outcomes-other-seed1.parquet").unlink()
    (tmp_path / "two" / "summary.json").unlink()
    (tmp_path / "two" / "outcomes-other-seed1.parquet.tmp").write_bytes(b"half")
    kept = (tmp_path / "two" / "outcomes-small-seed0.parquet").stat().st_mtime_ns
    again = sva_bench(*command, "--out", "two", "--resume", "--json", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert again.stdout == one.stdout
    assert rows_of(tmp_path / "two").equals(rows_of(tmp_path / "one"))
    assert (tmp_path / "two" / "outcomes-small-seed0.parquet").stat().st_mtime_ns == kept
    assert not list((tmp_path / "two").glob("*.tmp"))

    refused = sva_bench(*command, "--out", "two", cwd=tmp_path)
    assert refused.returncode == 2
    assert "--resume" in refused.stderr
    differs = sva_bench(*command, "--trials", 61, "--out", "two", "--resume", cwd=tmp_path)
    assert differs.returncode == 2
    assert "options.trials" in differs.stderr


@pytest.mark.parametrize("fidelity", ["kinematic", pytest.param("rollout", marks=pytest.mark.long)])
def test_a_batch_has_the_rows_of_a_run_and_its_columns(tmp_path: Path, fidelity: str) -> None:
    told = (world_file(tmp_path), "--seed", 3, "--trials", 50, "--rollouts", 3, "--fidelity", fidelity)
    run = sva_bench("run", *told, "--out", "run", "--workers", 1, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    # Units of 20 trials: the last has 10, and none of them begins with noise draw 0 but the first.
    batch = sva_bench("batch", *told, "--unit-trials", 20, "--cache", tmp_path / "cache", "--out", "batch", "--workers",
                      1, cwd=tmp_path)
    assert batch.returncode == 0, batch.stderr
    (path,) = (tmp_path / "run").glob("*/outcomes.parquet")
    mine = pq.read_table(path)
    shard = pq.read_schema(next((tmp_path / "batch").glob("outcomes-*.parquet")))
    assert [shard.field(name) for name in mine.schema.names] == list(mine.schema)
    assert set(shard.names) - set(mine.schema.names) == {"world", "seed", "variant"}
    order = [(key, "ascending") for key in ("scenario", "planner", "trial", "robot")]
    theirs = rows_of(tmp_path / "batch").select(mine.schema.names).sort_by(order)
    assert theirs.equals(mine.replace_schema_metadata().sort_by(order))


def test_worlds_of_one_name_are_refused(tmp_path: Path) -> None:
    small = world_file(tmp_path)
    done = sva_bench("batch", small, small, *QUICK, "--cache", tmp_path / "cache", cwd=tmp_path)
    assert done.returncode == 2
    assert "this world is given twice" in done.stderr


def test_vss_over_maps_takes_maps_as_the_sample() -> None:
    # Map a: mean of its seeds 1 and 3 is 2; map b: 6. Over maps: 4, sd sqrt(8), half-width 12.706 sqrt(8) / sqrt(2).
    (row,) = aggregate([unit("a", 1.0), unit("a", 3.0), unit("b", 6.0)])
    assert row.maps == 2
    assert row.vss.mean == 4.0
    np.testing.assert_allclose(row.vss.ci95 or (), [4 - 25.412, 4 + 25.412], atol=1e-3)
    assert row.vss_pct == Percentage(mean=None, ci95=None, maps=0)


def test_percentages_give_their_number_of_maps_where_one_collects_nothing() -> None:
    (row,) = aggregate([unit("a", 1.0, 9.5), unit("b", 1.0, None)])
    assert (row.maps, as_dict(row.vss_pct)) == (2, {"mean": 9.5, "ci95": None, "maps": 1})
    (row,) = aggregate([unit("a", 1.0, 9.5), unit("b", 1.0, 9.5)])
    assert as_dict(row.vss_pct) == {"mean": 9.5, "ci95": None}  # maps that agree don't tell how maps differ
    (row,) = aggregate([unit("a", 1.0, 0.0, 1.0), unit("b", 1.0, 0.0, 1.0)])
    assert as_dict(row.vss_pct) == {"mean": 0.0, "ci95": [0.0, 0.0]}  # no robot fails: both plans are the same anywhere


def plan_file(folder: Path, name: str, routes: dict[str, list[str]]) -> Path:
    path = folder / name
    path.write_text(json.dumps({"format": "sva-bench/plan@1", "routes": routes}), encoding="utf-8")
    return path


def test_plans_by_hand_are_executed_and_compared(tmp_path: Path) -> None:
    good = plan_file(tmp_path, "good.json", {"uv1": ["base", "p4", "base"], "uv2": ["base", "p1", "base"]})
    less = plan_file(tmp_path, "less.json", {"uv1": ["base", "p1", "base"], "uv2": []})
    done = sva_bench("execute", world_file(tmp_path), good, less, *QUICK, "--scenario", "half", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (scenario,) = json.loads(done.stdout)["scenarios"]
    assert "vss" not in scenario
    assert scenario["plans"]["good"]["expected"] == 40 + 0.5 * 40
    assert scenario["plans"]["less"]["expected"] == 10
    (pair,) = scenario["comparisons"]
    assert (pair["a"], pair["b"], pair["distinguishable"]) == ("good", "less", True)
    difference = scenario["plans"]["good"]["executed"]["mean"] - scenario["plans"]["less"]["executed"]["mean"]
    assert pair["mean"] == pytest.approx(difference)


@pytest.mark.long
def test_a_plan_that_breaks_its_fuel_is_refused_or_seen_running_dry(tmp_path: Path) -> None:
    world = world_file(tmp_path, SMALL.replace("fuel_capacity_s: 60", "fuel_capacity_s: 20"))
    dry = plan_file(tmp_path, "dry.json", {"uv1": ["base", "p1", "p4", "p3", "p2", "base"]})
    refused = sva_bench("execute", world, dry, *QUICK, cwd=tmp_path)
    assert refused.returncode == 3
    assert "dry.json" in refused.stderr
    assert "20.000 s" in refused.stderr
    assert not (tmp_path / "runs").exists()
    seen = sva_bench("execute", world, dry, *QUICK, "--allow-infeasible", "--json", cwd=tmp_path)
    assert seen.returncode == 0, seen.stderr
    for scenario in json.loads(seen.stdout)["scenarios"]:
        plan = scenario["plans"]["dry"]
        assert plan["ends"]["out_of_fuel"] == 60
        assert plan["ledger"]["out_of_fuel"] < 0
        assert plan["executed"]["mean"] < plan["expected"]


@pytest.mark.parametrize("routes", [
    {"uv1": ["base", "p1", "p1", "base"]}, {"uv1": ["base", "p1", "base", "p2", "base"]}, {"uv1": ["p1", "base"]},
    {"uv1": ["base", "p1", "base"], "uv2": ["base", "p1", "base"]}, {"uv1": ["base", "p9", "base"]},
    {"uv9": ["base", "p1", "base"]}])
def test_a_plan_that_cannot_be_driven_is_refused_even_if_infeasible_ones_are_allowed(
    routes: dict[str, list[str]], tmp_path: Path
) -> None:
    done = sva_bench("execute", world_file(tmp_path), plan_file(tmp_path, "odd.json", routes), "--allow-infeasible",
                     cwd=tmp_path)
    assert done.returncode in (2, 3)
    assert "odd.json" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "runs").exists()


@pytest.mark.long
@pytest.mark.parametrize("process", ["mission", "per_leg"])
def test_physics_trial_by_trial_is_what_composed_rollouts_cut_off_come_to(process: str, tmp_path: Path) -> None:
    tables = []
    for fidelity in ("rollout", "physics"):
        done = sva_bench("run", world_file(tmp_path), "--trials", 6, "--rollouts", 2, "--fidelity", fidelity,
                         "--execute-failure", process, "--scenario", "half", "--out", fidelity, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        (run,) = (tmp_path / fidelity).iterdir()
        tables.append(pq.read_table(run / "outcomes.parquet").drop_columns(["fidelity"]))
    times = ["end_time_s", "fuel_used_s"]
    assert tables[0].drop_columns(times).equals(tables[1].drop_columns(times))
    for name in times:  # composed routes are within 0.3 % of whole ones, legs within 2 %
        np.testing.assert_allclose(tables[0][name], tables[1][name], rtol=0.01, atol=0.05)
