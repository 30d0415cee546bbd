"""Results: the types behind ``summary.json``, from their computation to the page.

Each is created where its figures are computed, and validated where it is read from a file of any origin.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from sva_bench.choices import End, FailureProcess, OwnPlan, SourceName, Status
from sva_bench.files.fields import Name, NonNegativeInt, Probability
from sva_bench.files.printable import is_name
from sva_bench.files.records import Record, stands_after

SummaryFormat = Literal["sva-bench/summary@1", "sva-bench/summary@2"]
SUMMARY: SummaryFormat = "sva-bench/summary@1"
SUMMARY_OF_REACTIONS: SummaryFormat = "sva-bench/summary@2"
"""The format of a summary whose scenarios have ``reactions``."""
MOST_TRIALS, MOST_ROLLOUTS = 10_000_000, 10_000_000


def low_and_high(ends: object) -> object:
    """The value, if it is a list of two."""
    if not isinstance(ends, list | tuple) or len(ends) != 2:
        raise ValueError("expected [low, high]")
    return ends


def _in_order(ends: tuple[float, float]) -> tuple[float, float]:
    if ends[0] > ends[1]:
        raise ValueError(f"expected [low, high], found {list(ends)}")
    return ends


def _is_printable(name: str) -> str:
    if not is_name(name):
        raise ValueError("a name with control characters")
    return name


MOST_AMOUNT = 1e15
Amount = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-MOST_AMOUNT, le=MOST_AMOUNT)]
"""A sum of incentives, or a percentage of one; bounded, since pages add, subtract and plot them."""
NonNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=MOST_AMOUNT)]
Interval = Annotated[tuple[Amount, Amount], BeforeValidator(low_and_high), AfterValidator(_in_order)]
Words = Annotated[str, Field(max_length=10_000)]
PlanName = Annotated[str, Field(pattern=r"^[^/\x00-\x1f]{1,250}$"), AfterValidator(_is_printable)]
"""The name of a plan, which is part of file names."""
Availability = Annotated[Mapping[Name, Probability], Field(min_length=1)]


@dataclass(frozen=True, kw_only=True)
class Estimate(Record):
    """A mean and its 95 % confidence interval; ``None`` where the data give none."""

    mean: Amount
    ci95: Interval | None

    @property
    def excludes_zero(self) -> bool:
        """Whether the interval excludes zero; one of differences that are all zero doesn't."""
        return self.ci95 is not None and (self.ci95[0] > 0 or self.ci95[1] < 0)

    @property
    def half_width(self) -> float | None:
        """Half of the interval's width."""
        return None if self.ci95 is None else (self.ci95[1] - self.ci95[0]) / 2

    @model_validator(mode="after")
    def _within(self) -> Estimate:
        if self.ci95 is not None:
            slack = 1e-9 * max(abs(self.mean), 1e-300)
            if not self.ci95[0] - slack <= self.mean <= self.ci95[1] + slack:
                raise ValueError(f"ci95: the mean, {self.mean:g}, lies outside")
        return self


@dataclass(frozen=True, kw_only=True)
class Share(Record):
    """A share of trials and its 95 % confidence interval."""

    share: Probability
    ci95: Interval | None


@dataclass(frozen=True, kw_only=True)
class Distribution(Record):
    """Quantiles over trials (each an observed value), and the mean of the worst tenth (CVaR)."""

    least: Amount
    q05: Amount
    q25: Amount
    q50: Amount
    q75: Amount
    q95: Amount
    greatest: Amount
    cvar10: Amount


@dataclass(frozen=True, kw_only=True)
class Ledger(Record):
    """The decomposition of the difference between promised and executed value; its entries add up to it."""

    promised: Amount
    assumption: Amount
    draws: Amount
    out_of_fuel: Amount
    late: Amount
    stuck: Amount
    executed: Amount


@dataclass(frozen=True, kw_only=True)
class SourceEffect(Record):
    """What a source of noise does to a plan.

    Attributes:
        incentive: Mean value with it less that without it, everything else being the same.
        seconds: How much longer the team's routes take with it [s], driven whole, waits included.
    """

    incentive: Amount
    seconds: Amount


