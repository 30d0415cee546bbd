"""Results of scenarios: the two plans of a run, or given plans, compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import BeforeValidator, Field, model_validator

from sva_bench.analysis.calibration import Calibration
from sva_bench.analysis.reaction_results import ComparedReaction, ReactionResult
from sva_bench.analysis.results import (
    AssumptionRow,
    Comparison,
    GivenPlanResult,
    PerfectInformation,
    PlanName,
    PlanResult,
    Ranked,
    ScenarioFigures,
    ScenarioPlans,
    Vss,
)


def not_null(given: object) -> object:
    """The value of a key that may be absent, but not null."""
    if given is None:
        raise ValueError("expected something, found nothing")
    return given


@dataclass(frozen=True, kw_only=True)
class ScenarioSummary(ScenarioFigures):
    """One scenario of ``run``.

    Attributes:
        evpi_executed: Executed EVPI, with ``--informed``.
        assumptions: Plans executed under each failure process, with ``--assumptions``.
        calibration: How the calibrated plan was found, with ``--calibrate``.
        reactions: Results of teams that react, by policy and news, where they do.
    """

    plans: Annotated[Mapping[PlanName, PlanResult], Field(min_length=1)]
    vss: Vss
    evpi_executed: Annotated[PerfectInformation | None, BeforeValidator(not_null)] = None
    assumptions: Annotated[tuple[AssumptionRow, ...] | None, BeforeValidator(not_null)] = None
    calibration: Annotated[Calibration | None, BeforeValidator(not_null)] = None
    reactions: Annotated[tuple[ReactionResult, ...] | None, BeforeValidator(not_null)] = None

    @model_validator(mode="after")
    def _is_consistent(self) -> ScenarioSummary:
        _refuse_other_robots(self.plans, self.availability)
        if not {"stochastic", "deterministic"} <= set(self.plans):
            raise ValueError("a scenario with 'vss' has the plans 'stochastic' and 'deterministic'")
        if (self.calibration is None) == ("calibrated" in self.plans):
            raise ValueError("a scenario has the plan 'calibrated' if and only if it has 'calibration'")
        s, d = self.stochastic.executed.mean, self.deterministic.executed.mean
        if abs(self.vss.executed.mean - (s - d)) > 1e-6 * max(abs(s), abs(d)):
            raise ValueError("vss.executed.mean: expected the difference between the plans' means, "
                             f"{s - d:g}, found {self.vss.executed.mean:g}")
        return self


@dataclass(frozen=True, kw_only=True)
class UnitScenario(ScenarioFigures):
    """One scenario of one world, variant and seed of a batch.

    Attributes:
        calibration: How the calibrated plan was found, where one was asked for.
        reactions: Results of teams that react, by policy and news, where they do.
    """

    calibration: Annotated[Calibration | None, BeforeValidator(not_null)] = None
    reactions: Annotated[tuple[ReactionResult, ...] | None, BeforeValidator(not_null)] = None


@dataclass(frozen=True, kw_only=True)
class ComparedScenario(ScenarioPlans):
    """One scenario of ``execute``: the comparison of every pair of plans, and their ranking.

    Attributes:
        reactions: The same of teams that react, by policy and news, where they do.
    """

    plans: Annotated[Mapping[PlanName, GivenPlanResult], Field(min_length=1)]
    comparisons: tuple[Comparison, ...]
    ranking: tuple[Ranked, ...]
    reactions: Annotated[tuple[ComparedReaction, ...] | None, BeforeValidator(not_null)] = None

    @model_validator(mode="after")
    def _is_consistent(self) -> ComparedScenario:
        _refuse_other_robots(self.plans, self.availability)
        for number, reaction in enumerate(self.reactions or ()):
            expected = [*self.plans, *(["anticipative"] if reaction.candidates else [])]
            if list(reaction.plans) != expected or list(reaction.value_of_recourse) != expected:
                raise ValueError(f"reactions[{number}]: expected the plans of the scenario, in its order, and behind "
                                 "them the anticipative one if 'candidates' says what that was chosen from")
        ranked: tuple[ComparedScenario | ComparedReaction, ...] = self, *(self.reactions or ())
        for each in ranked:
            if sorted(row.plan for row in each.ranking) != sorted(each.plans):
                raise ValueError("ranking: expected each of 'plans' once")
            if not {name for pair in each.comparisons for name in (pair.a, pair.b)} <= set(each.plans):
                raise ValueError("comparisons: expected pairs of 'plans'")
        return self


def _refuse_other_robots(plans: Mapping[str, PlanResult], availability: Mapping[str, float]) -> None:
    for name, plan in plans.items():
        for key, held in (("by_robot", plan.by_robot), ("end_shares", plan.end_shares)):
            if list(held) != list(availability):
                raise ValueError(f"plans.{name}.{key}: expected the robots of 'availability', in its order")
