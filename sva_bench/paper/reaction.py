"""What stochastic planning is worth if the team reacts: the paper's claim under every process and kind of news."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import get_args

from sva_bench.analysis.reaction_results import ReactionResult
from sva_bench.analysis.reactions import reaction_result
from sva_bench.analysis.results import Estimate
from sva_bench.batch.map_samples import percentage_over_maps
from sva_bench.choices import NEWS, FailureProcess, News
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Drives
from sva_bench.execution.execute import execute
from sva_bench.files.printable import counted
from sva_bench.report.reaction_shares import in_per_cent, recourse_pct, vss_pct
from sva_bench.report.wording import percentage, with_interval
from sva_bench.study.costs import plan_costs
from sva_bench.study.options import Options
from sva_bench.study.planning import own_cases, plan_scenarios
from sva_bench.study.recourse import Stage, react_in_scenarios
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import Scenario, World

AVAILABILITIES = (0.25, 0.5, 0.75)
"""Of each world's last robot; the others are certain."""


@dataclass(frozen=True, kw_only=True)
class ReactedWorld:
    """A world under one failure process and availability: the results by news.

    Attributes:
        last_stays: Whether the last robot, the uncertain one, stays at the base in all plans.
    """

    world: str
    process: FailureProcess
    availability: float
    by_news: Mapping[News, ReactionResult]
    last_stays: bool = False


def reaction(
    worlds: Sequence[World], settings: Settings, executor: Executor | None, progress: OnProgress,
) -> list[ReactedWorld]:
    """Plans for each failure process, executed under it by teams that react: a row per world, process, availability."""
    rows = []
    for world in map(_with_availabilities, worlds):
        costs = plan_costs(world, "prmstar", progress)
        own = replace(settings, rollouts=settings.rollouts if world.noisy else 1, recorded=False)
        options = Options(policies=("resolve",), anticipate=True,
                          news=tuple(news for news in NEWS if world.stations or news != "station"))
        drives = Drives()
        for process in get_args(FailureProcess):
            here = replace(world, plan_failure=process, execute_failure=process)
            planned = plan_scenarios(here, costs, options, progress)
            cases = [case for scenario in here.scenarios for case in own_cases(scenario, planned[scenario.name])]
            executed = execute(here, costs, cases, own, executor,
                               lambda done, of: progress("driving routes", done, of), drives)
            found = react_in_scenarios(Stage(
                world=here, costs=costs, instances={name: p.instance for name, p in planned.items()}, settings=own,
                executed=executed, executor=executor, drives=drives), options, reaction_result, progress)
            rows += [ReactedWorld(world=world.name, process=process, availability=availability,
                                  by_news={result.news: result for result in found[scenario.name].results},
                                  last_stays=_stays(world.robots[-1].name, scenario.name, cases))
                     for scenario, availability in zip(here.scenarios, AVAILABILITIES, strict=True)]
    return rows


def _stays(robot: str, scenario: str, cases: Sequence[Case]) -> bool:
    """Whether a robot has no route in any plan of a scenario."""
    return all(len(set(case.plan.routes.get(robot, ()))) < 2 for case in cases if case.scenario.name == scenario)


def _with_availabilities(world: World) -> World:
    """The world with a scenario for each availability of its last robot."""
    names = [robot.name for robot in world.robots]
    return replace(world, scenarios=tuple(
        Scenario(name=f"A{100 * p:.0f}", availability={**dict.fromkeys(names, 1.0), names[-1]: p})
        for p in AVAILABILITIES))


_Figure = Callable[[ReactionResult], Estimate | None]


def _of_best(result: ReactionResult, gain: Estimate) -> Estimate | None:
    """A difference in per cent of the best plan's value."""
    return in_per_cent(gain, result.plans[result.best.plan].executed.mean)


def reaction_page(rows: Sequence[ReactedWorld], settings: Settings) -> str:
    """The rows as Markdown: over worlds first, then world by world."""
    worlds = list(dict.fromkeys(row.world for row in rows))
    lines = [
        "# What stochastic planning is worth if the team reacts", "",
        f"`sva-bench reproduce reaction`: {counted(len(worlds), 'world')} ({', '.join(worlds)}), "
        f"{counted(settings.rollouts, 'noise draw')}, fidelity {settings.fidelity}, seed {settings.seed}.", "",
        _assumed(rows), "",
        *_idle(rows),
        "## What it means for the paper's claim", "",
        _meaning(rows), "",
        "## VSS against news", "",
        "How much more the stochastic plan is worth than the deterministic one under the same reaction, in per cent of "
        "the stochastic plan: the mean over worlds, and its 95 % interval with the worlds as the sample, which allows "
        "for the noise draws that all worlds share. `never` is without reaction.", "",
        *_table(rows, vss_pct), "",
        "## What reacting adds", "",
        "Value of recourse: what the same plan is worth more if the team reacts, in per cent of its value if nobody "
        "does.", "",
        "Deterministic plan:", "",
        *_table(rows, lambda result: recourse_pct(result, "deterministic")), "",
        "Stochastic plan:", "",
        *_table(rows, lambda result: recourse_pct(result, "stochastic")), "",
        "## The best plan for the reaction", "",
        "VSS with recourse: the best plan for the reaction less the deterministic one, in per cent of the best. It is "
        "one of the stochastic, the deterministic and the anticipative plan, which is chosen by simulating it.", "",
        *_table(rows, lambda result: _of_best(result, result.vss_with_recourse)), "",
        "Anticipation: the best plan less the stochastic one.", "",
        *_table(rows, lambda result: _of_best(result, result.anticipation)), "",
        "## World by world", "",
        "VSS in per cent by news, with the 95 % interval over noise draws (failures are enumerated, so they add no "
        "sampling error).", "",
        *_by_world(rows)]
    return "\n".join([*lines, ""])


