"""What calibrated plans come to, in words and on the page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from sva_bench.analysis.calibration import Calibration, Tried
from sva_bench.analysis.results import Estimate, Share
from sva_bench.analysis.scenarios import ScenarioSummary
from sva_bench.analysis.summaries import Summary
from sva_bench.files.printable import counted
from sva_bench.palette import PLANS, hex_of
from sva_bench.report.page import details, heading, note, table
from sva_bench.report.panels import Axes, Panel, Point, panels
from sva_bench.report.wording import listed, per_cent, with_interval

CALIBRATION_HEAD = ("scenario", "made for costs at", "promised", "executed by the twin", "missions that go wrong [%]",
                    "noise draws", "")
"""Of the curve: a row for each plan that was tried."""


def calibration_lines(summary: Summary) -> list[str]:
    """What the calibration of each scenario comes to, in a sentence, and in another what was executed otherwise.

    Scenarios of which the same is to be said share a line.
    """
    said: dict[str, list[str]] = {}
    for scenario in summary.scenarios:
        if (found := scenario.calibration) is not None:
            said.setdefault(f"{_told(found)}{_executed_otherwise(summary, scenario, found)}", []).append(scenario.name)
    return [f"{listed(names)}: {words}" for words, names in said.items()]


def calibration_told(summary: Summary) -> str:
    """In which scenarios the share that was asked for is met, and in which it is missed; nothing without one."""
    found = [(s, s.calibration) for s in summary.scenarios if s.calibration is not None]
    if not found:
        return ""
    goal = share_pct(found[0][1])
    if not goal:
        return "Plans were made for the greatest executed value by the twin."
    by_verdict: dict[str, list[str]] = {}
    for scenario, calibration in found:
        by_verdict.setdefault(verdict_of(scenario, calibration), []).append(scenario.name)
    told = "; ".join(f"{verdict} in {listed(names)}" for verdict, names in by_verdict.items())
    return f"At most {goal} of missions were to go wrong though nobody fails: {told}."


MET, MISSED = "met", "missed"
_AS_EXECUTED = "met by the twin, missed as executed"


def verdict_of(scenario: ScenarioSummary, found: Calibration) -> str:
    """Whether a plan keeps the share that was asked for: by the twin, and as it was executed."""
    if found.share is None:
        return "greatest value"
    if not found.reached:
        return MISSED
    bad = scenario.plans["calibrated"].bad
    return MET if bad is None or bad.share <= found.share else _AS_EXECUTED


def _executed_otherwise(summary: Summary, scenario: ScenarioSummary, found: Calibration) -> str:
    """Where more missions went wrong than were asked for though the twin proves the share: how that may be."""
    bad = scenario.plans["calibrated"].bad
    if bad is None or found.share is None or verdict_of(scenario, found) != _AS_EXECUTED:
        return ""
    return (f" Executed, {per_cent(100 * bad.share)} of missions go wrong, more than the {share_pct(found)} asked for: "
            f"{_why_otherwise(summary, found.share)}.")


def _why_otherwise(summary: Summary, share: float) -> str:
    one, reasons = 1 / summary.rollouts, []
    if one > share:
        reasons.append(f"this run has {counted(summary.rollouts, 'noise draw')}, of which a single bad one is "
                       f"{per_cent(100 * one)} of missions")
    if summary.fidelity != "kinematic":
        reasons.append("physics may do what the twin doesn't see")
    return "; and ".join(reasons) or "this run has other noise draws than those that prove the share"


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
    found = [(s, s.calibration) for s in summary.scenarios if s.calibration is not None]
    if not found:
        return []
    tried = details("What was tried, on the noise draws by which the plan was chosen", table(
        CALIBRATION_HEAD[1:], [row[1:] for row in curve_rows(summary.scenarios)], words=(0, 5),
        sections=[s.name for s, calibration in found for _ in calibration.curve])
        + note("By the noisy twin, under noise draws of its own. A plan that can't prove the share any more is left "
               "early, so it has fewer draws."))
    return [heading("Calibrated plans"), _verdicts(found), *map(note, _explained(summary, found)),
            _price(found), tried]


def _verdicts(found: Sequence[tuple[ScenarioSummary, Calibration]]) -> str:
    """The verdict on each scenario, and the shares that it rests on."""
    goal = share_pct(found[0][1])
    rows = [[s.name, *(_both_verdicts(s, c) if goal else ()), _plain(c.bad),
             "" if (bad := s.plans["calibrated"].bad) is None else _plain(bad),
             _plain(c.nominal.bad), c.chosen.name, f"{c.promised:.1f}", f"{c.nominal.promised:.1f}"] for s, c in found]
    head = ["scenario", *(["by the twin", "as executed"] if goal else []), "wrong by the twin [%]",
            "wrong as executed [%]", "nominal plan, by the twin [%]", "made for costs at", "promises",
            "nominal plan promises"]
    asked = f": at most {goal} asked for" if goal else ""
    return table(head, rows, words=(0, *((1, 2, 6) if goal else (4,))),
                 caption=f"Missions that go wrong though nobody fails{asked}. In them some robot runs out of fuel, is "
                         "late or gets stuck; the nominal plan is the stochastic one")


def _both_verdicts(scenario: ScenarioSummary, found: Calibration) -> tuple[str, str]:
    """By the twin, and as executed, where the latter is known."""
    bad = scenario.plans["calibrated"].bad
    executed = "" if bad is None or found.share is None else MET if bad.share <= found.share else MISSED
    return (MET if found.reached else MISSED), executed


def _plain(bad: Share) -> str:
    return with_interval(_in_per_cent(bad))


def _explained(summary: Summary, found: Sequence[tuple[ScenarioSummary, Calibration]]) -> Iterator[str]:
    """What a verdict other than that the share is met is due to."""
    above = [s.name for s, c in found if verdict_of(s, c) == _AS_EXECUTED]
    share = found[0][1].share
    if above and share is not None:
        yield f"Missed as executed in {listed(above)}: {_why_otherwise(summary, share)}."
    if share is not None and (unproved := [s.name for s, c in found if _met_without_proof(s, share)]):
        yield (f"Met as executed, but not proved by {counted(summary.rollouts, 'noise draw')}, in {listed(unproved)}: "
               f"the interval goes beyond {share_pct(found[0][1])}. The twin proves by draws of its own.")
    for scenario, calibration in found:
        if not calibration.reached:
            yield f"{scenario.name}: {_told(calibration)}"
    if nominal := [s.name for s, c in found if c.is_nominal and c.reached]:
        yield f"In {listed(nominal)} the nominal plan is the one that was asked for."


def _met_without_proof(scenario: ScenarioSummary, share: float) -> bool:
    """Whether the share of missions that went wrong as executed is small enough, and the end of its interval isn't."""
    bad = scenario.plans["calibrated"].bad
    return bad is not None and bad.share <= share and bad.ci95 is not None and bad.ci95[1] > share


