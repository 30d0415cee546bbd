"""The report of a run, and that of a batch: the answer first, then what it rests on."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from sva_bench.analysis.reach import infeasible, lost_robots, nothing_reached
from sva_bench.choices import ENDS
from sva_bench.files.printable import counted
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.report.page import figure, heading, note, sentence, table, text, write_page
from sva_bench.report.wording import (
    ASSUMPTION_HEAD,
    adjusted,
    answer,
    assumption_rows,
    finding,
    optional,
    per_cent,
    ranked,
    remarks,
    vss_verdict,
    with_interval,
)
from sva_bench.storage.stored_run import Content
from sva_bench.world.model import World

_WORST_LEGS = 10

Scenarios = Sequence[Mapping[str, Any]]


def write_report(path: Path, content: Content) -> None:
    """Write ``report.html``."""
    summary = content.summary
    scenarios: Scenarios = summary["scenarios"]
    compared = all("vss" in scenario for scenario in scenarios)
    question = "Is the stochastic plan worth it" if compared else "What are the plans worth"
    parts = [
        f"<h1>{text(summary['world'])}: {question}, and how sure is that?</h1>",
        *_answer(summary),
        *(_comparison(scenarios) if compared else _ranking(scenarios)),
        note(f"{counted(summary['trials'], 'trial')} of each plan in each scenario, "
             f"{counted(summary['rollouts'], 'noise draw')}, fidelity {summary['fidelity']}, seed {summary['seed']}; "
             f"planned under {summary['failure']['plan']}, executed under {summary['failure']['execute']} failures. "
             "Incentive in the units of the world file; 95 % intervals in brackets, over trials and noise draws."),
        *_charts(scenarios, compared=compared),
        *_world(content.world),
        *_over_trials(scenarios),
        *_from_promise(scenarios),
        *_assumptions(scenarios),
        *_ends(scenarios),
        *_legs(content.legs),
        *_routes(content.routes),
        *_recordings(content.stems),
        *_again(summary, content.manifest),
    ]
    write_page(path, str(summary["world"]), parts)


def _answer(summary: Mapping[str, Any]) -> list[str]:
    lines = []
    for scenario in [] if nothing_reached(summary) else summary["scenarios"]:
        if "vss" in scenario:
            doubtful = ", ".join(f"{robot} {per_cent(100 * p)}" for robot, p in scenario["availability"].items()
                                 if p < 1)
            known = f"availability: {doubtful}" if doubtful else "all available"
            lines.append(f"<li><b>{text(scenario['name'])}</b> ({sentence(known)}): "
                         f"{sentence(finding(scenario))}</li>")
        elif scenario["comparisons"]:
            lines.append(f"<li><b>{text(scenario['name'])}</b>: {text(ranked(scenario))}</li>")
    unproved = "" if summary["reproducible"] else note(
        "A solve met its limit: these plans may differ on another machine.")
    return [f"<div class=answer><p>{sentence(answer(summary))}</p>", f"<ul>{''.join(lines)}</ul>" if lines else "",
            *(note(said) for said in remarks(summary)), unproved, "</div>"]


def _comparison(scenarios: Scenarios) -> list[str]:
    head = ["scenario", "stochastic, executed", "deterministic, executed", "VSS, executed", "VSS [%]", "VSS, modelled",
            "EVPI"]
    rows = [[s["name"], *(with_interval(s["plans"][name]["executed"]) for name in ("stochastic", "deterministic")),
             vss_verdict(s), per_cent(s["vss"]["executed_pct"]), f"{s['vss']['modelled']:.1f}", optional(s["evpi"])]
            for s in scenarios]
    return [table(head, rows, caption="Value of the stochastic solution (VSS): what the stochastic plan collects "
                                      "beyond the deterministic one, in the same trials")]


def _ranking(scenarios: Scenarios) -> list[str]:
    rows = [[s["name"], name, "no: fuel or limit" if infeasible(plan) else "yes", lost_robots(plan),
             optional(plan["expected"]), with_interval(plan["executed"])]
            for s in scenarios for name, plan in s["plans"].items()]
    parts = [table(["scenario", "plan", "feasible", "robots lost", "expected", "executed"], rows, words=(0, 1, 2),
                   caption="What the plans are worth")]
    pairs = [[s["name"], f"{c['a']} − {c['b']}", with_interval(c), adjusted(c)] for s in scenarios
             for c in s["comparisons"]]
    if pairs:
        parts.append(table(["scenario", "plans", "difference", "adjusted for the number of pairs"], pairs, words=(0, 1),
                           caption="Differences, trial by trial"))
    return parts


def _charts(scenarios: Scenarios, *, compared: bool) -> list[str]:
    with holding_back_ctrl_c():
        from sva_bench.report import charts  # matplotlib takes its time to load, and only a page needs it

    plans = list(scenarios[0]["plans"])
    shown = ["stochastic", "deterministic"] if compared else plans[:4]
    parts = [heading("The plans side by side"), "<div class=pair>",
             figure(charts.plans_compared(scenarios), "Mean over all trials, with its 95 % interval.")]
    if compared:
        rows = [(s["name"], s["vss"]["executed"]) for s in scenarios]
        parts.append(figure(charts.differences(rows, "VSS, executed", "incentive"), "Stochastic less deterministic in "
                            "the same trials: right of zero, planning for failures pays."))
    robots = [figure(charts.incentive_by_robot(scenarios, plan, shown), f"What each robot collects by the {plan} plan.")
              for plan in shown]
    parts += ["</div>", heading("Incentive by robot and scenario"), "<div class=pair>", *robots, "</div>"]
    names = list(scenarios[0]["availability"])
    return [*parts, table(["scenario", "plan", *names], [
        [s["name"], name, *(f"{plan['by_robot'][r]:.1f}" for r in names)] for s in scenarios
        for name, plan in s["plans"].items()], words=(0, 1))]


def _over_trials(scenarios: Scenarios) -> list[str]:
    with holding_back_ctrl_c():
        from sva_bench.report import charts

    keys = ("least", "cvar10", "q05", "q25", "q50", "q75", "q95", "greatest")
    rows = [[s["name"], name, *(f"{plan['distribution'][key]:.1f}" for key in keys)]
            for s in scenarios for name, plan in s["plans"].items()]
    return [heading("Over trials"),
            figure(charts.distributions(scenarios), "Box: the middle half of the trials; whiskers: 5 to 95 %; "
                   "triangle: mean of the worst tenth (CVaR)."),
            table(["scenario", "plan", "least", "worst tenth", "5 %", "25 %", "50 %", "75 %", "95 %", "greatest"], rows,
                  words=(0, 1))]


def _from_promise(scenarios: Scenarios) -> list[str]:
    rows = [[s["name"], name,
             *(f"{x:+.1f}" if 0 < k < 6 else f"{x:.1f}" for k, x in enumerate(plan["ledger"].values())),
             with_interval(plan["executed_controlled"])] for s in scenarios for name, plan in s["plans"].items()]
    return [heading("From promise to execution"), table(
        ["scenario", "plan", "promised", "assumption", "draws", "out of fuel", "late", "stuck", "executed",
         "executed, luck of the draw taken out"], rows, words=(0, 1)),
        note("Assumption: the plan's value under the failures executed, against what its maker believed. Draws: "
             "failures as drawn, against their expectation. Then what each unhappy end cost.")]


def _assumptions(scenarios: Scenarios) -> list[str]:
    rows = assumption_rows(scenarios)
    if not rows:
        return []
    return [heading("The wrong assumption"), table(ASSUMPTION_HEAD, rows, words=(0, 1, 2, 3)),
            note("Loss: what the stochastic plan for the failures that were executed collects beyond this one, in the "
                 "same trials.")]


def _ends(scenarios: Scenarios) -> list[str]:
    rows = []
    for s in scenarios:
        for name, plan in s["plans"].items():
            for robot, shares in plan["end_shares"].items():
                cells = [{"mean": 100 * shares[end]["share"], "ci95": shares[end]["ci95"] and
                          [100 * x for x in shares[end]["ci95"]]} if end in shares else None for end in ENDS]
                rows.append([s["name"], name, robot, *("" if c is None else with_interval(c) for c in cells)])
    return [heading("How the robots ended"), table(
        ["scenario", "plan", "robot", *(f"{end.replace('_', ' ')} [%]" for end in ENDS)], rows, words=(0, 1, 2)),
        note("Failed: by draw. Out of fuel, late (home past its limit) and stuck: by what physics made of the plan. "
             "Where all trials ended alike, the interval says how often another end could still come up.")]


def _legs(legs: Mapping[str, Sequence[Any]]) -> list[str]:
    with holding_back_ctrl_c():
        from sva_bench.report import charts

    planned, driven = (np.asarray(legs[key], dtype=np.float64) for key in ("planned_s", "driven_s"))
    parts = [heading("Time and fuel, planned against driven")]
    if not (planned > 0).any():
        return [*parts, note("No leg was driven.")]
    names = [str(robot) for robot in legs["robot"]]
    rows = []
    for robot in dict.fromkeys(names):
        mine = np.array([name == robot for name in names]) & (planned > 0)
        if mine.any():
            off = 100 * (driven[mine] / planned[mine] - 1)
            rows.append([robot, str(int(mine.sum())), f"{planned[mine].sum():.1f}", f"{driven[mine].sum():.1f}",
                         f"{100 * (driven[mine].sum() / planned[mine].sum() - 1):+.2f}", f"{off.min():+.2f}",
                         f"{off.max():+.2f}"])
    late = np.argsort(-(driven - planned), kind="stable")[:_WORST_LEGS]
    worst = [[*(str(legs[key][k]) for key in ("scenario", "planner", "robot", "rollout", "origin", "destination")),
              f"{planned[k]:.2f}", f"{driven[k]:.2f}", f"{driven[k] - planned[k]:+.2f}"] for k in late.tolist()]
    return [*parts,
            figure(charts.legs_driven(planned, driven, names), "Each point is a leg under one noise draw. Fuel is "
                   "measured in seconds of driving, so a leg's time is its fuel."),
            table(["robot", "legs", "planned [s]", "driven [s]", "off [%]", "least [%]", "most [%]"], rows),
            table(["scenario", "plan", "robot", "noise draw", "from", "to", "planned [s]", "driven [s]", "off [s]"],
                  worst, words=(0, 1, 2, 4, 5), caption="The legs that took longest beyond their plan")]


def _world(world: World) -> list[str]:
    with holding_back_ctrl_c():
        from sva_bench.report.drawing import Overlays, draw_world, for_page

    picture = for_page(draw_world(world, "svg", Overlays()).decode(), "world", f"The world {world.name} from above")
    return [heading("The world"), figure(picture, f"{world.name}: {counted(len(world.stations), 'station')}, "
                                         f"{counted(len(world.pois), 'point of interest', 'points of interest')} with "
                                         "what each robot earns there.")]


def _routes(routes: Mapping[tuple[str, str], Mapping[str, Sequence[str]]]) -> list[str]:
    rows = [[scenario, planner, robot, " → ".join(route) or "stays home"]
            for (scenario, planner), robots in routes.items() for robot, route in robots.items()]
    return [heading("Routes"), table(["scenario", "plan", "robot", "route"], rows, words=(0, 1, 2, 3))]


def _recordings(stems: Mapping[tuple[str, str], str]) -> list[str]:
    links = [f'<a href="recordings/{quote(stem)}.rrd">{text(f"{scenario}, {planner}")}</a>'
             for (scenario, planner), stem in stems.items()]
    return [heading("Recordings"), f"<p>Trial 0 of each plan, for the Rerun viewer: {', '.join(links)}. Open them all "
            "with <code>sva-bench view</code> and this folder.</p>"]


def _again(summary: Mapping[str, Any], manifest: Mapping[str, Any]) -> list[str]:
    packages = ", ".join(f"{name} {version}" for name, version in manifest["packages"].items())
    return [heading("How to get the same again"),
            f"<pre><code>{text(shlex.join(manifest['command']))}</code></pre>",
            note(f"sva-bench {manifest['version']}, seed {summary['seed']}, Python {manifest['machine']['python']}; "
                 f"{packages}. The resolved world and all options stand in manifest.json, the figures in summary.json, "
                 "every trial in outcomes.parquet.")]
