"""What takes long to load, part by part: between two parts Ctrl-C is heard, however slow the disk is."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module

from sva_bench.interrupts import holding_back_ctrl_c

EVERYTHING = ("geometry.buckets", "travel.roadmap", "solver.two_stage", "execution.execute", "storage.tables",
              "recording.rerun")
"""Each brings a library or two: numba, SciPy and OMPL, HiGHS, PyBullet, Arrow, Rerun."""
PRELOAD = "sva_bench.execution.execute"
"""What worker processes load while this one plans."""


def load_libraries(parts: Sequence[str] = EVERYTHING) -> None:
    """Load these modules; by default all that it takes to plan, execute and record."""
    for part in parts:
        with holding_back_ctrl_c():
            import_module(f"sva_bench.{part}")
