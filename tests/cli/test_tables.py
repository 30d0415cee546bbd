"""The summary's table on the terminal."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sva_bench.analysis.summaries import Summary
from sva_bench.cli.tables import print_summary
from tests.results_for_tests import summary


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


def test_few_robots_have_a_column_each(capsys: pytest.CaptureFixture[str]) -> None:
    print_summary(with_robots(3))
    said = capsys.readouterr().out
    assert all(f" u{number} " in said for number in range(3))
    assert "left out" not in said
