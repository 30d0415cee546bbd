"""Local worker processes: spawned, one thread each, deaf to Ctrl-C, which is the parent's to handle."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager


@contextmanager
def local_workers(count: int) -> Iterator[Executor | None]:
    """An executor of so many processes; ``None`` for one, since this process can do its work."""
    if count <= 1:
        yield None
        return
    executor = ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)
    try:
        for _ in range(count):  # they start, import and load compiled code while this process plans
            executor.submit(_warm_up)
        yield executor
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _begin() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _warm_up() -> None:
    import sva_bench.execution.execute  # noqa: F401
