"""Values of a varied key compared: against rows by hand, on a finished batch, over maps, and what cannot be asked."""

from __future__ import annotations

import csv
import functools
import json
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sva_bench.__main__ import run_command_line
from sva_bench.analysis.compared_values import (
    numbers_of,
    other_settings,
    own_value,
    shown_value,
    variant_of,
)
from sva_bench.analysis.over_maps import BatchSummary
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.statistics import sample_mean
from sva_bench.batch.compared import values_of
from sva_bench.batch.folder import refuse_other_settings, settings_in
from sva_bench.batch.grid import Grid, Point
from sva_bench.batch.grid import grid_of as grid_from
from sva_bench.batch.map_samples import over_maps
from sva_bench.batch.schema import PointEntry
from sva_bench.batch.sweep import Sweep, grid_of
from sva_bench.files.records import as_dict, from_dict
from sva_bench.report.variant_names import VariantNames
from sva_bench.study.options import Options
from sva_bench.world.model import World
from tests.pages import read
from tests.worlds_for_tests import SMALL, world_of

KEY = "robots.uv2.fuel_capacity_s"
QUIET = SMALL.replace("noise: {wheel_gain_sd: 0.01}\n", "")


def world(folder: Path, name: str, text: str = QUIET) -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(text.replace("name: small", f"name: {name}"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One map, two seeds, two units each, three values, no noise."""
    folder = tmp_path_factory.mktemp("one")
    assert run_command_line([
        "batch", str(world(folder, "one")), "--trials", "60", "--unit-trials", "40", "--seed", "0-1", "--rollouts", "2",
        "--fidelity", "kinematic", "--set", f"{KEY}=10,60,x2", "--compare", KEY, "--out", str(folder / "out"),
        "--cache", str(folder / "cache"), "--workers", "1", "--csv", "--json"]) == 0
    return folder / "out"


def compared(folder: Path) -> dict[str, Any]:
    (found,) = json.loads((folder / "summary.json").read_text())["compared"]
    return dict(found)


def totals(folder: Path, value: str, scenario: str, planner: str) -> dict[tuple[int, int], float]:
    """Value of the team by seed and trial."""
    found: dict[tuple[int, int], float] = {}
    for path in folder.glob("outcomes-*.parquet"):
        for row in pq.read_table(path).to_pylist():
            if (row["variant"], row["scenario"], row["planner"]) == (f"{KEY}={value}", scenario, planner):
                key = row["seed"], row["trial"]
                found[key] = found.get(key, 0.0) + row["value"]
    return found


def test_differences_are_those_of_the_rows_trial_by_trial(batch: Path) -> None:
    found = compared(batch)
    assert (found["reference"], found["values"], found["sample"]) == ("60", ["10", "60", '"x2"'], "trials")
    for row in found["rows"]:
        own = {plan: totals(batch, row["value"], row["scenario"], plan) for plan in ("stochastic", "deterministic")}
        assert len(own["stochastic"]) == 120
        assert row["executed"]["mean"] == pytest.approx(np.mean(list(own["stochastic"].values())))
        if row["value"] == "60":
            assert "gain" not in row
            continue
        base = {plan: totals(batch, "60", row["scenario"], plan) for plan in own}
        gains = [own["stochastic"][key] - base["stochastic"][key] for key in base["stochastic"]]
        vss = [gain - own["deterministic"][key] + base["deterministic"][key]
               for gain, key in zip(gains, base["stochastic"], strict=True)]
        for figure, by_hand in (("gain", gains), ("vss_gain", vss)):
            assert row[figure]["mean"] == pytest.approx(np.mean(by_hand), abs=1e-9)
            low, high = row[figure]["ci95"]
            adjusted = row[figure]["ci95_adjusted"]
            assert adjusted[0] <= low <= high <= adjusted[1]
            # Without noise the interval is that of a mean of independent trials, or wider, for what was not met.
            assert high - low >= 2 * 1.9 * np.std(by_hand) / np.sqrt(len(by_hand))


def test_what_is_told_apart_is_said_with_its_interval(batch: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command_line(["report", str(batch), "--compare", KEY]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f"{KEY} against 60, over trials" in said
    less = [row for row in compared(batch)["rows"] if row["value"] == "10" and row["gain"]["distinguishable"]]
    assert less, "a sixth of the fuel costs something"
    for row in less:
        assert f"{row['scenario']}: 10 is worth {-row['gain']['mean']:.1f} less than 60" in said


def test_a_finished_batch_answers_without_running_anything_again(batch: Path) -> None:
    before = compared(batch)
    shards = {path: path.stat().st_mtime_ns for path in batch.glob("outcomes-*")}
    assert run_command_line(["report", str(batch)]) == 0
    assert "compared" not in json.loads((batch / "summary.json").read_text())
    assert run_command_line(["report", str(batch), "--compare", KEY]) == 0  # the file's own value is known still
    assert compared(batch) == before
    assert run_command_line(["report", str(batch), "--compare", f"{KEY}=x2"]) == 0
    again = compared(batch)
    assert again["reference"] == '"x2"'
    opposite = {row["scenario"]: row for row in before["rows"] if row["value"] == '"x2"'}
    for row in again["rows"]:
        if row["value"] == "60":
            assert row["gain"]["mean"] == pytest.approx(-opposite[row["scenario"]]["gain"]["mean"], abs=1e-9)
    assert {path: path.stat().st_mtime_ns for path in batch.glob("outcomes-*")} == shards
    assert run_command_line(["report", str(batch), "--compare", KEY]) == 0


@pytest.mark.long
def test_a_sweep_file_compares_like_the_option_which_comes_before_it(batch: Path, tmp_path: Path) -> None:
    world(tmp_path, "one")
    (tmp_path / "sweep.yaml").write_text(
        "format: sva-bench/sweep@1\nworlds: [one.yaml]\ntrials: 60\nunit_trials: 40\nseeds: 0-1\nrollouts: 2\n"
        f"fidelity: kinematic\nset: {{{KEY}: [10, 60, x2]}}\ncompare: [{KEY}=10]\n", encoding="utf-8")
    words = ["batch", str(tmp_path / "sweep.yaml"), "--out", str(tmp_path / "out"), "--cache", str(tmp_path / "cache"),
             "--workers", "1"]
    assert run_command_line(words) == 0
    assert compared(tmp_path / "out")["reference"] == "10"
    assert run_command_line([*words, "--compare", KEY, "--resume"]) == 0
    assert compared(tmp_path / "out") == compared(batch)


@pytest.mark.parametrize(("line", "said"), [
    ("robots.uv2.fuel_capacity", "robots.uv2.fuel_capacity is not varied in this batch; did you mean"),
    (f"[{KEY}=70]", "take one of 10, 60"),
    (f"[{KEY}, {KEY}=60]", "asked for twice"),
    ("7", "expected a list, found 7"),
    ("[]", "at least 1 entry"),
])
def test_what_a_sweep_file_cannot_compare_is_told_with_its_line(
    line: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    world(tmp_path, "one")
    (tmp_path / "sweep.yaml").write_text(
        f"format: sva-bench/sweep@1\nworlds: [one.yaml]\nfidelity: kinematic\nset: {{{KEY}: [10, 60]}}\n"
        f"compare: {line}\n", encoding="utf-8")
    assert run_command_line(["batch", str(tmp_path / "sweep.yaml"), "--dry-run"]) == 2
    told = capsys.readouterr().err
    assert "sweep.yaml:5: compare" in told
    assert said in told


def test_the_page_shows_the_response_and_the_table(batch: Path) -> None:
    page = (batch / "report.html").read_text()
    assert "Which value is worth more?" in page
    assert f"Value over {KEY}: means and 95 % intervals" in page
    assert "Value more than at 60: means and 95 % intervals" in page
    assert page.count("the reference") >= 4


def test_tables_have_a_column_for_each_varied_key_and_the_means_of_both_plans(batch: Path) -> None:
    for name in ("maps.csv", "aggregate.csv", "compared.csv"):
        with (batch / name).open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        assert {row[KEY] for row in rows} == {"10", "60", "x2"}, name
    with (batch / "maps.csv").open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            value = '"x2"' if row[KEY] == "x2" else row[KEY]
            for plan in ("stochastic", "deterministic"):
                by_hand = np.mean(list(totals(batch, value, row["scenario"], plan).values()))
                assert float(row[plan]) == pytest.approx(by_hand)
    with (batch / "compared.csv").open(newline="", encoding="utf-8") as file:
        for line, row in zip(csv.DictReader(file), compared(batch)["rows"], strict=True):
            assert float(line["gain"] or 0) == row.get("gain", {"mean": 0})["mean"]


def test_over_maps_the_maps_are_the_sample_and_other_settings_stay_apart(tmp_path: Path) -> None:
    worlds = [world(tmp_path, "one"), world(tmp_path, "two", QUIET.replace("p4: 40}", "p4: 70}"))]
    assert run_command_line([
        "batch", *map(str, worlds), "--trials", "40", "--fidelity", "kinematic", "--scenario", "half", "--set",
        f"{KEY}=20,60", "--set", "robots.uv1.fuel_capacity_s=30,60", "--compare", KEY, "--out", str(tmp_path / "out"),
        "--cache", str(tmp_path / "cache"), "--workers", "1", "--csv", "--json"]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    found = compared(tmp_path / "out")
    assert found["sample"] == "maps"
    means = {(unit["variant"], unit["world"]): unit["scenarios"][0]["plans"]["stochastic"]["executed"]["mean"]
             for unit in summary["units"]}
    gains = [row for row in found["rows"] if "gain" in row]
    assert [row["others"] for row in gains] == ["robots.uv1.fuel_capacity_s=30", "robots.uv1.fuel_capacity_s=60"]
    for row in gains:
        by_map = [means[f"{KEY}=20; {row['others']}", name] - means[f"{KEY}=60; {row['others']}", name]
                  for name in ("one", "two")]
        single, both = sample_mean(by_map), sample_mean(by_map, comparisons=2)
        assert row["gain"]["mean"] == pytest.approx(single.mean)
        if single.ci95 is not None and both.ci95 is not None:
            assert row["gain"]["ci95"] == pytest.approx(list(single.ci95))
            assert row["gain"]["ci95_adjusted"] == pytest.approx(list(both.ci95))
    # The maps share their draws, which the interval of what a plan collected over them allows for.
    own: dict[str, list[list[Estimate]]] = {unit["variant"]: [] for unit in summary["units"]}
    for unit in summary["units"]:
        executed = unit["scenarios"][0]["plans"]["stochastic"]["executed"]
        own[unit["variant"]].append([Estimate(mean=executed["mean"], ci95=tuple(executed["ci95"]))])
    with (tmp_path / "out" / "aggregate.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        whole, between = over_maps(own[row["variant"]], sure=False), sample_mean(
            [seeds[0].mean for seeds in own[row["variant"]]])
        ends = tuple(float(end) for end in (row["stochastic_low"], row["stochastic_high"]) if end)
        assert ends == (whole.ci95 or ())
        assert whole.ci95 is None or between.ci95 is None or whole.ci95[0] < between.ci95[0]
    assert any(row["stochastic_low"] for row in rows)


def test_an_interval_that_holds_with_others_is_wider_by_the_number_of_them() -> None:
    figures = [1.0, 2.0, 4.0, 3.0, 2.5]
    widths = [sample_mean(figures, comparisons=count).half_width or 0.0 for count in (1, 2, 10)]
    assert widths == sorted(widths)
    # t with 4 degrees of freedom: 2.776 at 97.5 %, 3.495 at 98.75 %; the mean's standard error is 0.5.
    assert 2.776 * 0.5 <= widths[0] <= 1.1 * 2.776 * 0.5  # a little wider, for what may lie beyond those met
    assert 3.495 * 0.5 <= widths[1] <= 1.1 * 3.495 * 0.5


@pytest.mark.parametrize(("words", "said"), [
    (["robots.uv2.fuel_capacity"], "did you mean 'robots.uv2.fuel_capacity_s'"),
    (["nonsense=1"], "nonsense is not varied in this batch"),
    ([f"{KEY}=70"], "take one of 20, 60"),
    ([f"{KEY}="], "take one of 20, 60"),
    ([KEY, f"{KEY}=20"], "asked for twice"),
    (["robots.uv1.fuel_capacity_s"], "one value only, 50"),
])
def test_what_cannot_be_compared_is_refused_before_anything_is_done(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = [part for word in words for part in ("--compare", word)]
    assert run_command_line([
        "batch", str(world(tmp_path, "one")), "--set", f"{KEY}=20,60", "--set", "robots.uv1.fuel_capacity_s=50",
        *asked, "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: --compare ")
    assert said in told
    assert not (tmp_path / "out").exists()


def test_without_varied_keys_there_is_nothing_to_compare(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command_line(["batch", str(world(tmp_path, "one")), "--compare", KEY, "--dry-run"]) == 2
    assert "nothing is varied in this batch; give values by --set" in capsys.readouterr().err


def test_a_run_has_no_values_to_compare(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "manifest.json").write_text('{"format": "sva-bench/manifest@1"}')
    assert run_command_line(["report", str(tmp_path), "--compare", KEY]) == 2
    assert "no folder of a batch" in capsys.readouterr().err


def grid(folder: Path, **vary: list[Any]) -> Grid:
    return grid_of(Sweep(worlds=(world(folder, "one"), world(folder, "two")), vary={
        key.replace("__", "."): values for key, values in vary.items()}))


def test_the_files_own_value_is_the_reference_where_it_is_among_them(tmp_path: Path) -> None:
    assert grid(tmp_path, robots__uv2__fuel_capacity_s=[20, 60]).own == {KEY: "60"}
    assert grid(tmp_path, robots__uv2__fuel_capacity_s=["x0.5", "x1"]).own == {KEY: '"x1"'}
    assert grid(tmp_path, robots__uv2__fuel_capacity_s=[20, 30]).own == {}
    assert own_value([20, 60], [60, 50]) is None  # worlds differ


words = st.one_of(st.integers(), st.floats(allow_nan=False, allow_infinity=False), st.text(), st.none(), st.booleans(),
                  st.lists(st.text(max_size=5), max_size=3), st.dictionaries(st.text(max_size=5), st.integers()))


@given(st.dictionaries(st.from_regex(r"[a-z_]+(\.[a-z_*]+)*", fullmatch=True), words, min_size=1, max_size=4))
def test_settings_are_handed_on_whatever_their_values_hold(values: dict[str, Any]) -> None:
    parts = {key: json.dumps(value) for key, value in values.items()}
    grid_now = grid_with([parts, {**parts, next(iter(parts)): '"another; planner=x"'}])
    assert {key: list(found) for key, found in values_of(grid_now).items()} == {
        key: list(dict.fromkeys([word, *(['"another; planner=x"'] if not number else [])]))
        for number, (key, word) in enumerate(parts.items())}
    stored = json.loads(json.dumps(as_dict(grid_now.points[0].entry())))
    assert from_dict(PointEntry, stored).settings == parts
    for key in parts:
        assert other_settings(parts, key) == {k: v for k, v in parts.items() if k != key}


@functools.cache
def small_world() -> World:
    with tempfile.TemporaryDirectory() as folder:
        return world_of(Path(folder))


def grid_with(settings: Sequence[dict[str, str]]) -> Grid:
    """A grid of these variants of one world."""
    return Grid(points=[Point(world=small_world(), planner="prmstar", variant=variant_of(each), settings=each)
                        for each in settings], seeds=[0], options=Options(trials=1), unit_trials=1)


def test_a_folder_of_a_version_that_named_its_variants_only_is_reported_and_says_why_it_compares_nothing(
    batch: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    older = Path(shutil.copytree(batch, tmp_path / "older"))
    manifest = json.loads((older / "manifest.json").read_text())
    del manifest["command"]
    for point in manifest["settings"]["points"].values():
        del point["settings"]
    (older / "manifest.json").write_text(json.dumps(manifest))
    assert run_command_line(["report", str(older)]) == 0
    assert f"{KEY}=10" in read(older / "report.html")
    assert run_command_line(["report", str(older), "--compare", KEY]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "doesn't say the varied settings one by one; run the batch again" in said
    # Its variants are the same by their names, so it can be gone on with.
    refuse_other_settings(older, grid_from(*settings_in(batch)).settings())


def test_a_page_names_variants_by_their_values_and_says_the_key_once(batch: Path) -> None:
    page = read(batch / "report.html")
    assert f"VSS over maps, by {KEY}" in page
    assert f"{KEY}=" not in page.split("How to get the same again")[0]
    assert "one (x2)" in page  # a map under a variant
    assert "How to get the same again" in page
    assert "2 seeds: 0, 1." in page


@pytest.mark.parametrize(("settings", "names"), [
    ([{"a.k": "1"}, {"a.k": '"x2"'}], ["1", "x2"]),
    ([{"a.k": "1", "margin": "0.1"}, {"a.k": "2", "margin": "0.1"}], ["k 1, margin 0.1", "k 2, margin 0.1"]),
    ([{"a.k": "1", "b.k": "2"}, {"a.k": "1", "b.k": "3"}], ["a.k 1, b.k 2", "a.k 1, b.k 3"])])
def test_of_several_keys_as_much_is_said_as_tells_them_apart(settings: list[dict[str, str]], names: list[str]) -> None:
    found = VariantNames(BatchSummary(
        trials=1, fidelity="kinematic", worlds=("w",), seeds=(0,), variants=tuple(map(variant_of, settings)), units=(),
        maps=(), aggregate=(), failed=(), settings={variant_of(each): each for each in settings}))
    assert [found.short(variant_of(each)) for each in settings] == names


def test_values_that_are_numbers_have_their_places_on_an_axis_and_others_have_not() -> None:
    assert numbers_of(("200", "2.5e2")) == {"200": 200.0, "2.5e2": 250.0}
    assert numbers_of(('"x0.8"', '"x1.2"')) == {'"x0.8"': 0.8, '"x1.2"': 1.2}
    assert numbers_of(("200", '"x1.2"')) is None
    assert numbers_of(('"turtlebot2"', '"jackal"')) is None
    assert shown_value('"turtlebot2"') == "turtlebot2"
    assert shown_value("planner") == "planner"
