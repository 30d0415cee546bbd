"""Local worker processes: spawned, one thread each, deaf to Ctrl-C, which is the parent's to handle."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager

from sva_bench.interrupts import holding_back_ctrl_c


@contextmanager
def local_workers(wanted: int | None) -> Iterator[Executor | None]:
    """An executor of so many processes (default: one a core); ``None`` for one, since this process can do its work."""
    count = wanted or len(os.sched_getaffinity(0))
    if count <= 1:
        yield None
        return
    before = set(multiprocessing.active_children())
    executor = ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"))
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


def _warm_up() -> None:
    import sva_bench.execution.execute  # noqa: F401
