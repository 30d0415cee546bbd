"""The engine of a Dask cluster. The only importer of distributed, which is an optional extra."""

from __future__ import annotations

import contextlib
import logging
import pickle
import queue
import time
from pathlib import Path
from typing import Any
from uuid import uuid4

from sva_bench.errors import BadInput
from sva_bench.files.digest import code_digest
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.workers.answers import Answer, Caps, Failed
from sva_bench.workers.engine import Job
from sva_bench.workers.guarded import GuardedWorker

_CONNECT_S = 10.0
_LOST_S = 60.0
"""Time without contact after which the scheduler counts as lost [s]."""
_COUNT_S = 2.0


class DaskCluster:
    """The workers of a Dask scheduler; each runs jobs in a guarded process that contains crashes and hangs."""

    def __init__(self, address: str, caps: Caps) -> None:
        try:
            with holding_back_ctrl_c():
                from distributed import Client
        except ImportError:
            raise BadInput("--dask: distributed isn't installed; pip install 'sva-bench[dask]'") from None
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # relevant events have messages of our own
        where = {"scheduler_file": address} if Path(address).is_file() else {"address": address}
        try:
            self._client = Client(**where, timeout=_CONNECT_S)
        except (OSError, TimeoutError, ValueError) as error:
            raise BadInput(f"--dask {address}: no Dask scheduler answers there ({error})") from None
        self._address, self._caps = address, caps
        self._futures: dict[Any, str] = {}
        self._counted, self._threads = -_COUNT_S, 0
        self._seen = time.monotonic()

    @property
    def slots(self) -> int:
        """Two jobs for each thread of the cluster, so that none idles; workers may come and go."""
        if time.monotonic() - self._counted > _COUNT_S:
            self._threads = sum(self._client.nthreads().values()) if self._client.status == "running" else self._threads
            self._counted = time.monotonic()
        return 2 * max(self._threads, 1)

    def submit(self, key: str, job: Job) -> None:
        """Send the job to the cluster, which runs it again elsewhere if a worker is lost."""
        future = self._client.submit(run_guarded, pickle.dumps(job, protocol=5), self._caps, code_digest(),
                                     key=f"sva-bench-{uuid4().hex}", pure=False)
        self._futures[future] = key

    def answers(self, timeout_s: float) -> list[tuple[str, Answer]]:
        """Wait for futures.

        Raises:
            BadInput: If the scheduler is gone.
        """
        from distributed import wait

        with contextlib.suppress(TimeoutError):
            wait(list(self._futures), timeout=timeout_s, return_when="FIRST_COMPLETED")
        if self._client.status == "running":
            self._seen = time.monotonic()
        elif time.monotonic() - self._seen > _LOST_S:
            raise BadInput(f"--dask {self._address}: the scheduler is gone; what is done is kept: start it and go on "
                           "with --resume")
        found = []
        for future in [future for future in self._futures if future.done()]:
            key = self._futures.pop(future)
            found.append((key, _answer(future)))
            future.release()
        return found

    def close(self) -> None:
        """Cancel all jobs in flight and disconnect."""
        try:
            self._client.cancel(list(self._futures))
        finally:
            self._client.close(timeout=5)


def _answer(future: Any) -> Answer:
    if future.status == "finished":
        answer: Answer = future.result()
        return answer
    if future.status == "error":
        return Failed(reason=f"the cluster gave it up: {future.exception()}"[:300])
    return Failed(reason="the cluster lost it")


_idle: queue.SimpleQueue[GuardedWorker] = queue.SimpleQueue()


def run_guarded(content: bytes, caps: Caps, code: str) -> Answer:
    """Run a job in a guarded process of this worker's machine."""
    if code != code_digest():
        return Failed(reason="a worker of the cluster has another version of sva-bench or of its libraries; install "
                      "the same everywhere", mendable=True)
    try:
        worker = _idle.get_nowait()
        if worker.caps != caps:
            worker.close()
            raise queue.Empty
    except queue.Empty:
        worker = GuardedWorker(caps)
    answer = worker.ask(content)
    if isinstance(answer, Failed) and not answer.mendable:
        worker.close()
    else:
        _idle.put(worker)
    return answer
