"""Whole summaries: the common head, and the scenarios."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Generic, Self, TypeVar

from pydantic import BeforeValidator, Field, model_validator

from sva_bench.analysis.calibration import Calibration
from sva_bench.analysis.driving import DrivesMade
from sva_bench.analysis.results import (
    MOST_ROLLOUTS,
    MOST_TRIALS,
    SUMMARY,
    SUMMARY_OF_REACTIONS,
    Amount,
    Interval,
    ScenarioFacts,
    SummaryFormat,
)
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary, not_null
from sva_bench.analysis.shown import headline, lines_of, table_of
from sva_bench.choices import FailureProcess, Fidelity
from sva_bench.errors import UnknownName, nearest
from sva_bench.files.fields import Name, NonNegativeInt, Seed
from sva_bench.files.records import Record, stands_after

ScenarioT = TypeVar("ScenarioT", ScenarioSummary, ComparedScenario)


@dataclass(frozen=True, kw_only=True)
class Failures(Record):
    """The failure process that was planned for, and the one executed."""

    plan: FailureProcess
    execute: FailureProcess


@dataclass(frozen=True, kw_only=True)
class Travel(Record):
    """Number of travel times, and the extent of their metric repair."""

    pairs: NonNegativeInt
    triangle_violations_pct: Amount
    max_excess_pct: Amount


@dataclass(frozen=True, kw_only=True)
class ReachedPrecision(Record):
    """The required precision, and the one reached.

    Attributes:
        asked_pct, reached_pct: Half-width of the executed VSS [% of the stochastic plan's mean].
        met: Whether it is reached.
        max_trials: Trials at which to stop all the same.
        anytime: With ``--anytime``, the interval of the executed VSS in each scenario that holds whenever a run stops.
    """

    asked_pct: Amount
    reached_pct: Amount | None
    met: bool
    max_trials: NonNegativeInt
    anytime: Mapping[Name, Interval | None] | None = None


@dataclass(frozen=True, kw_only=True)
class Reach(Record):
    """The POIs that robots cannot reach within fuel and limit.

    Attributes:
        nothing: Whether no robot reaches any POI.
        robots: Robots that reach no POI.
        pois: POIs that no robot reaches, of those that would earn some robot something.
        missed: POIs that a robot doesn't reach and that would earn it something, for robots with any.
    """

    nothing: bool
    robots: tuple[Name, ...]
    pois: tuple[Name, ...]
    missed: Mapping[Name, tuple[Name, ...]]


@dataclass(frozen=True, kw_only=True)
class Head(Record):
    """The common head of summaries.

    Attributes:
        world, seed, trials, rollouts, fidelity: The settings of the execution.
        failure: The failure processes.
        travel: Figures of the travel times.
        reproducible: Whether every solve was proved within its gap, so that the plans don't depend on the machine.
    """

    format: SummaryFormat = SUMMARY
    world: Name
    seed: Seed
    trials: Annotated[int, Field(strict=True, ge=1, le=MOST_TRIALS)]
    rollouts: Annotated[int, Field(strict=True, ge=1, le=MOST_ROLLOUTS)]
    fidelity: Fidelity
    failure: Failures
    travel: Travel
    reproducible: bool


@dataclass(frozen=True, kw_only=True)
class Facts(Head):
    """The modelled values of a batch point, known before any trial.

    Attributes:
        scenarios: Those of each scenario.
        reach: POIs that robots cannot reach.
        calibrations: How calibrated plans were found, by scenario; empty where none was asked for.
    """

    scenarios: Annotated[tuple[ScenarioFacts, ...], Field(min_length=1, max_length=10_000)]
    reach: Reach
    calibrations: Mapping[Name, Calibration] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class OfScenarios(Head, Generic[ScenarioT]):
    """A whole summary: one entry for each scenario, all of the same plans and robots.

    Attributes:
        drives: How the drives behind it were made; ``None`` in older folders.
    """

    scenarios: tuple[ScenarioT, ...]
    reach: Reach
    drives: Annotated[DrivesMade | None, BeforeValidator(not_null)] = None

    def scenario(self, name: str) -> ScenarioT:
        """The scenario of that name.

        Raises:
            UnknownName: If there is none.
        """
        for scenario in self.scenarios:
            if scenario.name == name:
                return scenario
        raise UnknownName(f"{self.world} has no scenario {name!r}; {nearest(name, [s.name for s in self.scenarios])}")

    def with_reactions(self, reactions: Mapping[str, Sequence[Any]]) -> Self:
        """The summary with the results of teams that react, by scenario."""
        return replace(self, format=SUMMARY_OF_REACTIONS, scenarios=tuple(
            replace(scenario, reactions=tuple(reactions[scenario.name])) for scenario in self.scenarios))

    def __repr__(self) -> str:
        return "\n".join([self._headline(), *lines_of(self.scenarios)])

    def _repr_html_(self) -> str:
        """A notebook's table."""
        return table_of(self._headline(), self.scenarios)

    def _headline(self) -> str:
        return headline(self.world, self.seed, self.trials, self.rollouts, self.fidelity)

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        first = self.scenarios[0]
        if len({scenario.name for scenario in self.scenarios}) < len(self.scenarios):
            raise ValueError("scenarios: a name is a duplicate")
        for number, scenario in enumerate(self.scenarios):
            if (list(scenario.plans), list(scenario.availability)) != (list(first.plans), list(first.availability)):
                raise ValueError(f"scenarios[{number}]: other plans or robots than in the first scenario")
        form = SUMMARY if first.reactions is None else SUMMARY_OF_REACTIONS
        if self.format != form or any((s.reactions is None) != (first.reactions is None) for s in self.scenarios):
            raise ValueError(f"format: expected {form!r}, as the first scenario has "
                             f"{'no ' if first.reactions is None else ''}reactions, and the others like it")
        return self


@dataclass(frozen=True, kw_only=True, repr=False)
class Summary(OfScenarios[ScenarioSummary]):
    """``summary.json`` of ``run``."""

    scenarios: Annotated[tuple[ScenarioSummary, ...], Field(min_length=1, max_length=10_000)]
    precision: Annotated[ReachedPrecision | None, BeforeValidator(not_null)] = field(
        default=None, metadata=stands_after("scenarios"))


@dataclass(frozen=True, kw_only=True, repr=False)
class ComparisonSummary(OfScenarios[ComparedScenario]):
    """``summary.json`` of ``execute``."""

    scenarios: Annotated[tuple[ComparedScenario, ...], Field(min_length=1, max_length=10_000)]


AnySummary = Summary | ComparisonSummary


def summary_form(data: object) -> type[Summary] | type[ComparisonSummary]:
    """The type of a summary in a file: one with comparisons is of ``execute``."""
    scenarios = data.get("scenarios") if isinstance(data, dict) else None
    first = scenarios[0] if isinstance(scenarios, list) and scenarios else None
    return ComparisonSummary if isinstance(first, dict) and "comparisons" in first else Summary