def _assumed(rows: Sequence[ReactedWorld]) -> str:
    """What is taken for granted; of stations only where a world has one."""
    stations = any("station" in row.by_news for row in rows)
    return (_ASSUMED + "News comes when it happens (`instant`)" + (
        ", when the planned arrival at the next stop passes without a report (`report`), or to each robot as it leaves "
        "a station (`station`)." if stations else
        ", or when the planned arrival at the next stop passes without a report (`report`)."))


def _idle(rows: Sequence[ReactedWorld]) -> list[str]:
    """Worlds whose last robot stays at the base in all plans: its failures cost nothing there."""
    idle = [world for world in dict.fromkeys(row.world for row in rows)
            if all(row.last_stays for row in rows if row.world == world)]
    return [f"In {', '.join(idle)} the last robot stays at the base in all plans: it earns nothing there, its failures "
            "cost nothing, and the figures are zero for that reason alone.", ""] if idle else []


_ASSUMED = (
    "In each world the availability of the last robot is set here, whatever the world file says: it is uncertain and "
    "the others are certain. Its availability is the probability to be "
    "there for the mission (`mission`), to survive until its next POI (`per_leg`), or to survive driving for the whole "
    "mission limit (`hazard`). Plans are made for the process that is executed. When a failure is heard of, the policy "
    "`resolve` plans the rest of the mission again, exactly and for that process; robots finish the leg that they are "
    "on. ")


def _meaning(rows: Sequence[ReactedWorld]) -> str:
    """What is left of the value of planning for failures, at the least availability."""
    least = min(row.availability for row in rows)

    def mean(process: FailureProcess, news: News, figure: _Figure = vss_pct) -> str:
        found = [figure(row.by_news[news]) for row in rows
                 if (row.process, row.availability) == (process, least) and news in row.by_news]
        return f"{_mean(found)} %"

    missed, known = mean("mission", "report"), mean("mission", "instant")
    best = mean("mission", "report", lambda result: _of_best(result, result.vss_with_recourse))
    return (
        "The paper plans for failures because a vehicle that fails takes its incentives along; its introduction speaks "
        "of recourse, and its model has none in flight. Without a reaction the hedge is worth "
        f"{mean('mission', 'never')} at {100 * least:.0f} % availability, as means over the worlds (`mission`). If the "
        f"team plans again when a report is missed, {missed} is left, and {known} if it knows at once: below zero the "
        "deterministic plan is worth more, since the stochastic one pays for its hedge in missions in which nobody "
        "fails. Where any leg may be the last, re-planning comes too late for what was not hedged, and more is left: "
        f"{mean('per_leg', 'report')} under `per_leg`; of lifetimes it is {mean('hazard', 'report')}. The best plan "
        f"for the reaction is worth {best} more than the deterministic one under `mission` and missed reports. So what "
        "planning for failures is worth depends on when a team hears of them no less than on how often they happen; "
        "the paper's figures hold for teams that never hear.")


def _table(rows: Sequence[ReactedWorld], figure: _Figure) -> list[str]:
    """Means over worlds, a row per process and availability and a column per news."""
    heard = [news for news in NEWS if any(news in row.by_news for row in rows)]
    lines = [f"| process | availability | {' | '.join(heard)} |", f"| --- | ---: |{' ---: |' * len(heard)}"]
    for process, availability in dict.fromkeys((row.process, row.availability) for row in rows):
        mine = [row for row in rows if (row.process, row.availability) == (process, availability)]
        cells = [_mean([figure(row.by_news[news]) for row in mine if news in row.by_news]) for news in heard]
        lines.append(f"| {process} | {100 * availability:.0f} % | {' | '.join(cells)} |")
    return lines


def _mean(shares: Sequence[Estimate | None]) -> str:
    return percentage(percentage_over_maps([[share] for share in shares], sure=False))


def _by_world(rows: Sequence[ReactedWorld]) -> list[str]:
    heard = [news for news in NEWS if any(news in row.by_news for row in rows)]
    lines = [f"| world | process | availability | {' | '.join(heard)} | best plan on report | anticipation on report |",
             f"| --- | --- | ---: |{' ---: |' * len(heard)} --- | ---: |"]
    for row in rows:
        cells = [_vss(row.by_news[news]) if news in row.by_news else "" for news in heard]
        report = row.by_news["report"]
        share = "" if report.anticipation.pct is None else f"{report.anticipation.pct:.1f}"
        lines.append(f"| {row.world} | {row.process} | {100 * row.availability:.0f} % | {' | '.join(cells)} | "
                     f"{report.best.plan} | {share} |")
    return lines


def _vss(result: ReactionResult) -> str:
    """The VSS in per cent of the stochastic plan's mean, with its interval."""
    share = vss_pct(result)
    return "the same plan" if result.vss.same_plan else "" if share is None else with_interval(share)
