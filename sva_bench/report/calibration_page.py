"""What calibrated plans come to, in words and on the page."""

from __future__ import annotations

from collections.abc import Iterable

from sva_bench.analysis.calibration import Calibration, Tried
from sva_bench.analysis.results import Estimate, Share
from sva_bench.analysis.scenarios import ScenarioSummary
from sva_bench.analysis.summaries import Summary
from sva_bench.files.printable import counted
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.report.page import figure, heading, note, table
from sva_bench.report.wording import per_cent, with_interval

CALIBRATION_HEAD = ("scenario", "made for costs at", "promised", "executed by the twin", "missions that go wrong [%]",
                    "noise draws", "")
"""Of the curve: a row for each plan that was tried."""


def calibration_lines(summary: Summary) -> list[str]:
    """What the calibration of each scenario comes to, in a sentence, and in another what was executed otherwise."""
    return [f"{scenario.name}: {_told(found)}{_executed_otherwise(summary, scenario, found)}"
            for scenario in summary.scenarios if (found := scenario.calibration) is not None]


def against_nominal(scenario: ScenarioSummary) -> str:
    """In one sentence: what the calibrated plan promises and earns against the nominal one; nothing without one."""
    found = scenario.calibration
    if found is None:
        return ""
    if found.is_nominal:
        return "The nominal plan is the calibrated one." if found.reached else \
            f"The share asked for, {share_pct(found)}, is not reached; the plan shown in its place is the nominal one."
    plan, nominal = scenario.plans["calibrated"].executed, scenario.stochastic.executed
    what = "The calibrated plan promises" if found.reached else \
        f"The share asked for, {share_pct(found)}, is not reached; the plan shown in its place promises"
    return (f"{what} {found.promised:.1f} in place of the nominal plan's {found.nominal.promised:.1f}, and earns, "
            f"executed, {with_interval(plan)} in place of {with_interval(nominal)}.")


def _executed_otherwise(summary: Summary, scenario: ScenarioSummary, found: Calibration) -> str:
    """Where more missions went wrong than were asked for though the twin proves the share: how that may be."""
    bad = scenario.plans["calibrated"].bad
    if bad is None or found.share is None or not found.reached or bad.share <= found.share:
        return ""
    one, reasons = 1 / summary.rollouts, []
    if one > found.share:
        reasons.append(f"this run has {counted(summary.rollouts, 'noise draw')}, of which a single bad one is "
                       f"{per_cent(100 * one)} of missions")
    if summary.fidelity != "kinematic":
        reasons.append("physics may do what the twin doesn't see")
    return (f" Executed, {per_cent(100 * bad.share)} of missions go wrong, more than the {share_pct(found)} asked for: "
            f"{'; and '.join(reasons) or 'this run has other noise draws than those that prove the share'}.")


def _told(found: Calibration) -> str:
    wrong = (f"by the twin, under {counted(found.draws, 'draw')} of its own, {bad_pct(found.bad)} of missions go wrong "
             "though nobody fails")
    if found.is_nominal and found.draws == 1 and found.bad.share == 0:
        return "nothing here differs from one mission to the next, and none goes wrong: the nominal plan is the " \
               "calibrated one."
    if not found.reached:
        return (f"not calibrated. No costs that were tried prove that at most {share_pct(found)} of missions go wrong; "
                f"the plan shown in its place, made for {_costs(found)}, does so most seldom{_of_those(found)}: "
                f"{wrong}.")
    price = found.nominal.promised - found.promised
    promised = f"it promises {found.promised:.1f} as the nominal plan does"
    if price:
        share = f", {per_cent(100 * price / found.nominal.promised)} less" if found.nominal.promised > 0 < price else ""
        promised = f"it promises {found.promised:.1f} in place of {found.nominal.promised:.1f}{share}"
    goal = "for the greatest executed value" if found.share is None else f"for at most {share_pct(found)}"
    if found.is_nominal:
        return f"calibrated {goal}: that is the nominal plan; {wrong}."
    return (f"calibrated {goal}: made for {_costs(found)}, {promised}; {wrong}; with the nominal "
            f"plan {bad_pct(found.nominal.bad)} do. By the twin it is worth {found.executed:.1f}, the nominal one "
            f"{found.nominal.executed:.1f}.")


def _costs(found: Calibration) -> str:
    return "nominal costs" if found.is_nominal else f"costs at {found.chosen.name} of noise draws"


def share_pct(found: Calibration) -> str:
    """The share that was asked for."""
    return "" if found.share is None else f"{100 * found.share:g} %"


def bad_pct(bad: Share) -> str:
    """A share of missions in per cent, with its interval."""
    return with_interval(_in_per_cent(bad), unit=" %")


def _in_per_cent(bad: Share) -> Estimate:
    return Estimate(mean=100 * bad.share, ci95=bad.ci95 and (100 * bad.ci95[0], 100 * bad.ci95[1]))


def curve_rows(scenarios: Iterable[ScenarioSummary]) -> list[list[str]]:
    """The rows under ``CALIBRATION_HEAD``."""
    return [[scenario.name, tried.name, f"{tried.promised:.1f}", f"{tried.executed:.1f}",
             with_interval(_in_per_cent(tried.bad)), str(tried.draws),
             _remark(found, tried)]
            for scenario in scenarios if (found := scenario.calibration) is not None for tried in found.curve]


def _of_those(found: Calibration) -> str:
    """Among which plans the one shown goes wrong most seldom."""
    return " of the plans in which somebody leaves the base (one in which nobody does doesn't count)" \
        if any(tried.nobody_leaves for tried in found.curve) and not found.chosen.nobody_leaves else ""


def _remark(found: Calibration, tried: Tried) -> str:
    if tried == found.chosen:
        return "chosen" if found.reached else "shown, not calibrated"
    if not tried.nobody_leaves:
        return ""
    return "nobody leaves" if found.share is None else "nobody leaves: doesn't count"


def calibration_section(summary: Summary) -> list[str]:
    """The section of the page; nothing where no plan was calibrated."""
    scenarios = summary.scenarios
    if not any(scenario.calibration for scenario in scenarios):
        return []
    with holding_back_ctrl_c():
        from sva_bench.report import charts  # matplotlib takes its time to load

    pictures = [figure(charts.calibration_curve(scenario.name, scenario.calibration),
                       f"{scenario.name}: each point is a plan; from right to left costs are raised.")
                for scenario in scenarios if scenario.calibration and len(scenario.calibration.curve) > 1]
    return [heading("Calibrated plans"), *(note(line) for line in calibration_lines(summary)),
            *(["<div class=pair>", *pictures, "</div>"] if pictures else []),
            table(CALIBRATION_HEAD, curve_rows(scenarios), words=(0, 1, 6),
                  caption="What was tried, on the noise draws by which the plan was chosen"),
            note("A mission goes wrong where some robot runs out of fuel, is late or gets stuck though none fails by "
                 "draw. All by the noisy twin, under noise draws of its own; the sentences above are of draws that the "
                 "plan was not chosen by. A plan that can't prove the share any more is left early, so it has fewer "
                 "draws.")]
