"""The summary's table on the terminal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sva_bench.analysis.calibration import Calibration, PlanJudged, Tried
from sva_bench.analysis.results import Share
from sva_bench.analysis.summaries import Summary
from sva_bench.choices import FailureProcess
from sva_bench.cli.tables import print_summary, processes_told
from tests.results_for_tests import summary
from tests.worlds_for_tests import SMALL, world_of


def with_robots(count: int) -> Summary:
    found = summary((10.0, 20.0), 900.0)
    robots = [f"u{number}" for number in range(count)]
    (scenario,) = found.scenarios
    plans = {name: replace(plan, by_robot=dict.fromkeys(robots, 56.5), end_shares={robot: {} for robot in robots})
             for name, plan in scenario.plans.items()}
    return replace(found, scenarios=(replace(scenario, plans=plans, availability=dict.fromkeys(robots, 0.5)),))


def test_robots_that_do_not_fit_are_left_out_of_the_table_and_it_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    print_summary(with_robots(16))
    said = capsys.readouterr().out
    assert all(figure in said for figure in ("900.0", "885.0", "15.0 [10.0, 20.0]", "56.5"))
    assert "\u2026" not in said.split("\n\n")[0]
    assert " u0 " in said
    assert " u15 " not in said
    assert "of 16 left out of the table for want of room" in said


@pytest.mark.parametrize(("planned", "executed", "said"), [
    ("mission", "mission", "Robots may fail for a whole mission, as plans expect it."),
    ("mission", "per_leg", "Plans expect that robots may fail for a whole mission; in execution they may fail before "
                           "each POI."),
    ("hazard", "hazard", "Robots may fail at any time while driving, as plans expect it."),
])
def test_when_robots_fail_is_said_in_words(planned: FailureProcess, executed: FailureProcess, said: str) -> None:
    found = summary((10.0, 20.0), 900.0)
    assert processes_told(replace(found, failure=replace(found.failure, plan=planned, execute=executed))) == said


def test_how_missions_ended_is_said_plan_by_plan_without_brackets_in_brackets(
        capsys: pytest.CaptureFixture[str]) -> None:
    found = summary((10.0, 20.0), 900.0)
    (scenario,) = found.scenarios
    bad = Share(share=0.5, ci95=(0.4, 0.6))
    judged = PlanJudged(promised=80.0, executed=70.0, bad=bad)
    missed = Calibration(share=0.01, quantile=0.9, factor=1.0, **vars(judged), nominal=judged, reached=False, draws=100,
                         curve=(Tried(**vars(judged), quantile=0.9, factor=1.0, draws=100),))
    plans = {name: replace(plan, ends={"home": 90, "out_of_fuel": 7, "late": 3})
             for name, plan in scenario.plans.items()}
    print_summary(replace(found, scenarios=(replace(
        scenario, plans={**plans, "calibrated": plans["stochastic"]}, calibration=missed),)))
    said = " ".join(capsys.readouterr().out.split())
    assert ("Of 100 robot missions of each plan ended otherwise than home or by draw: "
            "stochastic 7 out of fuel, 3 late; deterministic 7 out of fuel, 3 late; calibrated (share not reached) 7 "
            "out of fuel, 3 late.") in said


def test_robots_that_are_available_together_are_told_so_on_the_terminal(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    joint = "{joint: [{probability: 0.6, available: [uv1, uv2]}, {probability: 0.4, available: []}]}"
    world = world_of(tmp_path, SMALL.replace("half: {uv2: 0.5}", f"S: {joint}"))
    print_summary(summary((10.0, 20.0), 900.0), world=world)
    assert "S: availability: uv1 and uv2 together 60 %." in capsys.readouterr().out
    alone = world_of(tmp_path, SMALL.replace("half: {uv2: 0.5}", "S: {uv2: 0.5}"))
    print_summary(summary((10.0, 20.0), 900.0), world=alone)
    assert "availability" not in capsys.readouterr().out


def test_few_robots_have_a_column_each(capsys: pytest.CaptureFixture[str]) -> None:
    print_summary(with_robots(3))
    said = capsys.readouterr().out
    assert all(f" u{number} " in said for number in range(3))
    assert "left out" not in said