def _price(found: Sequence[tuple[ScenarioSummary, Calibration]]) -> str:
    """What caution costs: plans by how often they go wrong and what they are worth."""
    colour = hex_of(PLANS["calibrated"])
    shown = []
    for scenario, calibration in found:
        points: dict[tuple[float, float], list[Point]] = {}
        for tried in calibration.curve:
            at = 100 * tried.bad.share
            said = f"{tried.name}: worth {tried.executed:.1f}, promises {tried.promised:.1f}, {per_cent(at)} go wrong"
            chosen = tried == calibration.chosen
            points[at, tried.executed] = [
                Point(x=at, y=tried.promised, said=said, shape="hollow", colour="var(--soft)"),
                Point(x=at, y=tried.executed, said=said, colour=colour, ringed=chosen)]
        if len(points) > 1:
            shown.append(Panel(title=scenario.name, points=[point for pair in points.values() for point in pair],
                               aim=None if calibration.share is None else 100 * calibration.share))
    goal = ", dashed line: the share asked for" if share_pct(found[0][1]) else ""
    return panels("Value of plans for higher and higher costs, by the share of missions that go wrong",
                  Axes(x="missions that go wrong [%]", apart=True), shown,
                  "The price of caution: each full dot is a plan, by how often it goes wrong and what it is worth by "
                  f"the twin; hollow: what it promises; ring: the plan that was taken{goal}.")
