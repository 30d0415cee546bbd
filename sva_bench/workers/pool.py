"""Local worker processes: spawned, single-threaded, ignoring Ctrl-C, and killed with their parent."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib import import_module
from multiprocessing import resource_tracker, util
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from types import ModuleType
from typing import Any

from sva_bench.errors import BadInput, ExitCode, SvaBenchError
from sva_bench.interrupts import holding_back_ctrl_c

MOST_PER_CORE, FEWEST_MOST = 4, 16
"""Most workers per core, and least value of the maximum: more would only compete for memory."""


class WorkerLost(SvaBenchError):
    """A worker process died or ran out of memory, so that its work is lost."""

    exit_code = ExitCode.UNFINISHED_TRIALS

    def __init__(self, how: str) -> None:
        super().__init__(how)
        self.how = how

    def __str__(self) -> str:
        return (f"a worker process was lost ({self.how}), and nothing was written: if memory is short, take fewer "
                "workers (--workers 1), trials or rollouts; a batch tries such units again")


def usable_cores() -> int:
    """Number of cores that this process may run on; where the system has no affinity (macOS), all cores."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


def count_of(wanted: int | None) -> int:
    """Number of worker processes: as given, else one per core.

    Raises:
        BadInput: If it exceeds the maximum for this machine.
    """
    cores = usable_cores()
    most = max(MOST_PER_CORE * cores, FEWEST_MOST)
    if wanted is not None and wanted > most:
        raise BadInput(f"--workers {wanted}: at most {most} on this machine, which has {cores} cores")
    return wanted or cores


@contextmanager
def local_workers(wanted: int | None, preload: str) -> Iterator[Executor | None]:
    """An executor of worker processes (default: one per core); ``None`` for one, since this process does its work.

    Args:
        wanted: Number of processes; ``None`` = one per core.
        preload: Module that workers import in the background.
    """
    count = count_of(wanted)
    if count <= 1:
        yield None
        return
    # Interpreters that are started with -c look for modules in the current folder first, unless told not to.
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    before = set(multiprocessing.active_children())
    started: set[BaseProcess] = set()
    executor = ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"),
                                   initializer=kill_with_parent, initargs=(os.getpid(),))
    _end_tracker_at_exit()
    try:
        with holding_back_ctrl_c(), _without_main_module():  # workers inherit the former for good
            for _ in range(count):  # they start, import and load compiled code while this process plans
                executor.submit(import_module, preload)
            _hear_of_cut_off_answers(executor)
        started = set(multiprocessing.active_children()) - before
        with _ending_together(started):
            yield executor
            executor.shutdown(wait=True, cancel_futures=True)  # within: it waits for answers too
    except BaseException as error:
        for worker in set(multiprocessing.active_children()) - before:
            worker.terminate()  # their results are no longer needed, and may take long
        if isinstance(error, BrokenProcessPool):
            executor.shutdown(wait=True, cancel_futures=True)
            raise WorkerLost(_death_of(started)) from None
        if isinstance(error, MemoryError):
            raise WorkerLost("memory ran out") from None
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _hear_of_cut_off_answers(executor: Any) -> None:
    """Close this process's own end of the pipe that workers answer by, now that each has its own.

    A worker that is terminated in the middle of an answer leaves it cut off, and whoever reads it would wait for the
    rest of it as long as anybody could write there.
    """
    executor._result_queue._writer.close()


@contextmanager
def _ending_together(workers: set[BaseProcess]) -> Iterator[None]:
    """A block in which the end of one worker ends the others.

    A worker that is killed in the middle of an answer leaves it cut off and the lock of the pipe taken: the others wait
    for the lock, and this process for the rest of the answer as long as anybody lives who could write it.
    A worker ends by itself only when no work is left, so nothing is lost with the others.
    """
    closed, closing = multiprocessing.Pipe(duplex=False)

    def end_others() -> None:
        if closed not in wait([closed, *(worker.sentinel for worker in workers)]):
            for worker in workers:
                worker.terminate()

    with holding_back_ctrl_c():  # the thread inherits it: Ctrl-C is the main thread's to hear
        watching = threading.Thread(target=end_others, daemon=True)
        watching.start()
    try:
        yield
    finally:
        closing.close()
        watching.join()
        closed.close()


def _death_of(workers: set[BaseProcess]) -> str:
    """Cause of death of the first of some worker processes; the others were terminated because of it."""
    codes = {worker.exitcode for worker in workers} - {None, 0, -signal.SIGTERM}
    if -signal.SIGKILL in codes:
        return "SIGKILL, sent by somebody, or for want of memory"
    return ", ".join(signal.Signals(-code).name if code < 0 else f"status {code}" for code in codes if code) or "ended"


def _end_tracker_at_exit() -> None:
    """Stop multiprocessing's resource tracker before this process ends.

    By default it ends when the kernel closes its pipe, so it briefly outlives the program. It must
    be stopped last, after all resources that it tracks are released.
    """
    if not _at_exit:
        _at_exit.append(util.Finalize(None, _end_tracker, exitpriority=-1000))


def _end_tracker() -> None:
    tracker: Any = resource_tracker._resource_tracker
    if tracker._pid is not None:  # else it is another process's, or none was started
        tracker._stop()


_at_exit: list[util.Finalize] = []


@contextmanager
def _without_main_module() -> Iterator[None]:
    """A block in which workers are started without importing the program's main module, which they don't need."""
    main, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def kill_with_parent(parent: int) -> None:
    """Have this process killed as soon as its parent ends, for whatever reason.

    By the kernel on Linux; elsewhere by a thread that polls each second, when compiled code releases the GIL.

    Args:
        parent: The parent's process id, since it may have ended already.
    """
    prctl = getattr(ctypes.CDLL(None, use_errno=True), "prctl", None)
    if prctl is None:
        threading.Thread(target=_die_after, args=(parent,), daemon=True).start()
        return
    prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)


def _die_after(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK_S)
    os.kill(os.getpid(), signal.SIGKILL)


_PR_SET_PDEATHSIG = 1
_LOOK_S = 1.0
