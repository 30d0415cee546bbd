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
from sva_bench.report.overlays import Overlays
from sva_bench.report.page import figure, heading, note, sentence, table, text, write_page
from sva_bench.report.reaction_page import reaction_ledgers, reaction_section, reactions_answered
from sva_bench.report.source_table import source_section
from sva_bench.report.stands import stands_of
from sva_bench.report.wording import (
    ASSUMPTION_HEAD,
    adjusted,
    answer,
    assumed,
    assumption_rows,
    cell,
    finding,
    optional,
    per_cent,
    ranked,
    reliability_told,
    remarks,
    vss_verdict,
    with_interval,
)
from sva_bench.storage.manifest import Manifest
from sva_bench.storage.stored_run import Content
from sva_bench.world.model import World

Scenarios = Sequence[ScenarioSummary | ComparedScenario]


def write_report(path: Path, content: Content) -> None:
    """Write ``report.html``."""
    summary = content.summary
    scenarios = summary.scenarios
    names = ShownNames(scenarios)
    question = "Is the stochastic plan worth it" if isinstance(summary, Summary) else "What are the plans worth"
    parts = [
        f"<h1>{text(summary.world)}: {question}, and how sure is that?</h1>",
        *_answer(summary, content.world),
        *reactions_answered(summary),
        *(_comparison(summary) if isinstance(summary, Summary) else _ranking(summary)),
        note(f"{counted(summary.trials, 'trial')} of each plan in each scenario, "
             f"{counted(summary.rollouts, 'noise draw')}, fidelity {summary.fidelity}, seed {summary.seed}; "
             f"{assumed(summary)}. "
             "Values in the units of the world file's incentives; 95 % intervals in brackets, over trials and noise "
             "draws."),
        *_charts(summary),
        *(calibration_section(summary) if isinstance(summary, Summary) else ()),
        *reaction_section(summary),
        *_world(content.world),
        *_over_trials(scenarios),
        *_from_promise(scenarios),
        *source_section(scenarios),
        *reaction_ledgers(summary),
        *(_assumptions(summary) if isinstance(summary, Summary) else ()),
        *_ends(scenarios, content.routes),
        *_measured(scenarios),
        *interaction_section(scenarios, content.world),
        *meetings_section(content),
        *legs_section(content, names),
        *_routes(content.routes, names),
        *_recordings(content, names),
        *_again(summary, content.manifest),
    ]
    write_page(path, summary.world, parts)


def _answer(summary: AnySummary, world: World) -> list[str]:
    lines = []
    if not summary.reach.nothing:
        lines = [f"<li><b>{text(name)}</b>{line}</li>" for name, line in (
            _findings(summary, world) if isinstance(summary, Summary) else _rankings(summary, world))]
    unproved = "" if summary.reproducible else note(
        "A solve met its limit: these plans may differ on another machine.")
    return [f"<div class=answer><p>{sentence(answer(summary))}</p>", f"<ul>{''.join(lines)}</ul>" if lines else "",
            *(f"<p><b>{sentence(said)}</b></p>" for said in failed_physics(summary)),
            *(f"<p><b>{CONTRADICTED}</b> {sentence(said)}</p>" for said in contradictions(summary)),
            *(note(remark) for remark in (*upset_by_noise(summary), *remarks(summary))), unproved, "</div>"]


def _findings(summary: Summary, world: World) -> Iterator[tuple[str, str]]:
    for scenario in summary.scenarios:
        known, told = reliability_told(world, scenario.name, summary), against_nominal(scenario)
        yield scenario.name, f" ({sentence(known)}): {sentence(finding(scenario.vss))}{sentence(told and f'. {told}')}"


def _rankings(summary: ComparisonSummary, world: World) -> Iterator[tuple[str, str]]:
    for scenario in summary.scenarios:
        if scenario.comparisons:
            known = reliability_told(world, scenario.name, summary)
            yield scenario.name, f" ({sentence(known)}): {text(ranked(scenario))}"


