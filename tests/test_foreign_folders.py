"""Run and batch folders from elsewhere: whatever stands in them, there is one message, and never a fault."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.report import run_page as report
from tests.worlds_for_tests import SMALL

QUICK = ("--trials", "6", "--rollouts", "2", "--fidelity", "kinematic", "--workers", "1")
ABSENT = object()
VALUES: tuple[Any, ...] = (ABSENT, None, True, -1, 0, 3, 2.5, -1e300, 10**30, 1e18, float("nan"), "", "x", "1",
                           "\x1b[31m", "../../etc", [], [1], [[]], {}, {"a": 1})


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A run, an execution of its plans, and a batch of which a unit failed, all small."""
    folder = tmp_path_factory.mktemp("folders")
    world = folder / "small.yaml"
    world.write_text(SMALL, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "_charts", lambda *_, **__: [])  # drawing is tried once, below; it takes a second
        patch.setattr(report, "_world", lambda *_, **__: [])
        assert run_command_line(["run", str(world), *QUICK, "--informed", "--assumptions", "--policy",
                                 "resolve", "--news", "instant", "--anticipate", "--out", str(folder / "runs")]) == 0
        (run,) = (folder / "runs").iterdir()
        plans = sorted(map(str, (run / "plans").glob("half-*tic.json")))
        assert run_command_line(["execute", str(world), *plans, *QUICK, "--out", str(folder / "more")]) == 0
    assert run_command_line(["batch", str(world), *QUICK, "--unit-trials", "3", "--seed", "0-1", "--cache",
                             str(folder / "cache"), "--out", str(folder / "batch")]) == 0
    next((folder / "batch").glob("outcomes-*seed1-t00000003.parquet")).unlink()
    (folder / "batch" / "failures.json").write_text(json.dumps({"format": "sva-bench/batch-failures@1", "failures": [
        {"unit": "small-seed1-t00000003", "world": "small", "seed": 1, "reason": "r", "attempts": 3}]}))
    (execution,) = (folder / "more").iterdir()
    return {"run": run, "execution": execution, "batch": folder / "batch", "cache": folder / "cache"}


