"""Commands as tests run them: in their own process where nothing hangs on another, which takes seconds to load."""

from __future__ import annotations

import contextlib
import io
import subprocess
import sys
from pathlib import Path

from sva_bench.__main__ import run_command_line


def sva_bench(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder."""
    out, err = io.StringIO(), io.StringIO()
    words = [str(word) for word in arguments]
    with contextlib.chdir(cwd), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run_command_line(words)
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())


def sva_bench_alone(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder and in a process of its own."""
    return subprocess.run([sys.executable, "-m", "sva_bench", *map(str, arguments)], cwd=cwd, text=True,
                          capture_output=True, timeout=300, check=False)
