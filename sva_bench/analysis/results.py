"""Results: what ``summary.json`` holds, from the measuring to the page. Each type is made where its figures are worked
out, and checked where it is read from a file that may come from anywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from sva_bench.choices import End, FailureProcess, Objective, Status
from sva_bench.files.fields import Name, Probability, WholeNumber
from sva_bench.files.printable import is_name
from sva_bench.files.records import Record, stands_after

SUMMARY: Literal["sva-bench/summary@1"] = "sva-bench/summary@1"
MOST_TRIALS, MOST_ROLLOUTS = 10_000_000, 10_000_000


def two(ends: object) -> object:
    """A list of two."""
    if not isinstance(ends, list | tuple) or len(ends) != 2:
        raise ValueError("expected [low, high]")
    return ends


def _in_order(ends: tuple[float, float]) -> tuple[float, float]:
    if ends[0] > ends[1]:
        raise ValueError(f"expected [low, high], found {list(ends)}")
    return ends


def _is_shown(name: str) -> str:
    if not is_name(name):
        raise ValueError("a name that holds control characters")
    return name


MOST_AMOUNT = 1e15
Amount = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-MOST_AMOUNT, le=MOST_AMOUNT)]
"""A sum of incentives, or a percentage of one; a page adds, subtracts and draws them."""
Interval = Annotated[tuple[Amount, Amount], BeforeValidator(two), AfterValidator(_in_order)]
Words = Annotated[str, Field(max_length=10_000)]
PlanName = Annotated[str, Field(pattern=r"^[^/\x00-\x1f]{1,250}$"), AfterValidator(_is_shown)]
"""Part of file names."""
Availability = Annotated[Mapping[Name, Probability], Field(min_length=1)]


@dataclass(frozen=True, kw_only=True)
class Estimate(Record):
    """A mean and its 95 % interval; ``None`` where the data carry none."""

    mean: Amount
    ci95: Interval | None

    @property
    def excludes_zero(self) -> bool:
        """Whether the interval leaves zero out. Differences that are all zero are not distinguishable from it."""
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
    """A share of trials and its 95 % interval."""

    share: Probability
    ci95: Interval | None


@dataclass(frozen=True, kw_only=True)
class Distribution(Record):
    """Quantiles over trials, all of them figures that a trial came to, and the mean of the worst tenth."""

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
    """How a promise became what was executed; the entries between the two add up to their difference."""

    promised: Amount
    assumption: Amount
    draws: Amount
    out_of_fuel: Amount
    late: Amount
    stuck: Amount
    executed: Amount


@dataclass(frozen=True, kw_only=True)
class Promise(Record):
    """What is known of a plan before any trial.

    Attributes:
        promised: Its value in its own objective.
        bound: The upper bound that its solver proved.
        status: How its solve ended; ``None`` for a plan from elsewhere that doesn't say.
        expected: Its closed-form value under the failure process executed.
    """

    promised: Amount
    bound: Amount | None
    status: Status | None
    expected: Amount


@dataclass(frozen=True, kw_only=True)
class PlanFigures(Promise):
    """What came of a plan, as far as sums over its trials tell.

    Attributes:
        executed: What the team collected.
        by_robot: What each robot collected, on average.
        ends: How often missions ended which way.
        ledger: From promise to execution.
        statistics: Those of ``analysis.catalogue`` that are measured trial by trial, by their keys.
    """

    executed: Estimate
    by_robot: Mapping[Name, Amount]
    ends: Mapping[End, WholeNumber]
    ledger: Ledger
    statistics: Mapping[Name, Estimate] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class PlanResult(PlanFigures):
    """What came of a plan, single trials at hand.

    Attributes:
        executed_controlled: What it collected, free of the luck of the draw.
        distribution: Over trials.
        end_shares: Share of trials in which each robot ended which way.
    """

    executed_controlled: Estimate = field(metadata=stands_after("executed"))
    distribution: Distribution = field(metadata=stands_after("executed_controlled"))
    end_shares: Mapping[Name, Mapping[End, Share]] = field(metadata=stands_after("distribution"))


@dataclass(frozen=True, kw_only=True)
class GivenPlanResult(PlanResult):
    """What came of a plan from anywhere.

    Attributes:
        feasible: Whether it keeps within fuel and limit.
        lost: How many robot missions ended along the route.
    """

    feasible: bool
    lost: WholeNumber


@dataclass(frozen=True, kw_only=True)
class VssFigures(Record):
    """The value of the stochastic solution, as far as sums over trials tell.

    Attributes:
        modelled, modelled_pct: Difference of the plans' closed-form values; in per cent of the stochastic plan's.
        modelled_range: Least and greatest over all deterministic plans that tie; ``None`` if not known.
        executed, executed_pct: Difference of what was collected; in per cent of the stochastic plan's mean.
        distinguishable: Whether the executed interval leaves zero out.
        same_plan: Whether both plans have the same routes.
        verdict: Which plan is worth more, in words.
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
    """The value of the stochastic solution, single trials at hand.

    Attributes:
        executed_range: Least and greatest executed VSS over the deterministic plans that tie.
        executed_controlled: The executed VSS, free of the luck of the draw.
    """

    executed_range: Interval | None = field(metadata=stands_after("executed_pct"))
    executed_controlled: Estimate = field(metadata=stands_after("executed_range"))


