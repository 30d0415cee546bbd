"""What the files of a batch folder hold, key by key."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from sva_bench.analysis.unseen import UNHAPPY
from sva_bench.choices import ENDS, Fidelity, Objective, PathPlanner
from sva_bench.files.fields import Name, Number, Section, WholeNumber
from sva_bench.storage.results_schema import MOST_ROLLOUTS, MOST_TRIALS, Facts, Seed, Words

_Sum = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e25, le=1e25)]
_Square = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1e40)]
_Count = Annotated[int, Field(strict=True, ge=0, le=10**12)]


class OptionsEntry(Section):
    trials: Annotated[int, Field(strict=True, ge=1, le=MOST_TRIALS)]
    rollouts: Annotated[int, Field(strict=True, ge=1, le=MOST_ROLLOUTS)]
    fidelity: Fidelity
    informed: Literal[False]
    assumptions: Literal[False]
    time_limit_s: Annotated[Number, Field(ge=0)] | None
    gap: Annotated[Number, Field(ge=0)]
    evpi: bool


class PointEntry(Section):
    variant: Words
    planner: PathPlanner
    world: dict[str, Any]
    files: dict[Words, Words] | None = None


class SettingsEntry(Section):
    version: Words
    seeds: Annotated[list[Seed], Field(min_length=1)]
    options: OptionsEntry
    unit_trials: Annotated[int, Field(strict=True, ge=1)]
    points: Annotated[dict[Words, PointEntry], Field(min_length=1)]


class ManifestFile(Section):
    """``manifest.json`` of a batch; the worlds in it are checked as any world is."""

    format: Literal["sva-bench/batch-manifest@1"]
    settings: SettingsEntry


class FailureEntry(Section):
    unit: Words
    world: Words
    seed: Seed
    reason: Words
    attempts: WholeNumber


class FailuresFile(Section):
    """``failures.json``: units that were given up."""

    format: Literal["sva-bench/batch-failures@1"]
    failures: list[FailureEntry]


_Bounds = Annotated[list[_Sum], Field(min_length=2, max_length=2)]


class FigureEntry(Section):
    count: Annotated[_Count, Field(ge=1)]
    mean: _Sum
    squares: _Square
    drawn_bounds: _Bounds
    taken_bounds: _Bounds
    counts: list[_Count]
    sums: list[_Sum]

    @model_validator(mode="after")
    def _fits_together(self) -> FigureEntry:
        if len(self.counts) != len(self.sums) or (self.counts and sum(self.counts) != self.count):
            raise ValueError("counts and sums by noise draw don't add up to the trials")
        if self.drawn_bounds[0] > self.drawn_bounds[1] or self.taken_bounds[0] > self.taken_bounds[1]:
            raise ValueError("bounds: expected [low, high]")
        return self


class PlanEntry(Section):
    total: FigureEntry
    by_robot: list[_Sum]
    ends: Annotated[list[_Count], Field(min_length=len(ENDS), max_length=len(ENDS))]
    charged: Annotated[list[_Sum], Field(min_length=len(UNHAPPY), max_length=len(UNHAPPY))]


class TallyEntry(Section):
    difference: FigureEntry
    plans: dict[Objective, PlanEntry]


class NoteFile(Section):
    """What a shard says of itself, in the metadata of its table."""

    facts: Facts
    variant: Words
    robots: Annotated[list[Name], Field(min_length=1)]
    first: WholeNumber
    trials: Annotated[int, Field(strict=True, ge=1, le=MOST_TRIALS)]
    tallies: dict[Name, TallyEntry]

    @model_validator(mode="after")
    def _fits_together(self) -> NoteFile:
        names = [scenario.name for scenario in self.facts.scenarios]
        if list(self.tallies) != names:
            raise ValueError("tallies: expected one for each scenario of 'facts', in its order")
        for number, scenario in enumerate(self.facts.scenarios):
            if list(scenario.availability) != self.robots or len(scenario.plans) != 2:
                raise ValueError(f"facts.scenarios[{number}]: expected the robots of 'robots', and two plans")
        for name, tally in self.tallies.items():
            figures = [tally.difference, *(plan.total for plan in tally.plans.values())]
            if len(tally.plans) != 2 or any(len(plan.by_robot) != len(self.robots) for plan in tally.plans.values()) \
                    or {f.count for f in figures} != {self.trials} or len({len(f.counts) for f in figures}) != 1:
                raise ValueError(f"tallies.{name}: not of two plans, these robots and these trials")
        return self
