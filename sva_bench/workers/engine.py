"""The interfaces of jobs and of the engines that run them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Protocol

from sva_bench.workers.answers import Answer


class Job(Protocol):
    """One piece of work.

    Attributes:
        kind: Kind of its result, for the cache.
        kept: Whether its result is cached.
        result: Type of its result.
    """

    kind: ClassVar[str]
    kept: ClassVar[bool]
    result: ClassVar[Any]

    @property
    def key(self) -> str:
        """Hash of all that the result depends on; equal jobs run once."""

    @property
    def what(self) -> str:
        """A description for messages."""

    def run(self) -> Any:
        """Compute the result."""

    def fits(self, result: Any) -> bool:
        """Whether a result of the right type is consistent with this job, so that later steps can rely on it."""



class Engine(Protocol):
    """Runs jobs and returns their answers in any order; every job is answered."""

    @property
    def slots(self) -> int:
        """How many jobs it runs at a time."""

    def submit(self, key: str, job: Job) -> None:
        """Accept a job under a key."""

    def answers(self, timeout_s: float) -> Sequence[tuple[str, Answer]]:
        """The answers that arrive within the timeout, by the keys of their jobs."""

    def close(self) -> None:
        """Cancel all jobs in flight."""
