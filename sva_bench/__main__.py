"""Entry point: turns whatever happens into an exit code and one clear message.

What takes time to import is imported in functions here, once there is somebody who hears Ctrl-C.
"""

from __future__ import annotations

from sva_bench.environment import distrust_current_folder, limit_threads

distrust_current_folder()  # before all else, for what else is imported
limit_threads()

import errno  # noqa: E402
import os  # noqa: E402
import sys  # noqa: E402

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence

_INTERRUPTED = 130
_ends: list[int] = []
"""Signals that asked this process to end, other than Ctrl-C."""
_codes: list[int] = []
"""The exit code, once it is known."""


def main() -> None:
    """Run the command line."""
    _hear_signals()
    import atexit
    import signal

    from sva_bench.files import streams

    atexit.register(_end)  # first, to be called last
    output = streams.take_over()
    code = run_command_line(sys.argv[1:])
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, lambda *_: os._exit(code))  # all is done: there is nothing left to interrupt
    if code == _INTERRUPTED and _ends:
        code = 128 + _ends[0]
    if output.lost is not None and not code:
        sys.stderr.write(f"error: standard output cannot be written to ({output.lost}); what was to stand there is "
                         "lost\n")
        code = 2
    _codes.append(code)
    sys.exit(code)


def run_command_line(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code; every failure becomes one message on standard error."""
    import signal

    import typer
    from rich.markup import escape
    from typer.exceptions import TyperException

    from sva_bench.cli.app import app
    from sva_bench.cli.terminal import messages
    from sva_bench.errors import ExitCode, Interrupted, SvaBenchError
    from sva_bench.files.printable import printable
    from sva_bench.interrupts import as_ctrl_c

    try:
        if signal.getsignal(signal.SIGINT) is _end_at_once:  # from now on there is something to be kept or cleared away
            signal.signal(signal.SIGINT, signal.default_int_handler)
        with as_ctrl_c(SvaBenchError, TyperException, typer.Abort):
            result = app(list(arguments), standalone_mode=False)
        sys.stdout.flush()
    except Interrupted as kept:
        messages.print(escape(str(kept)), highlight=False, soft_wrap=True)
        return int(kept.exit_code)
    except SvaBenchError as error:
        messages.print(f"[bold red]error:[/bold red] {escape(str(error))}", highlight=False, soft_wrap=True)
        return int(error.exit_code)
    except TyperException as error:  # bad usage: knows how to show itself, with a hint at --help
        from pydantic import ValidationError  # --help should not wait for it

        from sva_bench.files.complaints import of_a_choice, of_an_option

        if isinstance(error.__cause__, ValidationError):
            error.message = of_an_option(error.__cause__)
        error.message = of_a_choice(error.message)
        error.message = printable(error.message)
        getattr(error, "show", error.format_message)()
        return error.exit_code
    except (KeyboardInterrupt, typer.Abort):
        messages.print("interrupted")
        return int(ExitCode.INTERRUPTED)
    except Exception as error:
        return _unforeseen(error)
    code = int(result) if isinstance(result, int) else int(ExitCode.DONE)
    if code == ExitCode.INTERRUPTED:  # the command line's own answer to Ctrl-C is a number alone
        messages.print("interrupted")
    return code


def _unforeseen(error: Exception) -> int:
    """Say what nobody caught: a disk without room, or a fault of ours."""
    import logging
    import tempfile
    import traceback
    from pathlib import Path

    from rich.markup import escape

    from sva_bench.cli.terminal import messages
    from sva_bench.errors import ExitCode

    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EROFS):
        # Results name themselves; what is left are temporary files, and not all of their errors know where they were.
        where = error.filename or f"a temporary file in {tempfile.gettempdir()}"
        messages.print(f"[bold red]error:[/bold red] {escape(str(where))} cannot be written ({error.strerror}); make "
                       "room there, or let TMPDIR name another folder", highlight=False, soft_wrap=True)
        return int(ExitCode.BAD_INPUT)
    frame = traceback.extract_tb(error.__traceback__)[-1]
    messages.print(f"[bold red]fault:[/bold red] {escape(type(error).__name__)}: {escape(str(error))} "
                   f"({escape(Path(frame.filename).name)}:{frame.lineno})\nThis is a fault of the program or its "
                   "installation, not of your input: please report it.", highlight=False, soft_wrap=True)
    logging.getLogger(__name__).debug("where it happened", exc_info=True)
    return int(ExitCode.FAULT)


def _hear_signals() -> None:
    """Answer Ctrl-C from the first moment, and let what else ends a process be as tidy; who ignores one goes on so."""
    # Built in: ``signal`` itself takes some milliseconds to import, in which nobody would hear.
    import _signal as signal  # type: ignore[import-not-found]

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end_at_once)
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, _end_like_ctrl_c)


def _end() -> None:
    """End with the exit code of the command, once all is done that others want done at the end.

    To take the interpreter apart, with all that was loaded, takes up to a second; and it forgets our handlers first, so
    that a signal would meanwhile end it with another code.
    """
    if _codes:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_codes[0])


def _end_at_once(*_: object) -> None:
    """Ctrl-C while libraries are loaded: nothing is begun yet that would have to be kept or cleared away."""
    try:
        os.write(2, b"interrupted\n")
    finally:
        os._exit(128 + _ends[0] if _ends else _INTERRUPTED)


def _end_like_ctrl_c(number: int, *_: object) -> None:
    """End as on Ctrl-C, by the same ways: best plans are kept, drafts cleared away, workers ended."""
    import signal

    _ends.append(number)
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # in the background of a shell
        signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.raise_signal(signal.SIGINT)


if __name__ == "__main__":
    main()
