"""What each source of noise costs, in a sentence and in rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest

from sva_bench.analysis.results import SourceEffect
from sva_bench.analysis.scenarios import ScenarioSummary
from sva_bench.choices import SourceName
from sva_bench.cli.tables import print_summary
from sva_bench.report.page import heading
from sva_bench.report.source_table import costliest, source_rows, source_section, source_title
from tests.results_for_tests import summary

Costs = Mapping[SourceName, float]


def scenario_of(stochastic: Costs, deterministic: Costs) -> ScenarioSummary:
    (scenario,) = summary((10.0, 20.0), 100.0).scenarios
    effects = {"stochastic": stochastic, "deterministic": deterministic}
    return replace(scenario, plans={name: replace(plan, sources={
        source: SourceEffect(incentive=value, seconds=0.0) for source, value in effects[name].items()})
        for name, plan in scenario.plans.items()})


@pytest.mark.parametrize(("stochastic", "deterministic", "said"), [
    ({"capacity": -26.44, "people": -3.0}, {"capacity": -1.0, "people": -2.0},
     "By itself, capacity costs most: 26.4 of the stochastic plan in S."),
    ({"capacity": -26.44, "people": -26.36}, {"capacity": -1.0, "people": -2.0},
     "By themselves, capacity and people cost most, as much as each other: 26.4 of the stochastic plan in S."),
    ({"capacity": -26.4, "people": 0.0}, {"capacity": -26.4, "people": 0.0},
     "By itself, capacity costs most: 26.4 of the stochastic plan in S and the deterministic plan in S."),
    ({"capacity": -26.4, "people": 0.0}, {"capacity": 0.0, "people": -26.4},
     "By themselves, capacity (the stochastic plan in S) and people (the deterministic plan in S) cost most, as much "
     "as each other: 26.4."),
    ({"capacity": 1.0, "people": -0.04}, {"interplay": -9.0}, "No source of noise by itself costs any plan anything."),
])
def test_the_costliest_source_is_named_with_all_that_are_equal_as_printed(
    stochastic: Costs, deterministic: Costs, said: str
) -> None:
    assert costliest([scenario_of(stochastic, deterministic)]) == said


def test_sources_stand_in_one_order_under_all_plans_of_a_scenario() -> None:
    # Over both plans: people 3 + 30, capacity 20 + 2, delay 1 + 1; the interplay is last however large.
    rows = source_rows([scenario_of({"interplay": -99.0, "capacity": -20.0, "people": 3.0, "delay": -1.0},
                                    {"capacity": -2.0, "people": -30.0, "delay": -1.0, "interplay": 0.0})])
    assert [row[2] for row in rows] == 2 * ["people", "capacity", "delay", "interplay"]


@pytest.mark.parametrize(("source", "title"), [
    ("wheels", "What each source of noise did"), ("waits", "What noise and other robots did"),
    ("collisions", "What noise and other robots did")])
def test_terminal_and_page_call_the_table_by_one_name(
        source: SourceName, title: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = summary((10.0, 20.0), 100.0)
    scenarios = (scenario_of({source: -1.0}, {source: -1.0}),)
    assert title == source_title(source_rows(scenarios))
    assert heading(title) in source_section(scenarios)
    print_summary(replace(found, scenarios=scenarios), sources=True)
    assert title in capsys.readouterr().out
