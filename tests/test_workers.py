"""Workers start and end with their parent, whenever Ctrl-C comes."""

from __future__ import annotations

import subprocess
import sys

SCRIPT = """
import multiprocessing, os, signal
from concurrent.futures import ProcessPoolExecutor
from sva_bench.workers import local_workers

submit = ProcessPoolExecutor.submit

def interrupted(*arguments):
    os.kill(os.getpid(), signal.SIGINT)  # as the first worker starts
    return submit(*arguments)

if __name__ == "__main__":
    ProcessPoolExecutor.submit = interrupted
    try:
        with local_workers(2):
            print("lost")
    except KeyboardInterrupt:
        print("caught", len(multiprocessing.active_children()))
"""


def test_ctrl_c_while_workers_start_is_not_lost_and_ends_them() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout == "caught 0\n", done.stderr
