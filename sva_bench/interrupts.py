"""Ctrl-C, deferred where it would break something or lose work, and raised where the work so far is kept.

Python raises ``KeyboardInterrupt`` at whatever line is executing, in a callback of compiled code too, which turns it
into another error or swallows it. So code that keeps partial results marks where it may be raised:

- ``deferring_ctrl_c``: nothing is raised in the block. Around calls of compiled code, and around work that is worth
  keeping, from its beginning until it is written.
- ``hearing_ctrl_c``, inside such a block: here it is raised, at once if it was pressed before. The code that opens this
  block catches it and keeps the partial result.
- ``holding_back_ctrl_c``: the signal itself is blocked. For imports, and for starting workers, which inherit the mask.

Once pressed, Ctrl-C stays pending until the outermost block ends: a ``hearing_ctrl_c`` block entered in the meantime
ends at once. The outermost block raises it at its end unless it was handled. Outside of all blocks nothing is changed;
blocks do nothing outside of the main thread, where Python raises no ``KeyboardInterrupt``, or where Ctrl-C is ignored.

Libraries may swallow what is raised in a callback, or replace it by an error of their own. So it is raised again at
short intervals until it is handled; never while a ``KeyboardInterrupt`` is propagating, where that would interrupt the
cleanup. The command line runs each command in such a block (``as_ctrl_c``).

Compiled code that takes long polls ``flag`` (``solver/polling.py``) and returns early with an invalid result: the end
of the block around it raises before the result is used.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any

_NOT, _PRESSED, _HEARD = 0, 1, 2
_AGAIN_S = 0.05
_flag = bytearray(1)  # shared with compiled code, so it stays one and the same object
_blocks: list[bool] = []  # whether Ctrl-C is heard; the innermost last
_before: Callable[[int, FrameType | None], Any] | None = None
_reminding = _thread.allocate_lock()
_reminds = _reminded = False  # whether a thread sends the signal again, and whether it has since the handler ran


def flag() -> bytearray:
    """One byte, not 0 as soon as Ctrl-C was pressed in a block."""
    return _flag if _blocks and _in_main_thread() else bytearray(1)


def pressed() -> bool:
    """Whether Ctrl-C was pressed since the outermost block around began."""
    return _flag[0] != _NOT and bool(_blocks) and _in_main_thread()


def hear_ctrl_c() -> None:
    """Raise a pending Ctrl-C where it may be raised: for loops, in case a callback swallowed it."""
    if pressed() and _flag[0] == _PRESSED and _blocks[-1] and not _on_its_way():
        raise KeyboardInterrupt


def heard_ctrl_c() -> None:
    """Mark it as handled: it is not raised at the end of the outermost block."""
    if pressed():
        _flag[0] = _HEARD


@contextmanager
def as_ctrl_c(*meant: type[Exception]) -> Iterator[None]:
    """A block that raises Ctrl-C as ``KeyboardInterrupt``, whatever error a library replaces it by.

    Args:
        meant: Our own errors, which are passed on unchanged.

    Raises:
        KeyboardInterrupt: If Ctrl-C was pressed and not handled, at the latest at the end of the block.
    """
    with deferring_ctrl_c(), hearing_ctrl_c():
        try:
            yield
        except meant:
            raise
        except Exception:
            if _flag[0] == _PRESSED and pressed():
                raise KeyboardInterrupt from None
            raise


class _Block:
    """A block in which Ctrl-C is raised, or deferred."""

    _hears = False
    _masks = False

    def __enter__(self) -> None:
        global _before
        self._depth, self._active = len(_blocks), _in_main_thread()
        if self._active and not _blocks:
            before = signal.getsignal(signal.SIGINT)
            self._active = callable(before)
            if callable(before) and before is not _on_ctrl_c:
                _before = before
                signal.signal(signal.SIGINT, _on_ctrl_c)
        if self._masks:
            self._mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        if self._active:
            _blocks.append(False)
            if self._hears and pressed():
                self.__exit__(KeyboardInterrupt, None, None)
                raise KeyboardInterrupt
            _blocks[-1] = self._hears  # last: nothing may be raised once the block is begun and before it is entered

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None,
    ) -> None:
        if self._active:
            _blocks[self._depth:] = [False]  # removes inner blocks too whose exit was interrupted
        if self._masks:
            signal.pthread_sigmask(signal.SIG_SETMASK, self._mask)
        if not self._active:
            return
        if kind is not None and issubclass(kind, KeyboardInterrupt):
            heard_ctrl_c()
        if self._depth > 0:
            _blocks.pop()
            if kind is None:
                hear_ctrl_c()
            return
        with _reminding:  # from here on the thread sends no further signal
            due = _flag[0] == _PRESSED
            _flag[0] = _NOT
        try:
            _blocks.pop()
        finally:  # a key that another thread was told of may be raised just here
            signal.signal(signal.SIGINT, _before)
        if kind is None and (due or _flag[0] != _NOT):
            _flag[0] = _NOT
            raise KeyboardInterrupt


class deferring_ctrl_c(_Block):
    """Ctrl-C is deferred to the end of the block, except while Numba compiles, which takes long."""


class hearing_ctrl_c(_Block):
    """Ctrl-C is raised in this block, inside one that defers it; at once if it was pressed before."""

    _hears = True


class holding_back_ctrl_c(_Block):
    """Ctrl-C is deferred to the end of the block by masking the signal, which stays pending.

    For starting workers, which inherit the mask for good, and for imports: native libraries abort the process when
    an exception comes up in the middle of their initialisation.
    """

    _masks = True


def _on_ctrl_c(signum: int, frame: FrameType | None) -> None:
    global _reminded
    again, _reminded = _reminded, False
    if again and _flag[0] != _PRESSED:
        return  # it was handled meanwhile
    if not _blocks:  # between two
        if _before is not None:
            _before(signum, frame)
        return
    if _flag[0] == _NOT:
        _flag[0] = _PRESSED
    if not (_blocks[-1] or (len(_blocks) > 1 and _blocks[-2] and _compiling(frame))):
        return
    _remind()
    if not (_swallowed(frame) or _on_its_way()):  # else the thread sends it again soon
        raise KeyboardInterrupt


def _swallowed(frame: FrameType | None) -> bool:
    """Whether an exception raised here would be swallowed: in a callback of llvmlite, or in ``__del__``."""
    while frame is not None:  # a SIGTERM that came as Ctrl-C has its own handler's frame in front
        if "llvmlite" in frame.f_code.co_filename or frame.f_code.co_name == "__del__":
            return True
        frame = frame.f_back
    return False


def _on_its_way() -> bool:
    """Whether a caller is handling a ``KeyboardInterrupt``: another one would interrupt its cleanup."""
    error = sys.exception()
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__context__
    return False


def _remind() -> None:
    """Send the signal again at intervals until it is handled."""
    global _reminds
    with _reminding:
        begun, _reminds = _reminds, True
    if not begun:
        _thread.start_new_thread(_press_again, ())


def _press_again() -> None:
    global _reminds, _reminded
    while True:
        time.sleep(_AGAIN_S)
        with _reminding:
            if _flag[0] != _PRESSED:
                _reminds = False
                return
            _reminded = True
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


def _compiling(frame: FrameType | None) -> bool:
    """Whether numba is compiling, which is plain Python but for callbacks of llvmlite."""
    while frame is not None:
        if frame.f_code.co_name == "_compile_for_args":
            return True
        frame = frame.f_back
    return False


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
