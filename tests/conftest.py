"""What every test begins with."""

from __future__ import annotations

import signal


def pytest_configure() -> None:
    """Let Ctrl-C reach the programs that tests start, though the tests themselves run in the background of a shell."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
