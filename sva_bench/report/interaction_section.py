"""What robots of one world did to each other: a section of the page of a run, and what the terminal says."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.meetings import interactions
from sva_bench.analysis.plan_names import shown_over
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.choices import INTERACTIONS
from sva_bench.report.page import heading, note, table
from sva_bench.world.model import World

INTERACTION_HEAD = ("scenario", "plan", "collisions", "waited [s]", "detours", "exact [%]")
MEANT = ("Means over missions. Collisions: how many times two robots came to touch. Waited: how long robots waited for "
         "others, added up over the team. Detours: legs driven on another path than the shortest, because of other "
         "robots. Exact: share of missions that were played themselves, or provably end as one that was; the others "
         "have their ends from a mission alike.")

Scenarios = Sequence[ScenarioSummary | ComparedScenario]


def interaction_table(scenarios: Scenarios) -> list[list[str]]:
    """A row for each scenario and plan; none where robots do not meet."""
    return [[scenario, plan, f"{found.contacts:.2f}", f"{found.waited_s:.1f}", f"{found.detours:.2f}",
             _share(found.exact_share)] for scenario, plan, found in interactions(scenarios)]


def interaction_section(scenarios: Scenarios, world: World) -> list[str]:
    """The section of the page; nothing where robots do not meet."""
    rows = interaction_table(scenarios)
    if not rows:
        return []
    said = INTERACTIONS[world.interaction]
    return [heading("Robots in one world"), note(f"Interaction {world.interaction}: {said}."),
            table(INTERACTION_HEAD, rows, words=(0, 1), caption="What robots did to each other, a mission"),
            note(MEANT)]


def interaction_told(scenarios: Scenarios) -> str:
    """What robots did to each other under each plan, the mean over scenarios; nothing where they do not meet."""
    told = []
    for name in scenarios[0].plans:
        found = [mine for scenario in scenarios if (mine := scenario.plans[name].interaction) is not None]
        if found:
            waited_s, collisions, detours = (sum(values) / len(found) for values in zip(*(
                (each.waited_s, each.contacts, each.detours) for each in found), strict=True))
            told.append(f"{shown_over(scenarios, name)} {waited_s:.1f} s of waiting for others, {detours:.1f} detours, "
                        f"{collisions:.1f} collisions")
    over = "a mission" if len(scenarios) == 1 else "a mission, mean over scenarios"
    return f"Robots meet, {over}: {'; '.join(told)}." if told else ""


def _share(share: float) -> str:
    """In per cent; 100 only where all are exact."""
    return "100" if share == 1 else f"{min(100 * share, 99.9):.1f}"
