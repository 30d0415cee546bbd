"""What every test begins with."""

from __future__ import annotations

import signal
from collections import Counter

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
    """Of a test that is marked ``first(n)``, leave the cases behind the first n to ``make test-long``."""
    seen: Counter[str] = Counter()
    for item in items:
        mark = item.get_closest_marker("first")
        if mark is not None:
            test = item.nodeid.split("[")[0]
            seen[test] += 1
            if seen[test] > mark.args[0]:
                item.add_marker(pytest.mark.long)