@dataclass(frozen=True, kw_only=True)
class Promise(Record):
    """The values of a plan that are known before any trial.

    Attributes:
        promised: Its value in its own objective.
        bound: The upper bound that its solver proved.
        status: How its solve ended; ``None`` for a given plan without one.
        expected: Its closed-form value under the failure process executed.
    """

    promised: Amount
    bound: Amount | None
    status: Status | None
    expected: Amount


@dataclass(frozen=True, kw_only=True)
class InteractionSummary(Record):
    """What robots of one world did to each other: means over missions.

    Attributes:
        contacts: How many times two robots came to touch.
        waited_s: How long robots waited for others, added up over the team [s].
        detours: How many legs were driven on another path than the shortest, because of other robots.
        exact_share: Share of missions whose ends are exact, not taken over from a mission alike.
    """

    contacts: NonNegative
    waited_s: NonNegative
    detours: NonNegative
    exact_share: Probability


@dataclass(frozen=True, kw_only=True)
class PlanFigures(Promise):
    """The results of a plan that follow from sums over its trials.

    Attributes:
        executed: Mean value of the team.
        by_robot: Mean value of each robot.
        ends: Number of robot missions with each end.
        ledger: Decomposition of executed less promised value.
        statistics: Those of ``analysis.catalogue`` that are measured trial by trial, by their keys.
        interaction: What robots did to each other; ``None`` where they do not meet.
    """

    executed: Estimate
    by_robot: Mapping[Name, Amount]
    ends: Mapping[End, NonNegativeInt]
    ledger: Ledger
    statistics: Mapping[Name, Estimate] = field(default_factory=dict)
    interaction: InteractionSummary | None = field(default=None, metadata=stands_after("ledger"))


@dataclass(frozen=True, kw_only=True)
class PlanResult(PlanFigures):
    """The results of a plan from its single trials.

    Attributes:
        executed_controlled: Variance-reduced mean value of the team.
        distribution: Distribution over trials.
        end_shares: Share of trials with each end, by robot.
        bad: Share of trials in which some robot ran out of fuel, was late or got stuck; ``None`` in older folders.
        sources: What each source of noise did; empty without noise. The incentives add up to what was executed less
            what was expected of the failures drawn.
    """

    executed_controlled: Estimate = field(metadata=stands_after("executed"))
    distribution: Distribution = field(metadata=stands_after("executed_controlled"))
    end_shares: Mapping[Name, Mapping[End, Share]] = field(metadata=stands_after("distribution"))
    bad: Share | None = field(default=None, metadata=stands_after("end_shares"))
    sources: Mapping[SourceName, SourceEffect] = field(default_factory=dict, metadata=stands_after("ledger"))

    @property
    def beside_draws(self) -> float:
        """Executed value less what was expected and what the failures drawn did to it."""
        return self.executed.mean - self.expected - self.ledger.draws

    @model_validator(mode="after")
    def _adds_up(self) -> PlanResult:
        found = math.fsum(effect.incentive for effect in self.sources.values())
        if self.sources and abs(found - self.beside_draws) > 1e-6 * max(1.0, abs(self.executed.mean)):
            raise ValueError(f"sources: expected incentives that add up to {self.beside_draws:g}, found {found:g}")
        return self


@dataclass(frozen=True, kw_only=True)
class GivenPlanResult(PlanResult):
    """The results of a given plan.

    Attributes:
        feasible: Whether it keeps fuel capacities and mission limits.
        lost: Number of robot missions that left the base and didn't come home.
    """

    feasible: bool
    lost: NonNegativeInt


@dataclass(frozen=True, kw_only=True)
class VssFigures(Record):
    """The value of the stochastic solution, from sums over trials.

    Attributes:
        modelled, modelled_pct: Difference of the plans' closed-form values; in per cent of the stochastic plan's.
        modelled_range: Least and greatest over all deterministic plans that tie; ``None`` if not known.
        executed, executed_pct: Difference in value; in per cent of the stochastic plan's mean.
        distinguishable: Whether the executed interval excludes zero.
        same_plan: Whether both plans have the same routes.
        verdict: Which plan has the greater value, in words.
    """

    modelled: Amount
    modelled_pct: Amount | None
    modelled_range: Interval | None
    executed: Estimate
    executed_pct: Amount | None
    distinguishable: bool
    same_plan: bool
    verdict: Words


