"""Means of what robots did to each other, by hand and by law, in results and their files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sva_bench.analysis.meetings import INTERACTION_COLUMNS, interaction_rows, interaction_summary, interactions
from sva_bench.analysis.results import InteractionSummary, PlanFigures, PlanResult
from sva_bench.execution.meetings import Meetings
from sva_bench.files.records import as_dict, from_dict
from tests.results_for_tests import plan_result, summary

FOUR = Meetings(contacts=np.array([0, 2, 0, 0]), waited_s=np.array([0.0, 3.0, 5.0, 8.0]),
                detours=np.array([0, 1, 0, 0]), exact=np.array([True, True, False, True]))
FOUND = InteractionSummary(contacts=0.5, waited_s=4.0, detours=0.25, exact_share=0.75)


def test_means_over_missions_by_hand() -> None:
    # Contacts 2 / 4, waits 16 / 4, detours 1 / 4, exact 3 / 4.
    assert interaction_summary(FOUR) == FOUND


def test_missions_count_by_their_probability() -> None:
    # 0.1 x 3 + 0.2 x 5 + 0.3 x 8 = 3.7 s; contacts 0.1 x 2; exact all but 0.2.
    found = interaction_summary(FOUR, np.array([0.4, 0.1, 0.2, 0.3]))
    assert found is not None
    assert (found.contacts, found.waited_s, found.detours) == pytest.approx((0.2, 3.7, 0.1))
    assert found.exact_share == pytest.approx(0.8)


def test_robots_that_do_not_meet_have_none() -> None:
    assert interaction_summary(None) is None


@given(st.lists(st.floats(0.01, 1.0), min_size=1, max_size=60))
def test_missions_that_are_all_exact_have_a_share_of_one_and_no_rounding(weights: list[float]) -> None:
    # Weights that add up to 1 but for rounding must not make it 0.9999999.
    missions, weight = len(weights), np.array(weights)
    zeros = np.zeros(missions, dtype=np.int64)
    found = interaction_summary(Meetings(contacts=zeros, waited_s=np.zeros(missions), detours=zeros,
                                         exact=np.ones(missions, dtype=bool)), weight / weight.sum())
    assert found == InteractionSummary(contacts=0.0, waited_s=0.0, detours=0.0, exact_share=1.0)


def test_a_plan_says_it_in_its_file_only_where_robots_meet() -> None:
    plain = plan_result(10.0)
    assert "interaction" not in as_dict(plain)
    told = as_dict(replace(plain, interaction=FOUND))
    assert told["interaction"] == {"contacts": 0.5, "waited_s": 4.0, "detours": 0.25, "exact_share": 0.75}
    assert from_dict(PlanResult, told).interaction == FOUND
    assert list(as_dict(plain)) == [key for key in told if key != "interaction"]


@pytest.mark.parametrize(("key", "value"), [
    ("contacts", -0.1), ("waited_s", float("nan")), ("waited_s", "3"), ("detours", float("inf")), ("exact_share", 1.1),
    ("exact_share", -0.1), ("touches", 0.0)])
def test_what_cannot_be_is_refused_where_it_is_read(key: str, value: object) -> None:
    told = as_dict(plan_result(10.0)) | {"interaction": as_dict(FOUND) | {key: value}}
    with pytest.raises(ValidationError, match=key):
        from_dict(PlanResult, told)


def test_rows_are_of_the_plans_of_robots_that_meet() -> None:
    (scenario,) = summary((10.0, 20.0), 100.0).scenarios
    plans: dict[str, PlanFigures] = {"stochastic": replace(scenario.plans["stochastic"], interaction=FOUND),
                                     "deterministic": scenario.plans["deterministic"]}
    (row,) = interaction_rows("S", "none", "never", plans)
    assert dict(zip(INTERACTION_COLUMNS, row, strict=True)) == {
        "scenario": "S", "policy": "none", "news": "never", "planner": "stochastic", "contacts": 0.5, "waited_s": 4.0,
        "detours": 0.25, "exact_share": 0.75}
    assert interactions([scenario]) == []
