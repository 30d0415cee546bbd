"""Small inputs that ask for unbounded work or memory are refused at once, by name and number."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.batch.sweep import Sweep, grid_of, seeds_of, sweep_of
from sva_bench.errors import BadFile, BadInput
from sva_bench.files.documents import read_json
from sva_bench.files.patterns import MOST_LOOKED_AT, matching
from sva_bench.files.read_back import MOST_BYTES
from sva_bench.mission.instance_file import MOST_SITES, MOST_VEHICLES, read_instance
from sva_bench.mission.plan_file import MOST_STOPS, read_plan
from sva_bench.storage.tables import LEGS, OUTCOMES, pieces_of, write_table
from tests.worlds_for_tests import SMALL

TINY: dict[str, Any] = {
    "format": "sva-bench/instance@1", "name": "tiny", "sites": ["base", "p1"], "base": "base",
    "fuel_s": [[0, 1], [1, 0]],
    "vehicles": [{"name": "uv1", "fuel_capacity_s": 9, "mission_limit_s": 9, "availability": 1}]}


@pytest.fixture
def world(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(SMALL, encoding="utf-8")
    return path


def told(arguments: list[object], capsys: pytest.CaptureFixture[str]) -> str:
    """The one error of a command."""
    assert run_command_line(list(map(str, arguments))) == 2
    said = capsys.readouterr().err
    assert said.count("error") + said.count("Error") == 1, said
    return " ".join(said.replace("│", " ").split())


def test_a_sweep_of_a_hundred_million_variants_is_refused(
    world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    values = list(range(1, 11))
    (tmp_path / "sweep.yaml").write_text(json.dumps({
        "format": "sva-bench/sweep@1", "worlds": [world.name],
        "set": {f"robots.uv{k}.{key}": values for k in (1, 2) for key in
                ("fuel_capacity_s", "mission_limit_s", "incentives.p1", "incentives.p2")}}))
    assert "100000000 worlds, variants and planners in all; a batch has 10000 at most" in told(
        ["batch", tmp_path / "sweep.yaml", "--dry-run"], capsys)


@pytest.mark.parametrize(("options", "units"), [
    (["--seed", "0-99999", "--trials", 10_000_000, "--unit-trials", 1], 10**12),
    (["--seed", "0-99999", "--unit-trials", 10], 100_000 * 100), (["--trials", 10_000_000, "--unit-trials", 1], 10**7)])
def test_a_grid_of_too_many_units_is_refused(
    options: list[object], units: int, world: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert f"{units} units" in told(["batch", world, *options, "--dry-run"], capsys)


def test_seeds_are_bounded_in_number_and_size(world: Path) -> None:
    with pytest.raises(BadInput, match="more than 100000 seeds in all"):
        seeds_of(["0-99999,200000-299999"])
    world.with_name("s.yaml").write_text(json.dumps(
        {"format": "sva-bench/sweep@1", "worlds": [world.name], "seeds": [2**63]}))
    with pytest.raises(BadFile, match="seeds"):
        sweep_of([world.with_name("s.yaml")], Sweep())


@pytest.mark.parametrize("pattern", ["/**", "/**/*.yaml"])
def test_a_pattern_that_would_visit_too_many_entries_is_refused(
    pattern: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sva_bench.files.patterns.MOST_LOOKED_AT", 2000)  # the machine of a test may be small
    with pytest.raises(BadInput, match="narrow the pattern"):
        matching(Path(pattern), 1000)
    assert MOST_LOOKED_AT <= 1_000_000


def test_patterns_match_as_those_of_a_shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a.yaml", "b.yml", ".hidden.yaml", "sub/c.yaml", "sub/deep/d.yaml", ".sub/e.yaml", "[x].yaml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "link").symlink_to(tmp_path)  # a circle
    monkeypatch.chdir(tmp_path)

    def found(pattern: str) -> list[str]:
        return [str(path) for path in matching(Path(pattern), 100)]

    assert found("*.yaml") == ["[x].yaml", "a.yaml"]
    assert found("?.y*ml") == ["a.yaml", "b.yml"]
    assert found("**/*.yaml") == ["[x].yaml", "a.yaml", "sub/c.yaml", "sub/deep/d.yaml"]
    assert found("sub/*/*.yaml") == ["sub/deep/d.yaml"]
    assert found(".*.yaml") == [".hidden.yaml"]
    assert found("[[]x].yaml") == ["[x].yaml"]
    assert found(f"{tmp_path}/*/c.yaml") == [f"{tmp_path}/sub/c.yaml"]
    assert found("nothing*/x") == []


def test_ten_thousand_variants_have_ten_thousand_names(world: Path) -> None:
    values = {"robots.uv1.fuel_capacity_s": list(range(50, 60)), "robots.uv2.fuel_capacity_s": list(range(50, 60))}
    grid = grid_of(Sweep(worlds=(world,), vary=values))
    assert len({point.name for point in grid.points}) == 100
    assert len({id(point.world.obstacles) for point in grid.points}) == 1  # in memory once


@pytest.mark.parametrize(("change", "said"), [
    ({"sites": [f"s{k}" for k in range(100_000)]}, "sites: 100000 entries; at most 2000 are read"),
    ({"stations": ["s"] * 5000}, "stations: 5000 entries"), ({"stop_s": [0] * 5000}, "stop_s: 5000 entries"),
    ({"fuel_s": [[0] * 1_000_000]}, "fuel_s: a row or a column of 1000000 entries"),
    ({"fuel_s": [[]] * 5000}, "fuel_s: a row or a column of 5000 entries"),
    pytest.param({"fuel_s": [[0] * 2000] * 2000, "vehicles": [{"fuel_s": [[0] * 2000] * 2001}]}, "2001 entries",
                 marks=pytest.mark.long),
    pytest.param({"vehicles": [{"fuel_s": [[0] * 2000] * 2000}] * 3}, "fuel_s: 12000004 costs in all; at most 8000000",
                 marks=pytest.mark.long),
    ({"vehicles": [{}] * 100_000}, f"vehicles: 100000 entries; at most {MOST_VEHICLES}"),
    ({"vehicles": [{"incentives": {f"p{k}": 1 for k in range(MOST_SITES + 1)}}]}, r"vehicles\[0\].incentives: 2001"),
    ({"joint_availability": [{}] * 20_000}, "joint_availability: 20000 entries; at most 10000"),
    ({"joint_availability": [{"available": ["uv1"] * 900}]}, r"joint_availability\[0\].available: 900 entries")])
def test_an_instance_beyond_its_bounds_is_refused(change: dict[str, Any], said: str, tmp_path: Path) -> None:
    path = tmp_path / "i.json"
    path.write_text(json.dumps(TINY | change))
    with pytest.raises(BadFile, match=said):
        read_instance(path)


@pytest.mark.parametrize(("routes", "said"), [
    ({"uv1": ["base"] * 100_000}, f"routes.uv1: 100000 stops; at most {MOST_STOPS} are driven"),
    ({f"v{k}": [] for k in range(1000)}, f"1000 routes; at most {MOST_VEHICLES} are read")])
def test_a_plan_beyond_its_bounds_is_refused(routes: dict[str, Any], said: str, tmp_path: Path) -> None:
    (tmp_path / "i.json").write_text(json.dumps(TINY))
    (tmp_path / "p.json").write_text(json.dumps({"format": "sva-bench/plan@1", "routes": routes}))
    with pytest.raises(BadFile, match=said):
        read_plan(tmp_path / "p.json", read_instance(tmp_path / "i.json"))


def test_a_document_that_is_too_long_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "manifest.json").open("wb") as file:
        file.truncate(MOST_BYTES + 1)  # no blocks of the disk are taken
    with pytest.raises(BadFile, match=f"{MOST_BYTES + 1} bytes; at most {MOST_BYTES} are read"):
        read_json(tmp_path / "manifest.json", MOST_BYTES)


def test_more_trials_than_fit_into_memory_are_refused(world: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = told(["run", world, "--trials", 10_000_000, "--fidelity", "kinematic", "--workers", 1], capsys)
    assert "80000000 outcomes (10000000 trials x 2 scenarios x 2 plans x 2 robots)" in said
    assert "a run keeps 50000000 at most" in said


@pytest.mark.parametrize("command", ["run", "batch"])
def test_more_workers_than_of_use_are_refused_before_any_work(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "--workers 99999999: at most" in told([command, tmp_path / "no-such.yaml", "--workers", 99_999_999], capsys)


def outcomes(rows: int) -> pa.Table:
    values = {pa.string(): "x", pa.int64(): 0, pa.float64(): 1.0, pa.bool_(): True}
    return pa.table({field.name: pa.repeat(pa.scalar(values[field.type], field.type), rows) for field in OUTCOMES},
                    schema=OUTCOMES)


def unpacked(path: Path, **bounds: Any) -> int:
    return sum(piece.num_rows for piece in pieces_of(path, OUTCOMES, **bounds))


def test_words_are_held_once_however_many_rows_they_fill(tmp_path: Path) -> None:
    # 200 000 rows of a word of 20 000 letters are 4 GB where each row has its own.
    word = "w" * 20_000
    pieces = [outcomes(50).set_column(0, OUTCOMES.field("scenario"), pa.array([word] * 50))] * 4000
    write_table(tmp_path / "t.parquet", OUTCOMES, [pa.concat_tables(pieces[:400])] * 10)
    assert (tmp_path / "t.parquet").stat().st_size < 1_000_000
    for piece in pieces_of(tmp_path / "t.parquet", OUTCOMES):
        assert piece.column("scenario").chunk(0).dictionary.nbytes < 100_000


@pytest.mark.long  # it packs a gigabyte
def test_a_table_that_unpacks_to_more_than_its_bound_is_refused(tmp_path: Path) -> None:
    table = outcomes(40)
    words = pa.array([f"{k}" + "x" * 20_000_000 for k in range(40)])
    pq.write_table(table.set_column(0, OUTCOMES.field("scenario"), words), tmp_path / "t.parquet", compression="zstd")
    assert (tmp_path / "t.parquet").stat().st_size < 1_000_000
    with pytest.raises(BadFile, match=r"unpacks to \d+ bytes; at most"):
        unpacked(tmp_path / "t.parquet")


def test_a_table_with_more_rows_than_belong_or_are_read_is_refused(tmp_path: Path) -> None:
    write_table(tmp_path / "t.parquet", OUTCOMES, [outcomes(1000)])
    assert unpacked(tmp_path / "t.parquet", rows=1000) == 1000
    with pytest.raises(BadFile, match="1000 rows, where 999 belong"):
        unpacked(tmp_path / "t.parquet", rows=999)
    with pytest.raises(BadFile, match="1000 rows; at most 10 are read"):
        unpacked(tmp_path / "t.parquet", most=10)
    with pytest.raises(BadFile, match="scenario: 'x' is unknown to this run"):
        unpacked(tmp_path / "t.parquet", words={"scenario": frozenset(("half",))})


def test_a_pipe_in_place_of_a_table_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "t.parquet")
    with pytest.raises(BadFile, match="no file is there"):
        list(pieces_of(tmp_path / "t.parquet", LEGS))
