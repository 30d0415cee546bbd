"""Standard output and standard error that tolerate closed pipes, closed descriptors and full disks."""

from __future__ import annotations

import io
import os
import select
import sys
from typing import Any

STANDARD_OUTPUT, STANDARD_ERROR = 1, 2
CLOSED = "standard output is closed, and the result would be lost"


class Stream(io.FileIO):
    """A file descriptor that discards output once writing fails, so that the command still completes.

    Attributes:
        lost: Why output was lost; ``None`` if none was, or the reader closed the pipe.
        leads_nowhere: Whether it was closed before this process began.
    """

    def __init__(self, descriptor: int, *, leads_nowhere: bool = False) -> None:
        super().__init__(descriptor, "wb", closefd=False)
        self.lost: str | None = None
        self.leads_nowhere = leads_nowhere

    def write(self, content: Any) -> int:
        """Write some or all of the content; the number of bytes."""
        try:
            while True:
                written = super().write(content)
                if written is not None:
                    return written
                select.select([], [self.fileno()], [])  # a nonblocking pipe that is full
        except OSError as error:
            if not isinstance(error, BrokenPipeError):
                self.lost = error.strerror or str(error)
            _redirect_to_null(self.fileno())
            return len(memoryview(content).cast("B"))


def take_over() -> Stream:
    """Replace standard output and error by streams that never raise; the one of standard output.

    Closed descriptors are redirected to the null device: else the next file opened would get one of them, and
    output would be written into it.
    """
    closed = set()
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            closed.add(descriptor)
            _redirect_to_null(descriptor)
    output = Stream(STANDARD_OUTPUT, leads_nowhere=STANDARD_OUTPUT in closed)
    errors = Stream(STANDARD_ERROR, leads_nowhere=STANDARD_ERROR in closed)
    sys.stdout = _text(output, sys.stdout, line_by_line=output.isatty())
    sys.stderr = _text(errors, sys.stderr, line_by_line=True)
    return output


def output_is_closed() -> bool:
    """Whether standard output was closed when this process started, so that a result written to it would be lost."""
    stream = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return sys.stdout is None or (isinstance(stream, Stream) and stream.leads_nowhere)


def _text(stream: Stream, before: Any, *, line_by_line: bool) -> io.TextIOWrapper:
    encoding = "utf-8" if before is None else before.encoding
    # Characters that the encoding lacks are escaped.
    return io.TextIOWrapper(io.BufferedWriter(stream), encoding, "backslashreplace", line_buffering=line_by_line)


def _redirect_to_null(descriptor: int) -> None:
    nowhere = os.open(os.devnull, os.O_RDWR)
    if nowhere == descriptor:
        os.set_inheritable(nowhere, True)  # as those of all programs are
    else:
        os.dup2(nowhere, descriptor)
        os.close(nowhere)
