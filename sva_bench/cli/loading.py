"""The one way in which commands load what takes long."""

from __future__ import annotations

from sva_bench.interrupts import holding_back_ctrl_c


class loading(holding_back_ctrl_c):
    """A block of imports in a command: when they are needed, and with Ctrl-C waiting until they are done.

    ``--help`` would wait for what modules import at their tops. What is wrong with an input is said before libraries
    are loaded that only work on it takes, so a command may have several such blocks; one that takes all of them calls
    ``load_libraries`` first, for Ctrl-C is heard between two parts of it.
    """
