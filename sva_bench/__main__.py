"""Entry point: turns whatever happens into an exit code and one clear message."""

from __future__ import annotations

import os
import sys


def main() -> None:
    """Run the command line."""
    # One thread a process: the workers are the parallelism, and sums keep one order.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    from sva_bench.cli import run_command_line

    code = run_command_line(sys.argv[1:])
    sys.stdout.flush()
    sys.exit(code)


if __name__ == "__main__":
    main()
