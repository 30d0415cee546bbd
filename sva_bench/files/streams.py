"""Standard output and standard error of a command, whoever reads them: nobody, a pipe that is closed, a full disk."""

from __future__ import annotations

import io
import os
import select
import sys
from typing import Any

STANDARD_OUTPUT, STANDARD_ERROR = 1, 2
CLOSED = "standard output is closed, and the result would be lost"


class Stream(io.FileIO):
    """A file descriptor that goes quiet once nothing can be written to it: the command's work is done all the same.

    Attributes:
        lost: Why something was lost that somebody wants; ``None`` if nothing was. A reader who has gone wants nothing.
        leads_nowhere: Whether it was closed before this process began.
    """

    def __init__(self, descriptor: int, *, leads_nowhere: bool = False) -> None:
        super().__init__(descriptor, "wb", closefd=False)
        self.lost: str | None = None
        self.leads_nowhere = leads_nowhere

    def write(self, content: Any) -> int:
        """Write some or all of it, and say how many bytes."""
        try:
            while True:
                written = super().write(content)
                if written is not None:
                    return written
                select.select([], [self.fileno()], [])  # a pipe that doesn't wait, and is full
        except OSError as error:
            if not isinstance(error, BrokenPipeError):
                self.lost = error.strerror or str(error)
            _to_nowhere(self.fileno())
            return len(memoryview(content).cast("B"))


def take_over() -> Stream:
    """Let this process print to streams that never fail; gives that of standard output.

    Descriptors that were closed lead nowhere from now on: else the next file to be opened would be one of them, and
    what is printed would be written into it.
    """
    closed = set()
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            closed.add(descriptor)
            _to_nowhere(descriptor)
    output = Stream(STANDARD_OUTPUT, leads_nowhere=STANDARD_OUTPUT in closed)
    errors = Stream(STANDARD_ERROR, leads_nowhere=STANDARD_ERROR in closed)
    sys.stdout = _text(output, sys.stdout, line_by_line=output.isatty())
    sys.stderr = _text(errors, sys.stderr, line_by_line=True)
    return output


def output_is_closed() -> bool:
    """Whether standard output was closed when this process began: a result that goes nowhere else would be lost."""
    stream = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return sys.stdout is None or (isinstance(stream, Stream) and stream.leads_nowhere)


def _text(stream: Stream, before: Any, *, line_by_line: bool) -> io.TextIOWrapper:
    encoding = "utf-8" if before is None else before.encoding
    # What an encoding lacks is better shown askew than not at all.
    return io.TextIOWrapper(io.BufferedWriter(stream), encoding, "backslashreplace", line_buffering=line_by_line)


def _to_nowhere(descriptor: int) -> None:
    nowhere = os.open(os.devnull, os.O_RDWR)
    if nowhere == descriptor:
        os.set_inheritable(nowhere, True)  # as those of all programs are
    else:
        os.dup2(nowhere, descriptor)
        os.close(nowhere)
