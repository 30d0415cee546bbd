"""Calibrated plans: what is promised of how often they go wrong, on draws that nothing was chosen by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sva_bench.analysis.calibration import Target, draws_for, target_of, target_text
from sva_bench.analysis.proof import most_bad, proves, share_of
from sva_bench.errors import BadInput
from sva_bench.execution.twin_draws import TwinDraws, as_planned, draws_seed
from sva_bench.files.records import as_dict, from_dict
from sva_bench.mission.certify import certify
from sva_bench.report.calibration_page import calibration_lines, curve_rows
from sva_bench.study.calibration import Calibrated, calibrate
from sva_bench.study.costs import plan_costs
from sva_bench.study.options import Options
from sva_bench.study.planning import Planned, plan_scenarios
from sva_bench.study.run import measure
from sva_bench.travel.fuel import FuelCosts
from sva_bench.workers.pool import local_workers
from sva_bench.world.model import World
from sva_bench.world.noise import REALISTIC, Noise, Passage, People
from tests.worlds_for_tests import SMALL, world_of

TIGHT = SMALL.replace("fuel_capacity_s: 60", "fuel_capacity_s: 30").replace("mission_limit_s: 120",
                                                                          "mission_limit_s: 45")
ELSEWHERE = 1000
"""A set of noise draws that no plan is chosen or reported by."""


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> World:
    return replace(world_of(tmp_path_factory.mktemp("world"), TIGHT), noise=Noise())


@pytest.fixture(scope="module")
def costs(calm: World) -> dict[str, FuelCosts]:
    return plan_costs(calm, "prmstar", lambda *_: None)


@pytest.fixture(scope="module")
def planned(calm: World, costs: Mapping[str, FuelCosts]) -> dict[str, Planned]:
    return plan_scenarios(calm, costs, Options(), lambda *_: None)


def calibrated(world: World, costs: Mapping[str, FuelCosts], planned: Mapping[str, Planned], target: Target,
               workers: int = 1) -> dict[str, Calibrated]:
    with local_workers(workers, "sva_bench.execution.execute") as executor:
        return calibrate(world, costs, {name: (plans.stochastic, plans.instance) for name, plans in planned.items()},
                         target, Options().limits, executor, lambda *_: None)


@pytest.fixture(scope="module")
def noisy(calm: World) -> World:
    return replace(calm, noise=REALISTIC)


@pytest.fixture(scope="module")
def at_most(noisy: World, costs: Mapping[str, FuelCosts], planned: Mapping[str, Planned]) -> dict[str, Calibrated]:
    return calibrated(noisy, costs, planned, 0.02)


@pytest.mark.long
def test_a_plan_goes_wrong_no_oftener_than_asked_for_on_draws_of_nobody(
    noisy: World, costs: Mapping[str, FuelCosts], at_most: Mapping[str, Calibrated]
) -> None:
    fresh = TwinDraws(noisy, costs, ELSEWHERE, None)
    assert any(found.result.nominal.bad.share > 0.05 for found in at_most.values())  # else there is nothing to show
    for scenario in noisy.scenarios:
        found = at_most[scenario.name]
        assert found.result.reached
        assert proves(found.result.bad, 0.02)
        bad, _ = fresh.judge(scenario, found.plan, 1000)
        # Three standard errors of 1000 draws about the bound.
        assert bad.mean() <= 0.02 + 3 * np.sqrt(0.02 * 0.98 / 1000)


@pytest.mark.long
def test_the_plan_keeps_the_costs_that_it_was_made_for(at_most: Mapping[str, Calibrated]) -> None:
    for found in at_most.values():
        certificate = certify(found.instance, found.plan)
        assert certificate.feasible, certificate.reasons
        assert certificate.reasons == ()


def test_the_plan_is_one_of_the_curve_that_proves_the_share(at_most: Mapping[str, Calibrated]) -> None:
    for found in at_most.values():
        result = found.result
        assert result.curve[0].quantile is None
        assert proves(result.chosen.bad, 0.02)
        assert result.draws == 1000
        assert all(tried.draws == 1000 for tried in result.curve if proves(tried.bad, 0.02))


def test_a_result_is_read_as_it_was_written(at_most: Mapping[str, Calibrated]) -> None:
    for found in at_most.values():
        assert from_dict(type(found.result), as_dict(found.result)) == found.result


@pytest.mark.long
def test_any_number_of_workers_calibrates_alike(
    noisy: World, costs: Mapping[str, FuelCosts], planned: Mapping[str, Planned], at_most: Mapping[str, Calibrated]
) -> None:
    again = calibrated(noisy, costs, planned, 0.02, workers=2)
    for name, found in at_most.items():
        assert again[name].result == found.result
        assert again[name].plan.routes == found.plan.routes


@pytest.mark.long
def test_best_is_worth_most_of_the_curve(
    noisy: World, costs: Mapping[str, FuelCosts], planned: Mapping[str, Planned]
) -> None:
    for found in calibrated(noisy, costs, planned, "best").values():
        result = found.result
        assert result.reached
        assert result.share is None
        assert result.chosen.executed == max(tried.executed for tried in result.curve)
        assert all(tried.draws == result.draws for tried in result.curve)


@pytest.mark.parametrize("noise", [Noise(), Noise(hull_friction=0.4), Noise(payload_kg=(1.0, 2.0))])
def test_where_nothing_differs_from_the_plan_the_nominal_one_is_calibrated(
    calm: World, costs: Mapping[str, FuelCosts], planned: Mapping[str, Planned], noise: Noise
) -> None:
    for name, found in calibrated(replace(calm, noise=noise), costs, planned, 0.01).items():
        assert found.plan is planned[name].stochastic
        assert (found.result.bad.share, found.result.bad.ci95, found.result.reached) == (
            (0.0, (0.0, 0.0), True) if not replace(calm, noise=noise).noisy else
            (0.0, found.result.bad.ci95, True))


def test_a_door_that_is_always_shut_makes_the_plan_reckon_with_it(
    calm: World, costs: Mapping[str, FuelCosts], planned: Mapping[str, Planned]
) -> None:
    # Across the whole room: every way beyond it waits, in every mission alike.
    door = Passage(name="d1", ends_m=(3.0, 2.6, 3.0, 6.0), blocked=1.0, wait_s=20.0)
    world = replace(calm, passages=(door,))
    assert not as_planned(world)
    assert not world.noisy
    found = calibrated(world, costs, planned, 0.01)["safe"].result
    assert found.nominal.bad.share == 1.0
    assert (found.bad.share, found.reached, found.draws) == (0.0, True, 1)


@pytest.mark.long
def test_where_no_costs_help_that_is_said(
    calm: World, costs: Mapping[str, FuelCosts], planned: Mapping[str, Planned]
) -> None:
    # Half of all metres have somebody in the way for longer than the mission.
    world = replace(calm, noise=Noise(people=People(per_m=0.5, stop_s=200.0)))
    found = calibrated(world, costs, planned, 0.01)
    for each in found.values():
        assert not each.result.reached
        assert not proves(each.result.bad, 0.01)


def test_a_run_has_the_calibrated_plan_beside_the_others_and_says_what_came_of_it(noisy: World) -> None:
    summary = measure(noisy, Options(trials=64, rollouts=8, fidelity="kinematic", calibrate=0.02), None,
                      lambda *_: None).summary
    for scenario in summary.scenarios:
        assert list(scenario.plans) == ["stochastic", "deterministic", "calibrated"]
        assert scenario.calibration is not None
        assert scenario.plans["calibrated"].promised == scenario.calibration.promised
    lines = calibration_lines(summary)
    assert [line.split(":")[0] for line in lines] == [scenario.name for scenario in summary.scenarios]
    assert all("2 %" in line for line in lines)
    assert sum(row[-1] == "chosen" for row in curve_rows(summary.scenarios)) == len(summary.scenarios)
    assert from_dict(type(summary), as_dict(summary)) == summary


@pytest.mark.parametrize(("text", "target"), [("1%", 0.01), (" 0.5 % ", 0.005), ("best", "best"), ("50%", 0.5)])
def test_what_is_asked_for_is_read(text: str, target: Target) -> None:
    assert target_of(text) == pytest.approx(target)
    assert target_of(target_text(target_of(text))) == target_of(text)


@pytest.mark.parametrize("text", ["1", "0.01", "0%", "60%", "nan%", "-1%", "", "least", "%"])
def test_what_is_no_share_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match="such as 1%, or the word best"):
        target_of(text)


@pytest.mark.parametrize("share", [0.0005, 0.01, 0.1, 0.5])
def test_so_many_draws_can_prove_a_share(share: float) -> None:
    draws = draws_for(share)
    assert draws >= 1000
    allowed = most_bad(draws, share)
    assert allowed >= 0
    assert proves(share_of(allowed, draws), share)
    assert not proves(share_of(allowed + 1, draws), share)


def test_no_bad_draw_of_a_thousand_leaves_a_share_of_clopper_and_pearson() -> None:
    # 1 - 0.025^(1/1000) = 0.00368
    assert share_of(0, 1000).ci95 == pytest.approx((0.0, 1 - 0.025 ** (1 / 1000)))


def test_sets_of_draws_differ_from_each_other_and_from_those_of_runs() -> None:
    seeds = [draws_seed(number) for number in range(50)]
    assert len(set(seeds)) == 50
    assert min(seeds) > 10**9  # nobody asks for such a seed by accident


@pytest.mark.long
def test_calibration_stands_in_the_folder(tmp_path: Path, noisy: World) -> None:
    from sva_bench.mission.instance_file import read_instance
    from sva_bench.mission.plan_file import read_plan
    from sva_bench.storage.stored_run import read_content, write_csv
    from sva_bench.study.run import run

    options = Options(trials=16, rollouts=4, fidelity="kinematic", calibrate=0.02)
    done = run(noisy, options, tmp_path, None, lambda *_: None)
    for scenario in noisy.scenarios:
        instance = read_instance(done.folder / f"instance-{scenario.name}+calibrated.json")
        plan = read_plan(done.folder / "plans" / f"{scenario.name}-calibrated.json", instance)
        assert certify(instance, plan).reasons == ()
    assert read_content(done.folder).summary == done.summary
    assert "calibration.csv" in {path.name for path in write_csv(done.folder)}
    page = (done.folder / "report.html").read_text(encoding="utf-8")
    assert "Calibrated plans" in page
    assert "The price of caution" in page
