"""The report of a run: the answer first, then the results behind it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from sva_bench.analysis.catalogue import Section, Statistic, statistics
from sva_bench.analysis.driving import driving_told
from sva_bench.analysis.plan_names import ShownNames, shown_name
from sva_bench.analysis.results import Estimate, PlanFigures, Share
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.analysis.summaries import AnySummary, Summary
from sva_bench.choices import ENDS, End
from sva_bench.files.printable import counted
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.report.calibration_page import calibration_section
from sva_bench.report.doubts import costless_ends
from sva_bench.report.interaction_section import interaction_section
from sva_bench.report.legs_section import legs_section
from sva_bench.report.main_tables import difference_table, plans_table, titles_of
from sva_bench.report.meetings_section import meetings_section
from sva_bench.report.page import CONTENTS, command, figure, folded, heading, note, table, text, write_page
from sva_bench.report.plan_view import PlanView
from sva_bench.report.reaction_page import reaction_ledgers, reaction_section, reactions_answered
from sva_bench.report.recordings_section import recordings_section
from sva_bench.report.results_charts import differences, distributions, plans_compared
from sva_bench.report.route_maps import route_maps
from sva_bench.report.run_answer import answer_box
from sva_bench.report.source_table import source_section
from sva_bench.report.told_columns import NOTHING, difference, told_columns
from sva_bench.report.wording import assumed, cell, listed, verdict, with_interval
from sva_bench.storage.manifest import Manifest
from sva_bench.storage.stored_run import Content
from sva_bench.storage.trial_counts import TrialCounts
from sva_bench.world.model import World

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
        *answer_box(content),
        *reactions_answered(summary),
        *difference_table(summary),
        note(f"{counted(summary.trials, 'trial')} of each plan in each scenario, "
             f"{counted(summary.rollouts, 'noise draw')}, fidelity {summary.fidelity}, seed {summary.seed}; "
             f"{assumed(summary)}. "
             "Values in the units of the world file's incentives; 95 % intervals in brackets, over trials and noise "
             "draws."),
        CONTENTS,
        *maps,
        heading("What the plans are worth"),
        *plans_table(summary, content.world, content.counts),
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
        *recordings_section(content, names),
        *_again(summary, content.manifest),
    ]
    write_page(path, summary.world, parts)


def _charts(summary: AnySummary) -> list[str]:
    scenarios = summary.scenarios
    parts = ["<div class=pair>",
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
        ["plan", *names], [[shown_name(s, name), *(f"{plan.by_robot[r]:.1f}" for r in names)] for s in scenarios
                           for name, plan in s.plans.items()], sections=titles_of(scenarios))]


def _over_trials(scenarios: Scenarios, counts: TrialCounts) -> list[str]:
    return [heading("Over trials"),
            figure(distributions(scenarios, counts), "Each dot is a value that trials had, the larger the more often; "
                   "of plans whose trials had many values, the line is the share of trials that are worth at most so "
                   "much. Tick: mean; triangle: mean of the worst tenth (CVaR)."),
            _statistics(scenarios, "over trials")]


def _from_promise(scenarios: Scenarios) -> list[str]:
    return [heading("From promise to execution"), _statistics(scenarios, "promise"),
            note("Assumption: the plan's value under the failures executed, against what its maker believed. Draws: "
                 "failures as drawn, against their expectation. Then the value lost to each end of the execution. "
                 f"{NOTHING}: nothing; columns of nothing else are left out.")]


def _measured(scenarios: Scenarios) -> list[str]:
    return [heading("Measured trial by trial"), _statistics(scenarios, "measured")] if statistics("page", "measured") \
        else []


def _statistics(scenarios: Scenarios, section: Section) -> str:
    """A table of statistics, a row for each scenario and plan, of those that tell something."""
    entries = statistics("page", section)
    rows = [[shown_name(s, name), *(_told(entry, plan) for entry in entries)]
            for s in scenarios for name, plan in s.plans.items()]
    head, cells = told_columns(["plan", *(entry.heading for entry in entries)], rows, (0,))
    return table(head, cells, sections=titles_of(scenarios))


def _told(entry: Statistic, plan: PlanFigures) -> str:
    value = entry.of(plan)
    return difference(value) if entry.signed and isinstance(value, float) else cell(entry, plan)


def _assumptions(summary: Summary) -> list[str]:
    rows = [(s.name, row) for s in summary.scenarios for row in s.assumptions or ()]
    if not rows:
        return []
    cells = [[row.planner, row.planned_for or "no failures",
              verdict(row.loss, distinguishable=row.loss.distinguishable, same=row.loss.same_plan),
              with_interval(row.executed), f"{row.expected:.1f}"] for _, row in rows]
    return [heading("The wrong assumption"),
            table(["plan", "made for", "loss", "executed", "expected"], cells, words=(0, 1), sections=[
                f"{name}, executed under {row.executed_under} failures" for name, row in rows]),
            note("Loss: how much more the stochastic plan for the failures that were executed is worth than this one, "
                 "in the same trials.")]


def _ends(scenarios: Scenarios, routes: Mapping[tuple[str, str], Mapping[str, Sequence[str]]]) -> list[str]:
    def ends(scenario: str, planner: str, robot: str, shares: Mapping[End, Share]) -> list[str]:
        # The perfect-information plans have other routes in each outcome.
        if planner != "informed" and stays_home(routes[scenario, planner].get(robot, ())):
            return ["stays home", *[""] * (len(ENDS) - 1)]
        return [_in_per_cent(shares[end]) if end in shares else NOTHING for end in ENDS]

    rows = [[shown_name(s, name), robot, *ends(s.name, name, robot, shares)]
            for s in scenarios for name, plan in s.plans.items() for robot, shares in plan.end_shares.items()]
    head, cells = told_columns(["plan", "robot", *(f"{end.replace('_', ' ')} [%]" for end in ENDS)], rows, (0, 1, 2))
    never = [end.replace("_", " ") for end in ENDS if f"{end.replace('_', ' ')} [%]" not in head]
    return [heading("How the robots ended"),
            table(head, cells, words=(0, 1), sections=[
                s.name for s in scenarios for plan in s.plans.values() for _ in plan.end_shares]),
            note("Failed: by draw. Out of fuel, late (home past its limit), stuck: by what physics made of the plan. "
                 + (f"No robot ended {listed(never, 'or')}. " if never else "")
                 + "Where all trials ended alike, the interval says how often another end could still come up."),
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
    rows = [[shown.of(scenario, planner), robot, "stays home" if stays_home(route) else " → ".join(route)]
            for (scenario, planner), robots in routes.items() for robot, route in robots.items()]
    return [heading("List of routes"), table(["plan", "robot", "route"], rows, words=(0, 1, 2), sections=[
        scenario for (scenario, _), robots in routes.items() for _ in robots])]


def _again(summary: AnySummary, manifest: Manifest) -> list[str]:
    packages = ", ".join(f"{name} {version}" for name, version in manifest.packages.items())
    return [heading("How to get the same again"), command(manifest.command),
            note(f"sva-bench {manifest.version}, seed {summary.seed}, Python {manifest.machine.python}; "
                 f"{packages}. The resolved world and all options stand in manifest.json, the figures in summary.json, "
                 "every trial in outcomes.parquet."),
            *([] if summary.drives is None else [note(f"Driven: {driving_told(summary.drives)}.")])]
