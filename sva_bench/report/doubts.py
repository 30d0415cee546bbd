"""What a reader should doubt, in sentences: a model that the execution contradicts, and plans that noise upsets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sva_bench.analysis.plan_names import shown_name
from sva_bench.analysis.results import PlanResult
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.analysis.summaries import AnySummary, Summary
from sva_bench.analysis.unseen import EXECUTION_LOSSES
from sva_bench.files.printable import counted
from sva_bench.report.wording import listed, per_cent, with_interval

CONTRADICTED = "The execution contradicts the model."
"""What a contradiction is announced by."""
_TOLERANCE = 1e-6  # relative: of sums in another order
_MOST_NAMED, _MOST_PLANS = 6, 8


def contradictions(summary: AnySummary) -> list[str]:
    """A sentence for each scenario whose executed VSS contradicts the modelled one.

    It does where its interval excludes the modelled value, or has the other sign. Failures that are drawn may do so by
    chance, so the execution must have cost one of the plans something, too.
    """
    if not isinstance(summary, Summary):
        return []
    return [said for scenario in summary.scenarios if (said := _contradiction(scenario)) is not None]


def _contradiction(scenario: ScenarioSummary) -> str | None:
    vss, found = scenario.vss, scenario.vss.executed
    lost = {name: _lost(plan) for name, plan in scenario.plans.items() if name in ("stochastic", "deterministic")}
    if vss.same_plan or found.ci95 is None or not any(amount for amount, _ in lost.values()):
        return None
    slack = _TOLERANCE * max(1.0, abs(vss.modelled))
    excluded = not found.ci95[0] - slack <= vss.modelled <= found.ci95[1] + slack
    turned = min(vss.modelled, found.mean) < -slack and max(vss.modelled, found.mean) > slack
    if not excluded and not turned:
        return None
    how = "and not" if excluded else "of the other sign than"
    return (f"{scenario.name}: executed, planning for failures is worth {with_interval(found)}, {how} the "
            f"{vss.modelled:.1f} of the model: {_why(lost, scenario.plans)}.")


def _why(lost: Mapping[str, tuple[float, str]], plans: Mapping[str, PlanResult]) -> str:
    """What cost most, and where to look: by end. What each source of noise cost stands beside the ledger."""
    name, (amount, end) = max(lost.items(), key=lambda item: item[1][0])
    met = plans[name].interaction
    collided = end == "stuck" and met is not None and met.contacts > 0
    return (f"what cost most is that robots of the {name} plan {'collided and ' if collided else ''}ended "
            f"{end.replace('_', ' ')} ({amount:.1f}); see "
            '"From promise to execution"' + (' and "Robots in one world"' if collided else ""))


def _lost(plan: PlanResult) -> tuple[float, str]:
    """The most that an end of the execution cost a plan, and which end."""
    return max((-getattr(plan.ledger, end), end) for end in EXECUTION_LOSSES)


def failed_physics(summary: AnySummary) -> list[str]:
    """In how many drives physics failed; nothing where it failed in none."""
    made = summary.drives
    if made is None or not made.physics_failed:
        return []
    return [f"Physics failed in {made.physics_failed} of {counted(made.count, 'drive')}: it gave no finite pose of the "
            "robot. Missions with such a drive count as stuck there, which says nothing about their plan: look at the "
            "masses, sizes and loads of the robots."]


def costless_ends(scenarios: Sequence[ScenarioSummary | ComparedScenario]) -> list[str]:
    """A sentence about ends of robots that cost their plans nothing though nobody wants them; nothing without any."""
    told: dict[str, list[str]] = {}
    for scenario in scenarios:
        for name, plan in scenario.plans.items():
            for end in EXECUTION_LOSSES:
                if plan.ends.get(end) and not round(getattr(plan.ledger, end), _DIGITS):
                    told.setdefault(end.replace("_", " "), []).append(f"{scenario.name} {shown_name(scenario, name)}")
    return [f"Robots that ended {end} cost these plans nothing: {_some(plans)}. All that they were to collect was "
            f"collected before, as on the way home{'' if end == 'late' else _LOST}." for end, plans in told.items()]


_LOST = ", and losing a robot itself costs nothing without a loss_cost"
_DIGITS = 6  # of values that are summed in another order


def _some(words: Sequence[str]) -> str:
    left = len(words) - _MOST_PLANS
    return listed(words if left <= 0 else [*words[:_MOST_PLANS], f"{left} more"])


def upset_by_noise(summary: AnySummary) -> list[str]:
    """How often some robot of each plan ran dry, was late or got stuck; nothing where none did."""
    told = []
    for scenario in summary.scenarios:
        shares = {name: plan.bad.share for name, plan in scenario.plans.items() if plan.bad is not None}
        if any(shares.values()):
            told.append(f"{scenario.name}: " + ", ".join(f"{shown_name(scenario, name)} {per_cent(100 * share)}"
                                                         for name, share in shares.items()))
    if not told:
        return []
    left = f"; {len(told) - _MOST_NAMED} more scenarios" if len(told) > _MOST_NAMED else ""
    return ["Missions in which some robot ran out of fuel, came home late or got stuck, which no plan reckons with: "
            f"{'; '.join(told[:_MOST_NAMED])}{left}."]