def _comparison(summary: Summary) -> list[str]:
    head = ["scenario", "stochastic, executed", "deterministic, executed", "VSS, executed", "VSS [%]", "VSS, modelled",
            "EVPI"]
    rows = [[s.name, *(with_interval(plan.executed) for plan in (s.stochastic, s.deterministic)), vss_verdict(s.vss),
             per_cent(s.vss.executed_pct), f"{s.vss.modelled:.1f}", optional(s.evpi)] for s in summary.scenarios]
    return [table(head, rows, caption="Value of the stochastic solution (VSS): how much more the stochastic plan "
                                      "is worth than the deterministic one, in the same trials")]


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
    with holding_back_ctrl_c():
        from sva_bench.report import charts  # matplotlib takes its time to load, and only a page needs it

    scenarios, plans = summary.scenarios, list(summary.scenarios[0].plans)
    parts = [heading("The plans side by side"), "<div class=pair>",
             figure(charts.plans_compared(scenarios), "Mean over all trials, with its 95 % interval.")]
    if isinstance(summary, Summary):
        rows = [(s.name, s.vss.executed) for s in summary.scenarios]
        parts.append(figure(charts.differences(rows, "VSS, executed", "value"), "Stochastic less deterministic in "
                            "the same trials: right of zero, planning for failures pays."))
    shown = ["stochastic", "deterministic"] if isinstance(summary, Summary) else plans[:4]
    robots = [figure(charts.value_by_robot(scenarios, plan, shown), f"The value of each robot under the {plan} plan.")
              for plan in shown]
    parts += ["</div>", heading("Value by robot and scenario"), "<div class=pair>", *robots, "</div>"]
    names = list(scenarios[0].availability)
    return [*parts, table(["scenario", "plan", *names], [
        [s.name, shown_name(s, name), *(f"{plan.by_robot[r]:.1f}" for r in names)] for s in scenarios
        for name, plan in s.plans.items()], words=(0, 1))]


def _over_trials(scenarios: Scenarios) -> list[str]:
    with holding_back_ctrl_c():
        from sva_bench.report import charts

    return [heading("Over trials"),
            figure(charts.distributions(scenarios), "Box: the middle half of the trials; whiskers: 5 to 95 %; "
                   "triangle: mean of the worst tenth (CVaR)."),
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


def _world(world: World) -> list[str]:
    with holding_back_ctrl_c():
        from sva_bench.report.canvas import for_page
        from sva_bench.report.drawing import draw_world

    drawn = draw_world(world, "svg", Overlays(stands=stands_of(world))).decode()
    picture = for_page(drawn, "world", f"The world {world.name} from above")
    return [heading("The world"), figure(picture, f"{world.name}: {counted(len(world.stations), 'station')}, "
                                         f"{counted(len(world.pois), 'point of interest', 'points of interest')} with "
                                         "what each robot earns there.")]


def _routes(routes: Mapping[tuple[str, str], Mapping[str, Sequence[str]]], shown: ShownNames) -> list[str]:
    rows = [[scenario, shown.of(scenario, planner), robot, "stays home" if stays_home(route) else " → ".join(route)]
            for (scenario, planner), robots in routes.items() for robot, route in robots.items()]
    return [heading("Routes"), table(["scenario", "plan", "robot", "route"], rows, words=(0, 1, 2, 3))]


def _recordings(content: Content, shown: ShownNames) -> list[str]:
    lacking = content.lacking

    def linked(stems: Mapping[str, str]) -> list[str]:
        return [f'<a href="recordings/{quote(stem)}.rrd">{text(what)}</a>' for what, stem in stems.items()
                if f"recordings/{stem}.rrd" not in lacking]

    links = linked({f"{scenario}, {shown.of(scenario, planner)}": stem
                    for (scenario, planner), stem in content.stems.items()})
    reacting = linked({f"{scenario}, {planner}, {policy} on {news} news": stem
                       for (scenario, planner, policy, news), stem in content.reaction_stems.items()})
    parts = [heading("Recordings")]
    if links:
        parts.append(f"<p>A typical trial of each plan, for the Rerun viewer: {', '.join(links)}. Open them all with "
                     "<code>sva-bench view</code> and this folder.</p>")
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
