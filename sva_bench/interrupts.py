"""Ctrl-C, held back where it would break something or lose work, and heard where the work so far is kept.

Python raises ``KeyboardInterrupt`` wherever it stands, in a callback of compiled code too, which turns it into another
error or swallows it. So whoever keeps work says where it may come:

- ``deferring_ctrl_c``: nothing is raised in the block. Around calls of compiled code, and around work that is worth
  keeping, from its beginning until it is written.
- ``hearing_ctrl_c``, inside such a block: here it is raised, at once if it was pressed before. Whoever opens this block
  catches it and keeps what there is.
- ``holding_back_ctrl_c``: the signal itself is held back. For imports, and for starting workers, which inherit that.

Once pressed it stays so until the outermost block ends: whatever is begun in the meantime and would hear it ends at
once. The outermost block raises it at its end unless somebody heard it. Outside of all blocks nothing is changed;
blocks do nothing outside of the main thread, where Python raises no ``KeyboardInterrupt``, or where Ctrl-C is ignored.

Compiled code that takes long looks at ``flag`` (``solver/looking.py``) and ends early, with a result of no use: the end
of the block around it raises before anybody uses it.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any

_NOT, _PRESSED, _HEARD = 0, 1, 2
_AGAIN_S = 0.05
_flag = bytearray(1)  # shared with compiled code, so it stays one and the same object
_blocks: list[bool] = []  # whether Ctrl-C is heard; the innermost last
_before: Callable[[int, FrameType | None], Any] | None = None


def flag() -> bytearray:
    """One byte, not 0 as soon as Ctrl-C was pressed in a block."""
    return _flag if _blocks and _in_main_thread() else bytearray(1)


def pressed() -> bool:
    """Whether Ctrl-C was pressed since the outermost block around began."""
    return _flag[0] != _NOT and bool(_blocks) and _in_main_thread()


def hear_ctrl_c() -> None:
    """Raise what was pressed and not heard yet, if it is heard here: for loops, in case a callback swallowed it."""
    if pressed() and _flag[0] == _PRESSED and _blocks[-1]:
        raise KeyboardInterrupt


def heard_ctrl_c() -> None:
    """Say that somebody acts upon it: no need to raise it in the end."""
    if pressed():
        _flag[0] = _HEARD


class _Block:
    """A block in which Ctrl-C is heard, or isn't."""

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
            _blocks[self._depth:] = [False]  # and with it blocks whose end was cut short
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
        due = _flag[0] == _PRESSED
        _flag[0] = _NOT
        _blocks.pop()
        signal.signal(signal.SIGINT, _before)
        if kind is None and (due or _flag[0] != _NOT):
            _flag[0] = _NOT
            raise KeyboardInterrupt


class deferring_ctrl_c(_Block):
    """Ctrl-C waits until the end of the block. Numba's compiler, which takes long, doesn't let it wait."""


class hearing_ctrl_c(_Block):
    """Ctrl-C is raised in the block, though it waits around it; at once if it was pressed before."""

    _hears = True


class holding_back_ctrl_c(_Block):
    """Ctrl-C waits until the end of the block, the signal itself too; nothing of it is lost.

    For starting workers, which inherit the mask for good, and for imports: native libraries abort the process when
    an exception comes up in the middle of their initialisation.
    """

    _masks = True


def _on_ctrl_c(signum: int, frame: FrameType | None) -> None:
    if not _blocks:  # between two
        if _before is not None:
            _before(signum, frame)
        return
    if _flag[0] == _NOT:
        _flag[0] = _PRESSED
    if _blocks[-1]:
        raise KeyboardInterrupt
    if len(_blocks) > 1 and _blocks[-2] and _compiling(frame):
        if frame is not None and "llvmlite" in frame.f_code.co_filename:  # a callback would swallow it: once more soon
            again = threading.Timer(_AGAIN_S, _once_more)
            again.daemon = True
            again.start()
        else:
            raise KeyboardInterrupt


def _once_more() -> None:
    if _flag[0] == _PRESSED:
        signal.raise_signal(signal.SIGINT)


def _compiling(frame: FrameType | None) -> bool:
    """Whether numba is compiling, which is plain Python but for callbacks of llvmlite."""
    while frame is not None:
        if frame.f_code.co_name == "_compile_for_args":
            return True
        frame = frame.f_back
    return False


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
