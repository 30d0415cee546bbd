"""Expressions over a summary: what they find, and what is said of those that can't be judged."""

from __future__ import annotations

from typing import Any

import pytest

from sva_bench.analysis.expectations import judge
from sva_bench.errors import BadInput

SUMMARY: dict[str, Any] = {
    "world": "w", "trials": 100, "reproducible": True,
    "scenarios": [
        {"name": "S3", "vss": {"executed": {"mean": 4.0, "ci95": [1.0, 7.0]}, "executed_pct": 8.0, "modelled_pct": None,
                               "distinguishable": True, "verdict": "stochastic is worth more"},
         "plans": {"my.plan": {"expected": 3.0}, "other": {"expected": 0.1 + 0.2}}},
        {"name": "S.3", "vss": {"executed": {"mean": -4.0, "ci95": [-7.0, -1.0]}}}]}


@pytest.mark.parametrize(("expression", "met"), [
    ("S3.vss.executed_pct >= 5", True),
    ("S3.vss.executed_pct>8", False),
    ("S3.vss.executed_pct <= 8.0", True),
    ("S3.vss.executed.ci95[0] > 0", True),
    ("S3.vss.executed.ci95[1] < 7", False),
    ('["S.3"].vss.executed.mean < 0', True),
    ("S.3.vss.executed.mean < 0", True),  # the longest name that is there
    ("scenarios[1].vss.executed.mean < 0", True),
    ("S3.plans.my.plan.expected == 3", True),
    ("S3.plans.other.expected == 0.3", True),  # not the last digit of 0.1 + 0.2
    ("S3.plans.other.expected != 0.3", False),
    ("S3.vss.executed.mean > S.3.vss.executed.mean", True),
    ("S3.vss.distinguishable == true", True),
    ("S3.vss.distinguishable == 1", False),
    ("S3.vss.verdict == stochastic is worth more", True),
    ('S3.vss.verdict != "stochastic is worth more"', False),
    ("S3.vss.modelled_pct == null", True),
    ("S3.vss.modelled_pct >= 0", False),  # there is no such figure
    ("trials == 100", True),
    ("reproducible != false", True),
])
def test_an_expression_is_met_or_not(expression: str, met: bool) -> None:
    assert judge(expression, SUMMARY).met == met


@pytest.mark.parametrize(("expression", "said"), [
    ("S3.vss.executed_pct", "expected PATH OPERATOR VALUE"),
    ("S3.vss.executed_pct >=", "expected PATH OPERATOR VALUE"),
    (">= 5", "expected PATH OPERATOR VALUE"),
    ("1 < trials < 3", "expected PATH OPERATOR VALUE"),
    ("", "expected PATH OPERATOR VALUE"),
    ("S4.vss.executed_pct >= 5", "no 'S4'; did you mean 'S3'?"),
    ("S3.vss.executed_pc >= 5", "no 'executed_pc' in S3.vss; did you mean 'executed_pct'?"),
    ("S3.vss >= 5", "S3.vss is no single value; name one in it: executed"),
    ("S3.vss.executed.ci95 >= 5", "ci95[0]"),
    ("S3.vss.executed.ci95[2] >= 5", "is a list of 2"),
    ("S3.vss.executed.ci95.low >= 5", "is a list of 2"),
    ("S3.vss.executed.mean.more >= 5", "there is nothing in S3.vss.executed.mean to name"),
    ("S3..vss >= 5", "can't read '.vss'"),
    ("S3.vss[x] >= 5", "can't read '[x]'"),
    ("S3.vss.verdict >= 5", "compares numbers"),
    ("S3.vss.executed_pct >= abc", "compares numbers"),
    ("S3.vss.executed_pct >= true", "compares numbers"),
    ("S3.vss.executed_pct >= NaN", "expected a number"),
    ("S3.vss.executed_pct >= 1e999", "expected a number"),
    ("S3.vss.executed_pct >= [1]", "expected a number"),
    ("S3.vss.executed_pct >= " + "[" * 1500, "can't read"),
    ("S3." + "a" * 2000 + " >= 5", "at most 2000"),
])
def test_what_can_not_be_judged_is_refused_with_what_to_change(expression: str, said: str) -> None:
    with pytest.raises(BadInput) as error:
        judge(expression, SUMMARY)
    assert said in str(error.value)


def test_the_interval_is_said_beside_the_value() -> None:
    assert judge("S3.vss.executed.mean > 0", SUMMARY).said().endswith("found 4 [1, 7]")
    assert judge("S3.vss.executed_pct > 0", SUMMARY).said().endswith("found 8 (executed 4 [1, 7])")
    assert judge("trials > 0", SUMMARY).said() == "trials > 0: found 100"
    assert judge("S3.vss.executed.mean > S.3.vss.executed.mean", SUMMARY).said().endswith(
        "found 4 [1, 7], compared with -4")


def test_scenarios_of_a_batch_are_named_with_their_variant() -> None:
    batch = {"aggregate": [{"scenario": "S2", "variant": "", "vss": {"mean": 1.0}},
                           {"scenario": "S2", "variant": "margin=0.1", "vss": {"mean": 2.0}}]}
    assert judge("S2.vss.mean == 1", batch).met
    assert judge('["S2 (margin=0.1)"].vss.mean == 2', batch).met