@dataclass(frozen=True, kw_only=True)
class Comparison(Record):
    """What plan ``a`` collected beyond plan ``b``, trial by trial; the verdict rests on the adjusted interval."""

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
    """A plan's place: one more than the number of plans that are distinguishably better."""

    rank: Annotated[int, Field(strict=True, ge=1)]
    plan: PlanName
    mean: Amount


@dataclass(frozen=True, kw_only=True)
class PerfectInformation(Estimate):
    """What the informed planner collected beyond the stochastic plan."""

    distinguishable: bool
    verdict: Words


@dataclass(frozen=True, kw_only=True)
class Loss(Estimate):
    """What the plan for the failures executed collected beyond another one."""

    distinguishable: bool
    same_plan: bool


@dataclass(frozen=True, kw_only=True)
class AssumptionRow(Record):
    """One plan under one failure process.

    Attributes:
        executed_under: The failure process.
        planner: ``stochastic`` or ``deterministic``.
        planned_for: The failure process that it was made for; ``None`` for the plan that knows no failures.
        expected: Its closed-form value under the process executed.
        executed: What it collected.
        loss_modelled, loss: What the plan for the process executed is worth beyond it.
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
    """What the model says of a scenario before any trial; ``None`` = not worked out, or without a meaning there.

    Attributes:
        name, availability: The scenario.
        plans: What is known of its two plans.
        modelled_range: Least and greatest modelled VSS over all deterministic plans that tie.
        same_plan: Whether both have the same routes.
        vss_mean_value: Birge's VSS, of the plan for the mean scenario.
        ws: Value of knowing beforehand who is available (wait and see).
        evpi: Expected value of perfect information.
        value_of_process: What planning for failures along the route is worth under them.
    """

    name: Name
    availability: Availability
    plans: Mapping[Objective, Promise]
    modelled_range: Interval | None
    same_plan: bool
    vss_mean_value: Amount | None
    ws: Amount | None
    evpi: Amount | None
    value_of_process: Amount | None


@dataclass(frozen=True, kw_only=True)
class ScenarioPlans(Record):
    """A scenario and what came of its plans."""

    name: Name
    availability: Availability
    plans: Mapping[PlanName, PlanFigures]


@dataclass(frozen=True, kw_only=True)
class ScenarioFigures(ScenarioPlans):
    """What came of the two plans of a scenario, as far as sums over trials tell."""

    vss: VssFigures
    vss_mean_value: Amount | None
    vss_mean_value_executed: Amount | None
    ws: Amount | None
    evpi: Amount | None
    value_of_process: Amount | None

    @property
    def stochastic(self) -> PlanFigures:
        """The stochastic plan's."""
        return self.plans["stochastic"]

    @property
    def deterministic(self) -> PlanFigures:
        """The deterministic plan's."""
        return self.plans["deterministic"]


def told(given: object) -> object:
    """A key that may be absent holds something where it is there."""
    if given is None:
        raise ValueError("expected something, found nothing")
    return given


@dataclass(frozen=True, kw_only=True)
class ScenarioSummary(ScenarioFigures):
    """One scenario of ``run``.

    Attributes:
        evpi_executed: What the informed planner collected beyond the stochastic plan, where it was asked for.
        assumptions: Plans under the failures they were made for and under the others, where it was asked for.
    """

    plans: Annotated[Mapping[PlanName, PlanResult], Field(min_length=1)]
    vss: Vss
    evpi_executed: Annotated[PerfectInformation | None, BeforeValidator(told)] = None
    assumptions: Annotated[tuple[AssumptionRow, ...] | None, BeforeValidator(told)] = None

    @model_validator(mode="after")
    def _fits_together(self) -> ScenarioSummary:
        _of_these_robots(self.plans, self.availability)
        if not {"stochastic", "deterministic"} <= set(self.plans):
            raise ValueError("a scenario with 'vss' has the plans 'stochastic' and 'deterministic'")
        s, d = self.stochastic.executed.mean, self.deterministic.executed.mean
        if abs(self.vss.executed.mean - (s - d)) > 1e-6 * max(abs(s), abs(d)):
            raise ValueError("vss.executed.mean: expected what the stochastic plan collects beyond the other, "
                             f"{s - d:g}, found {self.vss.executed.mean:g}")
        return self


@dataclass(frozen=True, kw_only=True)
class ComparedScenario(ScenarioPlans):
    """One scenario of ``execute``: every pair of plans compared, and all of them from best to worst."""

    plans: Annotated[Mapping[PlanName, GivenPlanResult], Field(min_length=1)]
    comparisons: tuple[Comparison, ...]
    ranking: tuple[Ranked, ...]

    @model_validator(mode="after")
    def _fits_together(self) -> ComparedScenario:
        _of_these_robots(self.plans, self.availability)
        if sorted(row.plan for row in self.ranking) != sorted(self.plans):
            raise ValueError("ranking: expected each of 'plans' once")
        if not {name for pair in self.comparisons for name in (pair.a, pair.b)} <= set(self.plans):
            raise ValueError("comparisons: expected pairs of 'plans'")
        return self


def _of_these_robots(plans: Mapping[str, PlanResult], availability: Mapping[str, float]) -> None:
    for name, plan in plans.items():
        for key, held in (("by_robot", plan.by_robot), ("end_shares", plan.end_shares)):
            if list(held) != list(availability):
                raise ValueError(f"plans.{name}.{key}: expected the robots of 'availability', in its order")
