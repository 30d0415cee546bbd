"""What takes long to load, part by part: between two parts Ctrl-C is heard, however slow the disk is."""

from __future__ import annotations

from importlib import import_module

from sva_bench.interrupts import holding_back_ctrl_c

_PARTS = ("geometry.buckets", "travel.roadmap", "solver.two_stage", "execution.execute", "storage.tables",
          "recording.rerun")
"""Each brings a library or two: numba, SciPy and OMPL, HiGHS, PyBullet, Arrow, Rerun."""


def load_libraries() -> None:
    """Load all that a command needs that plans, executes and records."""
    for part in _PARTS:
        with holding_back_ctrl_c():
            import_module(f"sva_bench.{part}")
