"""What commands print: results on standard output, progress and messages on standard error."""

from __future__ import annotations

import json
import logging
import os
import sys
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.logging import RichHandler
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.segment import Segment

from sva_bench.errors import BadInput
from sva_bench.files.outputs import is_standard_output
from sva_bench.files.printable import printable
from sva_bench.files.streams import CLOSED, output_is_closed
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.workers.progress import OnProgress


class SafeConsole(Console):
    """Prints nothing that a terminal would obey, wherever a text came from: the one door for all that is shown."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """What is to be printed, piece by piece."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(printable(segment.text), segment.style)


class _SafeFormatter(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record))


messages = SafeConsole(stderr=True)
_PIPED = 80
"""Columns of a terminal since there are any: what a pipe ends in is seldom wider."""


def results() -> Console:
    """Standard output; in a pipe as wide as COLUMNS says, else 80 columns."""
    told = os.environ.get("COLUMNS", "")
    width = None if sys.stdout.isatty() else int(told) if told.isdecimal() and 20 <= int(told) <= 1000 else _PIPED
    return SafeConsole(width=width, markup=False)  # names may hold brackets


def print_hanging(text: str, lead: str = "") -> None:
    """Print a line of results; what finds no room in it goes on below, as far in as the text behind ``lead`` begins."""
    console = results()
    indent = " " * len(lead)
    for line in textwrap.wrap(printable(text), console.width, initial_indent=lead, subsequent_indent=indent,
                              break_on_hyphens=False) or [lead.rstrip()]:
        console.print(line, highlight=False, soft_wrap=True)


def refuse_closed_output() -> None:
    """Check, before any work, that standard output takes a result that goes nowhere else.

    Raises:
        BadInput: If it is closed.
    """
    if output_is_closed():
        raise BadInput(f"{CLOSED}; open it")


def print_json(data: Mapping[str, Any]) -> None:
    """Print a result as JSON on standard output.

    Raises:
        BadInput: If that is closed.
    """
    refuse_closed_output()
    sys.stdout.write(json.dumps(data, indent=1, allow_nan=False) + "\n")


def set_up_logging(verbose: bool) -> None:
    """Send warnings to standard error, and everything of ours where the user wants to know more."""
    if messages.is_terminal:
        logging.basicConfig(level=logging.WARNING, format="%(message)s", force=True,
                            handlers=[RichHandler(console=messages, show_time=False, show_path=False)])
    else:  # a line each, whatever reads them
        handler = logging.StreamHandler()
        handler.setFormatter(_SafeFormatter("%(levelname)s %(message)s"))
        logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    logging.getLogger("sva_bench").setLevel(logging.DEBUG if verbose else logging.WARNING)


@contextmanager
def progress_bars() -> Iterator[OnProgress]:
    """Progress bars on standard error; plain lines where that is no terminal."""
    if not messages.is_terminal:
        said: set[str] = set()

        def say(what: str, done: int, of: int) -> None:
            if what not in said and done < of:
                said.add(what)
                messages.print(f"{what} ...", highlight=False)

        yield say
        return
    tasks: dict[str, TaskID] = {}

    def show(what: str, done: int, of: int) -> None:
        if what not in tasks:
            tasks[what] = bars.add_task(what, total=of)
        bars.update(tasks[what], completed=done, total=of)

    bars = Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                    console=messages, transient=True)
    try:
        with holding_back_ctrl_c():  # the thread that draws them inherits it: Ctrl-C is this one's to hear
            bars.start()
        yield show
    finally:
        bars.stop()


def say_written(path: Path | None) -> None:
    """Name the file that a result was written to; nothing where that is standard output."""
    if path is not None and not is_standard_output(path):
        messages.print(f"written to [bold]{escape(str(path))}[/bold]", highlight=False, soft_wrap=True)
