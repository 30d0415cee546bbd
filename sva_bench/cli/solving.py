"""A solve as it goes on: value, bound, gap and nodes on standard error."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import Protocol

from rich.progress import Progress, ProgressColumn, SpinnerColumn, Task, TimeElapsedColumn
from rich.text import Text

from sva_bench.cli.terminal import messages
from sva_bench.files.printable import counted
from sva_bench.interrupts import holding_back_ctrl_c

_EVERY_S = 10.0  # between lines where standard error is no terminal


class Found(Protocol):
    """What a search has found by now."""

    @property
    def objective(self) -> str: ...
    @property
    def value(self) -> float: ...
    @property
    def bound(self) -> float: ...
    @property
    def nodes(self) -> int: ...


@contextmanager
def watched_solve(every_s: float = _EVERY_S) -> Iterator[Callable[[Found], None]]:
    """Shows what a search has found while the block lasts: in a line that changes, or where that is no terminal in a
    line at times.

    Args:
        every_s: Time between such lines [s].

    Returns:
        What is called with each search as it begins.
    """
    searches: list[Found] = []

    def told() -> str:
        return said(searches[-1]) if searches else "solving"

    show = _line_that_changes if messages.is_terminal else _lines
    with show(told, every_s):
        yield searches.append


def said(found: Found) -> str:
    """What a search has found, in a line."""
    value, bound = found.value, found.bound
    gap = (bound - value) / abs(value) if value else math.inf
    known = f", bound {bound:.6g}, gap {100 * max(gap, 0.0):.2g} %" if math.isfinite(gap) else ""
    return f"{found.objective}: value {value:.6g}{known}, {counted(found.nodes, 'node')}"


class _Told(ProgressColumn):
    """A text that is asked for anew each time it is drawn."""

    def __init__(self, told: Callable[[], str]) -> None:
        super().__init__()
        self._told = told

    def render(self, _: Task) -> Text:
        return Text(self._told())


@contextmanager
def _line_that_changes(told: Callable[[], str], _: float) -> Iterator[None]:
    line = Progress(SpinnerColumn(), _Told(told), TimeElapsedColumn(), console=messages, transient=True)
    line.add_task("")
    try:
        with holding_back_ctrl_c():  # the thread that draws it inherits it: Ctrl-C is this one's to hear
            line.start()
        yield
    finally:
        line.stop()


@contextmanager
def _lines(told: Callable[[], str], every_s: float) -> Iterator[None]:
    messages.print("solving ...", highlight=False)
    ended = Event()

    def tell() -> None:
        while not ended.wait(every_s):
            messages.print(told(), highlight=False)

    thread = Thread(target=tell, daemon=True)
    try:
        with holding_back_ctrl_c():
            thread.start()
        yield
    finally:
        ended.set()
        thread.join()
