"""The engine of guarded worker processes on this machine."""

from __future__ import annotations

import pickle
from collections import deque
from multiprocessing.connection import wait

from sva_bench.workers.answers import Answer, Caps, Failed
from sva_bench.workers.engine import Job
from sva_bench.workers.guarded import GuardedWorker


class LocalProcesses:
    """Guarded workers of this machine."""

    def __init__(self, count: int, caps: Caps) -> None:
        self._caps = caps
        self._workers = [GuardedWorker(caps) for _ in range(count)]
        self._job_of: dict[GuardedWorker, str] = {}
        self._waiting: deque[tuple[str, Job]] = deque()

    @property
    def slots(self) -> int:
        """The number of workers."""
        return len(self._workers)

    @property
    def pids(self) -> list[int]:
        """Process ids of the workers."""
        return [worker.pid for worker in self._workers]

    def submit(self, key: str, job: Job) -> None:
        """Queue the job for the next idle worker."""
        self._waiting.append((key, job))
        self._assign()

    def answers(self, timeout_s: float) -> list[tuple[str, Answer]]:
        """Wait for workers to answer, die or exceed their time limit."""
        busy = [worker for worker in self._workers if worker in self._job_of or not worker.ready]
        until = min([timeout_s, *(max(worker.left_s(), 0.0) for worker in busy)])
        heard = set(wait([worker.connection for worker in self._workers], until))
        found: list[tuple[str, Answer]] = []
        for worker in list(self._workers):
            if worker.connection in heard:
                answer = worker.take()
            elif worker in busy and worker.left_s() <= 0:
                answer = worker.overdue()
            else:
                continue
            if answer is None:
                continue
            job = self._job_of.pop(worker, None)
            if isinstance(answer, Failed) and not answer.mendable:
                self._replace(worker)
                if not worker.ready and job is None and self._waiting:
                    job = self._waiting.popleft()[0]  # fail a job, else workers that can't start are started for ever
            if job is not None:
                found.append((job, answer))
        self._assign()
        return found

    def close(self) -> None:
        """End all workers."""
        for worker in self._workers:
            worker.close()

    def _replace(self, worker: GuardedWorker) -> None:
        worker.close()
        self._workers[self._workers.index(worker)] = GuardedWorker(self._caps)

    def _assign(self) -> None:
        idle = [worker for worker in self._workers if worker.ready and worker not in self._job_of]
        for worker, _ in zip(idle, list(self._waiting), strict=False):
            key, job = self._waiting.popleft()
            self._job_of[worker] = key
            # Pickle is safe here: a private pipe between this process and its own child.
            worker.give(pickle.dumps(job, protocol=5))
