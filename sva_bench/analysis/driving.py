"""How the drives behind a run were made: how much of them in physics, and how well the twin stands the check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from sva_bench.analysis.results import Amount
from sva_bench.choices import DriveUnit
from sva_bench.files.fields import NonNegativeInt
from sva_bench.files.records import Record


@dataclass(frozen=True, kw_only=True)
class DrivesMade(Record):
    """The drives of a run.

    Attributes:
        unit: What was driven at a time: hops from site to site under ``rollout``, else whole routes.
        count: How many of them.
        in_physics_pct: Share of the driving time that was driven in physics.
        checked: How many were driven in physics for no other reason than to check the twin.
        worst_check_pct: By how much physics took another time on one of them at most; ``None`` without any.
        tipped_over: How many ended because the robot fell on its side.
        physics_failed: How many ended because physics gave no finite pose of the robot; they count as stuck.
    """

    unit: DriveUnit
    count: NonNegativeInt
    in_physics_pct: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=100)]
    checked: NonNegativeInt
    worst_check_pct: Amount | None
    tipped_over: NonNegativeInt
    physics_failed: NonNegativeInt = 0


def driving_told(made: DrivesMade) -> str:
    """The same in a sentence."""
    said = f"{made.in_physics_pct:.3g} % of the driving time of {made.count} {made.unit} in physics"
    if made.checked and made.worst_check_pct is not None:
        said += (f"; {made.checked} of them checked the twin, which was off by {made.worst_check_pct:.2g} % of a "
                 "drive's time at most")
    if made.tipped_over:
        said += f"; {made.tipped_over} ended since the robot fell on its side"
    return said + (f"; in {made.physics_failed} physics failed" if made.physics_failed else "")
