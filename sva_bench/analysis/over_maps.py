"""What a batch comes to: a summary for each world, variant and seed, the VSS map by map, and over maps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from sva_bench.analysis.results import Estimate, ScenarioFigures, Words
from sva_bench.analysis.summaries import Head, Reach
from sva_bench.choices import Fidelity
from sva_bench.files.fields import WholeNumber
from sva_bench.files.records import Record

BATCH: Literal["sva-bench/batch@1"] = "sva-bench/batch@1"


@dataclass(frozen=True, kw_only=True)
class UnitSummary(Head):
    """The summary of one world, variant and seed.

    Attributes:
        variant: What a sweep varied; empty without a sweep.
        scenarios: What came of its scenarios, as far as sums over trials tell.
        reach: What its robots cannot reach.
    """

    variant: str
    scenarios: tuple[ScenarioFigures, ...]
    reach: Reach

    @property
    def label(self) -> str:
        """Its map, for a person."""
        return labelled(self.world, self.variant)


@dataclass(frozen=True, kw_only=True)
class MapVss(Estimate):
    """The executed VSS of one map over the trials of all its seeds; ``same_plan`` = under each of them."""

    same_plan: bool


@dataclass(frozen=True, kw_only=True)
class MapRow(Record):
    """One map under one scenario; ``vss_pct`` is the mean over its seeds."""

    variant: str
    world: str
    scenario: str
    seeds: int
    vss: MapVss
    vss_pct: float | None


@dataclass(frozen=True, kw_only=True)
class Percentage(Record):
    """Mean percentage over maps, and its interval.

    Attributes:
        mean, ci95: ``None`` where no map has one, or nothing tells how maps differ.
        maps: Over how many maps, where it is over fewer than the rest of its row.
    """

    mean: float | None
    ci95: tuple[float, float] | None
    maps: int | None = None


@dataclass(frozen=True, kw_only=True)
class OverMaps(Record):
    """The VSS over maps, which are the sample, for one variant and scenario."""

    variant: str
    scenario: str
    maps: int
    vss: Estimate
    vss_pct: Percentage

    @property
    def label(self) -> str:
        """Scenario and variant, for a person."""
        return labelled(self.scenario, self.variant)


@dataclass(frozen=True, kw_only=True)
class GivenUp(Record):
    """A unit that was given up, and why."""

    unit: Words
    world: Words
    seed: WholeNumber
    reason: Words
    attempts: WholeNumber


@dataclass(frozen=True, kw_only=True)
class BatchSummary(Record):
    """``summary.json`` of a batch."""

    format: Literal["sva-bench/batch@1"] = BATCH
    trials: int
    fidelity: Fidelity
    worlds: tuple[str, ...]
    seeds: tuple[int, ...]
    variants: tuple[str, ...]
    units: tuple[UnitSummary, ...]
    maps: tuple[MapRow, ...]
    aggregate: tuple[OverMaps, ...]
    failed: tuple[GivenUp, ...]


def labelled(name: str, variant: str) -> str:
    """A scenario or a map, and what a sweep varied in it."""
    return f"{name} ({variant})" if variant else name
