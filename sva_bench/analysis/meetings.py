"""What meeting others comes to in a mission, over many, and as a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from sva_bench.analysis.plan_names import shown_name
from sva_bench.analysis.results import InteractionSummary, PlanFigures, ScenarioPlans
from sva_bench.arrays import FloatArray
from sva_bench.execution.meetings import Meetings

INTERACTION_COLUMNS = ("scenario", "policy", "news", "planner", "contacts", "waited_s", "detours", "exact_share")
"""Columns of ``interaction.csv``."""


@dataclass(frozen=True, kw_only=True)
class MetTally:
    """Sums over missions of robots that meet; those of two ranges of missions add up.

    Attributes:
        missions: How many missions.
        contacts, detours: How many times robots touched each other, and how many legs were detours.
        waited_s: How long robots waited for others [s].
        exact: How many missions are exact.
    """

    missions: int
    contacts: int
    waited_s: float
    detours: int
    exact: int

    def __add__(self, other: MetTally) -> MetTally:
        return MetTally(
            missions=self.missions + other.missions, contacts=self.contacts + other.contacts,
            waited_s=self.waited_s + other.waited_s, detours=self.detours + other.detours,
            exact=self.exact + other.exact)

    @property
    def means(self) -> InteractionSummary:
        """A mission's share of the sums."""
        return InteractionSummary(
            contacts=self.contacts / self.missions, waited_s=self.waited_s / self.missions,
            detours=self.detours / self.missions, exact_share=self.exact / self.missions)


def met_tally(meetings: Meetings | None) -> MetTally | None:
    """The sums over missions that all count alike; ``None`` where robots do not meet."""
    return None if meetings is None else MetTally(
        missions=len(meetings.exact), contacts=int(meetings.contacts.sum()), waited_s=float(meetings.waited_s.sum()),
        detours=int(meetings.detours.sum()), exact=int(meetings.exact.sum()))


def interaction_summary(meetings: Meetings | None, weight: FloatArray | None = None) -> InteractionSummary | None:
    """The means over missions; ``None`` where robots do not meet.

    Args:
        meetings: What came of each mission.
        weight: Probability of each mission, which add up to 1, shape (missions,); ``None`` = all alike.
    """
    if meetings is None:
        return None
    if weight is None:
        tally = met_tally(meetings)
        return None if tally is None else tally.means
    return InteractionSummary(
        contacts=float(weight @ meetings.contacts), waited_s=float(weight @ meetings.waited_s),
        detours=float(weight @ meetings.detours),
        exact_share=1.0 if meetings.exact.all() else min(float(weight @ meetings.exact), 1.0))


def interactions(scenarios: Iterable[ScenarioPlans]) -> list[tuple[str, str, InteractionSummary]]:
    """Scenario, plan as pages name it, and what robots did to each other; none where they do not meet."""
    return [(scenario.name, shown_name(scenario, name), plan.interaction) for scenario in scenarios
            for name, plan in scenario.plans.items() if plan.interaction is not None]


def interaction_rows(
    scenario: str, policy: str, news: str, plans: Mapping[str, PlanFigures]
) -> list[Sequence[object]]:
    """The rows of a scenario's plans in ``interaction.csv``; none where robots do not meet."""
    return [[scenario, policy, news, name, *(getattr(plan.interaction, key) for key in INTERACTION_COLUMNS[4:])]
            for name, plan in plans.items() if plan.interaction is not None]
