"""Whatever is killed, and whenever: the resumed table is the undisturbed one, row for row."""

from __future__ import annotations

import itertools
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pytest

from tests.batch.test_batches import posted, started, wait_for
from tests.batch.test_commands import rows_of
from tests.commands_for_tests import sva_bench_alone

TRIALS = ("--trials", 1200, "--unit-trials", 10, "--rollouts", 2, "--fidelity", "kinematic")
UNITS = 2 * 120


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, pa.Table]:
    """A folder with two worlds and a warm cache, and the rows of a batch that nobody disturbed."""
    folder = tmp_path_factory.mktemp("kills")
    for name in ("small", "other"):
        posted(folder, name, 1)
    done = sva_bench_alone("batch", "small.yaml", "other.yaml", *TRIALS, "--unit-trials", 1200, "--workers", 1,
                           "--cache", "cache", "--out", "whole", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, rows_of(folder / "whole")


def children(pid: int) -> list[int]:
    """Processes that a process started and that live."""
    try:
        listed = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8")
    except FileNotFoundError:
        return []
    return [int(word) for word in listed.split()]


def end(pid: int) -> None:
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return


def await_a_moment(draw: random.Random, out: Path, batch: subprocess.Popen[str], kills: int) -> None:
    """Let some time pass: now and then any, else until some more is done, but not all of it."""
    if draw.random() < 0.2:
        time.sleep(draw.uniform(0, 3))
        return
    done = shards(out)
    enough = done + draw.randint(1, max(1, (UNITS - done) // (kills + 1)))
    wait_for(lambda: shards(out) >= enough or batch.poll() is not None)
    time.sleep(draw.uniform(0, 0.02))


def shards(out: Path) -> int:
    return len(list(out.glob("outcomes-*.parquet")))


@pytest.mark.long
@pytest.mark.parametrize("kills", [1, 3, 56])
def test_killing_parent_and_workers_at_random_moments_changes_no_row(
    kills: int, undisturbed: tuple[Path, pa.Table]
) -> None:
    folder, whole = undisturbed
    draw = random.Random(kills)
    worlds = ["small.yaml", "other.yaml"]
    killed = {"parent": 0, "worker": 0}

    def left() -> int:
        return kills - sum(killed.values())

    for number in itertools.count():
        out = folder / f"out-{kills}-{number}"
        while True:
            draw.shuffle(worlds)  # their order is nothing that rows depend on
            with started(*worlds, *TRIALS, "--workers", draw.choice([1, 2]), "--cache", "cache", "--out", out,
                         "--resume", cwd=folder) as batch:
                lost = 0
                while left() and batch.poll() is None:
                    await_a_moment(draw, out, batch, left())
                    workers = children(batch.pid)
                    # A batch that lost a worker goes on by itself; but a unit that loses three is given up.
                    if workers and lost < 2 and draw.random() < 0.6:
                        end(draw.choice(workers))
                        killed["worker"] += 1
                        lost += 1
                    elif batch.poll() is None:
                        end(batch.pid)
                        killed["parent"] += 1
                        break
                _, messages = batch.communicate(timeout=600)
            assert batch.returncode in (0, -signal.SIGKILL), messages
            if batch.returncode == 0:
                break
        assert rows_of(out).equals(whole)
        names = {path.name for path in out.iterdir()}
        assert not any(name.endswith(".tmp") for name in names)
        assert len(names) == UNITS + 3
        if not left():
            break
    assert kills == 1 or min(killed.values()) > 0, killed


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and two workers on loopback, each a process of its own."""
    pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    scheduler = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
         "--scheduler-file", str(file)], **quiet)  # type: ignore[call-overload]
    workers = [subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(file), "--host", "127.0.0.1",
         "--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(tmp_path)],
        **quiet) for _ in range(2)]  # type: ignore[call-overload]
    try:
        wait_for(file.exists)
        yield str(file), workers
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_a_dask_cluster_gives_the_same_rows_though_a_worker_is_killed(
    seed: int, undisturbed: tuple[Path, pa.Table], cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    folder, whole = undisturbed
    scheduler, workers = cluster
    draw = random.Random(seed)
    out = folder / f"dask-{seed}"
    with started("small.yaml", "other.yaml", *TRIALS, "--dask", scheduler, "--cache", "cache", "--out", out,
                 cwd=folder) as batch:
        enough = draw.randint(1, UNITS // 2)
        wait_for(lambda: shards(out) >= enough or batch.poll() is not None)
        draw.choice(workers).kill()
        _, messages = batch.communicate(timeout=600)
    assert batch.returncode == 0, messages
    assert rows_of(out).equals(whole)


@pytest.mark.long  # it waits for one
def test_a_missing_dask_scheduler_is_an_error(tmp_path: Path) -> None:
    world = posted(tmp_path, "small", 1)
    done = sva_bench_alone("batch", world, *TRIALS, "--dask", "tcp://127.0.0.1:9", "--out", "out", "--cache", "cache",
                           cwd=tmp_path)
    assert done.returncode == 2
    assert "no Dask scheduler answers there" in done.stderr
    assert "Traceback" not in done.stderr
