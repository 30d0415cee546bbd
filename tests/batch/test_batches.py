"""Batches as a user runs them: what goes wrong on the way, and what is never lost."""

from __future__ import annotations

import csv
import fcntl
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from sva_bench.batch.folder import begin, settings_in, shard_path, write_maps
from sva_bench.batch.grid import Grid, Point
from sva_bench.batch.schema import BatchSettings
from sva_bench.errors import BadFile, BadInput
from sva_bench.solver.two_stage import SolveLimits
from sva_bench.study.options import Options
from tests.batch.test_commands import rows_of
from tests.commands_for_tests import sva_bench
from tests.world.test_map_worlds import two_rooms
from tests.worlds_for_tests import SMALL, world_of

POST = "- {cylinder: [4.4, 3.2], radius_m: 0.3}"

# Only in workers, and only for the worlds that the test marks by the number of their posts: a crash and a hang in the
# physics engine, as it is started.
SABOTAGE = """
import sys
if "sva_bench.workers.far_end" in sys.orig_argv:
    import ctypes, time
    from sva_bench.execution import driving
    near = driving.solids_near
    def sabotaged(obstacles, *others):
        if len(obstacles.cylinders) == 2:
            ctypes.string_at(0)
        if len(obstacles.cylinders) == 3:
            time.sleep(600)
        return near(obstacles, *others)
    driving.solids_near = sabotaged
"""


