"""What robots did to each other, in the page's table and in a sentence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from sva_bench.analysis.results import InteractionSummary
from sva_bench.analysis.scenarios import ScenarioSummary
from sva_bench.choices import INTERACTIONS, Interaction
from sva_bench.cli.tables import print_summary
from sva_bench.report.interaction_section import interaction_section, interaction_table, interaction_told
from sva_bench.world.variants import adapted
from tests.results_for_tests import summary
from tests.worlds_for_tests import world_of

WAITED = InteractionSummary(contacts=0.0, waited_s=12.34, detours=0.5, exact_share=0.99999)
TOUCHED = InteractionSummary(contacts=2.0, waited_s=0.0, detours=0.0, exact_share=1.0)


def scenario_of(found: Mapping[str, InteractionSummary | None], name: str = "S") -> ScenarioSummary:
    (scenario,) = summary((10.0, 20.0), 100.0).scenarios
    return replace(scenario, name=name, plans={plan: replace(scenario.plans[plan], interaction=mine)
                                               for plan, mine in found.items()})


BOTH = scenario_of({"stochastic": WAITED, "deterministic": TOUCHED})
APART = scenario_of({"stochastic": None, "deterministic": None})


def test_all_are_said_to_be_exact_only_if_they_are() -> None:
    assert interaction_table([BOTH]) == [["S", "stochastic", "0.00", "12.3", "0.50", "99.9"],
                                         ["S", "deterministic", "2.00", "0.0", "0.00", "100"]]


def test_the_sentence_has_each_plan_over_all_scenarios() -> None:
    # Waits (12.34 + 0) / 2 and detours (0.5 + 0) / 2 of the stochastic plan; collisions 2 and 0 of the other.
    other = scenario_of({"stochastic": TOUCHED, "deterministic": WAITED}, "T")
    assert interaction_told([BOTH]) == (
        "Robots meet, a mission: stochastic 12.3 s of waiting for others, 0.5 detours, 0.0 collisions; "
        "deterministic 0.0 s of waiting for others, 0.0 detours, 2.0 collisions.")
    said = interaction_told([BOTH, other])
    assert said.startswith("Robots meet, a mission, mean over scenarios: stochastic 6.2 s of waiting")
    assert "1.0 collisions" in said


@pytest.mark.parametrize("interaction", INTERACTIONS)
def test_the_page_says_what_robots_are_to_each_other(interaction: Interaction, tmp_path: Path) -> None:
    world = adapted(world_of(tmp_path), interaction=interaction)
    assert interaction_section([APART], world) == []
    page = "".join(interaction_section([BOTH], world))
    assert f"Interaction {interaction}: {INTERACTIONS[interaction]}." in page
    assert "12.3" in page


def test_the_terminal_says_it_where_robots_meet(capsys: pytest.CaptureFixture[str]) -> None:
    found = summary((10.0, 20.0), 100.0)
    for wide in (False, True):
        print_summary(replace(found, scenarios=(BOTH,)), sources=wide)
        said = " ".join(capsys.readouterr().out.split())
        assert "Robots meet, a mission: stochastic 12.3 s of waiting for others" in said
        assert ("What robots did to each other, a mission" in said) == wide
        print_summary(replace(found, scenarios=(APART,)), sources=wide)
        said = capsys.readouterr().out
        assert "meet" not in said
        assert "What robots did" not in said
