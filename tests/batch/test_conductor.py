"""The conductor by itself: strands of jobs that add numbers, and an engine that does them when it is told to."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from sva_bench.batch.cache import Cache
from sva_bench.batch.conductor import ATTEMPTS, Conductor, Hooks
from sva_bench.workers.answers import Answer, Done, Failed
from sva_bench.workers.engine import Job


@dataclass(frozen=True)
class Add:
    """A job: the sum of two numbers."""

    kind: ClassVar[str] = "sums"
    kept: ClassVar[bool] = True
    result: ClassVar[Any] = tuple[int, ...]
    a: int
    b: int

    @property
    def key(self) -> str:
        return f"{self.a:064d}{self.b}"

    @property
    def what(self) -> str:
        return f"{self.a} + {self.b}"

    def run(self) -> tuple[int, ...]:
        return (self.a + self.b,)

    def fits(self, result: tuple[int, ...]) -> bool:
        return result == (self.a + self.b,)


class Fake:
    """An engine that answers the last job first, as ``answer`` says, and counts what it was given."""

    slots = 2

    def __init__(self, answer: Callable[[Job], Answer]) -> None:
        self._answer, self._held = answer, list[tuple[str, Job]]()
        self.given: list[str] = []

    def submit(self, key: str, job: Job) -> None:
        assert len(self._held) < self.slots
        self.given.append(job.what)
        self._held.append((key, job))

    def answers(self, timeout_s: float) -> Sequence[tuple[str, Answer]]:
        assert timeout_s > 0
        key, job = self._held.pop()
        return [(key, self._answer(job))]

    def close(self) -> None:
        self._held.clear()


Sums = Generator[Sequence[Job], Sequence[Any], None]


def done(job: Job) -> Answer:
    return Done(result=job.run())


def conduct(folder: Path, engine: Fake, strands: Sequence[Sums]) -> list[tuple[str, int]]:
    """Bring strands to their end: the failures told of."""
    failed: list[tuple[str, int]] = []
    hooks = Hooks(shard=lambda *_: None, unit_failed=lambda *_: None, tick=lambda: None,
                  strand_failed=lambda _, __, reason, attempts: failed.append((reason, attempts)))
    point: Any = None
    Conductor(engine, Cache(folder=folder), hooks).run((point, 0, strand) for strand in strands)
    return failed


def summing(found: list[Any], steps: Sequence[Sequence[Add]]) -> Sums:
    """A strand that asks for the jobs of each step, and keeps what it is given."""
    for step in steps:
        results = yield list(step)
        found += [results]


def test_results_come_in_the_order_asked_for_and_step_by_step(tmp_path: Path) -> None:
    found: list[Any] = []
    engine = Fake(done)
    assert conduct(tmp_path, engine, [summing(found, [[Add(1, 2), Add(3, 4)], [Add(5, 6)]])]) == []
    assert found == [[(3,), (7,)], [(11,)]]
    assert engine.given == ["1 + 2", "3 + 4", "5 + 6"]


def test_strands_share_a_job_and_a_later_batch_finds_it_kept(tmp_path: Path) -> None:
    one: list[Any] = []
    two: list[Any] = []
    engine = Fake(done)
    conduct(tmp_path, engine, [summing(one, [[Add(1, 2)]]), summing(two, [[Add(3, 4), Add(1, 2)]])])
    assert (one, two) == ([[(3,)]], [[(7,), (3,)]])
    assert sorted(engine.given) == ["1 + 2", "3 + 4"]
    again: list[Any] = []
    idle = Fake(done)
    conduct(tmp_path, idle, [summing(again, [[Add(1, 2)]])])
    assert (again, idle.given) == ([[(3,)]], [])


def test_a_job_that_fails_is_tried_again_and_then_its_strand_given_up(tmp_path: Path) -> None:
    found: list[Any] = []
    other: list[Any] = []
    engine = Fake(lambda job: Failed(reason="crashed") if job.what == "1 + 2" else done(job))
    failed = conduct(tmp_path, engine, [summing(found, [[Add(1, 2)], [Add(5, 6)]]), summing(other, [[Add(3, 4)]])])
    assert failed == [("1 + 2: crashed", ATTEMPTS)]
    assert engine.given.count("1 + 2") == ATTEMPTS
    assert (found, other) == ([], [[(7,)]])
    assert "5 + 6" not in engine.given


def test_a_world_whose_jobs_all_hang_is_given_up_before_most_of_them_are_tried(tmp_path: Path) -> None:
    other: list[Any] = []
    engine = Fake(lambda job: Failed(reason="too long") if job.what.startswith("1 ") else done(job))
    drives = [Add(1, number) for number in range(12)]
    failed = conduct(tmp_path, engine, [summing([], [drives]), summing(other, [[Add(3, 4)], [Add(5, 6)]])])
    ((reason, attempts),) = failed
    assert reason.endswith("too long")
    assert attempts == ATTEMPTS
    # Those that were in flight beside the one given up may have been tried as often, and no other at all.
    assert sum(what.startswith("1 ") for what in engine.given) <= engine.slots * ATTEMPTS
    assert other == [[(7,)], [(11,)]]


def test_what_the_user_must_mend_is_tried_once(tmp_path: Path) -> None:
    engine = Fake(lambda _: Failed(reason="no such file", mendable=True))
    assert conduct(tmp_path, engine, [summing([], [[Add(1, 2)]])]) == [("1 + 2: no such file", 1)]
    assert engine.given == ["1 + 2"]
