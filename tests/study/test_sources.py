"""What each source of noise did to a plan: all of it is told, none of it twice."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from sva_bench.analysis.results import PlanResult, SourceEffect
from sva_bench.analysis.summaries import Summary
from sva_bench.choices import NOISE_NAMES, NoiseName
from sva_bench.execution.sources import OF_PHYSICS, sources_on, without
from sva_bench.files.records import as_dict, from_dict
from sva_bench.report.source_table import source_rows
from sva_bench.study.options import Options
from sva_bench.study.run import measure
from sva_bench.world.model import World
from sva_bench.world.noise import REALISTIC, Noise, Passage, People
from tests.worlds_for_tests import SMALL, world_of

# Tight, so that noise costs some: what is late earns nothing.
TIGHT = SMALL.replace("fuel_capacity_s: 60", "fuel_capacity_s: 30").replace("mission_limit_s: 120",
                                                                          "mission_limit_s: 45")
DOOR = Passage(name="d1", ends_m=(3.0, 2.6, 3.0, 6.0), blocked=0.3, wait_s=10.0)
ALONE: Mapping[NoiseName, Noise] = {
    "wheels": Noise(wheel_gain_sd=0.05), "speed": Noise(speed_gain_sd=0.05), "track": Noise(track_gain_sd=0.1),
    "localisation": Noise(localisation=REALISTIC.localisation), "delay": Noise(delay_s=(0.05, 0.12)),
    "capacity": Noise(capacity_sd=0.1), "people": Noise(people=People(per_m=0.1, stop_s=5.0)), "passages": Noise()}
KINEMATIC = Options(trials=96, rollouts=16, fidelity="kinematic")


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> World:
    return replace(world_of(tmp_path_factory.mktemp("world"), TIGHT), noise=Noise())


def summary_of(world: World, options: Options = KINEMATIC) -> Summary:
    return measure(world, options, None, lambda *_: None).summary


def plans_of(summary: Summary) -> list[PlanResult]:
    return [plan for scenario in summary.scenarios for plan in scenario.plans.values()]


def total(plan: PlanResult) -> float:
    return math.fsum(effect.incentive for effect in plan.sources.values())


def test_a_source_that_is_switched_off_leaves_the_others() -> None:
    everything = Noise(**{**vars(REALISTIC), "wheel_gain_sd": 0.01, "payload_kg": (0.0, 1.0),
                          "people": People(per_m=0.1, stop_s=1.0)})
    world = world_of_everything(everything)
    assert sources_on(world) == NOISE_NAMES
    for source in NOISE_NAMES:
        assert sources_on(without(world, source)) == tuple(name for name in NOISE_NAMES if name != source)
        assert sources_on(without(without(world, source), source)) == sources_on(without(world, source))


def world_of_everything(noise: Noise) -> World:
    with tempfile.TemporaryDirectory() as folder:
        calm = world_of(Path(folder), SMALL)
    return replace(calm, noise=noise, passages=(DOOR,), obstacles=replace(
        calm.obstacles, floors=np.array([[1.0, 3.0, 0.3, 0.3, 0.0, 0.05]])))


@pytest.mark.spread(4)
@pytest.mark.parametrize("source", ALONE)
def test_of_one_source_alone_everything_is_its_own(calm: World, source: NoiseName) -> None:
    world = replace(calm, noise=ALONE[source], passages=(DOOR,) if source == "passages" else ())
    for plan in plans_of(summary_of(world)):
        assert set(plan.sources) == {source, "interplay"}
        assert plan.sources[source].incentive == pytest.approx(plan.beside_draws, abs=1e-9)
        assert plan.sources["interplay"].incentive == pytest.approx(0.0, abs=1e-9)
        # Planned times are rounded to a millisecond a leg.
        assert plan.sources["interplay"].seconds == pytest.approx(0.0, abs=0.02)


def test_waits_take_seconds_and_capacity_takes_none(calm: World) -> None:
    world = replace(calm, noise=Noise(capacity_sd=0.1, people=People(per_m=0.1, stop_s=5.0)))
    for plan in plans_of(summary_of(world)):
        assert plan.sources["people"].seconds > 0
        assert plan.sources["capacity"].seconds == 0.0
        assert total(plan) == pytest.approx(plan.beside_draws)


def test_all_sources_together_add_up_in_physics_and_what_the_twin_misses_is_contact(calm: World) -> None:
    summary = summary_of(replace(calm, noise=REALISTIC, passages=(DOOR,)), Options(trials=48, rollouts=8))
    for plan in plans_of(summary):
        assert set(plan.sources) == {*sources_on(replace(calm, noise=REALISTIC, passages=(DOOR,))), "interplay"}
        assert "contact" in plan.sources
        assert total(plan) == pytest.approx(plan.beside_draws, abs=1e-9)
    assert from_dict(Summary, as_dict(summary)) == summary
    rows = [row for row in source_rows(summary.scenarios) if row[2] != "interplay"]
    sizes: dict[tuple[str, str], float] = {}
    orders: dict[tuple[str, str], list[str]] = {}
    for scenario, name, source, value, _ in rows:
        orders.setdefault((scenario, name), []).append(source)
        sizes[scenario, source] = sizes.get((scenario, source), 0.0) + abs(float(value))
    for (scenario, _), order in orders.items():
        assert order == orders[scenario, "stochastic"]
        for a, b in pairwise(order):
            assert sizes[scenario, a] >= sizes[scenario, b] - 0.2  # of two plans, each figure rounded to 0.1


def test_kinematic_missions_have_no_source_that_only_physics_knows(calm: World) -> None:
    for plan in plans_of(summary_of(replace(calm, noise=REALISTIC))):
        assert not set(plan.sources) & set(OF_PHYSICS)


def test_a_world_without_noise_has_no_sources(calm: World) -> None:
    for plan in plans_of(summary_of(calm)):
        assert plan.sources == {}
        assert "sources" not in as_dict(plan)


def test_sources_that_do_not_add_up_are_refused(calm: World) -> None:
    plan = plans_of(summary_of(replace(calm, noise=ALONE["capacity"])))[0]
    wrong = replace(plan, sources={**plan.sources, "delay": SourceEffect(incentive=1.0, seconds=0.0)})
    with pytest.raises(ValidationError, match="expected incentives that add up"):
        from_dict(PlanResult, as_dict(wrong))


def test_any_number_of_noise_draws_is_compared_with_itself(calm: World) -> None:
    # The same trials with a source on and off: a source that changes nothing has exactly nothing.
    world = replace(calm, robots=tuple(replace(robot, fuel_capacity_s=1e6, mission_limit_s=1e6)
                                       for robot in calm.robots), noise=REALISTIC)
    for plan in plans_of(summary_of(world)):
        assert {effect.incentive for effect in plan.sources.values()} == {0.0}
