"""Runs in which no orders change: reacting is worth exactly nothing, or a sample just doesn't show what it is worth."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import sva_bench as sb
from sva_bench.analysis.reaction_results import ReactionFigures
from sva_bench.analysis.summaries import ComparisonSummary, Summary
from sva_bench.choices import NEWS, News
from sva_bench.cli.reaction_table import reaction_table
from sva_bench.execution import plays
from sva_bench.report.compared_reactions import reaction_lines
from sva_bench.report.reaction_page import reaction_section, reactions_answered
from sva_bench.report.reaction_wording import reacting, reaction_answers
from sva_bench.report.wording import DOUBTED
from tests.worlds_for_tests import SMALL, world_of

QUICK: dict[str, Any] = {"trials": 12, "rollouts": 3, "fidelity": "kinematic", "workers": 1}
PLANS = {"split": sb.Plan(routes={"uv1": ("base", "p4", "p3", "base"), "uv2": ("base", "p1", "p2", "base")}),
         "alone": sb.Plan(routes={"uv1": ("base", "p4", "p3", "base")})}


def reactions_of(summary: Summary | ComparisonSummary) -> Iterator[ReactionFigures]:
    for scenario in summary.scenarios:
        assert scenario.reactions is not None
        yield from scenario.reactions


def row_of(summary: Summary, news: News) -> list[str]:
    """The cells of the terminal's table in the row of some news."""
    (row,) = (row for row in reaction_table(reacting(summary)).rows if row[1] == news)
    return list(row)


def page_of(summary: Summary | ComparisonSummary) -> str:
    return html.unescape("\n".join([*reactions_answered(summary), *reaction_section(summary)])).replace("\u00a0", " ")


def plans_on(page: str) -> str:
    """The table of plans."""
    return page.split("Each plan with the reaction")[1].split("</table>")[0]


@pytest.mark.parametrize(("enumerated", "scenario", "news", "exactly"), [
    (True, "safe", "report", True),  # nobody fails
    (True, "half", "never", True), (False, "half", "never", True),  # uv2 fails and nobody hears of it
    (False, "safe", "report", False),  # a sample doesn't show that nobody ever fails
])
def test_a_value_of_recourse_is_exactly_zero_where_no_orders_can_change(
    enumerated: bool, scenario: str, news: News, exactly: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not enumerated:
        monkeypatch.setattr(plays, "MOST_HISTORIES", 0)
    # So much noise that a draw which wasn't observed might end a mission: what no reaction changes stays exact.
    world = world_of(tmp_path, SMALL.replace("wheel_gain_sd: 0.01", "wheel_gain_sd: 0.1"))
    summary = sb.run(world, scenario=scenario, policy="resolve", news=news, **QUICK).summary
    (reaction,) = reactions_of(summary)
    assert reaction.histories == ("enumerated" if enumerated else "sampled")
    for name, gain in reaction.value_of_recourse.items():
        assert reaction.plans[name].reacted == 0.0
        assert (gain.mean, gain.pct) == (0.0, 0.0)
        assert gain.ci95 is not None
        assert (gain.ci95 == (0.0, 0.0)) == exactly
        assert gain.ci95[0] <= 0.0 <= gain.ci95[1]
    mark = "" if exactly else DOUBTED
    _, _, _, stochastic, deterministic, *_, changed = row_of(summary, news)
    assert (stochastic, deterministic, changed) == (f"0.0{mark}", f"0.0{mark}", "0")
    rows = plans_on(page_of(summary))
    assert (f"0.0{DOUBTED} [" in rows) != exactly
    assert ("0.0 [0.0, 0.0]" in rows) == exactly
    said = str(reaction_answers(summary)[0])
    assert ("changes no plan's value." if exactly else "changes no plan's value distinguishably.") in said


def test_a_plan_with_nothing_to_take_over_gains_exactly_nothing_beside_one_that_gains(tmp_path: Path) -> None:
    # uv2 fails in half of the missions: of "alone" it had no orders, of "split" uv1 then takes over what it left.
    summary = sb.execute(world_of(tmp_path), PLANS, scenario="half", policy="resolve", news="report", **QUICK).summary
    (reaction,) = reactions_of(summary)
    split, alone = reaction.value_of_recourse["split"], reaction.value_of_recourse["alone"]
    assert split.mean > 0
    assert (alone.mean, alone.ci95) == (0.0, (0.0, 0.0))
    assert "to split and nothing to alone in half." in reaction_lines(summary)[0]


@pytest.fixture(scope="module")
def dead(tmp_path_factory: pytest.TempPathFactory) -> sb.World:
    """A world none of whose robots ever leaves."""
    return world_of(tmp_path_factory.mktemp("dead"), SMALL.replace("half: {uv2: 0.5}", "dead: {uv1: 0, uv2: 0}"))


def test_dead_robots_are_worth_nothing_and_hear_nothing(dead: sb.World) -> None:
    summary = sb.run(dead, scenario="dead", policy="resolve", news=list(NEWS), anticipate=True, **QUICK).summary
    for reaction in reactions_of(summary):
        assert set(reaction.plans) == {"stochastic", "deterministic", "anticipative"}
        for name, plan in reaction.plans.items():
            assert (plan.executed.mean, plan.executed.ci95, plan.modelled, plan.reacted) == (0.0, (0.0, 0.0), 0.0, 0.0)
            assert plan.end_shares == {"uv1": {"failed": 1.0}, "uv2": {"failed": 1.0}}
            gain = reaction.value_of_recourse[name]
            assert (gain.mean, gain.ci95, gain.pct) == (0.0, (0.0, 0.0), None)  # nothing in per cent of nothing
    for news in NEWS:
        assert row_of(summary, news)[-1] == "0"  # orders change in 0 % of missions
    assert all("every plan is worth exactly nothing in dead" in str(said) for said in reaction_answers(summary))
    shown = page_of(summary)
    assert "every plan is worth exactly nothing in dead" in shown
    assert "nan" not in shown.lower()
    assert DOUBTED not in plans_on(shown)


def test_dead_robots_with_orders_are_worth_nothing_too(dead: sb.World) -> None:
    # Each failure is news that nobody is left to take: orders change in no mission.
    summary = sb.execute(dead, PLANS, scenario="dead", policy="resolve", news=list(NEWS), **QUICK).summary
    for reaction in reactions_of(summary):
        for name, plan in reaction.plans.items():
            assert (plan.executed.mean, plan.executed.ci95, plan.reacted) == (0.0, (0.0, 0.0), 0.0)
            assert reaction.value_of_recourse[name].ci95 == (0.0, 0.0)
    lines = reaction_lines(summary)[:-2]
    assert len(lines) == len(NEWS)
    assert all("exactly as much as" in line and "nothing to split and nothing to alone in dead." in line
               for line in lines)
    rows = [re.findall(r"<td[^>]*>([^<]*)</td>", row) for row in plans_on(page_of(summary)).split("<tr")]
    assert [row[-2] for row in rows if row and row[0] in PLANS] == ["0.0"] * len(NEWS) * len(PLANS)
