"""What jobs are, and what takes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Protocol

from sva_bench.workers.answers import Answer


class Job(Protocol):
    """One piece of work.

    Attributes:
        kind: What sort of result it has.
        kept: Whether its result goes into the cache.
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
        """For a person: what is being done."""

    def run(self) -> Any:
        """Do it."""

    def fits(self, result: Any) -> bool:
        """Whether a result of the right type can be this job's, and nothing that follows would trip over it."""



class Engine(Protocol):
    """Takes jobs and gives answers, in any order; every job is answered."""

    @property
    def slots(self) -> int:
        """How many jobs it wants at a time."""

    def submit(self, key: str, job: Job) -> None:
        """Take a job."""

    def answers(self, timeout_s: float) -> Sequence[tuple[str, Answer]]:
        """Wait for answers; what there is after so long."""

    def close(self) -> None:
        """Drop what is in flight."""
