"""Polling for Ctrl-C and the deadline from compiled code.

While compiled code runs, Python handles no signals. So compiled loops call ``poll`` regularly, which lets
Python run its handlers; within ``deferring_ctrl_c`` these only set the flag ``stop``.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numba import njit
from numba.core import types as _numba_types
from numpy.typing import NDArray

from sva_bench.interrupts import flag

_types: Any = _numba_types

POLL_EVERY = 256
"""Steps of some microseconds between two polls."""

_run_handlers = _types.ExternalFunction("PyErr_CheckSignals", _types.int32())
_forget_error = _types.ExternalFunction("PyErr_Clear", _types.void())
_clock_gettime = _types.ExternalFunction("clock_gettime", _types.int32(_types.int32, _types.CPointer(_types.int64)))
_CLOCK = time.CLOCK_MONOTONIC


def stop_flag() -> NDArray[np.uint8]:
    """What ``poll`` reads: not 0 once Ctrl-C was pressed, shape (1,)."""
    return np.frombuffer(flag(), dtype=np.uint8)


@njit(cache=True)
def poll(stop):
    """Whether to stop: runs Python's signal handlers, and reads the flag they set."""
    if _run_handlers() != 0:  # an exception of another handler: compiled code can't raise it, so it stops
        _forget_error()
        stop[0] = 1
    return stop[0] != 0


@njit(cache=True)
def now_s():
    """The monotonic clock [s], from compiled code."""
    parts = np.zeros(2, np.int64)
    _clock_gettime(_CLOCK, parts.ctypes)
    return parts[0] + 1e-9 * parts[1]