def places(data: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where values stand in JSON data; of a list the first two and the last item."""
    yield at
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        if not isinstance(data, list) or key in (0, 1, len(data) - 1):
            yield from places(value, (*at, key))


def changed(data: Any, at: tuple[Any, ...], value: Any) -> Any:
    """A copy of JSON data with another value at a place, or none."""
    if not at:
        return value
    copy = dict(data) if isinstance(data, dict) else list(data)
    if len(at) > 1:
        copy[at[0]] = changed(copy[at[0]], at[1:], value)
    elif value is ABSENT:
        del copy[at[0]]
    else:
        copy[at[0]] = value
    return copy


def json_changes(folder: Path, names: list[str]) -> list[tuple[str, tuple[Any, ...], Any]]:
    found: list[tuple[str, tuple[Any, ...], Any]] = []
    for name in names:
        data = json.loads((folder / name).read_text(encoding="utf-8"))
        for at in places(data):
            found += [(name, at, value) for value in VALUES if at or value is not ABSENT]
        found += [(name, (*at, "unknown_key"), 1) for at in places(data) if isinstance(value_at(data, at), dict)]
    return found


def value_at(data: Any, at: tuple[Any, ...]) -> Any:
    for key in at:
        data = data[key]
    return data


def told_once(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> int:
    """Run a command; it must end well or with one error."""
    capsys.readouterr()
    code = run_command_line(arguments)
    messages = capsys.readouterr().err
    assert code in (0, 2, 3, 4), messages
    assert "fault" not in messages, messages
    assert "Traceback" not in messages, messages
    assert "\x1b" not in messages
    assert messages.count("error:") == (1 if code == 2 else 0), messages
    return code


def tried(folder: Path, name: str, at: tuple[Any, ...], value: Any, work: Path, arguments: list[str],
          capsys: pytest.CaptureFixture[str]) -> None:
    """Put a changed document into a folder, run the command, and put back what was there."""
    path = work / name
    path.write_text(json.dumps(changed(json.loads((folder / name).read_text(encoding="utf-8")), at, value)))
    try:
        told_once(arguments, capsys)
    except AssertionError as error:
        raise AssertionError(f"{name} {at} {value!r:.60}: {error}") from None
    finally:
        shutil.copy(folder / name, path)


def some(changes: list[Any], count: int, seed: int) -> list[Any]:
    return random.Random(seed).sample(changes, min(count, len(changes)))


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Charts take most of the time of a report; that they hold is tried with every kind of figure below."""
    monkeypatch.setattr(report, "_charts", lambda *_, **__: [])
    monkeypatch.setattr(report, "_world", lambda *_, **__: [])
    monkeypatch.setattr("sva_bench.report.run_page.distributions", lambda *_: "")
    monkeypatch.setattr("sva_bench.report.charts.legs_driven", lambda *_: "")


COUNTS = [12, pytest.param(3000, marks=pytest.mark.long)]


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("kind", ["run", "execution"])
@pytest.mark.usefixtures("undrawn")
def test_a_run_folder_with_anything_anywhere_gives_its_report_or_one_error(
    kind: str, count: int, folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, work = folders[kind], tmp_path / "work"
    shutil.copytree(folder, work)
    plan = sorted((folder / "plans").iterdir())[0].relative_to(folder).as_posix()
    changes = json_changes(folder, ["summary.json", "manifest.json", plan])
    assert told_once(["report", str(work)], capsys) == 0
    for name, at, value in some(changes, count, 0):
        tried(folder, name, at, value, work, ["report", str(work)], capsys)


@pytest.mark.parametrize("count", [8, pytest.param(1500, marks=pytest.mark.long)])
def test_charts_hold_with_every_figure_that_a_summary_may_have(
    count: int, folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, work = folders["run"], tmp_path / "work"
    shutil.copytree(folder, work)
    changes = [(name, at, value) for name, at, _ in json_changes(folder, ["summary.json"])
               for value in (0, 1e15, -1e15, 1e-300, None) if {"scenarios", "executed", "distribution", "by_robot",
                                                               "vss"} & set(at)]
    for name, at, value in some(changes, count, 1):
        tried(folder, name, at, value, work, ["report", str(work)], capsys)


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("command", ["status", "resume", "retry"])
def test_a_batch_folder_with_anything_anywhere_is_gone_on_with_or_gives_one_error(
    command: str, count: int, folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Nothing is computed: what is left to do is given up at once.
    monkeypatch.setattr("sva_bench.batch.conductor.Conductor.run", lambda *_: None)
    monkeypatch.setattr("sva_bench.workers.local.LocalProcesses.__init__", lambda *_: None)
    monkeypatch.setattr("sva_bench.workers.local.LocalProcesses.close", lambda *_: None)
    monkeypatch.setattr("sva_bench.batch.run.write_batch_report", lambda path, *_: path.write_text(""))
    folder, work = folders["batch"], tmp_path / "work"
    shutil.copytree(folder, work)
    world = folder.parent / "small.yaml"
    cache = ["--cache", str(folders["cache"])]
    arguments = {"status": ["batch", "status", str(work)], "retry": ["batch", "retry", str(work), *cache],
                 "resume": ["batch", str(world), *QUICK, "--unit-trials", "3", "--seed", "0-1", *cache, "--out",
                            str(work), "--resume"]}[command]
    assert told_once(arguments, capsys) in (0, 4)
    shutil.copy(folder / "failures.json", work)
    for name, at, value in some(json_changes(folder, ["manifest.json", "failures.json"]), count // 2, 2):
        tried(folder, name, at, value, work, arguments, capsys)
        shutil.copy(folder / "failures.json", work)
    shard = sorted(folder.glob("outcomes-*.parquet"))[0]
    note = json.loads(pq.read_schema(shard).metadata[b"sva-bench/unit"])
    for at, value in some([(at, value) for at in places(note) for value in VALUES if at or value is not ABSENT],
                          count // 2, 3):
        text = json.dumps(changed(note, at, value))
        pq.write_table(pq.read_table(shard).replace_schema_metadata({b"sva-bench/unit": text}), work / shard.name)
        try:
            told_once(arguments, capsys)
        except AssertionError as error:
            raise AssertionError(f"{at} {value!r:.60}: {error}") from None
        shutil.copy(folder / "failures.json", work)


def column_changes(schema: pa.Schema) -> Iterator[tuple[str, str]]:
    for name in schema.names:
        for what in ("drop", "twice", "nulls", "foreign", "text", "int32", "float32", "list", "dictionary"):
            yield name, what
    for what in ("no rows", "a row less", "rows twice", "half", "cut off", "empty", "text", "other columns too"):
        yield "", what


def spoilt(table: pa.Table, name: str, what: str) -> pa.Table:
    """A table with one column dropped, of another type, or of other content."""
    k, rows = table.column_names.index(name), table.num_rows
    column, kind = table.column(name), table.schema.field(name).type
    if what == "drop":
        return table.drop_columns([name])
    if what == "twice":
        return table.append_column(name, column)
    strange = {pa.string(): "\x1b[31mstrange", pa.int64(): -(2**62), pa.float64(): 1e300, pa.bool_(): None}[kind]
    new = {"nulls": lambda: pa.nulls(rows, kind), "foreign": lambda: pa.array([strange] * rows, kind),
           "text": lambda: pa.array(["x"] * rows), "int32": lambda: pa.array(np.zeros(rows, np.int32)),
           "float32": lambda: pa.array(np.full(rows, np.nan, np.float32)), "list": lambda: pa.array([[1]] * rows),
           "dictionary": lambda: column.combine_chunks().dictionary_encode()}[what]()
    return table.set_column(k, name, new)


def write_spoilt(source: Path, target: Path, name: str, what: str) -> None:
    table = pq.read_table(source)
    whole: dict[str, Callable[[], object]] = {
        "no rows": lambda: pq.write_table(table.slice(0, 0), target),
        "a row less": lambda: pq.write_table(table.slice(0, table.num_rows - 1), target),
        "rows twice": lambda: pq.write_table(pa.concat_tables([table, table]), target),
        "half": lambda: target.write_bytes(source.read_bytes()[: source.stat().st_size // 2]),
        "cut off": lambda: target.write_bytes(source.read_bytes()[:-3]),
        "empty": lambda: target.write_bytes(b""), "text": lambda: target.write_text("scenario,planner\n"),
        "other columns too": lambda: pq.write_table(table.append_column("more", pa.nulls(table.num_rows)), target)}
    if name:
        pq.write_table(spoilt(table, name, what), target)
    else:
        whole[what]()


def test_outcomes_of_runs_and_batches_have_the_same_columns_types_and_units(folders: dict[str, Path]) -> None:
    run = pq.read_schema(folders["run"] / "outcomes.parquet")
    for shard in (folders["batch"]).glob("outcomes-*.parquet"):
        held = pq.read_schema(shard)
        assert held.names == [*run.names, "world", "seed", "variant"]
        for field in run:
            other = held.field(field.name)
            assert (other.type, other.metadata.get(b"unit") if other.metadata else None) == (
                field.type, field.metadata.get(b"unit") if field.metadata else None), field.name
    assert run.field("fuel_used_s").metadata[b"unit"] == b"s of driving"


@pytest.mark.parametrize("table", ["outcomes", "legs", "paths"])
@pytest.mark.parametrize("count", [12, pytest.param(10_000, marks=pytest.mark.long)])
@pytest.mark.usefixtures("undrawn")
def test_a_run_folder_with_any_column_spoilt_gives_its_report_or_one_error(
    table: str, count: int, folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, work = folders["run"], tmp_path / "work"
    shutil.copytree(folder, work)
    file = f"{table}.parquet"
    refused = 0
    for name, what in some(list(column_changes(pq.read_schema(folder / file))), count, 4):
        write_spoilt(folder / file, work / file, name, what)
        try:
            refused += told_once(["report", str(work), "--csv"], capsys) == 2
        except AssertionError as error:
            raise AssertionError(f"{name} {what}: {error}") from None
    assert refused > 0.7 * min(count, 80)


@pytest.mark.parametrize("count", [8, pytest.param(10_000, marks=pytest.mark.long)])
def test_a_batch_folder_with_any_column_spoilt_gives_its_status_or_one_error(
    count: int, folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, work = folders["batch"], tmp_path / "work"
    shutil.copytree(folder, work)
    shard = sorted(folder.glob("outcomes-*.parquet"))[0]
    for name, what in some(list(column_changes(pq.read_schema(shard))), count, 5):
        write_spoilt(shard, work / shard.name, name, what)
        told_once(["batch", "status", str(work)], capsys)


def test_the_shard_of_another_unit_is_refused(
    folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    work = tmp_path / "work"
    shutil.copytree(folders["batch"], work)
    one, other = sorted(work.glob("outcomes-*.parquet"))[:2]
    shutil.copy(one, other)
    assert run_command_line(["batch", "status", str(work)]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "first: the shard of another unit: expected 3, found 0" in said
    assert other.name in said


@pytest.mark.parametrize(("command", "kind", "said"), [
    (["view"], "batch", "the folder of a batch"),
    (["batch", "status"], "run", "the folder of a run, not of a batch"),
    (["batch", "retry"], "run", "the folder of a run, not of a batch"),
    (["report"], "parent", "holds 1 run, and is none itself; name one of them; the newest is"),
    (["view"], "parent", "holds 1 run, and is none itself; name one of them; the newest is"),
    (["batch", "status"], "parent", "no folder of a batch")])
def test_a_folder_of_another_kind_is_called_what_it_is(
    command: list[str], kind: str, said: str, folders: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = folders["run"].parent if kind == "parent" else folders[kind]
    assert run_command_line([*command, str(folder)]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_the_newest_run_of_a_folder_is_named_and_no_batch_or_draft(
    folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for age, (name, kind) in enumerate((("b", "run"), ("a", "execution"), ("c", "run"), ("batch", "batch"),
                                        (".small.7.tmp", "run"))):
        shutil.copytree(folders[kind], tmp_path / name)
        if kind == "batch":
            shutil.copy(folders["run"] / "summary.json", tmp_path / name)
        os.utime(tmp_path / name / "summary.json", (age if name != "c" else 0, age if name != "c" else 0))
    assert run_command_line(["report", str(tmp_path)]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"holds 3 runs, and is none itself; name one of them; the newest is {tmp_path / 'a'}" in said


@pytest.mark.parametrize("command", ["report", "view"])
def test_several_run_folders_on_one_line_are_answered_with_a_hint(
    command: str, folders: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command_line([command, str(folders["run"]), str(folders["execution"])]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"sva-bench {command} takes one" in said
    assert "call it once for each" in said


@pytest.mark.spread(1)
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("kind", ["run", "execution"])
def test_a_plan_with_another_route_than_was_driven_is_refused_by_its_file(
    kind: str, folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    work = tmp_path / "work"
    shutil.copytree(folders[kind], work)
    for path in sorted((work / "plans").glob("*tic.json")):  # a perfect-information plan has many routes
        text = path.read_text(encoding="utf-8")
        plan = json.loads(text)
        robot, route = max(plan["routes"].items(), key=lambda item: len(item[1]))
        for other in (route[:-2] + route[-1:], [route[0], *reversed(route[1:-1]), route[-1]], [], route[:1]):
            if other == route:
                continue
            path.write_text(json.dumps(plan | {"routes": plan["routes"] | {robot: other}}), encoding="utf-8")
            assert run_command_line(["report", str(work)]) == 2, (path, other)
            said = " ".join(capsys.readouterr().err.split())
            assert f"{path.name}: routes.{robot}: not the route that was driven" in said
        path.write_text(text, encoding="utf-8")
    assert run_command_line(["report", str(work)]) == 0


@pytest.mark.usefixtures("undrawn")
def test_a_report_names_the_missing_files_that_it_can_do_without(
    folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    work = tmp_path / "work"
    shutil.copytree(folders["run"], work)
    recording = sorted((work / "recordings").iterdir())[0].relative_to(work).as_posix()
    for name in ("travel_times.parquet", "instance-half.json", recording):
        (work / name).unlink()
    assert run_command_line(["report", str(work)]) == 0
    said, page = " ".join(capsys.readouterr().err.split()), (work / "report.html").read_text(encoding="utf-8")
    named = f"travel_times.parquet, instance-half.json, {recording}"
    assert f"missing, but the report doesn't rest on them: {named}" in said
    assert f"Missing in this run folder: {named}." in page
    assert f'href="{recording}"' not in page


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("name", ["../../outside.rrd", "x" * 5000 + ".rrd", "a/b.rrd", "no recording"])
def test_a_recording_that_the_manifest_invents_is_missing_and_not_linked(
    name: str, folders: dict[str, Path], tmp_path: Path
) -> None:
    work = tmp_path / "work"
    shutil.copytree(folders["run"], work)
    manifest = json.loads((work / "manifest.json").read_text())
    manifest["recordings"][-1]["file"] = name
    (work / "manifest.json").write_text(json.dumps(manifest))
    code = run_command_line(["report", str(work)])
    assert code in (0, 2), "one clear error, or a page"
    if code == 0:
        links = re.findall('href="recordings/([^"]*)"', (work / "report.html").read_text())
        assert links
        assert all("/" not in link and (work / "recordings" / unquote(link)).is_file() for link in links)


def test_a_run_that_was_not_finished_is_called_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / ".small-seed0-0123.7.tmp").mkdir()
    assert run_command_line(["report", str(tmp_path / ".small-seed0-0123.7.tmp")]) == 2
    assert "a run that was not finished" in " ".join(capsys.readouterr().err.split())


def files_of(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*")
                  if path.is_file() and path.suffix in (".json", ".parquet"))


@pytest.mark.spread(1)
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("kind", ["run", "execution"])
def test_a_run_folder_without_any_of_its_files_is_called_incomplete(
    kind: str, folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # No page shows instances, and older folders have no paths: routes are straight lines there.
    names = [name for name in files_of(folders[kind]) if not name.startswith(("instance-", "paths."))]
    assert {"manifest.json", "summary.json", "legs.parquet", "outcomes.parquet", "travel_times.parquet"} < set(names)
    assert any(name.startswith("plans/") for name in names)
    for name in names:
        work = tmp_path / "work"
        shutil.copytree(folders[kind], work)
        (work / name).unlink()
        assert run_command_line(["report", str(work), "--csv"]) == 2, name
        said = " ".join(capsys.readouterr().err.split())
        where = "" if name == "manifest.json" else ", it stands in manifest.json"
        assert f"the run folder is incomplete: {name} is missing; run its command again{where}" in said
        shutil.rmtree(work)


def test_a_run_folder_without_recordings_is_called_incomplete(
    folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for spoil in (shutil.rmtree, lambda path: [file.unlink() for file in path.iterdir()]):
        work = tmp_path / "work"
        shutil.copytree(folders["run"], work)
        spoil(work / "recordings")
        assert run_command_line(["view", str(work), "--web"]) == 2
        assert "the run folder is incomplete: recordings/*.rrd is missing; run its command again" in " ".join(
            capsys.readouterr().err.split())
        shutil.rmtree(work)
