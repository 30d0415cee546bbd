"""What comes back of a job."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False, kw_only=True)
class Done:
    """A job's result, and what was warned of on the way."""

    result: Any
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Failed:
    """Why a job has no result.

    Attributes:
        reason: What happened.
        mendable: It is the user's to mend: trying again changes nothing.
    """

    reason: str
    mendable: bool = False


Answer = Done | Failed


@dataclass(frozen=True, kw_only=True)
class Caps:
    """How much one job may take.

    Attributes:
        time_s: Longest time [s].
        memory_mb: Most memory [MB]; 0 = any.
        preload: Module that jobs are of; a worker loads it before time is counted.
    """

    time_s: float
    memory_mb: int
    preload: str = "sva_bench"
