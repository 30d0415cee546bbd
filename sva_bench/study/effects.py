"""What is known of a plan's sources before its executed value: the types."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass

from sva_bench.analysis.results import SourceEffect
from sva_bench.choices import NoiseName, SourceName
from sva_bench.execution.case import Settings
from sva_bench.execution.drives import Drives
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World


@dataclass(frozen=True, eq=False, kw_only=True)
class Grounds:
    """What a run was executed with.

    Attributes:
        world, costs, settings: The world, its fuel costs, and how plans were executed.
        executor: Where drives run; ``None`` = here.
        drives: What was driven for the run.
    """

    world: World
    costs: Mapping[str, FuelCosts]
    settings: Settings
    executor: Executor | None
    drives: Drives


@dataclass(frozen=True, eq=False, kw_only=True)
class Effects:
    """What is known of a plan's sources before its executed value.

    Attributes:
        by_source: Of those that the twin knows.
        of_physics: The source that what only physics knows goes by, and its seconds; ``None`` = by none.
        twin: Mean value by the twin, with all sources.
        rest_s: Seconds beyond the planned ones that no source has [s].
    """

    by_source: Mapping[SourceName, SourceEffect]
    of_physics: tuple[NoiseName, float] | None
    twin: float
    rest_s: float
