"""What every test begins with."""

from __future__ import annotations

import signal

import pytest
from hypothesis import settings

# A deadline times the machine, and the compiler at the first call, rather than the code.
settings.register_profile("no deadline", deadline=None)
settings.load_profile("no deadline")


def pytest_configure() -> None:
    """Let Ctrl-C reach the programs that tests start, though the tests themselves run in the background of a shell."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Of a test that is marked ``spread(n)``, leave all but n cases to ``make test-long``: those kept lie far apart."""
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("spread") is not None:
            cases.setdefault(item.nodeid.split("[")[0], []).append(item)
    for those in cases.values():
        mark = those[0].get_closest_marker("spread")
        kept = {k * len(those) // mark.args[0] for k in range(mark.args[0])} if mark else set()
        for k, item in enumerate(those):
            if k not in kept:
                item.add_marker(pytest.mark.long)
