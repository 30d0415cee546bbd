"""What page and terminal say of calibrated plans, above all of those that are not."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from sva_bench.analysis.calibration import Calibration, PlanJudged, Tried
from sva_bench.analysis.plan_names import shown_over
from sva_bench.analysis.results import Share
from sva_bench.analysis.summaries import Summary
from sva_bench.cli.tables import print_summary
from sva_bench.palette import PLANS, hex_of
from sva_bench.report.calibration_page import (
    calibration_lines,
    calibration_section,
    calibration_told,
    curve_rows,
)
from sva_bench.report.wording import listed
from sva_bench.study.options import Options
from sva_bench.study.run import run
from sva_bench.world.noise import Noise, People
from tests.pages import read
from tests.results_for_tests import plan_result, summary
from tests.worlds_for_tests import SMALL, world_of

MARKED = "calibrated (share not reached)"
OF_PLAN = hex_of(PLANS["calibrated"])
NAMED_PLAINLY = re.compile(r"(?<!not )(?<!half-)(?<!safe-)\bcalibrated\b(?! \(share not reached)")
"""Not of plans: that one is not calibrated, and the files of recordings."""


def judged(promised: float, bad: float) -> PlanJudged:
    return PlanJudged(promised=promised, executed=promised * (1 - bad),
                      bad=Share(share=bad, ci95=(bad / 2, min(1.0, bad + 0.004))))


def run_of(*curve: tuple[float, float], chosen: int, reached: bool, executed_bad: float = 0.0) -> Summary:
    """A run of one scenario, for at most 1 %: what each plan of the curve promises, and how often it goes wrong."""
    tried = [Tried(**vars(judged(*one)), quantile=0.5 + 0.01 * k if k else None, factor=1.0, draws=1000)
             for k, one in enumerate(curve)]
    found = Calibration(**vars(judged(*curve[chosen])), share=0.01, quantile=tried[chosen].quantile, factor=1.0,
                        nominal=judged(*curve[0]), curve=tuple(tried), reached=reached, draws=1000)
    whole = summary((10.0, 20.0), 100.0, rollouts=32)
    (scenario,) = whole.scenarios
    plan = replace(plan_result(curve[chosen][0]), bad=Share(share=executed_bad, ci95=None))
    return replace(whole, scenarios=(replace(
        scenario, plans={**scenario.plans, "calibrated": plan}, calibration=found),))


@pytest.fixture(scope="module")
def missed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Summary]:
    """A run in which no costs reach the share: half of all metres have somebody in the way for long."""
    place = tmp_path_factory.mktemp("missed")
    world = replace(world_of(place, SMALL), noise=Noise(people=People(per_m=0.5, stop_s=200.0)))
    done = run(world, Options(trials=16, rollouts=4, fidelity="kinematic", calibrate=0.02), place, None,
               lambda *_: None)
    assert isinstance(done.summary, Summary)
    return done.folder, done.summary


def test_a_plan_that_missed_its_share_is_marked_wherever_it_is_named(
    missed: tuple[Path, Summary], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, found = missed
    page = (folder / "report.html").read_text(encoding="utf-8").replace("\u00a0", " ")
    assert page.count(MARKED) > 15  # legends, answer, and a row or more in each table of plans
    assert NAMED_PLAINLY.findall(page) == []
    print_summary(found, sources=True)
    assert MARKED in (said := capsys.readouterr().out)
    # A narrow table breaks the name before its mark, so what counts here are the sentences.
    assert NAMED_PLAINLY.findall(" ".join(line.strip() for line in said.splitlines() if "│" not in line)) == []


def test_a_plan_in_which_nobody_leaves_is_said_not_to_count() -> None:
    found = run_of((100.0, 0.5), (80.0, 0.1), (0.0, 0.0), chosen=1, reached=False)
    (line,) = calibration_lines(found)
    assert "most seldom of the plans in which somebody leaves the base (one in which nobody does doesn't count)" in line
    assert [row[-1] for row in curve_rows(found.scenarios)] == [
        "", "shown, not calibrated", "nobody leaves: doesn't count"]
    (without,) = calibration_lines(run_of((100.0, 0.5), (80.0, 0.1), chosen=1, reached=False))
    assert "somebody leaves" not in without


@pytest.mark.parametrize(("share", "most", "said"), [
    (0.005, 0.04, True), (0.005, 0.008, False), (0.02, 0.04, False)])  # 1 % was asked for
def test_a_share_that_is_met_as_executed_and_not_proved_is_said_to_be(share: float, most: float, said: bool) -> None:
    found = run_of((100.0, 0.5), (80.0, 0.0), chosen=1, reached=True)
    (scenario,) = found.scenarios
    plan = replace(scenario.plans["calibrated"], bad=Share(share=share, ci95=(0.0, most)))
    page = "".join(calibration_section(replace(found, scenarios=(
        replace(scenario, plans={**scenario.plans, "calibrated": plan}),)))).replace("\u00a0", " ")
    assert (f"Met as executed, but not proved by 32 noise draws, in {scenario.name}: the interval goes beyond 1 %." in
            page) == said


def test_scenarios_of_which_the_same_is_to_be_said_share_a_line() -> None:
    one = run_of((100.0, 0.5), (80.0, 0.1), chosen=1, reached=False).scenarios[0]
    other = run_of((100.0, 0.5), (90.0, 0.1), chosen=1, reached=False)
    both = replace(other, scenarios=tuple(replace(s, name=name) for name, s in (
        ("S1", one), ("S2", other.scenarios[0]), ("S3", one))))
    lines = calibration_lines(both)
    assert sorted(line.partition(":")[0] for line in lines) in (["S1 and S3", "S2"], ["S1, S2 and S3"])
    assert calibration_lines(replace(both, scenarios=both.scenarios[:1]))[0].partition(":")[2] == \
        next(line for line in lines if line.startswith("S1")).partition(":")[2]


def test_each_share_is_said_to_be_the_twins_or_executed_and_why_they_differ() -> None:
    above = run_of((100.0, 0.5), (80.0, 0.0), chosen=1, reached=True, executed_bad=1 / 32)
    (line,) = calibration_lines(above)
    assert "by the twin, under 1000 draws of its own, 0.0 % [0.0, 0.4] of missions go wrong" in line
    assert "Executed, 3.1 % of missions go wrong, more than the 1 % asked for: this run has 32 noise draws, of which " \
        "a single bad one is 3.1 % of missions." in line
    assert "physics" not in line  # which these missions have none of
    (line,) = calibration_lines(replace(above, fidelity="rollout", rollouts=1000))
    assert "asked for: physics may do what the twin doesn't see." in line
    (line,) = calibration_lines(replace(above, fidelity="rollout"))
    assert "is 3.1 % of missions; and physics may do" in line
    (line,) = calibration_lines(run_of((100.0, 0.5), (80.0, 0.0), chosen=1, reached=True, executed_bad=0.01))
    assert "Executed" not in line


def test_the_answer_says_in_which_scenarios_the_share_is_met() -> None:
    def said(*curve: tuple[float, float], reached: bool, bad: float = 0.0) -> str:
        return calibration_told(run_of(*curve, chosen=len(curve) - 1, reached=reached, executed_bad=bad))

    asked = "At most 1 % of missions were to go wrong though nobody fails: "
    assert said((100.0, 0.5), (80.0, 0.0), reached=True) == f"{asked}met in S."
    assert said((100.0, 0.5), (80.0, 0.0), reached=True, bad=0.01) == f"{asked}met in S."  # no more than was asked for
    above = said((100.0, 0.5), (80.0, 0.0), reached=True, bad=0.03)
    assert above == f"{asked}met by the twin, missed as executed in S."
    assert said((100.0, 0.5), (80.0, 0.2), reached=False, bad=0.2) == f"{asked}missed in S."
    assert calibration_told(summary((10.0, 20.0), 100.0)) == ""


@pytest.mark.parametrize(("reached", "bad", "verdicts"), [
    (True, 0.0, ["met", "met"]), (True, 0.03, ["met", "missed"]), (False, 0.0, ["missed", "met"]),
    (False, 0.2, ["missed", "missed"])])
def test_the_section_has_a_verdict_by_the_twin_and_as_executed(reached: bool, bad: float, verdicts: list[str]) -> None:
    found = run_of((100.0, 0.5), (80.0, 0.02), chosen=1, reached=reached, executed_bad=bad)
    shown = "".join(calibration_section(found))
    row = re.findall(r"<td[^>]*>(.*?)</td>", shown[shown.index("<tbody>"):])
    assert row[:3] == ["S", *verdicts]
    assert ("Missed as executed in S" in shown) == (verdicts == ["met", "missed"])


def test_the_answer_of_the_page_says_that_the_share_was_not_reached(missed: tuple[Path, Summary]) -> None:
    folder, found = missed
    page = read(folder / "report.html")
    names = listed([scenario.name for scenario in found.scenarios])
    assert f"At most 2 % of missions were to go wrong though nobody fails: missed in {names}." in page


def test_each_plan_of_a_curve_is_a_dot_beside_what_it_promises_and_the_one_taken_has_a_ring() -> None:
    # The first two are worth the same and go wrong as often, so they are one.
    found = run_of((100.0, 0.5), (100.0, 0.5), (80.0, 0.0), chosen=2, reached=True)
    shown = "".join(calibration_section(found))
    assert shown.count(f'style="fill:{OF_PLAN}"') == 2
    assert shown.count("stroke:var(--soft);stroke-width:1.6") == 2
    assert shown.count("<circle class=ring") == 1
    assert shown.count("<path class=aim") == 1  # at the share asked for


def test_a_legend_says_in_which_scenarios_a_share_is_not_reached() -> None:
    (no,), (yes,) = (run_of((100.0, 0.5), (80.0, 0.0), chosen=1, reached=reached).scenarios
                     for reached in (False, True))
    assert shown_over([no, no], "calibrated") == MARKED
    assert shown_over([yes, no], "calibrated") == "calibrated (share not reached in S)"
    assert shown_over([yes, no, no, no], "calibrated") == "calibrated (share not reached in 3 of 4 scenarios)"
    assert shown_over([yes, yes], "calibrated") == "calibrated"
    assert shown_over([no], "stochastic") == "stochastic"
