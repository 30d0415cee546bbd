"""The scheduler of a batch: submits jobs as strands need them, caches their results, and retries failures."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from sva_bench.batch.cache import Cache
from sva_bench.batch.grid import Point
from sva_bench.batch.jobs import TrialsJob
from sva_bench.batch.shards import Shard
from sva_bench.batch.strands import Strand
from sva_bench.workers.answers import Answer, Done
from sva_bench.workers.engine import Engine, Job

ATTEMPTS = 3
_TICK_S = 0.5

_log = logging.getLogger(__name__)


@dataclass(eq=False, kw_only=True)
class ActiveStrand:
    """A strand that is being executed.

    Attributes:
        point, seed: What it measures.
        strand: Its generator of jobs.
        results: Results of the current step's jobs, by position.
        missing: Number of results still missing.
        failure: Why one of the jobs failed for good, and after how many attempts.
    """

    point: Point
    seed: int
    strand: Strand
    results: list[Any] = field(default_factory=list)
    missing: int = 0
    failure: tuple[str, int] | None = None


@dataclass(frozen=True, kw_only=True)
class Hooks:
    """Callbacks of the conductor.

    Attributes:
        shard: A unit is complete: its name and shard.
        unit_failed: A unit failed for good: its name, why, after how many attempts.
        strand_failed: The remaining units of a point and seed failed: why, after how many attempts.
        tick: Called regularly.
    """

    shard: Callable[[str, Shard], None]
    unit_failed: Callable[[str, str, int], None]
    strand_failed: Callable[[Point, int, str, int], None]
    tick: Callable[[], None]


class Conductor:
    """Executes strands. They share jobs of equal hash, whether queued, running or cached."""

    def __init__(self, engine: Engine, cache: Cache, hooks: Hooks) -> None:
        self._engine, self._cache, self._hooks = engine, cache, hooks
        self._queue: deque[str] = deque()
        self._jobs: dict[str, Job] = {}
        self._attempts: dict[str, int] = {}
        self._waiting_strands: dict[str, list[tuple[ActiveStrand, int]]] = {}
        self._in_flight = 0
        self._open = 0
        self._given_up: dict[str, tuple[str, int]] = {}
        self._warned: set[str] = set()

    def run(self, strands: Iterator[tuple[Point, int, Strand]]) -> None:
        """Execute all strands to their end."""
        more = True
        while more or self._open:
            # A few more strands than workers, so that none idles, and memory stays bounded.
            while more and self._open < 2 * self._engine.slots + 2 and len(self._queue) < 4 * self._engine.slots:
                upcoming = next(strands, None)
                if upcoming is None:
                    more = False
                    break
                self._open += 1
                self._advance(ActiveStrand(point=upcoming[0], seed=upcoming[1], strand=upcoming[2]), None)
            while self._queue and self._in_flight < self._engine.slots:
                key = self._queue.popleft()
                if all(active.failure is not None for active, _ in self._waiting_strands[key]):
                    self._drop(key)
                    continue
                self._attempts[key] = self._attempts.get(key, 0) + 1
                self._in_flight += 1
                self._engine.submit(key, self._jobs[key])
            if self._in_flight:
                for key, answer in self._engine.answers(_TICK_S):
                    self._in_flight -= 1
                    self._take(key, answer)
            self._hooks.tick()

    def _advance(self, active: ActiveStrand, results: Sequence[Any] | None) -> None:
        """Advance a strand to its next step that has to wait for jobs."""
        while True:
            try:
                jobs = active.strand.send(results) if results is not None else next(active.strand)
            except StopIteration:
                self._open -= 1
                return
            active.results, active.missing = [None] * len(jobs), 0
            for position, job in enumerate(jobs):
                key = job.key
                if key in self._given_up:
                    active.failure = active.failure or self._given_up[key]
                    continue
                if key not in self._jobs:
                    kept = self._cache.get(job, key) if job.kept else None
                    if kept is not None:
                        active.results[position] = kept
                        continue
                    self._jobs[key] = job
                    self._queue.append(key)
                self._waiting_strands.setdefault(key, []).append((active, position))
                active.missing += 1
            if active.missing:
                return
            if active.failure is not None:
                self._give_up(active, active.failure)
                return
            results = active.results

    def _drop(self, key: str) -> None:
        """Cancel a job that only failed strands need, so that a world that hangs costs no more time."""
        del self._jobs[key]
        self._attempts.pop(key, None)
        for active, _ in self._waiting_strands.pop(key):
            active.missing -= 1
            if not active.missing and active.failure is not None:
                self._give_up(active, active.failure)

    def _give_up(self, active: ActiveStrand, failure: tuple[str, int]) -> None:
        self._open -= 1
        active.strand.close()
        self._hooks.strand_failed(active.point, active.seed, *failure)

    def _take(self, key: str, answer: Answer) -> None:
        job, attempts = self._jobs[key], self._attempts[key]
        if not isinstance(answer, Done) and not answer.mendable and attempts < ATTEMPTS:
            _log.info("%s: %s; trying again", job.what, answer.reason)
            self._queue.appendleft(key)  # first, so that a world whose drives all hang is given up early
            return
        if isinstance(answer, Done):
            for warning in answer.warnings:
                if warning not in self._warned:
                    self._warned.add(warning)
                    _log.warning("%s", warning)
            if job.kept:
                self._cache.put(job, key, answer.result)
            elif isinstance(job, TrialsJob):
                self._hooks.shard(job.unit, answer.result)
        elif isinstance(job, TrialsJob):
            self._hooks.unit_failed(job.unit, f"{job.what}: {answer.reason}", attempts)
        else:
            self._given_up[key] = (f"{job.what}: {answer.reason}", attempts)
        del self._jobs[key], self._attempts[key]
        for active, position in self._waiting_strands.pop(key):
            active.missing -= 1
            if isinstance(answer, Done):
                active.results[position] = answer.result if job.kept else None
            elif job.kept:
                active.failure = active.failure or self._given_up[key]
            if active.missing:
                continue
            if active.failure is None:
                self._advance(active, active.results)
            else:
                self._give_up(active, active.failure)
