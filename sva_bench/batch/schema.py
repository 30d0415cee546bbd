"""Schemas of the files of a batch folder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from sva_bench.analysis.over_maps import GivenUp
from sva_bench.analysis.reaction_results import ReactionResult
from sva_bench.analysis.results import MOST_ROLLOUTS, MOST_TRIALS, Words, low_and_high
from sva_bench.analysis.summaries import Facts
from sva_bench.analysis.unseen import EXECUTION_LOSSES
from sva_bench.choices import ENDS, OWN_PLANS, Fidelity, News, OwnPlan, PathPlanner, PolicyName
from sva_bench.files.fields import Name, NonNegativeInt, Number, Seed
from sva_bench.files.records import Record, stands_after
from sva_bench.storage.manifest import AnyText

MANIFEST: Literal["sva-bench/batch-manifest@1"] = "sva-bench/batch-manifest@1"
FAILURES: Literal["sva-bench/batch-failures@1"] = "sva-bench/batch-failures@1"

_Sum = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e25, le=1e25)]
_Square = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1e40)]
_Count = Annotated[int, Field(strict=True, ge=0, le=10**12)]


@dataclass(frozen=True, kw_only=True)
class OptionsEntry(Record):
    """The options of all runs of a batch."""

    informed: Literal[False]
    assumptions: Literal[False]
    trials: Annotated[int, Field(strict=True, ge=1, le=MOST_TRIALS)]
    rollouts: Annotated[int, Field(strict=True, ge=1, le=MOST_ROLLOUTS)]
    fidelity: Fidelity
    time_limit_s: Annotated[Number, Field(ge=0)] | None
    gap: Annotated[Number, Field(ge=0)]
    evpi: bool
    policies: tuple[PolicyName, ...] = field(default_factory=tuple)
    news: tuple[News, ...] = field(default_factory=tuple)
    anticipate: bool | None = None
    calibrate: Words | None = None


@dataclass(frozen=True, kw_only=True)
class PointEntry(Record):
    """A point of the grid; its world is validated as any world file. Older folders have no ``settings``."""

    variant: Words
    planner: PathPlanner
    world: Mapping[str, Any]
    files: Mapping[Words, Words] | None = None
    settings: Mapping[Words, Words] = field(default_factory=dict, metadata=stands_after("variant"))


@dataclass(frozen=True, kw_only=True)
class BatchSettings(Record):
    """Everything that the rows and shards of a batch depend on; ``own`` is as of ``Grid``."""

    version: Words
    seeds: Annotated[tuple[Seed, ...], Field(min_length=1)]
    options: OptionsEntry
    unit_trials: Annotated[int, Field(strict=True, ge=1)]
    points: Annotated[Mapping[Words, PointEntry], Field(min_length=1)]
    own: Mapping[Words, Words] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class BatchManifest(Record):
    """``manifest.json`` of a batch; ``command``: the command line that began it, which older folders lack."""

    format: Literal["sva-bench/batch-manifest@1"] = MANIFEST
    settings: BatchSettings
    command: Annotated[tuple[AnyText, ...], Field(max_length=10_000)] = field(default_factory=tuple)


@dataclass(frozen=True, kw_only=True)
class GivenUpUnits(Record):
    """``failures.json``: units that failed for good."""

    format: Literal["sva-bench/batch-failures@1"] = FAILURES
    failures: tuple[GivenUp, ...]


_Bounds = Annotated[tuple[_Sum, _Sum], BeforeValidator(low_and_high)]


@dataclass(frozen=True, kw_only=True)
class StoredFigure(Record):
    """A figure (``analysis.moments``) in a shard: its drawn part, and the losses by noise draw."""

    count: Annotated[_Count, Field(ge=1)]
    mean: _Sum
    squares: _Square
    drawn_bounds: _Bounds
    taken_bounds: _Bounds
    counts: tuple[_Count, ...]
    sums: tuple[_Sum, ...]
    certain: _Bounds | None = None

    @model_validator(mode="after")
    def _fits_together(self) -> StoredFigure:
        if len(self.counts) != len(self.sums) or (self.counts and sum(self.counts) != self.count):
            raise ValueError("counts and sums by noise draw don't add up to the trials")
        if any(low > high for low, high in (self.drawn_bounds, self.taken_bounds, self.certain or (0.0, 0.0))):
            raise ValueError("bounds: expected [low, high]")
        return self


@dataclass(frozen=True, kw_only=True)
class StoredMet(Record):
    """Sums over a plan's trials of what robots did to each other."""

    missions: Annotated[_Count, Field(ge=1)]
    contacts: _Count
    waited_s: Annotated[_Sum, Field(ge=0)]
    detours: _Count
    exact: _Count


