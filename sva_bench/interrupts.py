"""Ctrl-C, held back where it would break something."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def holding_back_ctrl_c() -> Iterator[None]:
    """Ctrl-C waits until the end of the block; nothing of it is lost.

    For starting workers, which inherit the mask for good, and for imports: native libraries abort the process when
    an exception comes up in the middle of their initialisation.
    """
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
