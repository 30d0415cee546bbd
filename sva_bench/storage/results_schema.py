"""What ``summary.json`` and ``manifest.json`` hold, key by key: every figure that a page is made of."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from sva_bench.choices import End, FailureProcess, Fidelity, Objective, Status
from sva_bench.files.fields import Name, Probability, Section, WholeNumber
from sva_bench.files.printable import is_name
from sva_bench.seeds import MOST_SEED

MOST_TRIALS, MOST_ROLLOUTS = 10_000_000, 10_000_000


def _in_order(ends: list[float]) -> list[float]:
    if ends[0] > ends[1]:
        raise ValueError(f"expected [low, high], found {ends}")
    return ends


def _is_text(value: object) -> object:
    if not isinstance(value, str):
        raise ValueError("expected a word")
    return value


def _is_shown(name: str) -> str:
    if not is_name(name):
        raise ValueError("a name that holds control characters")
    return name


Figure = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e15, le=1e15)]
"""A sum of incentives, or a percentage of one; a page adds, subtracts and draws them."""
Interval = Annotated[list[Figure], Field(min_length=2, max_length=2), AfterValidator(_in_order)]
Seed = Annotated[WholeNumber, Field(le=MOST_SEED)]
Words = Annotated[str, Field(max_length=10_000)]
AnyText = Annotated[Any, AfterValidator(_is_text)]
"""Of the command line, which may hold what is no UTF-8."""
PlanName = Annotated[str, Field(pattern=r"^[^/\x00-\x1f]{1,250}$"), AfterValidator(_is_shown)]
"""Part of file names."""
Share = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1)]


class Estimated(Section):
    mean: Figure
    ci95: Interval | None

    @model_validator(mode="after")
    def _within(self) -> Estimated:
        if self.ci95 is not None:
            slack = 1e-9 * max(abs(self.mean), 1e-300)
            if not self.ci95[0] - slack <= self.mean <= self.ci95[1] + slack:
                raise ValueError(f"ci95: the mean, {self.mean:g}, lies outside")
        return self


class Shared(Section):
    share: Share
    ci95: Interval | None


class Distribution(Section):
    least: Figure
    q05: Figure
    q25: Figure
    q50: Figure
    q75: Figure
    q95: Figure
    greatest: Figure
    cvar10: Figure


class Ledger(Section):
    promised: Figure
    assumption: Figure
    draws: Figure
    out_of_fuel: Figure
    late: Figure
    stuck: Figure
    executed: Figure


class Promise(Section):
    """What is known of a plan before any trial."""

    promised: Figure
    bound: Figure | None
    status: Status | None
    expected: Figure


class PlanResult(Promise):
    feasible: bool = True
    lost: WholeNumber = 0
    executed: Estimated
    executed_controlled: Estimated
    distribution: Distribution
    end_shares: dict[Name, dict[End, Shared]]
    by_robot: dict[Name, Figure]
    ends: dict[End, WholeNumber]
    ledger: Ledger


class Vss(Section):
    modelled: Figure
    modelled_pct: Figure | None
    modelled_range: Interval | None
    executed: Estimated
    executed_pct: Figure | None
    executed_range: Interval | None
    executed_controlled: Estimated
    distinguishable: bool
    same_plan: bool
    verdict: Words


class Comparison(Estimated):
    a: PlanName
    b: PlanName
    ci95_adjusted: Interval | None
    distinguishable: bool
    same_plan: bool
    verdict: Words


class Ranked(Section):
    rank: Annotated[int, Field(strict=True, ge=1)]
    plan: PlanName
    mean: Figure


class Beyond(Estimated):
    distinguishable: bool
    verdict: Words


class Loss(Estimated):
    distinguishable: bool
    same_plan: bool


class Assumed(Section):
    executed_under: FailureProcess
    planner: Words
    planned_for: FailureProcess | None
    expected: Figure
    executed: Estimated
    loss_modelled: Figure
    loss: Loss


class ScenarioResults(Section):
    """One scenario: of `run` with ``vss``, of `execute` with ``comparisons``."""

    name: Name
    availability: Annotated[dict[Name, Probability], Field(min_length=1)]
    plans: Annotated[dict[PlanName, PlanResult], Field(min_length=1)]
    vss: Vss | None = None
    vss_mean_value: Figure | None = None
    vss_mean_value_executed: Figure | None = None
    ws: Figure | None = None
    evpi: Figure | None = None
    value_of_process: Figure | None = None
    evpi_executed: Beyond | None = None
    assumptions: list[Assumed] | None = None
    comparisons: list[Comparison] | None = None
    ranking: list[Ranked] | None = None

    @model_validator(mode="after")
    def _fits_together(self) -> ScenarioResults:
        for plan, result in self.plans.items():
            for key in ("by_robot", "end_shares"):
                if list(getattr(result, key)) != list(self.availability):
                    raise ValueError(f"plans.{plan}.{key}: expected the robots of 'availability', in its order")
        told = self.model_fields_set
        if "vss" in told:
            if self.vss is None or not {"stochastic", "deterministic"} <= set(self.plans):
                raise ValueError("a scenario with 'vss' has the plans 'stochastic' and 'deterministic'")
            s, d = (self.plans[name].executed.mean for name in ("stochastic", "deterministic"))
            if abs(self.vss.executed.mean - (s - d)) > 1e-6 * max(abs(s), abs(d)):
                raise ValueError("vss.executed.mean: expected what the stochastic plan collects beyond the other, "
                                 f"{s - d:g}, found {self.vss.executed.mean:g}")
            missing = {"evpi", "ws", "vss_mean_value", "vss_mean_value_executed", "value_of_process"} - told
            if missing:
                raise ValueError(f"the key {min(missing)!r} is missing; add it")
        elif self.comparisons is None or self.ranking is None:
            raise ValueError("expected 'vss', or 'comparisons' and 'ranking'")
        for empty in ("evpi_executed", "assumptions"):
            if empty in told and getattr(self, empty) is None:
                raise ValueError(f"{empty}: expected something, found nothing")
        return self


class Failures(Section):
    plan: FailureProcess
    execute: FailureProcess


class Travel(Section):
    pairs: WholeNumber
    triangle_violations_pct: Figure
    max_excess_pct: Figure


class Precise(Section):
    asked_pct: Figure
    reached_pct: Figure | None
    met: bool
    max_trials: WholeNumber


class Reach(Section):
    """What robots cannot reach within fuel and limit."""

    nothing: bool
    robots: list[Name]
    pois: list[Name]
    missed: dict[Name, list[Name]]


class Head(Section):
    """What every summary says first."""

    world: Name
    seed: Seed
    trials: Annotated[int, Field(strict=True, ge=1, le=MOST_TRIALS)]
    rollouts: Annotated[int, Field(strict=True, ge=1, le=MOST_ROLLOUTS)]
    fidelity: Fidelity
    failure: Failures
    travel: Travel
    reach: Reach
    reproducible: bool


class SummaryFile(Head):
    """``summary.json`` of a run."""

    format: Literal["sva-bench/summary@1"]
    scenarios: Annotated[list[ScenarioResults], Field(min_length=1, max_length=10_000)]
    precision: Precise | None = None

    @model_validator(mode="after")
    def _alike(self) -> SummaryFile:
        first = self.scenarios[0]
        if len({scenario.name for scenario in self.scenarios}) < len(self.scenarios):
            raise ValueError("scenarios: a name stands twice")
        for number, scenario in enumerate(self.scenarios):
            if (list(scenario.plans), list(scenario.availability), scenario.vss is None) != (
                    list(first.plans), list(first.availability), first.vss is None):
                raise ValueError(f"scenarios[{number}]: other plans or robots than in the first scenario")
        if "precision" in self.model_fields_set and self.precision is None:
            raise ValueError("precision: expected something, found nothing")
        return self


class Machine(Section):
    platform: Words
    python: Words
    cpus: WholeNumber


class ManifestFile(Section):
    """``manifest.json`` of a run; the world in it is checked as any world is."""

    format: Literal["sva-bench/manifest@1"]
    version: Words
    seed: Seed
    options: dict[str, Any]
    command: Annotated[list[AnyText], Field(max_length=10_000)]
    started: Words
    seconds: dict[str, Figure]
    machine: Machine
    packages: dict[Words, Words]
    world: dict[str, Any]


class ScenarioFacts(Section):
    """What is known of a scenario of a batch before any trial."""

    name: Name
    availability: Annotated[dict[Name, Probability], Field(min_length=1)]
    plans: dict[Objective, Promise]
    modelled_range: Interval | None
    same_plan: bool = False
    vss_mean_value: Figure | None
    ws: Figure | None
    evpi: Figure | None
    value_of_process: Figure | None


class Facts(Head):
    """A summary without its figures."""

    format: Literal["sva-bench/summary@1"]
    scenarios: Annotated[list[ScenarioFacts], Field(min_length=1, max_length=10_000)]
