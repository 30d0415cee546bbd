"""Entry point: turns whatever happens into an exit code and one clear message."""

from __future__ import annotations

from sva_bench.safe_path import distrust_current_folder

distrust_current_folder()  # before all else, for what else is imported

import errno  # noqa: E402
import logging  # noqa: E402
import os  # noqa: E402
import sys  # noqa: E402
import traceback  # noqa: E402
from collections.abc import Sequence  # noqa: E402
from pathlib import Path  # noqa: E402

# One thread a process: the workers are the parallelism, and sums keep one order. Before numpy is imported.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import typer  # noqa: E402
from rich.markup import escape  # noqa: E402
from typer.exceptions import TyperException  # noqa: E402

from sva_bench.cli import app  # noqa: E402
from sva_bench.errors import ExitCode, Interrupted, SvaBenchError  # noqa: E402
from sva_bench.printable import printable  # noqa: E402
from sva_bench.terminal import messages  # noqa: E402

_log = logging.getLogger(__name__)


def main() -> None:
    """Run the command line."""
    sys.exit(run_command_line(sys.argv[1:]))


def run_command_line(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code; every failure becomes one message on standard error."""
    try:
        result = app(list(arguments), standalone_mode=False)
        sys.stdout.flush()  # here, where a full disk or a closed pipe is answered for
    except Interrupted as kept:
        messages.print(escape(str(kept)), highlight=False, soft_wrap=True)
        return int(kept.exit_code)
    except SvaBenchError as error:
        messages.print(f"[bold red]error:[/bold red] {escape(str(error))}", highlight=False, soft_wrap=True)
        return int(error.exit_code)
    except TyperException as error:  # bad usage: knows how to show itself, with a hint at --help
        from pydantic import ValidationError  # --help should not wait for it

        from sva_bench.complaints import of_an_option

        if isinstance(error.__cause__, ValidationError):
            error.message = of_an_option(error.__cause__)
        error.message = printable(error.message)
        getattr(error, "show", error.format_message)()
        return error.exit_code
    except (KeyboardInterrupt, typer.Abort):
        messages.print("interrupted")
        return int(ExitCode.INTERRUPTED)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # whoever read standard output has gone; say no more
        return int(ExitCode.DONE)
    except Exception as error:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EROFS):
            messages.print(f"[bold red]error:[/bold red] nothing can be written: {error.strerror}", highlight=False)
            return int(ExitCode.BAD_INPUT)
        frame = traceback.extract_tb(error.__traceback__)[-1]
        messages.print(f"[bold red]fault:[/bold red] {escape(type(error).__name__)}: {escape(str(error))} "
                       f"({escape(Path(frame.filename).name)}:{frame.lineno})\nThis is a fault of the program or its "
                       "installation, not of your input: please report it.", highlight=False, soft_wrap=True)
        _log.debug("where it happened", exc_info=True)
        return int(ExitCode.FAULT)
    code = int(result) if isinstance(result, int) else int(ExitCode.DONE)
    if code == ExitCode.INTERRUPTED:  # the command line's own answer to Ctrl-C is a number alone
        messages.print("interrupted")
    return code


if __name__ == "__main__":
    main()
