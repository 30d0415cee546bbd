"""Guarded workers: a crash, a hang or a fault of one job is an answer, and the next job meets a fresh worker."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import pytest

from sva_bench.errors import BadInput
from sva_bench.workers.answers import Answer, Caps, Done, Failed
from sva_bench.workers.local import LocalProcesses


@dataclass(frozen=True, kw_only=True)
class Deed:
    """A job that does what it is told."""

    kind: ClassVar[str] = "deed"
    kept: ClassVar[bool] = False
    result: ClassVar[Any] = int
    deed: str

    @property
    def key(self) -> str:
        return self.deed

    @property
    def what(self) -> str:
        return self.deed

    def run(self) -> Any:
        if self.deed == "crash":
            ctypes.string_at(0)
        if self.deed == "hang":
            time.sleep(600)
        if self.deed == "memory":
            return len(bytearray(3 << 30))
        if self.deed == "fault":
            raise ZeroDivisionError("by zero")
        if self.deed == "mend":
            raise BadInput("move the site")
        return os.getpid()

    def fits(self, result: Any) -> bool:
        return isinstance(result, int)


@pytest.fixture(scope="module")
def engine() -> Iterator[LocalProcesses]:
    local = LocalProcesses(1, Caps(time_s=3.0, memory_mb=2048))
    yield local
    local.close()


def answer_to(engine: LocalProcesses, deed: str) -> Answer:
    engine.submit(deed, Deed(deed=deed))
    end = time.monotonic() + 120
    while time.monotonic() < end:
        for key, answer in engine.answers(1.0):
            assert key == deed
            return answer
    raise TimeoutError(deed)


@pytest.mark.parametrize(("deed", "told", "mendable"), [
    ("crash", "SIGSEGV", False), ("hang", "longer than 3 s", False),
    pytest.param("memory", "2048 MB", False, marks=pytest.mark.long),
    pytest.param("fault", "ZeroDivisionError: by zero", False, marks=pytest.mark.long),
    ("mend", "move the site", True)])
def test_the_failure_of_a_job_is_reported_and_the_next_one_runs(
    deed: str, told: str, mendable: bool, engine: LocalProcesses
) -> None:
    failed = answer_to(engine, deed)
    assert isinstance(failed, Failed)
    assert told in failed.reason
    assert failed.mendable == mendable
    assert isinstance(answer_to(engine, "work"), Done)


ORPHANS = """
import sys, time
from sva_bench.workers.answers import Caps
from sva_bench.workers.local import LocalProcesses
from sva_bench.workers.pool import local_workers
from tests.workers.test_guarded import Deed

if __name__ == "__main__":
    engine = LocalProcesses(1, Caps(time_s=600.0, memory_mb=0))
    engine.submit("hang", Deed(deed="hang"))
    while not engine._job_of:
        engine.answers(0.5)
    with local_workers(2, "sva_bench.execution.execute") as executor:
        pids = {executor.submit(Deed(deed="work").run).result() for _ in range(8)}
        executor.submit(time.sleep, 600)
        print(*engine.pids, *pids, flush=True)
        time.sleep(600)
"""


def test_workers_die_with_a_parent_that_was_killed(tmp_path: Any) -> None:
    script = tmp_path / "orphans.py"
    script.write_text(ORPHANS, encoding="utf-8")
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True,
                          env=os.environ | {"PYTHONPATH": os.getcwd()}) as parent:
        assert parent.stdout is not None
        pids = [int(word) for word in parent.stdout.readline().split()]
        assert len(pids) >= 2
        parent.send_signal(signal.SIGKILL)
        parent.wait()
        end = time.monotonic() + 5
        while any(alive(pid) for pid in pids):
            assert time.monotonic() < end, "a worker outlived its parent"
            time.sleep(0.05)


def alive(pid: int) -> bool:
    """Whether a process runs; one that is dead and not yet waited for doesn't."""
    try:
        with open(f"/proc/{pid}/stat", encoding="utf-8") as file:
            return file.read().rpartition(")")[2].split()[0] not in ("Z", "X")
    except FileNotFoundError:
        return False
