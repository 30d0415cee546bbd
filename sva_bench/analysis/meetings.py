"""What meeting others comes to in a mission, over many, and as a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from sva_bench.analysis.plan_names import shown_name
from sva_bench.analysis.results import InteractionSummary, PlanFigures, ScenarioPlans
from sva_bench.arrays import FloatArray
from sva_bench.execution.meetings import Meetings

INTERACTION_COLUMNS = ("scenario", "policy", "news", "planner", "contacts", "waited_s", "detours", "exact_share")
"""Columns of ``interaction.csv``."""


def interaction_summary(meetings: Meetings | None, weight: FloatArray | None = None) -> InteractionSummary | None:
    """The means over missions; ``None`` where robots do not meet.

    Args:
        meetings: What came of each mission.
        weight: Probability of each mission, which add up to 1, shape (missions,); ``None`` = all alike.
    """
    if meetings is None:
        return None
    own = np.full(len(meetings.exact), 1.0 / len(meetings.exact)) if weight is None else weight
    return InteractionSummary(
        contacts=float(own @ meetings.contacts) + 0.0, waited_s=float(own @ meetings.waited_s) + 0.0,
        detours=float(own @ meetings.detours) + 0.0,
        exact_share=1.0 if meetings.exact.all() else min(float(own @ meetings.exact), 1.0))


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
