"""A worker process whose crash or hang is reported as an answer."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import socket
import subprocess
import sys
import time
from multiprocessing.connection import Connection

from sva_bench.environment import environment_of_children
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.workers.answers import Answer, Caps, Failed

_START_S = 300.0
"""Time limit of a worker's start [s]; on a busy machine its imports take half a minute."""

_HINTS = {"SIGKILL": ", sent by somebody, or for want of memory", "SIGABRT": ", raised by a library, perhaps for want "
          "of memory"}


class GuardedWorker:
    """One process, one job at a time.

    Not a ``multiprocessing`` process, which a Dask worker may not have as a child.
    """

    def __init__(self, caps: Caps) -> None:
        self.caps = caps
        ours, theirs = socket.socketpair()
        with theirs, holding_back_ctrl_c():  # the child inherits the signal mask: only the parent handles Ctrl-C
            # Libraries may print to standard output, which belongs to the command.
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "sva_bench.workers.far_end", str(theirs.fileno()), str(os.getpid()),
                 str(caps.memory_mb), caps.preload],
                pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL, env=environment_of_children())
        self.connection = Connection(ours.detach())
        self.ready = False
        self._due = time.monotonic() + _START_S

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def ask(self, content: bytes) -> Answer:
        """Run a pickled job and wait for the answer."""
        if self.ready:
            self.give(content)
        while True:
            if not self.connection.poll(max(self.left_s(), 0.0)):
                return self.overdue()
            answer = self.take()
            if answer is not None:
                return answer
            self.give(content)

    def give(self, content: bytes) -> None:
        """Send a pickled job; the worker must be ready and idle. If it has died, ``take`` reports it."""
        self._due = time.monotonic() + self.caps.time_s
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self.connection.send_bytes(content)

    def left_s(self) -> float:
        """Time until the limit of its job or start [s]."""
        return self._due - time.monotonic()

    def take(self) -> Answer | None:
        """Receive its message: an answer, or ``None`` if it became ready. Call it when the connection has data."""
        try:
            content = self.connection.recv_bytes()
        except (EOFError, OSError):
            return Failed(reason=self._cause_of_death())
        if not self.ready:
            self.ready = True
            return None
        answer: Answer = pickle.loads(content)  # trusted: from a child process by a private pipe
        return answer

    def overdue(self) -> Failed:
        """Kill it, since its time limit has passed."""
        self.close()
        if not self.ready:
            return Failed(reason=f"the worker process didn't start within {_START_S:g} s")
        return Failed(reason=f"it took longer than {self.caps.time_s:g} s; give it more with --unit-time-limit")

    def close(self) -> None:
        """Kill the process and close the connection."""
        self._process.kill()
        self._process.wait()
        self.connection.close()

    def _cause_of_death(self) -> str:
        try:
            status = self._process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            return "the worker process closed its line"
        if status < 0:
            name = signal.Signals(-status).name if -status in set(signal.Signals) else str(-status)
            return f"the worker process crashed: {name}{_HINTS.get(name, '')}"
        return f"the worker process ended with status {status}"