def posted(folder: Path, name: str, posts: int) -> Path:
    """The small world with so many posts, the others far from all ways."""
    more = "".join(f"\n      - {{cylinder: [{5.9 - 0.05 * k}, {5.95}], radius_m: 0.02}}" for k in range(posts - 1))
    path = folder / f"{name}.yaml"
    path.write_text(SMALL.replace("name: small", f"name: {name}").replace(POST, POST + more), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


def started(*arguments: object, cwd: Path, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-m", "sva_bench", "batch", *map(str, arguments)], cwd=cwd, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ | environment)


@pytest.mark.long  # what fails is tried three times
@pytest.mark.parametrize("hanging", [False, True])
def test_worlds_that_crash_or_hang_the_physics_are_named_and_the_rest_goes_on(
    hanging: bool, tmp_path: Path, cache: Path
) -> None:
    worlds = [posted(tmp_path, "sound", 1), posted(tmp_path, "crashing", 2), posted(tmp_path, "hanging", 3)]
    (tmp_path / "sitecustomize.py").write_text(SABOTAGE, encoding="utf-8")
    command = (*worlds[:3 if hanging else 2], "--trials", 20, "--rollouts", 1, "--scenario", "half", "--out", "out",
               "--cache", cache / str(hanging), "--workers", 2)
    # A hang takes three times the limit; a shorter one would cut short what is only slow on a busy machine.
    with started(*command, "--unit-time-limit", 60, "--json", cwd=tmp_path, PYTHONPATH=str(tmp_path)) as batch:
        output, messages = batch.communicate(timeout=900)
    assert batch.returncode == 4, messages
    summary = json.loads(output)
    assert [unit["world"] for unit in summary["units"]] == ["sound"]
    reasons = {entry["world"]: entry["reason"] for entry in summary["failed"]}
    assert set(reasons) == ({"crashing", "hanging"} if hanging else {"crashing"})
    assert "SIGSEGV" in reasons["crashing"]
    assert "longer than 60 s" in reasons.get("hanging", "longer than 60 s")
    assert {entry["attempts"] for entry in summary["failed"]} == {3}

    told = sva_bench("batch", "status", "out", cwd=tmp_path)
    assert told.returncode == 0, told.stderr
    assert f"1 of {3 if hanging else 2} units done, {2 if hanging else 1} failed: over" in told.stdout
    assert "crashing" in told.stdout
    # Mended, they are taken up again, and nothing else is.
    kept = (tmp_path / "out" / "outcomes-sound-seed0.parquet").stat().st_mtime_ns
    again = sva_bench("batch", "retry", "out", "--cache", cache / str(hanging), "--workers", 1, "--json", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert [unit["world"] for unit in json.loads(again.stdout)["units"]] == [world.stem for world in worlds[
        :3 if hanging else 2]]
    assert (tmp_path / "out" / "outcomes-sound-seed0.parquet").stat().st_mtime_ns == kept


def test_a_folder_of_a_batch_without_results_can_be_used_again(tmp_path: Path) -> None:
    world, out = world_of(tmp_path), tmp_path / "out"
    out.mkdir()

    def settings(trials: int) -> BatchSettings:
        return Grid(points=[Point(world=world, planner="prmstar")], seeds=[0], options=Options(trials=trials),
                    unit_trials=10).settings()

    begin(out, settings(10), resume=False)
    write_maps(out, {"maps-0/map.pgm": b"P5"})
    with pytest.raises(BadFile, match=r"options\.trials \(10 there, 20 now\)"):
        begin(out, settings(20), resume=True)
    begin(out, settings(20), resume=False)
    assert settings_in(out)[1] == settings(20)
    shard_path(out, "small-seed0").touch()
    with pytest.raises(BadInput, match="--resume"):
        begin(out, settings(20), resume=False)


@pytest.mark.long
def test_ctrl_c_ends_a_batch_with_130_and_resume_goes_on(tmp_path: Path, cache: Path) -> None:
    world = posted(tmp_path, "small", 1)
    command = (world, "--trials", 3000, "--unit-trials", 10, "--rollouts", 2, "--fidelity", "kinematic", "--out", "out",
               "--cache", cache, "--workers", 1)
    out = tmp_path / "out"
    with started(*command, cwd=tmp_path) as batch:
        wait_for(lambda: len(list(out.glob("outcomes-*"))) > 5)
        batch.send_signal(signal.SIGSTOP)  # else it would be over when the second has started
        second = sva_bench("batch", *command, "--resume", cwd=tmp_path)
        batch.send_signal(signal.SIGINT)
        batch.send_signal(signal.SIGCONT)
        _, messages = batch.communicate(timeout=60)
    assert second.returncode == 2
    assert "another batch is at work" in second.stderr
    assert batch.returncode == 130, messages
    assert "Traceback" not in messages
    done = len(list(out.glob("outcomes-*")))
    assert f"interrupted: {done} of 300 units are done" in messages
    assert 5 < done < 300
    resumed = sva_bench("batch", *command, "--resume", cwd=tmp_path)
    assert resumed.returncode == 0, resumed.stderr
    assert rows_of(out).num_rows == 3000 * 2 * 2 * 2


def test_an_unwritable_folder_is_an_error_and_loses_nothing(tmp_path: Path, cache: Path) -> None:
    world = posted(tmp_path, "small", 1)
    command = ("batch", world, "--trials", 40, "--fidelity", "kinematic", "--workers", 1, "--cache", cache)
    (tmp_path / "file").write_text("", encoding="utf-8")
    refused = sva_bench(*command, "--out", tmp_path / "file", cwd=tmp_path)
    assert refused.returncode == 2
    assert "this is no folder" in refused.stderr
    assert "Traceback" not in refused.stderr


FULL = """
import errno, os, sys
from sva_bench.batch import folder
from sva_bench.__main__ import run_command_line

def full(handle, sync=os.fsync):
    if len(list(folder.Path("out").glob("outcomes-*.parquet"))) >= 2:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    sync(handle)

folder.os.fsync = full
sys.exit(run_command_line(sys.argv[1:]))
"""


@pytest.mark.long
def test_a_full_disk_ends_a_batch_with_one_clear_error_and_keeps_what_is_done(tmp_path: Path, cache: Path) -> None:
    world = posted(tmp_path, "small", 1)
    (tmp_path / "full.py").write_text(FULL, encoding="utf-8")
    command = ["batch", str(world), "--trials", "40", "--unit-trials", "10", "--fidelity", "kinematic", "--workers",
               "1", "--cache", str(cache), "--out", "out"]
    filled = subprocess.run([sys.executable, "full.py", *command], cwd=tmp_path, text=True, capture_output=True,
                            timeout=120, check=False)
    assert filled.returncode == 2
    assert "No space left on device" in filled.stderr
    assert "--resume" in filled.stderr
    assert "Traceback" not in filled.stderr
    assert len(list((tmp_path / "out").glob("outcomes-*.parquet"))) == 2
    assert not list((tmp_path / "out").glob("*.tmp"))
    resumed = sva_bench(*command, "--resume", cwd=tmp_path)
    assert resumed.returncode == 0, resumed.stderr
    assert rows_of(tmp_path / "out").num_rows == 40 * 2 * 2 * 2


def test_the_lock_on_a_folder_is_the_kernels(tmp_path: Path) -> None:
    from sva_bench.batch.folder import at_work, locked

    with locked(tmp_path / "out"):
        assert at_work(tmp_path / "out")
    assert not at_work(tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []  # no file that could be left over
    handle = os.open(tmp_path / "out", os.O_RDONLY)
    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    os.close(handle)


def wait_for(happened: Any, seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.02)


def test_shards_have_the_columns_of_a_run_and_their_world_seed_and_variant(tmp_path: Path, cache: Path) -> None:
    world = posted(tmp_path, "small", 1)
    done = sva_bench("batch", world, "--set", "robots.uv2.fuel_capacity_s=50,60", "--seed", "3-4", "--trials", 10,
                     "--scenario", "half", "--fidelity", "kinematic", "--workers", 1, "--cache", cache, "--out", "out",
                     "--json", "--csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["variants"] == ["robots.uv2.fuel_capacity_s=50", "robots.uv2.fuel_capacity_s=60"]
    assert [(row["variant"][-2:], row["maps"]) for row in summary["aggregate"]] == [("50", 1), ("60", 1)]
    shards = sorted((tmp_path / "out").glob("outcomes-*.parquet"))
    assert len(shards) == 4
    table = pq.read_table(shards[0])
    assert table.column_names == [
        "scenario", "planner", "policy", "news", "trial", "rollout", "history", "weight", "robot", "available",
        "incentive", "lost", "value", "pois_reached", "stops_reached", "end", "end_time_s", "fuel_used_s", "waited_s",
        "contacts", "fidelity", "world", "seed", "variant"]
    assert set(table["seed"].to_pylist()) < {3, 4}
    assert table.schema.field("end_time_s").metadata == {b"unit": b"s"}
    with (tmp_path / "out" / "maps.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["world"], row["variant"], row["scenario"], float(row["vss"])) for row in rows] == [
        (row["world"], row["variant"], row["scenario"], row["vss"]["mean"]) for row in summary["maps"]]
    with (tmp_path / "out" / "aggregate.csv").open(newline="", encoding="utf-8") as file:
        assert [(int(row["maps"]), row["vss_low"]) for row in csv.DictReader(file)] == [(1, ""), (1, "")]


@pytest.mark.long
def test_a_batch_folder_holds_the_maps_that_it_takes_to_go_on(tmp_path: Path, cache: Path) -> None:
    two_rooms(tmp_path)
    command = ("batch", "world.yaml", "--trials", "8", "--unit-trials", "4", "--fidelity", "kinematic", "--out", "out",
               "--cache", str(cache), "--workers", "1")
    assert sva_bench(*command, cwd=tmp_path).returncode == 0
    lost = next((tmp_path / "out").glob("outcomes-*-t00000004.parquet"))
    content = lost.read_bytes()
    lost.unlink()
    (tmp_path / "map.pgm").unlink()
    again = sva_bench("batch", "retry", "out", "--cache", str(cache), "--workers", "1", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert lost.read_bytes() == content


def test_settings_that_differ_are_named_each_with_both_values(tmp_path: Path) -> None:
    grid = Grid(points=[Point(world=world_of(tmp_path), planner="prmstar")], seeds=[0], options=Options(trials=10),
                unit_trials=10)
    (tmp_path / "out").mkdir()
    begin(tmp_path / "out", grid.settings(), resume=False)
    other = replace(grid, seeds=[0, 1], options=Options(trials=20, limits=SolveLimits(gap=0.5))).settings()
    with pytest.raises(BadFile) as refused:
        begin(tmp_path / "out", other, resume=True)
    assert ("settings: not those of the batch in this folder: seeds ([0] there, [0, 1] now), options.trials (10 there, "
            "20 now), options.gap (1e-06 there, 0.5 now); use the same settings") in str(refused.value)
    many = replace(grid, seeds=list(range(1000)), options=Options(
        trials=20, rollouts=2, fidelity="kinematic", evpi=True, limits=SolveLimits(time_limit_s=1.0, gap=0.5)))
    with pytest.raises(BadFile, match="settings: not those") as refused:
        begin(tmp_path / "out", many.settings(), resume=True)
    assert len(str(refused.value)) < 3000