@dataclass(frozen=True, kw_only=True)
class StoredPlan(Record):
    """Sums over a plan's trials."""

    total: StoredFigure
    by_robot: tuple[_Sum, ...]
    ends: Annotated[tuple[_Count, ...], Field(min_length=len(ENDS), max_length=len(ENDS))]
    charged: Annotated[tuple[_Sum, ...], Field(min_length=len(EXECUTION_LOSSES), max_length=len(EXECUTION_LOSSES))]
    statistics: Mapping[Name, StoredFigure] = field(default_factory=dict)
    met: StoredMet | None = None


@dataclass(frozen=True, kw_only=True)
class StoredTally(Record):
    """Sums over a scenario's trials."""

    difference: StoredFigure
    plans: Mapping[OwnPlan, StoredPlan]


@dataclass(frozen=True, kw_only=True)
class StoredNote(Record):
    """The note of a shard, in the metadata of its table."""

    facts: Facts
    variant: Words
    robots: Annotated[tuple[Name, ...], Field(min_length=1)]
    first: NonNegativeInt
    trials: Annotated[int, Field(strict=True, ge=1, le=MOST_TRIALS)]
    tallies: Mapping[Name, StoredTally]
    reactions: Mapping[Name, tuple[ReactionResult, ...]] = field(default_factory=dict)

    @model_validator(mode="after")
    def _fits_together(self) -> StoredNote:
        names = [scenario.name for scenario in self.facts.scenarios]
        if list(self.tallies) != names:
            raise ValueError("tallies: expected one for each scenario of 'facts', in its order")
        if self.reactions and list(self.reactions) != names:
            raise ValueError("reactions: expected those of each scenario of 'facts', in its order")
        for name, results in self.reactions.items():
            if any(not {"stochastic", "deterministic"} <= set(result.plans) or set(result.plans) != set(
                    result.value_of_recourse) for result in results):
                raise ValueError(f"reactions.{name}: not of the two plans")
        own = OWN_PLANS[: 3 if self.facts.calibrations else 2]
        for number, scenario in enumerate(self.facts.scenarios):
            if tuple(scenario.availability) != self.robots or tuple(scenario.plans) != own:
                raise ValueError(f"facts.scenarios[{number}]: expected the robots of 'robots', and the plans "
                                 f"{', '.join(own)}")
        if self.facts.calibrations and list(self.facts.calibrations) != names:
            raise ValueError("facts.calibrations: expected one for each scenario, in its order")
        for name, tally in self.tallies.items():
            plans = tally.plans.values()
            if any(plan.met is not None and (plan.met.missions != self.trials or plan.met.exact > self.trials)
                   for plan in plans) or len({plan.met is None for plan in plans}) != 1:
                raise ValueError(f"tallies.{name}: what robots did to each other is not of these trials")
            figures = [tally.difference, *(plan.total for plan in plans),
                       *(figure for plan in plans for figure in plan.statistics.values())]
            if tuple(tally.plans) != own or any(len(plan.by_robot) != len(self.robots) for plan in plans) \
                    or len({tuple(plan.statistics) for plan in plans}) != 1 \
                    or {f.count for f in figures} != {self.trials} or len({len(f.counts) for f in figures}) != 1:
                raise ValueError(f"tallies.{name}: not of these plans, robots and these trials")
        return self
