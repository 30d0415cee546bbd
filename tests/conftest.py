"""What every test begins with."""

from __future__ import annotations

import signal

from hypothesis import settings

# A deadline times the machine, and the compiler at the first call, rather than the code.
settings.register_profile("no deadline", deadline=None)
settings.load_profile("no deadline")


def pytest_configure() -> None:
    """Let Ctrl-C reach the programs that tests start, though the tests themselves run in the background of a shell."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
