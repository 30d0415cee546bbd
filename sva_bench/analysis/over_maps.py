"""Results of a batch: a summary for each world, variant and seed, the VSS of each map, and over maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from sva_bench.analysis.compared_values import KeyComparison
from sva_bench.analysis.results import Estimate, Words
from sva_bench.analysis.scenarios import UnitScenario
from sva_bench.analysis.summaries import Head, Reach
from sva_bench.choices import Fidelity, News, PolicyName
from sva_bench.files.fields import NonNegativeInt
from sva_bench.files.records import Record, stands_after

BatchFormat = Literal["sva-bench/batch@1", "sva-bench/batch@2"]
BATCH: BatchFormat = "sva-bench/batch@1"
BATCH_OF_REACTIONS: BatchFormat = "sva-bench/batch@2"
"""The format of a batch's summary with ``reactions``."""


@dataclass(frozen=True, kw_only=True)
class UnitSummary(Head):
    """The summary of one world, variant and seed.

    Attributes:
        variant: The varied settings; empty without a sweep.
        scenarios: Results of its scenarios, from sums over trials.
        reach: POIs that its robots cannot reach.
    """

    variant: str
    scenarios: tuple[UnitScenario, ...]
    reach: Reach

    @property
    def label(self) -> str:
        """Its map, as shown to users."""
        return labelled(self.world, self.variant)


@dataclass(frozen=True, kw_only=True)
class MapVss(Estimate):
    """The executed VSS of one map over the trials of all seeds; ``same_plan``: the plans are equal under each."""

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
        mean, ci95: ``None`` where no map has a percentage, or the sample gives no interval.
        maps: Number of maps, where fewer than in the rest of its row.
    """

    mean: float | None
    ci95: tuple[float, float] | None
    maps: int | None = None


@dataclass(frozen=True, kw_only=True)
class OverMaps(Record):
    """The VSS over maps, for one variant and scenario; the maps are the sample."""

    variant: str
    scenario: str
    maps: int
    vss: Estimate
    vss_pct: Percentage

    @property
    def label(self) -> str:
        """Scenario and variant, as shown to users."""
        return labelled(self.scenario, self.variant)


@dataclass(frozen=True, kw_only=True)
class GainOverMaps(Estimate):
    """A difference in value over maps, and in per cent."""

    pct: Percentage


@dataclass(frozen=True, kw_only=True)
class ReactionOverMaps(Record):
    """One policy and kind of news over maps, for one variant and scenario; the maps are the sample.

    Attributes:
        variant, scenario, policy, news: What was executed.
        maps: Number of maps.
        vss, value_of_recourse, vss_with_recourse, anticipation: As of ``ReactionResult``.
    """

    variant: str
    scenario: str
    policy: PolicyName
    news: News
    maps: int
    vss: GainOverMaps
    value_of_recourse: Mapping[str, GainOverMaps]
    vss_with_recourse: GainOverMaps
    anticipation: GainOverMaps

    @property
    def label(self) -> str:
        """Scenario and variant, as shown to users."""
        return labelled(self.scenario, self.variant)

    @property
    def name(self) -> str:
        """Policy and news, as shown to users."""
        return f"{self.policy} on {self.news} news"


@dataclass(frozen=True, kw_only=True)
class GivenUp(Record):
    """A unit that failed for good, and why."""

    unit: Words
    world: Words
    seed: NonNegativeInt
    reason: Words
    attempts: NonNegativeInt


@dataclass(frozen=True, kw_only=True)
class BatchSummary(Record):
    """``summary.json`` of a batch.

    Attributes:
        settings: The varied keys of each variant, each with its value as JSON; empty without a sweep.
    """

    format: BatchFormat = BATCH
    trials: int
    fidelity: Fidelity
    worlds: tuple[str, ...]
    seeds: tuple[int, ...]
    variants: tuple[str, ...]
    units: tuple[UnitSummary, ...]
    maps: tuple[MapRow, ...]
    aggregate: tuple[OverMaps, ...]
    failed: tuple[GivenUp, ...]
    reactions: tuple[ReactionOverMaps, ...] = field(default_factory=tuple, metadata=stands_after("aggregate"))
    settings: Mapping[str, Mapping[str, str]] = field(default_factory=dict, metadata=stands_after("variants"))
    compared: tuple[KeyComparison, ...] = field(default_factory=tuple, metadata=stands_after("aggregate"))


def labelled(name: str, variant: str) -> str:
    """A scenario or a map with its varied settings, as shown to users."""
    return f"{name} ({variant})" if variant else name