@dataclass(frozen=True, kw_only=True)
class Vss(VssFigures):
    """The value of the stochastic solution, from single trials.

    Attributes:
        executed_range: Least and greatest executed VSS over the deterministic plans that tie.
        executed_controlled: The variance-reduced executed VSS.
    """

    executed_range: Interval | None = field(metadata=stands_after("executed_pct"))
    executed_controlled: Estimate = field(metadata=stands_after("executed_range"))


@dataclass(frozen=True, kw_only=True)
class Comparison(Record):
    """The value of plan ``a`` less that of ``b``, trial by trial; the verdict follows the simultaneous interval."""

    a: PlanName
    b: PlanName
    mean: Amount
    ci95: Interval | None
    ci95_adjusted: Interval | None
    distinguishable: bool
    same_plan: bool
    verdict: Words


@dataclass(frozen=True, kw_only=True)
class Ranked(Record):
    """A plan's rank: one more than the number of plans that are distinguishably better."""

    rank: Annotated[int, Field(strict=True, ge=1)]
    plan: PlanName
    mean: Amount


@dataclass(frozen=True, kw_only=True)
class PerfectInformation(Estimate):
    """The executed EVPI: value of the perfect-information plans less that of the stochastic plan."""

    distinguishable: bool
    verdict: Words


@dataclass(frozen=True, kw_only=True)
class Loss(Estimate):
    """The loss of a plan against the plan made for the failure process executed."""

    distinguishable: bool
    same_plan: bool


@dataclass(frozen=True, kw_only=True)
class AssumptionRow(Record):
    """One plan under one failure process.

    Attributes:
        executed_under: The failure process.
        planner: ``stochastic`` or ``deterministic``.
        planned_for: The failure process that it was made for; ``None`` for the deterministic plan.
        expected: Its closed-form value under the process executed.
        executed: Mean value of the team.
        loss_modelled, loss: Value of the plan for the process executed less its own, modelled and executed.
    """

    executed_under: FailureProcess
    planner: Words
    planned_for: FailureProcess | None
    expected: Amount
    executed: Estimate
    loss_modelled: Amount
    loss: Loss


@dataclass(frozen=True, kw_only=True)
class ScenarioFacts(Record):
    """The modelled values of a scenario, known before any trial; ``None`` = not computed, or not defined there.

    Attributes:
        name, availability: The scenario.
        plans: Promises of its own plans.
        modelled_range: Least and greatest modelled VSS over all deterministic plans that tie.
        same_plan: Whether both have the same routes.
        vss_mean_value: VSS after Birge, against the plan for the mean scenario.
        ws: Wait-and-see value.
        evpi: Expected value of perfect information.
        value_of_process: Gain of planning for failures along the route, under them.
    """

    name: Name
    availability: Availability
    plans: Mapping[OwnPlan, Promise]
    modelled_range: Interval | None
    same_plan: bool
    vss_mean_value: Amount | None
    ws: Amount | None
    evpi: Amount | None
    value_of_process: Amount | None


@dataclass(frozen=True, kw_only=True)
class ScenarioPlans(Record):
    """A scenario and the results of its plans."""

    name: Name
    availability: Availability
    plans: Mapping[PlanName, PlanFigures]


@dataclass(frozen=True, kw_only=True)
class ScenarioFigures(ScenarioPlans):
    """The results of the two plans of a scenario, from sums over trials."""

    vss: VssFigures
    vss_mean_value: Amount | None
    vss_mean_value_executed: Amount | None
    ws: Amount | None
    evpi: Amount | None
    value_of_process: Amount | None

    @property
    def stochastic(self) -> PlanFigures:
        """The results of the stochastic plan."""
        return self.plans["stochastic"]

    @property
    def deterministic(self) -> PlanFigures:
        """The results of the deterministic plan."""
        return self.plans["deterministic"]
