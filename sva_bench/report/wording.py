"""Texts of a summary, shared by terminal and page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

from sva_bench.analysis.catalogue import Statistic
from sva_bench.analysis.over_maps import BatchSummary, OverMaps, Percentage
from sva_bench.analysis.reach import beyond_reach, infeasible_plans, warned, why_nothing
from sva_bench.analysis.results import Comparison, Estimate, PlanFigures, VssFigures
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.analysis.statistics import POWER, detectable
from sva_bench.analysis.summaries import AnySummary, ComparisonSummary, Summary
from sva_bench.choices import FAILURES, FailureProcess
from sva_bench.files.printable import counted
from sva_bench.mission.failures import process_of
from sva_bench.world.model import Scenario, World


class WithInterval(Protocol):
    """Anything that has a mean and its 95 % interval."""

    @property
    def mean(self) -> float:
        """The mean."""

    @property
    def ci95(self) -> tuple[float, float] | None:
        """Its interval, if there is one."""


def answer(summary: AnySummary) -> str:
    """In one sentence: which plan is worth more, and by how much."""
    if summary.reach.nothing:
        return f"There is nothing to compare, for {why_nothing(summary.reach)}."
    given = isinstance(summary, ComparisonSummary)
    said = _of_given_plans(summary) if isinstance(summary, ComparisonSummary) else _of_the_two_plans(summary)
    reacts = any(scenario.reactions for scenario in summary.scenarios) and not (
        given and len(summary.scenarios[0].plans) == 1)
    return f"If the team keeps its plan, {said[0].lower()}{said[1:]}" if reacts else said


def _of_given_plans(summary: ComparisonSummary) -> str:
    """Which plan is worth more than which, each pair once with all scenarios in which it is."""
    if len(summary.scenarios[0].plans) == 1:
        return "One plan: there is nothing to compare it with."
    clear: dict[tuple[str, str], list[str]] = {}
    for s in summary.scenarios:
        for c in s.comparisons:
            if c.distinguishable:
                pair = (c.a, c.b) if c.mean > 0 else (c.b, c.a)
                clear.setdefault(pair, []).append(f"{s.name} ({abs(c.mean):.1f})")
    if not clear:
        return "No difference between plans stands out of the noise."
    said = [f"{better} is worth more than {worse} in {_listed_few(where)}" for (better, worse), where in clear.items()]
    if len(said) > _MOST_NAMED:
        said[_MOST_NAMED:] = [f"{len(said) - _MOST_NAMED} more pairs differ"]
    pairs = sum(len(s.comparisons) for s in summary.scenarios)
    rest = "" if sum(map(len, clear.values())) == pairs else " No other difference stands out of the noise."
    return f"{'; '.join(said)}.{rest}"


def _listed_few(words: Sequence[str]) -> str:
    return listed(words if len(words) <= _MOST_NAMED else [*words[:_MOST_NAMED], f"{len(words) - _MOST_NAMED} more"])


def _of_the_two_plans(summary: Summary) -> str:
    if all(plan.promised == 0 and plan.status == "optimal" for s in summary.scenarios for plan in (
            s.stochastic, s.deterministic)):
        return "There is nothing to compare, for no robot earns anything where it can go: give it incentives there."
    differing = [s for s in summary.scenarios if not s.vss.same_plan]
    alike = [s.name for s in summary.scenarios if s.vss.same_plan]
    unproved = not all(plan.status == "optimal" for s in summary.scenarios for plan in (s.stochastic, s.deterministic))
    if not differing:
        if unproved:
            return f"Nothing can be said of planning for failures: {_UNPROVED}, and both plans found are the same" + (
                "." if len(alike) == 1 else " in every scenario.")
        return "Planning for failures changes nothing here: both plans are the same" + (
            "." if len(alike) == 1 else " in every scenario.")
    same = f" In {listed(alike)} both plans are the same." if alike else ""
    if all(s.vss.executed.ci95 is None for s in differing):
        return f"Too few trials or noise draws for an interval: whether planning for failures pays can't be said.{same}"
    pays = [s for s in differing if s.vss.distinguishable and s.vss.executed.mean > 0]
    costs = [s.name for s in differing if s.vss.distinguishable and s.vss.executed.mean < 0]
    loses = f" In {listed(costs)} it is worth less." if costs else ""
    named = listed([s.name + _share(s.vss) for s in pays]) if pays else ""
    rest = [s.name for s in differing if not s.vss.distinguishable]
    other = f" In {listed(rest)} the two can't be told apart." if rest and (pays or unproved) else ""
    if unproved:
        more = f" The stochastic plan found is worth more in {named}." if pays else ""
        return f"Whether planning for failures pays is not settled: {_UNPROVED}.{more}{other}{loses}{same}"
    if not pays:
        return (f"In {listed(rest)} these trials can't tell whether planning for failures pays: more of them may "
                f"(--trials, --precision)." if rest else "Planning for failures pays in no scenario.") + loses + same
    return f"Planning for failures pays in {named}.{other}{loses}{same}"


def _share(vss: VssFigures) -> str:
    return "" if vss.executed_pct is None else f" (VSS {per_cent(vss.executed_pct)})"


def assumed(summary: AnySummary) -> str:
    """What failures were planned for and which were executed, in words; given plans were not planned here."""
    failure = summary.failure
    if isinstance(summary, ComparisonSummary):
        return f"failures executed: {_failing(failure.execute)}"
    if failure.plan == failure.execute:
        return f"failures planned for and executed: {_failing(failure.execute)}"
    return f"failures planned for: {_failing(failure.plan)}; executed: {_failing(failure.execute)}"


def _failing(process: FailureProcess) -> str:
    return f"{process} ({FAILURES[process]})"


_UNPROVED = "some plans are not proved optimal"
_MOST_NAMED = 6
FEW_MAPS = 10
"""Maps below which an interval over them wants a word of caution: it is wide and shaky there."""
FEW_DRAWS = 16
"""Noise draws below which an interval is mostly due to draws that were not observed."""
VSS_PCT = "VSS in %: how much more the stochastic plan is worth than the deterministic one, in per cent of the former."


def ranked(scenario: ComparedScenario) -> str:
    """The plans of a scenario from best to worst; those of one rank can't be told apart from what is above them.

    What breaks its limits, and robots that were lost, are said before the figure.
    """
    return "; ".join(f"{row.rank}. {row.plan}{warned(scenario.plans[row.plan])} {row.mean:.1f}"
                     for row in scenario.ranking)


def adjusted(comparison: Comparison) -> str:
    """A difference with the interval that is adjusted for the number of pairs."""
    return verdict(Estimate(mean=comparison.mean, ci95=comparison.ci95_adjusted),
                   distinguishable=comparison.distinguishable, same=comparison.same_plan)


def finding(vss: VssFigures) -> str:
    """What a scenario comes to: how much more, how sure."""
    if vss.same_plan:
        return "the same plan is best either way: no difference in any trial"
    mean, interval = vss.executed.mean, vss.executed.ci95
    if interval is None:
        return f"{mean:+.1f} by planning for failures; no interval: more trials or noise draws would tell " \
               "how sure that is"
    if not vss.distinguishable:
        if interval[0] == interval[1] == 0:
            return "no difference in any trial"
        return f"not distinguishable from zero: {mean:+.1f}, 95 % sure of {interval[0]:.1f} to {interval[1]:.1f}; a " \
               f"run like this tells a difference of {detectable(vss.executed):.1f} with {100 * POWER:.0f} % power"
    share = "" if vss.executed_pct is None else f" ({per_cent(vss.executed_pct)})"
    better = "stochastic" if mean > 0 else "deterministic"
    if interval[0] == interval[1]:
        return f"the {better} plan is worth {abs(mean):.1f} more{share}, in every trial"
    if f"{interval[0]:.1f}" == f"{interval[1]:.1f}":
        return f"the {better} plan is worth {abs(mean):.1f} more{share}, 95 % sure of that figure"
    return f"the {better} plan is worth {abs(mean):.1f} more{share}, 95 % sure of " \
           f"{min(map(abs, interval)):.1f} to {max(map(abs, interval)):.1f}"


def reliability_told(world: World, scenario: str, summary: AnySummary) -> str:
    """How reliable the robots of a scenario are, and what it costs to lose them."""
    known = world.scenario(scenario)
    failure = summary.failure
    processes = {failure.execute} if isinstance(summary, ComparisonSummary) else {failure.execute, failure.plan}
    in_time = {name for name in processes if process_of(name).terms([]).rate is not None}
    lifetimes = dict(known.mtbf_s) if in_time else {}
    doubtful = [f"{listed(names)}{' together' if len(names) > 1 else ''} {per_cent(100 * p)}"
                for names, p in _available_together(known)
                if p < 1 and not (names[0] in lifetimes and processes == in_time)]
    if known.joint is not None and len(doubtful) > 1:
        doubtful[-1] += " (not independent of each other)"
    parts = [("availability", doubtful),
             ("mean driving time to failure", [f"{name} {mtbf:g} s" for name, mtbf in lifetimes.items()]),
             ("cost of losing a robot", [f"{r.name} {r.loss_cost:g}" for r in world.robots if r.loss_cost > 0])]
    told = [f"{what}: {', '.join(found)}" for what, found in parts if found]
    return "; ".join(told if doubtful or lifetimes else ["all available", *told])


def dependent_robots(world: World, summary: AnySummary) -> list[str]:
    """A line for each scenario whose robots are not available independently of each other."""
    return [f"{scenario.name}: {reliability_told(world, scenario.name, summary)}."
            for scenario in summary.scenarios if world.scenario(scenario.name).joint is not None]


def _available_together(scenario: Scenario) -> list[tuple[list[str], float]]:
    """Robots with their availability; those that are always available or lost together are one entry."""
    found: dict[tuple[str | int, ...], list[str]] = {}
    for name, p in scenario.availability.items():
        states = [k for k, state in enumerate(scenario.joint or ())
                  if state.probability > 0 and name in state.available]
        found.setdefault((name,) if scenario.joint is None or p >= 1 else tuple(states), []).append(name)
    return [(names, scenario.availability[names[0]]) for names in found.values()]


def remarks(summary: AnySummary) -> list[str]:
    """Remarks beside the answer: unreachable POIs, percentages, few noise draws, precision and EVPI."""
    found = named_remarks(summary)
    if isinstance(summary, Summary) and any(
            s.vss.executed_pct is not None and not s.vss.same_plan for s in summary.scenarios):
        found.insert(sum(name == "Out of reach" for name, _ in found), ("VSS", VSS_PCT))
    return [f"Caution: {said[0].lower()}{said[1:]}" if name == "Caution" else said for name, said in found]


def named_remarks(summary: AnySummary) -> list[tuple[str, str]]:
    """The same, each with the name of what it is about, without what percentages are."""
    found = [("Out of reach", said) for said in beyond_reach(summary.reach)]
    if isinstance(summary, ComparisonSummary):
        return [*found, *(("Infeasible", said) for said in infeasible_plans(summary)),
                *(("Caution", said) for said in _few_draws(summary))]
    compared = not all(s.vss.same_plan for s in summary.scenarios)
    return [*found, *(("Caution", said) for said in (_few_draws(summary) if compared else [])),
            *(("Precision", said) for said in _precision(summary)),
            *(("Perfect information", said) for said in _known_beforehand(summary))]


def _few_draws(summary: AnySummary) -> list[str]:
    if not 1 < summary.rollouts < FEW_DRAWS:
        return []
    return [f"The intervals rest on only {summary.rollouts} noise draws, and are wide where robots run short of fuel "
            "or time; more draws (--rollouts) make them narrower."]


def _precision(summary: Summary) -> list[str]:
    asked = summary.precision
    if asked is None:
        return []
    reached = "no interval" if asked.reached_pct is None else f"{asked.reached_pct:.2g} %"
    return [f"Precision asked for: VSS within {asked.asked_pct:g} % of the stochastic plan's value; reached: "
            f"{reached} after {counted(summary.trials, 'trial')} under {counted(summary.rollouts, 'noise draw')}"
            f"{'' if asked.met else ', the most that were allowed'}."
            f"{'' if asked.anytime is None else _anytime(asked.anytime)}"]


def _anytime(found: Mapping[str, tuple[float, float] | None]) -> str:
    told = [f"{name} [{ends[0]:.1f}, {ends[1]:.1f}]" for name, ends in found.items() if ends is not None]
    return f" Intervals of the VSS that hold with 95 % whenever a run stops: {', '.join(told)}." if told else ""


def _known_beforehand(summary: Summary) -> list[str]:
    known = [f"{s.name} {verdict(s.evpi_executed, distinguishable=s.evpi_executed.distinguishable)}"
             for s in summary.scenarios if s.evpi_executed is not None]
    return ["Perfect information about who is available, or replanning at the base, would add, executed: "
            f"{'; '.join(known)}."] if known else []


def over_few_maps(rows: Sequence[OverMaps]) -> str:
    """A word of caution for the VSS over few maps; nothing where there are enough."""
    fewest, alike = min((row.maps for row in rows), default=FEW_MAPS), ""
    if any(row.maps > 1 and row.vss.ci95 is None for row in rows):
        alike = "Where all maps show the same VSS there is no interval: take it for these maps only, for others may " \
            "show another."
        rows = [row for row in rows if row.vss.ci95 is not None]
    if fewest >= FEW_MAPS or not rows:
        return alike
    if fewest == 1:
        return "From one map there is no interval over maps, however many seeds it has: nothing tells how maps differ."
    return f"Over {fewest} maps only: the interval is wide, even where the VSS of each is positive, and what one map " \
        f"in ten shows may not be among them. {alike}".rstrip()


def same_draws(summary: BatchSummary) -> str:
    """That maps share draws which no interval allows for; nothing where all intervals do, or where there is one map."""
    if all(row.maps < 2 for row in summary.aggregate) or all(
            s.vss.executed.ci95 is not None for unit in summary.units for s in unit.scenarios):
        return ""
    return "One trial, or one noise draw, does not tell what chance did to all maps alike, and the interval over " \
        "maps leaves that out: give more --trials and --rollouts, or more seeds (--seed)."


def assumption_rows(scenarios: Sequence[ScenarioSummary]) -> list[list[str]]:
    """Scenario, failures executed, plan, what it was made for, expected, executed, loss; one row a plan."""
    return [[s.name, row.executed_under, row.planner, row.planned_for or "no failures", f"{row.expected:.1f}",
             with_interval(row.executed),
             verdict(row.loss, distinguishable=row.loss.distinguishable, same=row.loss.same_plan)]
            for s in scenarios for row in s.assumptions or ()]


ASSUMPTION_HEAD = ("scenario", "executed under", "plan", "made for", "expected", "executed", "loss")


def verdict(difference: WithInterval, *, distinguishable: bool, same: bool = False) -> str:
    """A difference with its interval, or that there is none to speak of: two equal plans, or within the noise."""
    if same:
        return "the same plan"
    if difference.ci95 is None:
        return f"{difference.mean:.1f}, no interval"
    return with_interval(difference) if distinguishable else "not distinguishable from zero"


def vss_verdict(vss: VssFigures) -> str:
    """The executed VSS of a scenario with its interval, marked where it is not distinguishable from zero."""
    if vss.same_plan or vss.distinguishable or vss.executed.ci95 is None:
        return verdict(vss.executed, distinguishable=vss.distinguishable, same=vss.same_plan)
    return with_interval(vss.executed).replace(" [", f"{DOUBTED} [", 1)


DOUBTED = "°"
"""Behind figures whose interval holds zero."""
DOUBTED_TOLD = f"{DOUBTED}: not distinguishable from zero."


def doubts_told(scenarios: Sequence[ScenarioSummary | ComparedScenario]) -> bool:
    """Whether some executed VSS is marked as not distinguishable from zero."""
    return any(DOUBTED in vss_verdict(s.vss) for s in scenarios if isinstance(s, ScenarioSummary))


def with_interval(estimate: WithInterval, digits: int = 1, unit: str = "") -> str:
    """``39.0 [36.1, 41.9]``."""
    interval = estimate.ci95
    return f"{estimate.mean:.{digits}f}{unit}" + (
        "" if interval is None else f" [{interval[0]:.{digits}f}, {interval[1]:.{digits}f}]")


def percentage(share: Percentage) -> str:
    """``9.5 (1 map)`` where it is over other maps than the rest of its row; nothing where no map has one."""
    if share.mean is None:
        return ""
    over = "" if share.maps is None else f" ({counted(share.maps, 'map')})"
    return with_interval(Estimate(mean=share.mean, ci95=share.ci95)) + over


def cell(entry: Statistic, plan: PlanFigures) -> str:
    """A statistic of a plan as tables show it; nothing where the plan has none."""
    value = entry.of(plan)
    if value is None:
        return ""
    return with_interval(value) if isinstance(value, Estimate) else f"{value:{'+' if entry.signed else ''}.1f}"


def per_cent(figure: float | None) -> str:
    """``18 %``, and a digit more where that says more; 42.5 is 43, as readers round it."""
    if figure is None:
        return ""
    whole = math.copysign(math.floor(abs(figure) + 0.5), figure)
    return f"{whole:.0f} %" if abs(figure) >= 9.95 or figure == 0 else f"{figure:.1f} %"


def optional(figure: float | None) -> str:
    """A figure, or nothing where there is none."""
    return "–" if figure is None else f"{figure:.1f}"


def listed(words: Sequence[str], last: str = "and") -> str:
    """``a, b and c``."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"
