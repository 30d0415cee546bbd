"""The process of a guarded worker: runs one job at a time within a memory limit, as long as its parent lives."""

from __future__ import annotations

import logging
import pickle
import resource
import sys
from importlib import import_module
from multiprocessing.connection import Connection

from sva_bench.workers.answers import Answer, Done, Failed
from sva_bench.workers.pool import kill_with_parent

_MOST_REASON_LENGTH = 300


def main() -> None:
    """The worker's main loop: ``python -m sva_bench.workers.far_end FD PARENT MEMORY_MB PRELOAD``."""
    line, parent, memory_mb = int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    kill_with_parent(parent)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if memory_mb:  # limits written data, not address space: libraries map far more than they use
        resource.setrlimit(resource.RLIMIT_DATA, (memory_mb << 20, memory_mb << 20))
    captured = _Warnings()
    logging.basicConfig(level=logging.WARNING, handlers=[captured], force=True)
    with Connection(line) as connection:
        import_module(sys.argv[4])  # before time is counted
        connection.send_bytes(b"ready")
        while True:
            try:
                content = connection.recv_bytes()
            except EOFError:
                return
            answer = _answer(content, memory_mb, captured)
            connection.send_bytes(pickle.dumps(answer, protocol=5))
            if isinstance(answer, Failed) and not answer.mendable:
                return  # a failure may leave the process in a bad state: no further job runs in it


class _Warnings(logging.Handler):
    """Collects log messages for the parent process to log."""

    def __init__(self) -> None:
        super().__init__()
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())


def _answer(content: bytes, memory_mb: int, captured: _Warnings) -> Answer:
    from sva_bench.errors import SvaBenchError

    captured.messages = []
    try:
        result = pickle.loads(content).run()  # trusted: from the parent process by a private pipe
        return Done(result=result, warnings=tuple(captured.messages))
    except SvaBenchError as error:
        return Failed(reason=str(error), mendable=True)
    except MemoryError:
        return Failed(reason=f"it wanted more than {memory_mb} MB of memory; give it more with --memory-mb")
    except Exception as error:
        return Failed(reason=f"{type(error).__name__}: {error}"[:_MOST_REASON_LENGTH])


if __name__ == "__main__":
    main()
