"""What a batch concludes: as much as its intervals allow, for each variant and scenario."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sva_bench.analysis.over_maps import BatchSummary, OverMaps
from sva_bench.analysis.results import Estimate
from sva_bench.report.response_chart import vss_responses
from sva_bench.report.variant_names import VariantNames
from sva_bench.report.vss_over_maps import headline_over_maps, verdicts_of
from sva_bench.report.wording import same_draws
from tests.results_for_tests import over_maps, unit, vss

PAYS, LOSES, EVEN, NONE = (1.0, 3.0), (-3.0, -1.0), (-1.0, 3.0), (0.0, 0.0)


def row(scenario: str, variant: str, ends: tuple[float, float] | None, maps: int = 12) -> OverMaps:
    return replace(over_maps(maps, ends), scenario=scenario, variant=variant)


def headline(*rows: OverMaps) -> str:
    return headline_over_maps(BatchSummary(
        trials=1, fidelity="kinematic", worlds=("a", "b"), seeds=(0,), units=(), maps=(), failed=(), aggregate=rows,
        variants=tuple(dict.fromkeys(each.variant for each in rows))))


@pytest.mark.parametrize(("rows", "said"), [
    ([row("S1", "", PAYS), row("S2", "", EVEN)], "Over 12 maps planning for failures pays in S1 (VSS 2.0 [1.0, 3.0])."),
    ([row("S1", "x", PAYS), row("S1", "y", PAYS), row("S2", "x", PAYS), row("S2", "y", EVEN)],
     "Over 12 maps planning for failures pays for every variant in S1 and for some variants in S2."),
    ([row("S1", "x", LOSES), row("S1", "y", EVEN)],
     "Over 12 maps no scenario shows a value of planning for failures beyond doubt."),
    ([row("S1", "", PAYS, maps=3), row("S2", "", None, maps=2)],
     "Over at most 3 maps planning for failures pays in S1 (VSS 2.0 [1.0, 3.0]). On both maps the VSS is the same in "
     "S2 (VSS 1.0), which has no interval over maps."),
    ([row("S1", "", None, maps=3)],
     "On all 3 maps the VSS is the same in S1 (VSS 1.0), which has no interval over maps."),
    ([row("S1", "x", None, maps=3), row("S1", "y", EVEN, maps=3), row("S2", "x", EVEN, maps=3),
      row("S2", "y", EVEN, maps=3)],
     "On all 3 maps the VSS is the same for some variants in S1, which has no interval over maps; no other scenario "
     "shows a value of planning for failures beyond doubt."),
    ([row("S1", "", PAYS, maps=9)], "Over only 9 maps planning for failures pays in S1 (VSS 2.0 [1.0, 3.0])."),
    ([row("S1", "", PAYS, maps=1)],
     "One map can't tell what planning for failures is worth over maps; below is its worth on this one.")])
def test_a_headline_says_over_how_many_maps_and_for_which_variants(rows: list[OverMaps], said: str) -> None:
    assert headline(*rows) == said


@pytest.mark.parametrize(("ends", "said"), [
    ([PAYS, PAYS], "pays for any variant (VSS 2.0)"), ([NONE, NONE], "no difference for any variant"),
    ([PAYS, EVEN], "pays for x (VSS 2.0 [1.0, 3.0]); can't be told for y"),
    ([EVEN, LOSES], "costs for y (VSS -2.0 [-3.0, -1.0]); can't be told for x"),
    ([None, PAYS], "pays for y (VSS 2.0 [1.0, 3.0]); the same on all 12 maps for x (VSS 1.0)"),
    ([None, None], "the same on all 12 maps for any variant (VSS 1.0)")])
def test_each_scenario_has_a_line_of_its_variants_by_their_intervals(
        ends: list[tuple[float, float] | None], said: str) -> None:
    assert verdicts_of([row("S", variant, each) for variant, each in zip("xy", ends, strict=True)], str) == said


def test_maps_that_all_show_none_have_no_difference_though_they_have_no_interval() -> None:
    here = replace(row("S", "x", None), vss=Estimate(mean=0.0, ci95=None))
    assert verdicts_of([here, row("S", "y", EVEN)], str) == "can't be told for y; no difference on these maps for x"
    assert verdicts_of([here, replace(here, variant="y")], str) == "no difference on these maps for any variant"
    assert verdicts_of([replace(here, maps=1)], str) == "no interval for any variant"


def test_batches_of_one_trial_or_noise_draw_say_what_their_intervals_leave_out() -> None:
    units = unit("a", 1.0), unit("b", 2.0)  # without intervals of their own
    summary = BatchSummary(trials=1, fidelity="kinematic", worlds=("a", "b"), seeds=(0,), units=units, maps=(),
                           failed=(), aggregate=(row("S1", "", PAYS),), variants=("",))
    assert "what chance did to all maps alike" in same_draws(summary)
    assert same_draws(replace(summary, aggregate=(row("S1", "", PAYS, maps=1),))) == ""
    known = [replace(each, scenarios=tuple(replace(s, vss=vss(s.vss.executed.mean, (0.0, 3.0)))
                                           for s in each.scenarios)) for each in units]
    assert same_draws(replace(summary, units=tuple(known))) == ""



def responses(*settings: dict[str, str]) -> list[str]:
    variants = {"; ".join(f"{key}={value}" for key, value in each.items()): each for each in settings}
    rows = [row(scenario, variant, ends) for variant in variants for scenario, ends in (("S1", NONE), ("S2", PAYS))]
    rows = [replace(each, vss=Estimate(mean=0.0, ci95=NONE)) if each.scenario == "S1" else each for each in rows]
    summary = BatchSummary(trials=1, fidelity="kinematic", worlds=("a", "b"), seeds=(0,), units=(), maps=(), failed=(),
                           aggregate=tuple(rows), variants=tuple(variants), settings=variants)
    return vss_responses(summary, VariantNames(summary))


def test_each_key_that_varies_in_numbers_has_its_response_curves() -> None:
    fuel, both = ({"a.fuel": value} for value in ("200", "300")), [
        {"a.fuel": fuel, "margin": margin} for fuel in ("200", "300", "400") for margin in ("0.1", "0.2")]
    (one,) = responses(*fuel)
    assert one.count("<svg") == 1  # S1 has no difference anywhere
    assert "S2" in one
    assert "200: 2.0 [1.0, 3.0]" in one
    over_fuel, over_margin = responses(*both)
    assert (over_fuel.count("<svg"), over_margin.count("<svg")) == (2, 3)
    assert "S2 (margin 0.1)" in over_fuel
    assert "S2 (fuel 400)" in over_margin


@pytest.mark.parametrize("settings", [
    [{"a.model": '"turtlebot2"'}, {"a.model": '"jackal"'}], [{"a.fuel": "200"}, {"b.fuel": "300"}],
    [{"a.fuel": "200"}]])
def test_words_and_single_values_have_no_curve(settings: list[dict[str, str]]) -> None:
    assert responses(*settings) == []
