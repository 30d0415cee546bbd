"""Results of teams that react: the types behind ``reactions`` in ``summary.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from pydantic import Field, model_validator

from sva_bench.analysis.results import (
    MOST_TRIALS,
    Amount,
    Comparison,
    Distribution,
    Estimate,
    Interval,
    Ledger,
    PlanFigures,
    PlanName,
    Ranked,
    VssFigures,
    Words,
)
from sva_bench.choices import End, HistoryMode, News, PolicyName
from sva_bench.files.fields import Name, NonNegativeInt, Probability
from sva_bench.files.records import Record, stands_after


@dataclass(frozen=True, kw_only=True)
class ReactionLedger(Ledger):
    """The decomposition of executed less promised value; ``reaction`` is what re-planning gained or lost."""

    reaction: Amount = field(metadata=stands_after("assumption"))


@dataclass(frozen=True, kw_only=True)
class ReactingPlan(PlanFigures):
    """The results of a plan whose team reacts.

    ``ends`` are the expected numbers in as many missions as the run has trials, rounded.

    Attributes:
        ledger: Decomposition of executed less promised value.
        modelled: Expected value with the reaction if each leg is driven as planned; without sampling error where
            histories are enumerated.
        distribution: Distribution over histories, weighted, or over trials.
        end_shares: Probability of each end, by robot.
        missions: Number of missions played: all histories under each noise draw, or trials.
        reacted: Probability that orders change in a mission, of a robot that lives to take them.
        doubled: Expected number of POIs that two robots visit.
    """

    ledger: ReactionLedger
    modelled: Amount = field(metadata=stands_after("expected"))
    distribution: Distribution = field(metadata=stands_after("executed"))
    end_shares: Mapping[Name, Mapping[End, Probability]] = field(metadata=stands_after("ends"))
    missions: Annotated[int, Field(strict=True, ge=1, le=MOST_TRIALS)]
    reacted: Probability
    doubled: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]


@dataclass(frozen=True, kw_only=True)
class Gain(Estimate):
    """A difference in value, and in per cent."""

    pct: Amount | None


@dataclass(frozen=True, kw_only=True)
class BestPlan(Record):
    """The best plan for a policy of those that were tried, and how much better than the next it is.

    Attributes:
        plan: Which it is.
        over: The next best of other routes; ``None`` where there is none.
        mean, ci95: The difference between the two.
    """

    plan: PlanName
    over: PlanName | None
    mean: Amount
    ci95: Interval | None


@dataclass(frozen=True, kw_only=True)
class Candidate(Record):
    """A plan tried for a policy: what it goes by, the exponent of the survival that it was made for, and its value."""

    plan: Words
    theta: Probability | None
    modelled: Amount


@dataclass(frozen=True, kw_only=True)
class DrivenWhole(Record):
    """Missions driven whole in physics, as a check of those put together from legs.

    Attributes:
        missions: How many were.
        differing: Of how many a stop, an end or an incentive is another.
    """

    missions: NonNegativeInt
    differing: NonNegativeInt


@dataclass(frozen=True, kw_only=True)
class ReactionFigures(Record):
    """One scenario under one policy and one kind of news.

    Attributes:
        policy, news: What the team does, and when it learns of a failure.
        histories: Whether all histories were played or a sample.
        plans: Results of the plans.
        value_of_recourse: What reacting adds to each plan, in per cent of its value without.
        driven_whole: Missions driven whole in physics, beside those put together from legs.
    """

    policy: PolicyName
    news: News
    histories: HistoryMode
    plans: Annotated[Mapping[PlanName, ReactingPlan], Field(min_length=1)]
    value_of_recourse: Mapping[PlanName, Gain]
    driven_whole: DrivenWhole

    @model_validator(mode="after")
    def _has_all(self) -> ReactionFigures:
        if set(self.value_of_recourse) != set(self.plans):
            raise ValueError("value_of_recourse: expected that of each of 'plans'")
        return self

    @property
    def name(self) -> str:
        """As shown to people."""
        return f"{self.policy} on {self.news} news"


@dataclass(frozen=True, kw_only=True)
class ReactionResult(ReactionFigures):
    """The plans of ``run`` in one scenario under one policy and one kind of news.

    Attributes:
        vss: Stochastic less deterministic plan under the policy; of either sign.
        vss_without_reaction: The same if nobody reacts, by the same histories or trials, in per cent of the stochastic
            plan's value then. The VSS of the run is by its own trials, and no match for ``vss``.
        vss_with_recourse: The best plan for the policy less the deterministic one, in per cent of the best.
        anticipation: The best plan for the policy less the stochastic one, in per cent of the best.
        best: Which plan is the best.
        candidates: The plans that ``anticipative`` was chosen from; none without it.
    """

    vss: VssFigures = field(metadata=stands_after("plans"))
    vss_without_reaction: Gain
    vss_with_recourse: Gain
    anticipation: Gain
    best: BestPlan
    candidates: tuple[Candidate, ...] = ()

    @property
    def best_plans(self) -> frozenset[str]:
        """The best plan, and those of its routes."""
        alike = {frozenset(("stochastic", "deterministic"))} if self.vss.same_plan else set()
        if self.candidates:  # the anticipative plan is the best of them, of equals the first
            alike.add(frozenset(("anticipative", max(self.candidates, key=lambda tried: tried.modelled).plan)))
        found = frozenset((self.best.plan,))
        for _ in alike:  # through one pair to the other
            found = found.union(*(pair for pair in alike if pair & found))
        return found & set(self.plans)

    @model_validator(mode="after")
    def _is_consistent(self) -> ReactionResult:
        if not {"stochastic", "deterministic"} <= set(self.plans):
            raise ValueError("plans: expected 'stochastic' and 'deterministic' among them")
        for key, name in (("plan", self.best.plan), ("over", self.best.over)):
            if name is not None and name not in self.plans:
                raise ValueError(f"best.{key}: expected one of 'plans'")
        return self


@dataclass(frozen=True, kw_only=True)
class ComparedReaction(ReactionFigures):
    """The plans of ``execute`` in one scenario under one policy and one kind of news, compared pair by pair.

    Attributes:
        comparisons: Every pair of plans under the policy, by the same histories or trials.
        ranking: The plans from best to worst.
        candidates: The plans that ``anticipative`` was chosen from; none without it.
    """

    comparisons: tuple[Comparison, ...] = field(metadata=stands_after("plans"))
    ranking: tuple[Ranked, ...] = field(metadata=stands_after("comparisons"))
    candidates: tuple[Candidate, ...] = field(default_factory=tuple)
