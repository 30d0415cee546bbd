"""The far end of a guarded worker: runs one job at a time, within its memory, for as long as its parent lives."""

from __future__ import annotations

import logging
import os
import pickle
import resource
import sys
from importlib import import_module
from multiprocessing.connection import Connection

from sva_bench.workers.answers import Answer, Done, Failed
from sva_bench.workers.pool import die_with

_FAILURES_TOLD = 300


def main() -> None:
    """Serve: ``python -m sva_bench.workers.far_end FD PARENT MEMORY_MB PRELOAD``."""
    line, parent, memory_mb = int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    die_with(parent)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if memory_mb:  # what is written to, not what is mapped: libraries reserve far more than they use
        resource.setrlimit(resource.RLIMIT_DATA, (memory_mb << 20, memory_mb << 20))
    warned = _Warnings()
    logging.basicConfig(level=logging.WARNING, handlers=[warned], force=True)
    with Connection(line) as connection:
        import_module(sys.argv[4])  # before time is counted
        connection.send_bytes(b"ready")
        while True:
            try:
                content = connection.recv_bytes()
            except EOFError:
                return
            answer = _answer(content, memory_mb, warned)
            connection.send_bytes(pickle.dumps(answer, protocol=5))
            if isinstance(answer, Failed) and not answer.mendable:
                return  # what a failure leaves behind should meet no other job


class _Warnings(logging.Handler):
    """Keeps what was said, for the parent to say it."""

    def __init__(self) -> None:
        super().__init__()
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.said.append(record.getMessage())


def _answer(content: bytes, memory_mb: int, warned: _Warnings) -> Answer:
    from sva_bench.errors import SvaBenchError

    warned.said = []
    try:
        result = pickle.loads(content).run()
        return Done(result=result, warnings=tuple(warned.said))
    except SvaBenchError as error:
        return Failed(reason=str(error), mendable=True)
    except MemoryError:
        return Failed(reason=f"it wanted more than {memory_mb} MB of memory; give it more with --memory-mb")
    except Exception as error:
        return Failed(reason=f"{type(error).__name__}: {error}"[:_FAILURES_TOLD])


if __name__ == "__main__":
    for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(_name, "1")
    main()
