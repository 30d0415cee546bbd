"""Local worker processes: spawned, one thread each, deaf to Ctrl-C, which is the parent's; they die with it."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager

from sva_bench.interrupts import holding_back_ctrl_c


def count_of(wanted: int | None) -> int:
    """How many worker processes: as many as wanted, else one a core."""
    return wanted or len(os.sched_getaffinity(0))


@contextmanager
def local_workers(wanted: int | None) -> Iterator[Executor | None]:
    """An executor of so many processes (default: one a core); ``None`` for one, since this process can do its work."""
    count = count_of(wanted)
    if count <= 1:
        yield None
        return
    before = set(multiprocessing.active_children())
    executor = ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"),
                                   initializer=die_with, initargs=(os.getpid(),))
    try:
        with holding_back_ctrl_c():  # workers inherit it for good
            for _ in range(count):  # they start, import and load compiled code while this process plans
                executor.submit(_warm_up)
        yield executor
    except BaseException:
        for worker in set(multiprocessing.active_children()) - before:
            worker.terminate()  # what they are at is of no use any more, and may take long
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def die_with(parent: int) -> None:
    """Have the kernel kill this process as soon as its parent has gone, however it went and whatever this one is at.

    Args:
        parent: The parent's process id, for it may have gone already.
    """
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)


_PR_SET_PDEATHSIG = 1


def _warm_up() -> None:
    import sva_bench.execution.execute  # noqa: F401
