"""Commands in the process of the tests, where nothing hangs on one of their own: each would take seconds to load."""

from __future__ import annotations

import contextlib
import io
import subprocess
from pathlib import Path

from sva_bench.__main__ import run_command_line


def sva_bench(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder."""
    out, err = io.StringIO(), io.StringIO()
    words = [str(word) for word in arguments]
    with contextlib.chdir(cwd), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run_command_line(words)
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())
