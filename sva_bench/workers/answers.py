"""The outcome of a job, and its limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False, kw_only=True)
class Done:
    """A job's result, and the warnings logged while it ran."""

    result: Any
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Failed:
    """Why a job has no result.

    Attributes:
        reason: What happened.
        mendable: Whether the user must correct the input: another attempt would fail too.
    """

    reason: str
    mendable: bool = False


Answer = Done | Failed


@dataclass(frozen=True, kw_only=True)
class Caps:
    """Limits of one job.

    Attributes:
        time_s: Longest time [s].
        memory_mb: Most memory [MB]; 0 = no limit.
        preload: Module that workers import before the time limit starts.
    """

    time_s: float
    memory_mb: int
    preload: str = "sva_bench"
