"""Times code by processor time, less what slows this machine beside one on which known work takes its usual time."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

_USUAL_S = 0.03
"""What ``_work`` took on an idle machine of two cores that share much [s]."""


def idle_seconds(call: Callable[[], object], repeats: int = 3) -> float:
    """Processor time of a call, the least of some, relative to that of known work right before [s]."""
    return min(_timed(call) * min(_USUAL_S / _timed(_work), 1.0) for _ in range(repeats))


def _timed(call: Callable[[], object]) -> float:
    began = time.process_time()
    call()
    return time.process_time() - began


def _work() -> float:
    """Interpreted and vector work, in equal parts of time."""
    total = sum(k % 7 for k in range(250_000))
    numbers = np.arange(100_000, dtype=np.float64)
    for _ in range(45):
        numbers = np.sqrt(numbers + 1.0)
    return total + float(numbers[0])
