"""The tables behind the answer of a run: what planning for failures is worth, and what each plan is."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.plan_names import shown_name
from sva_bench.analysis.results import GivenPlanResult, PlanResult
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.analysis.summaries import AnySummary, ComparisonSummary, Summary
from sva_bench.report.page import note, table
from sva_bench.report.told_columns import told_columns
from sva_bench.report.wording import (
    DOUBTED_TOLD,
    VSS_PCT,
    adjusted,
    doubts_told,
    optional,
    reliability_told,
    vss_verdict,
    with_interval,
)
from sva_bench.storage.trial_counts import TrialCounts
from sva_bench.world.model import World

Scenarios = Sequence[ScenarioSummary | ComparedScenario]


def difference_table(summary: AnySummary) -> list[str]:
    """What is worth more by how much; nothing where there is only one plan."""
    return _vss(summary) if isinstance(summary, Summary) else _pairs(summary)


def _vss(summary: Summary) -> list[str]:
    rows = [[s.name, vss_verdict(s.vss),
             "" if s.vss.same_plan or s.vss.executed_pct is None else f"{s.vss.executed_pct:.1f}",
             "" if s.vss.same_plan else with_interval(s.vss.executed_controlled), f"{s.vss.modelled:.1f}",
             optional(s.evpi)] for s in summary.scenarios]
    head = ["scenario", "VSS", "VSS [%]", "variance-reduced", "modelled", "EVPI"]
    told = [*([DOUBTED_TOLD] if doubts_told(summary.scenarios) else []),
            *([VSS_PCT] if any(row[2] for row in rows) else []),
            *([REDUCED] if any(row[3] for row in rows) else [])]
    return [table(head, rows, caption="Value of the stochastic solution (VSS): how much more the stochastic plan is "
                                      "worth than the deterministic one, in the same trials"),
            *([note(" ".join(told))] if told else [])]


REDUCED = "Variance-reduced: the luck of the failures drawn is replaced by its expectation, known in closed form; " \
          "what noise did stays as measured."


def _pairs(summary: ComparisonSummary) -> list[str]:
    """Every pair of given plans; nothing where only one was given."""
    pairs = [(s.name, c) for s in summary.scenarios for c in s.comparisons]
    if not pairs:
        return []
    if len({(c.a, c.b) for _, c in pairs}) == 1:
        first = pairs[0][1]
        return [table(["scenario", "difference"], [[name, adjusted(c)] for name, c in pairs],
                      caption=f"{first.a} less {first.b}, trial by trial")]
    return [table(["plans", "difference", "by itself"], [
        [f"{c.a} − {c.b}", adjusted(c), with_interval(c)] for _, c in pairs], sections=[name for name, _ in pairs],
        caption="Differences, trial by trial; their intervals hold together with 95 %, those by themselves one by one")]


def plans_table(summary: AnySummary, world: World, counts: TrialCounts) -> list[str]:
    """Each plan by itself."""
    head = ["plan", "executed", "rank", "goes wrong [%]", "robots lost", "expected", "promised"]
    rows: list[list[str]] = []
    for scenario in summary.scenarios:
        ranks = {row.plan: str(row.rank) for row in scenario.ranking} if isinstance(scenario, ComparedScenario) else {}
        rows += [[named(scenario, name), with_interval(plan.executed), ranks.get(name, ""),
                  _wrong(plan), lost(counts, scenario.name, name), optional(plan.expected),
                  f"{plan.promised:.1f}"] for name, plan in scenario.plans.items()]
    shown, cells = told_columns(head, rows, (0, 1, 4))
    meant = {"rank": "Rank: one more than the number of plans that are distinguishably better.",
             "goes wrong [%]": "Goes wrong: in so many missions some robot runs out of fuel, comes home late or gets "
                               "stuck.",
             "robots lost": "Robots lost: how many a mission left the base and never came back, on average."}
    titles = {s.name: f"{s.name} ({reliability_told(world, s.name, summary)})" for s in summary.scenarios}
    return [table(shown, cells, sections=[titles[s.name] for s in summary.scenarios for _ in s.plans]),
            note(" ".join(meant[name] for name in shown if name in meant))]


def _wrong(plan: PlanResult) -> str:
    return "" if plan.bad is None else f"{100 * plan.bad.share:.1f}"


def named(scenario: ComparedScenario | ScenarioSummary, name: str) -> str:
    """The shown name of a plan; what breaks fuel or limit is marked beside its name, so before any figure."""
    plan = scenario.plans[name]
    marked = isinstance(plan, GivenPlanResult) and not plan.feasible
    return shown_name(scenario, name) + (" (infeasible)" if marked else "")


def lost(counts: TrialCounts, scenario: str, planner: str) -> str:
    """How many robots a mission left the base and never came back."""
    share = share_lost(counts, scenario, planner)
    return "–" if share is None else f"{share:.2f}" if share == 0 or share >= 0.005 else "< 0.01"


def share_lost(counts: TrialCounts, scenario: str, planner: str) -> float | None:
    """The same as a number; ``None`` where nobody counted."""
    ended = counts.ended.get((scenario, planner, "none", "never"))
    return None if ended is None else sum(
        found.share for found in ended if found.left and found.end in ("failed", "out_of_fuel", "stuck"))


def titles_of(scenarios: Scenarios) -> list[str]:
    """The scenario of each row of a table that has one for each scenario and plan."""
    return [scenario.name for scenario in scenarios for _ in scenario.plans]
