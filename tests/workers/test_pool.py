"""Workers start and end with their parent, whenever Ctrl-C comes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sva_bench.errors import BadInput, ExitCode
from sva_bench.workers.pool import WorkerLost, count_of, local_workers

SCRIPT = """
import multiprocessing, os, signal
from concurrent.futures import ProcessPoolExecutor
from sva_bench.workers.pool import local_workers

submit = ProcessPoolExecutor.submit

def interrupted(*arguments):
    os.kill(os.getpid(), signal.SIGINT)  # as the first worker starts
    return submit(*arguments)

if __name__ == "__main__":
    ProcessPoolExecutor.submit = interrupted
    try:
        with local_workers(2, "sva_bench.execution.execute"):
            print("lost")
    except KeyboardInterrupt:
        print("caught", len(multiprocessing.active_children()))
"""


def test_ctrl_c_while_workers_start_is_not_lost_and_ends_them() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout == "caught 0\n", done.stderr


def asked_of_a_worker(function: Callable[..., Any], argument: Any) -> None:
    with local_workers(2, "sva_bench.execution.execute") as executor:
        assert executor is not None
        executor.submit(function, argument).result()


def test_a_killed_worker_is_an_error_with_a_remedy() -> None:
    with pytest.raises(WorkerLost, match=r"SIGKILL.*--workers 1") as lost:
        asked_of_a_worker(signal.raise_signal, signal.SIGKILL)
    assert lost.value.exit_code == ExitCode.UNFINISHED_TRIALS


def test_a_worker_out_of_memory_is_an_error_with_a_remedy() -> None:
    with pytest.raises(WorkerLost, match=r"memory ran out.*--workers 1"):
        asked_of_a_worker(bytearray, 1 << 60)


def cut_off(told: str) -> None:
    """In a worker: begin an answer of 1000 bytes, write one of them, and say so."""
    frame = sys._getframe()
    while "result_queue" not in frame.f_locals:
        assert frame.f_back is not None
        frame = frame.f_back
    os.write(frame.f_locals["result_queue"]._writer.fileno(), (1000).to_bytes(4, "big") + b"x")
    Path(told).touch()
    time.sleep(60)


CUT_OFF = """
import sys, time
from pathlib import Path
from sva_bench.workers.pool import local_workers
from tests.workers.test_pool import cut_off

try:
    with local_workers(2, "json") as executor:
        executor.submit(cut_off, sys.argv[1])
        while not Path(sys.argv[1]).exists():
            time.sleep(0.05)
        raise KeyboardInterrupt
except KeyboardInterrupt:
    print("caught")
"""


def test_a_worker_that_is_ended_in_the_middle_of_its_answer_is_not_waited_for(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", CUT_OFF, str(tmp_path / "told")], capture_output=True, text=True,
                          cwd=Path(__file__).parents[2], timeout=60, check=False)
    assert done.stdout == "caught\n", done.stderr


def die_in_an_answer() -> None:
    """In a worker: begin an answer, as its queue does, and be killed."""
    frame = sys._getframe()
    while "result_queue" not in frame.f_locals:
        assert frame.f_back is not None
        frame = frame.f_back
    queue = frame.f_locals["result_queue"]
    queue._wlock.acquire()
    os.write(queue._writer.fileno(), (1000).to_bytes(4, "big") + b"x")
    os.kill(os.getpid(), signal.SIGKILL)


KILLED_IN_AN_ANSWER = """
from sva_bench.workers.pool import WorkerLost, local_workers
from tests.workers.test_pool import die_in_an_answer

try:
    with local_workers(2, "json") as executor:
        answer = executor.submit(die_in_an_answer)
        WHAT
except WorkerLost as lost:
    print("lost", "SIGKILL" in str(lost))
"""


@pytest.mark.parametrize(("what", "said"), [
    ("answer.result()", "lost True\n"),
    ("pass", ""),  # nobody asks for the answer, and the pool still closes
])
def test_a_worker_killed_in_the_middle_of_its_answer_does_not_hang_the_pool(what: str, said: str) -> None:
    done = subprocess.run([sys.executable, "-c", KILLED_IN_AN_ANSWER.replace("WHAT", what)], capture_output=True,
                          text=True, cwd=Path(__file__).parents[2], timeout=60, check=False)
    assert done.stdout == said, done.stderr
    assert done.returncode == 0, done.stderr


HELPED = """
from sva_bench.workers.pool import local_workers
if __name__ == "__main__":
    with local_workers(2, "sva_bench.execution.execute") as executor:
        print(executor.submit(abs, -1).result())
"""


def test_no_process_of_ours_outlives_a_program_that_had_workers() -> None:
    with subprocess.Popen([sys.executable, "-c", HELPED], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          start_new_session=True) as program:
        program.wait()  # not until its outputs are closed: a helper would hold them
        left = [stat for path in Path("/proc").glob("[0-9]*/stat")
                if (stat := _stat(path)) and int(stat[3]) == program.pid]
        assert not left
        assert program.communicate() == ("1\n", "")


ORPHAN = """
import ctypes, os, time
from sva_bench.workers.pool import kill_with_parent
ctypes.CDLL = lambda *_, **__: object()  # a C library without prctl, as that of macOS
kill_with_parent(int(os.environ["PARENT"]))
print("there", flush=True)
time.sleep(60)
"""


def test_workers_die_with_their_parent_where_the_kernel_sees_to_nothing() -> None:
    with subprocess.Popen(["sh", "-c", 'PARENT=$$ "$0" -c "$1" & wait', sys.executable, ORPHAN],
                          stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        assert parent.stdout.readline() == "there\n"
        parent.kill()
        begun = time.monotonic()
        parent.stdout.read()  # until nobody is left who could write
        assert time.monotonic() - begun < 30


def _stat(path: Path) -> list[str]:
    """What the kernel says of a process, from its state on; its session comes fourth."""
    try:
        return path.read_text(encoding="utf-8").rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return []


def test_more_workers_than_a_machine_can_use_are_refused_by_number() -> None:
    cores = len(os.sched_getaffinity(0))
    assert count_of(None) == cores
    assert count_of(16) == 16
    with pytest.raises(BadInput, match=rf"--workers 99999999: at most {max(4 * cores, 16)} .* {cores} cores"):
        count_of(99_999_999)


def test_without_cpu_affinity_all_cores_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "sched_getaffinity")
    assert count_of(None) == os.cpu_count()
