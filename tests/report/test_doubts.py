"""What a page says first of a model that the execution contradicts."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sva_bench.analysis.results import InteractionSummary, Ledger, Share
from sva_bench.analysis.summaries import Summary
from sva_bench.report.doubts import contradictions, costless_ends, upset_by_noise
from tests.results_for_tests import summary


def run_of(modelled: float, ci95: tuple[float, float] | None, lost: float = 30.0, *, same: bool = False,
           bad: float | None = None) -> Summary:
    """A run whose deterministic plan lost so much to robots that ran dry."""
    whole = summary(ci95, 100.0)
    (scenario,) = whole.scenarios
    plan = scenario.plans["deterministic"]
    told: Ledger = replace(plan.ledger, out_of_fuel=-lost)
    plans = {**scenario.plans, "deterministic": replace(
        plan, ledger=told, bad=None if bad is None else Share(share=bad, ci95=None))}
    return replace(whole, scenarios=(replace(
        scenario, plans=plans, vss=replace(scenario.vss, modelled=modelled, same_plan=same)),))


@pytest.mark.parametrize(("modelled", "ci95", "said"), [
    (10.0, (-30.0, -12.0), "worth -21.0 [-30.0, -12.0], and not the 10.0 of the model"),
    (10.0, (30.0, 50.0), "worth 40.0 [30.0, 50.0], and not the 10.0 of the model"),
    (2.0, (-20.0, 10.0), "worth -5.0 [-20.0, 10.0], of the other sign than the 2.0 of the model")])
def test_it_is_said_with_both_figures_and_where_to_look(modelled: float, ci95: tuple[float, float], said: str) -> None:
    (sentence,) = contradictions(run_of(modelled, ci95))
    assert said in sentence
    assert sentence.startswith("S: ")
    assert "robots of the deterministic plan ended out of fuel (30.0)" in sentence
    assert "From promise to execution" in sentence


@pytest.mark.parametrize("found", [
    run_of(40.0, (30.0, 50.0)),  # within the interval
    run_of(10.0, (30.0, 50.0), 0.0),  # nothing went wrong: the draws of failures are to blame
    run_of(10.0, None), run_of(10.0, (30.0, 50.0), same=True),
    run_of(30.0 - 1e-9, (30.0, 50.0))])  # rounding
def test_nothing_is_said_where_nothing_is_contradicted(found: Summary) -> None:
    assert contradictions(found) == []


def test_missions_that_noise_upsets_are_said_by_plan() -> None:
    assert upset_by_noise(run_of(10.0, (30.0, 50.0))) == []
    assert upset_by_noise(run_of(10.0, (30.0, 50.0), bad=0.0)) == []
    (said,) = upset_by_noise(run_of(10.0, (30.0, 50.0), bad=0.31))
    assert "S: deterministic 31 %" in said


def test_ends_that_nobody_wants_and_that_cost_nothing_are_explained() -> None:
    found = run_of(10.0, (30.0, 50.0), lost=0.0)
    (scenario,) = found.scenarios
    assert costless_ends(found.scenarios) == []
    dry = replace(scenario, plans={name: replace(plan, ends={"home": 3, "out_of_fuel": 1})
                                   for name, plan in scenario.plans.items()})
    (said,) = costless_ends([dry])
    assert said.startswith("Robots that ended out of fuel cost these plans nothing: S stochastic and S deterministic. ")
    assert "on the way home, and losing a robot itself costs nothing without a loss_cost." in said
    (cost,) = run_of(10.0, (30.0, 50.0), lost=5.0).scenarios
    (said,) = costless_ends([replace(cost, plans={name: replace(plan, ends={"out_of_fuel": 1})
                                                  for name, plan in cost.plans.items()})])
    assert "nothing: S stochastic. " in said


@pytest.mark.parametrize(("contacts", "told"), [(0.5, True), (0.0, False), (None, False)])
def test_what_cost_most_is_said_to_be_a_collision_where_it_was_one(contacts: float | None, told: bool) -> None:
    found = run_of(10.0, (30.0, 50.0), lost=0.0)
    (scenario,) = found.scenarios
    plan = scenario.plans["deterministic"]
    met = None if contacts is None else InteractionSummary(
        contacts=contacts, waited_s=0.0, detours=0.0, exact_share=1.0)
    stuck = replace(plan, ledger=replace(plan.ledger, stuck=-30.0), interaction=met)
    (said,) = contradictions(replace(found, scenarios=(replace(
        scenario, plans={**scenario.plans, "deterministic": stuck}),)))
    assert f"robots of the deterministic plan {'collided and ' * told}ended stuck (30.0); see " in said
    assert ('"Robots in one world"' in said) == told
