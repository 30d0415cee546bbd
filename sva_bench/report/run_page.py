"""The report of a run: the answer first, then the results behind it."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

from sva_bench.analysis.catalogue import Section, statistics
from sva_bench.analysis.driving import driving_told
from sva_bench.analysis.plan_names import ShownNames, shown_name
from sva_bench.analysis.reach import lost_robots
from sva_bench.analysis.results import Estimate, Share
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.analysis.summaries import AnySummary, ComparisonSummary, Summary
from sva_bench.choices import ENDS, End
from sva_bench.files.printable import counted
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.report.calibration_page import against_nominal, calibration_section
from sva_bench.report.doubts import CONTRADICTED, contradictions, costless_ends, failed_physics, upset_by_noise
from sva_bench.report.interaction_section import interaction_section
from sva_bench.report.legs_section import legs_section
from sva_bench.report.meetings_section import meetings_section
from sva_bench.report.page import CONTENTS, figure, folded, heading, note, sentence, table, text, write_page
from sva_bench.report.plan_view import PlanView
from sva_bench.report.reaction_page import reaction_ledgers, reaction_section, reactions_answered
from sva_bench.report.results_charts import differences, distributions, plans_compared
from sva_bench.report.route_maps import route_maps
from sva_bench.report.source_table import source_section
from sva_bench.report.wording import (
    ASSUMPTION_HEAD,
    DOUBTED_TOLD,
    adjusted,
    answer,
    assumed,
    assumption_rows,
    cell,
    doubts_told,
    finding,
    listed,
    optional,
    ranked,
    reliability_told,
    remarks,
    vss_verdict,
    with_interval,
)
from sva_bench.storage.manifest import Manifest, RecordingNote
from sva_bench.storage.stored_run import Content
from sva_bench.storage.trial_counts import TrialCounts
from sva_bench.world.model import World

_MOST_TOLD = 6  # scenarios of whose lost robots the answer tells

Scenarios = Sequence[ScenarioSummary | ComparedScenario]


def write_report(path: Path, content: Content) -> None:
    """Write ``report.html``."""
    summary = content.summary
    scenarios = summary.scenarios
    names = ShownNames(scenarios)
    maps = route_maps(content)
    question = "Is the stochastic plan worth it" if isinstance(summary, Summary) else "What are the plans worth"
    parts = [
        f"<h1>{text(summary.world)}: {question}, and how sure is that?</h1>",
        *_answer(summary, content.world, content.counts),
        *reactions_answered(summary),
        *(_comparison(summary, content.counts) if isinstance(summary, Summary) else _ranking(summary)),
        note(f"{counted(summary.trials, 'trial')} of each plan in each scenario, "
             f"{counted(summary.rollouts, 'noise draw')}, fidelity {summary.fidelity}, seed {summary.seed}; "
             f"{assumed(summary)}. "
             "Values in the units of the world file's incentives; 95 % intervals in brackets, over trials and noise "
             "draws."),
        CONTENTS,
        *maps,
        *_charts(summary),
        *(calibration_section(summary) if isinstance(summary, Summary) else ()),
        *reaction_section(summary),
        *_over_trials(scenarios, content.counts),
        *_from_promise(scenarios),
        *source_section(scenarios),
        *reaction_ledgers(summary),
        *(_assumptions(summary) if isinstance(summary, Summary) else ()),
        *_ends(scenarios, content.routes),
        *folded(_by_robot(summary)),
        *folded(_measured(scenarios)),
        *interaction_section(scenarios, content.world),
        *folded(meetings_section(content)),
        *folded(legs_section(content, names)),
        *folded(_world(content.world, drawn=bool(maps))),
        *folded(_routes(content.routes, names)),
        *_recordings(content, names),
        *_again(summary, content.manifest),
    ]
    write_page(path, summary.world, parts)


def _answer(summary: AnySummary, world: World, counts: TrialCounts) -> list[str]:
    lines = []
    if not summary.reach.nothing:
        lines = [f"<li><b>{text(name)}</b>{line}</li>" for name, line in (
            _findings(summary, world) if isinstance(summary, Summary) else _rankings(summary, world))]
    unproved = "" if summary.reproducible else note(
        "A solve met its limit: these plans may differ on another machine.")
    return [f"<div class=answer><p>{sentence(answer(summary))}</p>", f"<ul>{''.join(lines)}</ul>" if lines else "",
            *(f"<p class=doubt><b>{sentence(said)}</b></p>" for said in failed_physics(summary)),
            *(f"<p class=doubt><b>{CONTRADICTED}</b> {sentence(said)}</p>" for said in contradictions(summary)),
            *(note(remark) for remark in (*_robots_lost(summary, counts), *upset_by_noise(summary), *remarks(summary),
                                          *_reduced(summary))), unproved, "</div>"]


def _findings(summary: Summary, world: World) -> Iterator[tuple[str, str]]:
    for scenario in summary.scenarios:
        known, told = reliability_told(world, scenario.name, summary), against_nominal(scenario)
        reduced = f"; variance-reduced {with_interval(scenario.vss.executed_controlled)}" if _is_reduced(scenario) \
            else ""
        yield scenario.name, (f" ({sentence(known)}): {sentence(finding(scenario.vss))}{sentence(reduced)}"
                              f"{sentence(told and f'. {told}')}")


def _is_reduced(scenario: ScenarioSummary) -> bool:
    """Whether the variance-reduced VSS is another figure than the plain one."""
    return not scenario.vss.same_plan and with_interval(scenario.vss.executed_controlled) != with_interval(
        scenario.vss.executed)


def _reduced(summary: AnySummary) -> list[str]:
    """What variance-reduced means, where there is such a figure."""
    return ["Variance-reduced: the luck of the failures drawn is replaced by its expectation, known in closed form; "
            "what noise did stays as measured."] if isinstance(summary, Summary) and any(
                map(_is_reduced, summary.scenarios)) else []


def _robots_lost(summary: AnySummary, counts: TrialCounts) -> list[str]:
    """How many robots a mission were lost under each plan; nothing where none was, or nobody counted."""
    told = []
    for scenario in summary.scenarios if isinstance(summary, Summary) else ():  # a ranking has it behind each plan
        lost = {shown_name(scenario, name): _lost(counts, scenario.name, name) for name in scenario.plans}
        if any(amount not in ("0.00", "–") for amount in lost.values()):
            told.append(f"{scenario.name}: {', '.join(f'{name} {amount}' for name, amount in lost.items())}")
    more = [f"{len(told) - _MOST_TOLD} more scenarios"] if len(told) > _MOST_TOLD else []
    return ["Robots lost a mission, on average (they left the base and never came back): "
            f"{'; '.join([*told[:_MOST_TOLD], *more])}."] if told else []


def _rankings(summary: ComparisonSummary, world: World) -> Iterator[tuple[str, str]]:
    for scenario in summary.scenarios:
        if scenario.comparisons:
            known = reliability_told(world, scenario.name, summary)
            yield scenario.name, f" ({sentence(known)}): {text(ranked(scenario))}"


def _comparison(summary: Summary, counts: TrialCounts) -> list[str]:
    head = ["scenario", "stochastic", "deterministic", "VSS", "VSS, variance-reduced", "VSS, modelled", "EVPI",
            "robots lost"]
    rows = [[s.name, *(with_interval(plan.executed) for plan in (s.stochastic, s.deterministic)), vss_verdict(s.vss),
             "" if s.vss.same_plan else with_interval(s.vss.executed_controlled),
             f"{s.vss.modelled:.1f}", optional(s.evpi),
             "\u00a0|\u00a0".join(_lost(counts, s.name, name) for name in ("stochastic", "deterministic"))]
            for s in summary.scenarios]
    return [table(head, rows, caption="Executed values of both plans, and the value of the stochastic solution "
                                      "(VSS): how much more the stochastic plan is worth, in the same trials"),
            note(("" if not doubts_told(summary.scenarios) else f"{DOUBTED_TOLD} ")
                 + "Robots lost: how many a mission left the base and never came back, on average, stochastic | "
                 "deterministic.")]


def _lost(counts: TrialCounts, scenario: str, planner: str) -> str:
    """How many robots a mission left the base and never came back."""
    ended = counts.ended.get((scenario, planner, "none", "never"))
    if ended is None:
        return "–"
    lost = sum(found.share for found in ended if found.left and found.end in ("failed", "out_of_fuel", "stuck"))
    return f"{lost:.2f}" if lost == 0 or lost >= 0.005 else "< 0.01"


def _ranking(summary: ComparisonSummary) -> list[str]:
    rows = [[s.name, name, "yes" if plan.feasible else "no: fuel or limit", lost_robots(plan),
             optional(plan.expected), with_interval(plan.executed)]
            for s in summary.scenarios for name, plan in s.plans.items()]
    parts = [table(["scenario", "plan", "feasible", "robots lost", "expected", "executed"], rows, words=(0, 1, 2),
                   caption="What the plans are worth")]
    pairs = [[s.name, f"{c.a} − {c.b}", with_interval(c), adjusted(c)] for s in summary.scenarios
             for c in s.comparisons]
    if pairs:
        parts.append(table(["scenario", "plans", "difference", "adjusted for the number of pairs"], pairs, words=(0, 1),
                           caption="Differences, trial by trial"))
    return parts


def _charts(summary: AnySummary) -> list[str]:
    scenarios = summary.scenarios
    parts = [heading("What the plans are worth"), "<div class=pair>",
             figure(plans_compared(scenarios), "Executed: mean over all trials, with its 95 % interval.")]
    if isinstance(summary, Summary):
        parts.append(figure(differences(summary.scenarios), "VSS: stochastic less deterministic in the same trials; "
                            "right of zero, planning for failures pays. Full dot and wide bar: plain mean and 95 % "
                            "interval; hollow dot and thin bar: variance-reduced; tick: modelled."))
    return [*parts, "</div>"]


def _by_robot(summary: AnySummary) -> list[str]:
    """Which robot earns what, scenario by scenario."""
    with holding_back_ctrl_c():
        from sva_bench.report import charts  # matplotlib takes its time to load, and only a page needs it

    scenarios, plans = summary.scenarios, list(summary.scenarios[0].plans)
    shown = ["stochastic", "deterministic"] if isinstance(summary, Summary) else plans[:4]
    robots = [figure(charts.value_by_robot(scenarios, plan, shown), f"The value of each robot under the {plan} plan.")
              for plan in shown]
    names = list(scenarios[0].availability)
    return [heading("Value by robot and scenario"), "<div class=pair>", *robots, "</div>", table(
        ["scenario", "plan", *names], [
            [s.name, shown_name(s, name), *(f"{plan.by_robot[r]:.1f}" for r in names)] for s in scenarios
            for name, plan in s.plans.items()], words=(0, 1))]


def _over_trials(scenarios: Scenarios, counts: TrialCounts) -> list[str]:
    return [heading("Over trials"),
            figure(distributions(scenarios, counts), "Each dot is a value that trials had, the larger the more often; "
                   "of plans whose trials had many values, the line is the share of trials that are worth at most so "
                   "much. Tick: mean; triangle: mean of the worst tenth (CVaR)."),
            _statistics(scenarios, "over trials")]


def _from_promise(scenarios: Scenarios) -> list[str]:
    return [heading("From promise to execution"), _statistics(scenarios, "promise"),
            note("Assumption: the plan's value under the failures executed, against what its maker believed. Draws: "
                 "failures as drawn, against their expectation. Then the value lost to each end of the execution.")]


def _measured(scenarios: Scenarios) -> list[str]:
    return [heading("Measured trial by trial"), _statistics(scenarios, "measured")] if statistics("page", "measured") \
        else []


def _statistics(scenarios: Scenarios, section: Section) -> str:
    """A table of statistics, a row for each scenario and plan."""
    entries = statistics("page", section)
    return table(["scenario", "plan", *(entry.heading for entry in entries)],
                 [[s.name, shown_name(s, name), *(cell(entry, plan) for entry in entries)] for s in scenarios
                  for name, plan in s.plans.items()], words=(0, 1))


def _assumptions(summary: Summary) -> list[str]:
    rows = assumption_rows(summary.scenarios)
    if not rows:
        return []
    return [heading("The wrong assumption"), table(ASSUMPTION_HEAD, rows, words=(0, 1, 2, 3)),
            note("Loss: how much more the stochastic plan for the failures that were executed is worth than this one, "
                 "in the same trials.")]


def _ends(scenarios: Scenarios, routes: Mapping[tuple[str, str], Mapping[str, Sequence[str]]]) -> list[str]:
    def ends(scenario: str, planner: str, robot: str, shares: Mapping[End, Share]) -> list[str]:
        # The perfect-information plans have other routes in each outcome.
        if planner != "informed" and stays_home(routes[scenario, planner].get(robot, ())):
            return ["stays home", *[""] * (len(ENDS) - 1)]
        return [_in_per_cent(shares[end]) if end in shares else "" for end in ENDS]

    rows = [[s.name, shown_name(s, name), robot, *ends(s.name, name, robot, shares)]
            for s in scenarios for name, plan in s.plans.items() for robot, shares in plan.end_shares.items()]
    return [heading("How the robots ended"), table(
        ["scenario", "plan", "robot", *(f"{end.replace('_', ' ')} [%]" for end in ENDS)], rows, words=(0, 1, 2)),
        note("Failed: by draw. Out of fuel, late (home past its limit) and stuck: by what physics made of the plan. "
             "Where all trials ended alike, the interval says how often another end could still come up."),
        *(note(said) for said in costless_ends(scenarios))]


def stays_home(route: Sequence[str]) -> bool:
    """Whether a robot of this route never leaves the base."""
    return len(set(route)) <= 1


def _in_per_cent(found: Share) -> str:
    return with_interval(Estimate(mean=100 * found.share, ci95=found.ci95 and (
        100 * found.ci95[0], 100 * found.ci95[1])))


def _world(world: World, *, drawn: bool) -> list[str]:
    picture = PlanView(world, incentives=True, drawn=drawn).picture(f"The world {world.name} from above")
    robots = listed([robot.name for robot in world.robots])
    return [heading("The world"), figure(picture, f"{world.name}: {counted(len(world.stations), 'station')}, "
                                         f"{counted(len(world.pois), 'point of interest', 'points of interest')} with "
                                         f"what each robot earns there ({robots}).")]


def _routes(routes: Mapping[tuple[str, str], Mapping[str, Sequence[str]]], shown: ShownNames) -> list[str]:
    rows = [[scenario, shown.of(scenario, planner), robot, "stays home" if stays_home(route) else " → ".join(route)]
            for (scenario, planner), robots in routes.items() for robot, route in robots.items()]
    return [heading("List of routes"), table(["scenario", "plan", "robot", "route"], rows, words=(0, 1, 2, 3))]


def _recordings(content: Content, shown: ShownNames) -> list[str]:
    lacking = content.lacking

    def linked(stems: Mapping[str, str]) -> list[str]:
        return [f'<a href="recordings/{quote(stem)}.rrd">{text(what)}</a>' for what, stem in stems.items()
                if f"recordings/{stem}.rrd" not in lacking]

    def named(told: RecordingNote) -> str:
        plans = listed([shown.of(told.scenario, planner) for planner in told.planners])
        return f"{told.scenario}, {plans}, trial {told.trial}"

    notes = [told for told in content.manifest.recordings if told.policy == "none" and told.file.endswith(".rrd")]
    pairs = linked({told.scenario: told.file.removesuffix(".rrd") for told in notes if len(told.planners) > 1})
    asked = linked({named(told): told.file.removesuffix(".rrd") for told in notes
                    if len(told.planners) == 1 and told.chosen in ("trial", "median", "worst")})

    links = linked({f"{scenario}, {shown.of(scenario, planner)}": stem
                    for (scenario, planner), stem in content.stems.items()})
    reacting = linked({f"{scenario}, {planner}, {policy} on {news} news": stem
                       for (scenario, planner, policy, news), stem in content.reaction_stems.items()})
    parts = [heading("Recordings")]
    if links:
        parts.append(f"<p>A typical trial of each plan, for the Rerun viewer: {', '.join(links)}. Open them all with "
                     "<code>sva-bench view</code> and this folder.</p>")
    if pairs:
        parts.append("<p>Two plans side by side, under the same failures and noise, where they differ: "
                     f"{', '.join(pairs)}.</p>")
    if asked:
        parts.append(f"<p>Asked for: {', '.join(asked)}.</p>")
    if reacting:
        parts.append(f"<p>The most probable course of events in which orders change: {', '.join(reacting)}.</p>")
    if lacking:
        parts.append(note(f"Missing in this run folder: {', '.join(lacking)}. This page doesn't rest on them."))
    return parts


def _again(summary: AnySummary, manifest: Manifest) -> list[str]:
    packages = ", ".join(f"{name} {version}" for name, version in manifest.packages.items())
    return [heading("How to get the same again"),
            f"<pre><code>{text(shlex.join(manifest.command))}</code></pre>",
            note(f"sva-bench {manifest.version}, seed {summary.seed}, Python {manifest.machine.python}; "
                 f"{packages}. The resolved world and all options stand in manifest.json, the figures in summary.json, "
                 "every trial in outcomes.parquet."),
            *([] if summary.drives is None else [note(f"Driven: {driving_told(summary.drives)}.")])]
