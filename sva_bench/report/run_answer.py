"""The answer on top of the page of a run: a headline, a line for each scenario, and a few facts with their names."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from sva_bench.analysis.plan_names import shown_over
from sva_bench.analysis.summaries import AnySummary, Summary
from sva_bench.report.calibration_page import calibration_told
from sva_bench.report.doubts import CONTRADICTED, contradictions, failed_physics
from sva_bench.report.main_tables import share_lost
from sva_bench.report.page import sentence, text
from sva_bench.report.wording import answer, finding, listed, named_remarks, per_cent, reliability_told
from sva_bench.storage.stored_run import Content

Fact = tuple[str, str]
"""What it is about, and a sentence."""


def answer_box(content: Content) -> list[str]:
    """What a run comes to."""
    summary = content.summary
    lines = "".join(
        f"<li><b>{text(s.name)}</b>{sentence(f' ({reliability_told(content.world, s.name, summary)})')}: "
        f"{sentence(finding(s.vss))}</li>" for s in summary.scenarios) \
        if isinstance(summary, Summary) and not summary.reach.nothing else ""
    return [f"<div class=answer><p>{sentence(answer(summary))}</p>", f"<ul>{lines}</ul>" if lines else "",
            *(f"<p class=doubt><b>{sentence(said)}</b></p>" for said in failed_physics(summary)),
            *(f"<p class=doubt><b>{CONTRADICTED}</b> {sentence(said)}</p>" for said in contradictions(summary)),
            facts(_facts(content)), "</div>"]


def facts(told: Iterator[Fact]) -> str:
    """Facts as a list with a name before each; those of one name stand below each other."""
    by_name: dict[str, list[str]] = {}
    for name, said in told:
        by_name.setdefault(name, []).append(said)
    items = "".join(f"<dt>{text(name)}</dt>{''.join(f'<dd>{sentence(line)}</dd>' for line in said)}"
                    for name, said in by_name.items())
    return f"<dl>{items}</dl>" if items else ""


def _facts(content: Content) -> Iterator[Fact]:
    summary = content.summary
    if told := _lost_told(content):
        yield "Robots lost", f"{told} a mission, on average: they left the base and never came back."
    if told := _wrong_told(summary):
        yield "Goes wrong", f"{told} of missions: some robot runs out of fuel, comes home late or gets stuck, which " \
                            "no plan reckons with."
    if isinstance(summary, Summary) and (told := calibration_told(summary)):
        yield "Calibration", told
    if told := unused(content):
        yield "Unused", told
    yield from named_remarks(summary)
    if not summary.reproducible:
        yield "Solver", "A solve met its limit: these plans may differ on another machine."


def _lost_told(content: Content) -> str:
    """How many robots a mission were lost under each plan; nothing where none was, or nobody counted."""
    found = {name: [share_lost(content.counts, s.name, name) or 0.0 for s in content.summary.scenarios]
             for name in content.summary.scenarios[0].plans}
    return _ranges(content.summary, found, lambda share: f"{share:.2f}" if share == 0 or share >= 0.005 else "< 0.01")


def _wrong_told(summary: AnySummary) -> str:
    """In how many missions some robot of each plan ran dry, was late or got stuck; nothing where none did."""
    found = {name: [plan.bad.share for s in summary.scenarios if (plan := s.plans[name]).bad is not None]
             for name in summary.scenarios[0].plans}
    return _ranges(summary, found, lambda share: per_cent(100 * share))


def _ranges(summary: AnySummary, found: Mapping[str, list[float]], show: Callable[[float], str]) -> str:
    """Each plan with the least and the most over scenarios; nothing where all is zero."""
    if not any(any(values) for values in found.values()):
        return ""
    told = []
    for name, values in found.items():
        if values:
            least, most = show(min(values)), show(max(values))
            shown = most if least == most else f"{least.removesuffix(' %') if most.endswith(' %') else least}–{most}"
            told.append(f"{shown_over(summary.scenarios, name)} {shown}")
    return ", ".join(told)


def unused(content: Content) -> str:
    """Which robots no plan sends anywhere; nothing where all drive."""
    summary = content.summary
    sent = {robot for routes in content.routes.values() for robot, route in routes.items() if len(set(route)) > 1}
    sent.update(content.legs.robot)  # those that are sent by new orders alone
    idle = [robot.name for robot in content.world.robots if robot.name not in sent
            and not (robot.name in summary.reach.robots and robot.name in summary.reach.missed)]  # said to reach none
    if not idle or summary.reach.nothing:
        return ""
    stay = "stays home" if len(idle) == 1 else "stay home"
    return f"{listed(idle)} {stay} in every plan of every scenario: the mission comes to the same without " \
           f"{'it' if len(idle) == 1 else 'them'}."
