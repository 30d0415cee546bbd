"""Whole summaries: what every one says first, and its scenarios."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, TypeVar

from pydantic import BeforeValidator, Field, model_validator

from sva_bench.analysis.results import (
    MOST_ROLLOUTS,
    MOST_TRIALS,
    SUMMARY,
    Amount,
    ComparedScenario,
    ScenarioFacts,
    ScenarioPlans,
    ScenarioSummary,
    told,
)
from sva_bench.analysis.shown import headline, lines_of, table_of
from sva_bench.choices import FailureProcess, Fidelity
from sva_bench.errors import nearest
from sva_bench.files.fields import Name, Seed, WholeNumber
from sva_bench.files.records import Record

ScenarioT = TypeVar("ScenarioT", bound=ScenarioPlans)


@dataclass(frozen=True, kw_only=True)
class Failures(Record):
    """The failure process that was planned for, and the one executed."""

    plan: FailureProcess
    execute: FailureProcess


@dataclass(frozen=True, kw_only=True)
class Travel(Record):
    """How many travel times there are, and what their metric repair changed."""

    pairs: WholeNumber
    triangle_violations_pct: Amount
    max_excess_pct: Amount


@dataclass(frozen=True, kw_only=True)
class ReachedPrecision(Record):
    """What became of the precision that was asked for."""

    asked_pct: Amount
    reached_pct: Amount | None
    met: bool
    max_trials: WholeNumber


@dataclass(frozen=True, kw_only=True)
class Reach(Record):
    """What robots cannot reach within fuel and limit.

    Attributes:
        nothing: Whether no robot reaches any POI.
        robots: Those that reach none.
        pois: Those that no robot reaches.
        missed: What each robot misses, if anything.
    """

    nothing: bool
    robots: tuple[Name, ...]
    pois: tuple[Name, ...]
    missed: Mapping[Name, tuple[Name, ...]]


@dataclass(frozen=True, kw_only=True)
class Head(Record):
    """What every summary says first.

    Attributes:
        world, seed, trials, rollouts, fidelity: What was executed, and how.
        failure: The failure processes.
        travel: Of the travel times.
        reproducible: Whether no solve met a limit.
    """

    format: Literal["sva-bench/summary@1"] = SUMMARY
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
    """What is known of a point of a batch before any trial."""

    scenarios: Annotated[tuple[ScenarioFacts, ...], Field(min_length=1, max_length=10_000)]
    reach: Reach


@dataclass(frozen=True, kw_only=True)
class Summary(Head):
    """``summary.json`` of ``run``."""

    scenarios: Annotated[tuple[ScenarioSummary, ...], Field(min_length=1, max_length=10_000)]
    precision: Annotated[ReachedPrecision | None, BeforeValidator(told)] = None
    reach: Reach

    def scenario(self, name: str) -> ScenarioSummary:
        """The scenario of that name.

        Raises:
            KeyError: If there is none.
        """
        return _of_name(self.scenarios, name)

    def __repr__(self) -> str:
        return "\n".join([_headline(self), *lines_of(self.scenarios)])

    def _repr_html_(self) -> str:
        """A notebook's table."""
        return table_of(_headline(self), self.scenarios)

    @model_validator(mode="after")
    def _alike(self) -> Summary:
        _of_the_same_plans(self.scenarios)
        return self


@dataclass(frozen=True, kw_only=True)
class ComparisonSummary(Head):
    """``summary.json`` of ``execute``."""

    scenarios: Annotated[tuple[ComparedScenario, ...], Field(min_length=1, max_length=10_000)]
    reach: Reach

    def scenario(self, name: str) -> ComparedScenario:
        """The scenario of that name.

        Raises:
            KeyError: If there is none.
        """
        return _of_name(self.scenarios, name)

    def __repr__(self) -> str:
        return "\n".join([_headline(self), *lines_of(self.scenarios)])

    def _repr_html_(self) -> str:
        """A notebook's table."""
        return table_of(_headline(self), self.scenarios)

    @model_validator(mode="after")
    def _alike(self) -> ComparisonSummary:
        _of_the_same_plans(self.scenarios)
        return self


AnySummary = Summary | ComparisonSummary


def summary_form(data: object) -> type[Summary] | type[ComparisonSummary]:
    """What a summary in a file is to be read as: one with comparisons is of ``execute``."""
    scenarios = data.get("scenarios") if isinstance(data, dict) else None
    first = scenarios[0] if isinstance(scenarios, list) and scenarios else None
    return ComparisonSummary if isinstance(first, dict) and "comparisons" in first else Summary


def _headline(head: Head) -> str:
    return headline(head.world, head.seed, head.trials, head.rollouts, head.fidelity)


def _of_name(scenarios: Sequence[ScenarioT], name: str) -> ScenarioT:
    for scenario in scenarios:
        if scenario.name == name:
            return scenario
    raise KeyError(f"no scenario {name!r}; {nearest(name, [scenario.name for scenario in scenarios])}")


def _of_the_same_plans(scenarios: Sequence[ScenarioPlans]) -> None:
    first = scenarios[0]
    if len({scenario.name for scenario in scenarios}) < len(scenarios):
        raise ValueError("scenarios: a name stands twice")
    for number, scenario in enumerate(scenarios):
        if (list(scenario.plans), list(scenario.availability)) != (list(first.plans), list(first.availability)):
            raise ValueError(f"scenarios[{number}]: other plans or robots than in the first scenario")
