"""What robots of one world do to plans: all of it is told, nothing where nobody meets, and margins know of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sva_bench.analysis.results import SourceEffect
from sva_bench.analysis.summaries import Summary
from sva_bench.choices import Interaction, SourceName
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Drives
from sva_bench.execution.execute import execute
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.shared.execute import Wanted, ground_of, play_all
from sva_bench.execution.shared.players import TeamDriven
from sva_bench.execution.shared.unfailed import unfailed_keys
from sva_bench.execution.sources import sources_on
from sva_bench.execution.twin_draws import TwinDraws, as_planned
from sva_bench.files.records import as_dict, from_dict
from sva_bench.mission.plan import Plan
from sva_bench.report.source_table import source_section
from sva_bench.study.costs import plan_costs
from sva_bench.study.effects import Grounds
from sva_bench.study.met_sources import met_effects
from sva_bench.study.noise_check import check_noise
from sva_bench.study.options import Options
from sva_bench.study.run import measure
from sva_bench.travel.fuel import FuelCosts
from sva_bench.workers.pool import local_workers
from sva_bench.world.load import load_world
from sva_bench.world.model import World
from sva_bench.world.noise import REALISTIC, Noise
from tests.execution.shared.random_missions import random_mission
from tests.worlds_for_tests import SMALL, world_of

WORLDS = Path(__file__).parents[2] / "worlds"
STATION_S = 20.0
# Both fill up at the one station first, where each stands for 20 s: one of them waits for the other.
QUEUE = SMALL.replace("r1: {at_m: [3.2, 5.2], stop_s: 4}", f"r1: {{at_m: [3.2, 5.2], stop_s: {STATION_S:g}}}").replace(
    "noise: {wheel_gain_sd: 0.01}", "interaction: shared")
ROUTES = {"uv1": ("base", "r1", "p3", "base"), "uv2": ("base", "r1", "p2", "base")}


def quiet(*_: object) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Queue:
    """A plan by which robots queue, and its scenario in which nobody fails."""

    world: World
    costs: Mapping[str, FuelCosts]
    case: Case

    def with_limit(self, limit_s: float, interaction: Interaction = "shared") -> World:
        """The world with another mission limit."""
        return replace(self.world, interaction=interaction, robots=tuple(
            replace(robot, mission_limit_s=limit_s) for robot in self.world.robots))

    def effects(self, world: World, trials: int = 3) -> Mapping[SourceName, SourceEffect]:
        """What the twin knows of the plan's sources."""
        settings, drives = Settings(seed=0, trials=trials, rollouts=trials if world.noisy else 1,
                                    fidelity="kinematic", recorded=False), Drives()
        execute(world, self.costs, [self.case], settings, None, None, drives)
        return met_effects(Grounds(world=world, costs=self.costs, settings=settings, executor=None, drives=drives),
                           [self.case])["safe", "queue"].by_source


@pytest.fixture(scope="module")
def queue(tmp_path_factory: pytest.TempPathFactory) -> Queue:
    world = world_of(tmp_path_factory.mktemp("queue"), QUEUE)
    # Who fails nowhere and has time enough collects 30 at p3, or at p2.
    return Queue(world=world, costs=plan_costs(world, "prmstar", quiet), case=Case(
        scenario=world.scenario("safe"), planner="queue", plan=Plan(routes=ROUTES), role="given"))


def ends_s(queue: Queue, world: World) -> list[float]:
    settings = Settings(seed=0, trials=1, rollouts=1, fidelity="kinematic", recorded=False)
    (run,) = execute(world, queue.costs, [queue.case], settings)
    found: list[float] = run.end_time_s[0].tolist()
    return found


def test_a_queue_costs_the_seconds_that_the_other_stands_there_and_nothing_where_there_is_time(queue: Queue) -> None:
    effects = queue.effects(queue.with_limit(1000.0))
    assert set(effects) == {"waits", "detours"}
    # The second to come waits for most of the first one's stop; its way there is longer by some seconds at most.
    assert STATION_S - 6 < effects["waits"].seconds + effects["detours"].seconds < STATION_S + 6
    assert (effects["waits"].incentive, effects["detours"].incentive) == (0.0, 0.0)


def test_who_waits_beyond_the_limit_pays_with_what_it_would_have_collected(queue: Queue) -> None:
    late_s = max(ends_s(queue, queue.with_limit(1000.0)))
    # With little less than the one that waits needs it is late at home only, with more less at its POI too.
    found = {limit_s: queue.effects(queue.with_limit(limit_s))["waits"].incentive
             for limit_s in np.arange(late_s - 14, late_s + 2).tolist()}
    assert set(found.values()) <= {0.0, -30.0}
    assert found[late_s - 14] == -30.0
    assert found[late_s + 1] == 0.0


def test_robots_that_nobody_coordinates_lose_all_that_lies_behind_their_collision(queue: Queue) -> None:
    effects = queue.effects(queue.with_limit(1000.0, "uncoordinated"))
    assert set(effects) == {"collisions"}
    # They touch at the station, before anybody collects anything; alone they would get 30 and 30.
    assert effects["collisions"].incentive == -60.0
    assert effects["collisions"].seconds < 0  # they drive no further


def test_margins_calibration_and_checks_know_of_waits(queue: Queue) -> None:
    tight = queue.with_limit(max(ends_s(queue, queue.with_limit(1000.0))) - 5)
    bad, _ = TwinDraws(tight, queue.costs, 7, None).judge(queue.case.scenario, queue.case.plan, 4)
    assert bad.tolist() == [True] * 4
    roomy = queue.with_limit(1000.0)
    bad, value = TwinDraws(roomy, queue.costs, 7, None).judge(queue.case.scenario, queue.case.plan, 4)
    assert bad.tolist() == [False] * 4
    assert value.tolist() == [60.0] * 4
    told = check_noise(replace(tight, noise=Noise(wheel_gain_sd=0.001)), queue.costs, {"queue": queue.case.plan},
                       draws=5, seed=0, progress=quiet).found.plans[0]
    assert told.bad == 1.0
    assert sum(leg.late == 1.0 for leg in told.legs if leg.destination == "base") == 1  # the one that waits
    settings = Settings(seed=0, trials=1, rollouts=1, fidelity="kinematic", recorded=False)
    (run,) = execute(tight, queue.costs, [queue.case], settings)
    for margins in run.margins:
        left_s = tight.robots[margins.robot].mission_limit_s - run.end_time_s[0, margins.robot]
        assert margins.time_s[0, -1] == pytest.approx(left_s, abs=1e-6)


@pytest.fixture(scope="module")
def noisy(tmp_path_factory: pytest.TempPathFactory) -> Summary:
    tight = SMALL.replace("fuel_capacity_s: 60", "fuel_capacity_s: 30").replace(
        "mission_limit_s: 120", "mission_limit_s: 45") + "interaction: shared\n"
    world = replace(world_of(tmp_path_factory.mktemp("noisy"), tight), noise=REALISTIC)
    return measure(world, Options(trials=32, rollouts=8), None, quiet).summary


def test_all_sources_together_add_up_where_robots_meet(noisy: Summary) -> None:
    plans = [plan for scenario in noisy.scenarios for plan in scenario.plans.values()]
    assert any(plan.beside_draws < 0 for plan in plans)
    for plan in plans:
        assert {"waits", "detours", "contact", "interplay", "localisation"} <= set(plan.sources)
        assert math.fsum(effect.incentive for effect in plan.sources.values()) == pytest.approx(
            plan.beside_draws, abs=1e-9)
    assert from_dict(Summary, as_dict(noisy)) == noisy
    text = "".join(source_section(noisy.scenarios))
    assert "What noise and other robots did" in text
    assert "what legs that led another way than the shortest took longer" in text


# Whether robots meet or not


def played(seed: int) -> tuple[Mapping[SourceName, SourceEffect], list[TeamDriven], list[TeamDriven]] | None:
    """Of a random mission: its sources, its missions under each draw, and those of each robot alone."""
    ready = random_mission(seed, process="mission")
    if ready is None:
        return None
    world, case = ready.world, ready.case
    settings, drives = Settings(seed=seed, trials=4, rollouts=2 if world.noisy else 1, fidelity="kinematic",
                                recorded=False), Drives()
    execute(world, ready.costs, [case], settings, None, None, drives)
    effects = met_effects(Grounds(world=world, costs=ready.costs, settings=settings, executor=None, drives=drives),
                          [case])[case.scenario.name, case.planner].by_source
    orders = orders_of(world, case, planned_legs(world, ready.costs, [case]))
    keys = unfailed_keys(world, [case], orders, settings.rollouts)
    found = []
    for alone in (False, True):
        missions: dict[object, TeamDriven] = {}
        play_all(world, ground_of(world, ready.costs), settings, [Wanted(orders, key) for key in keys], None, None,
                 missions, alone=alone)  # type: ignore[arg-type]
        found.append([missions[key] for key in keys])
    return effects, *found  # type: ignore[return-value]


@pytest.mark.long
def test_robots_that_do_not_meet_drive_and_end_as_each_would_alone_from_its_berth() -> None:
    apart = 0
    for known in filter(None, map(played, range(16))):
        effects, together, alone = known
        for ours, each in zip(together, alone, strict=True):
            if ours.waited_s == 0 and ours.detours == 0:
                apart += 1
                assert [(o.end, o.incentive, o.end_time_s) for o in ours.robots] == [
                    (o.end, o.incentive, o.end_time_s) for o in each.robots]
                for one, other in zip(ours.driven, each.driven, strict=True):
                    assert_array_equal(one.leg_s, other.leg_s)
        if not any(ours.detours for ours in together):
            assert effects["detours"].seconds == 0.0
        if not any(ours.waited_s or ours.detours for ours in together):
            assert effects["waits"].seconds == 0.0
        assert all(math.isfinite(effect.incentive) for effect in effects.values())
    assert apart > 0  # else there is nothing to show


def test_robots_that_go_their_own_ways_cost_each_other_nothing(queue: Queue) -> None:
    apart = replace(queue, case=replace(queue.case, plan=Plan(routes={
        "uv1": ("base", "p4", "base"), "uv2": ("base", "p2", "base")})))
    # Where localisation errs they keep further apart, and meet about their berths.
    for noise in (Noise(), replace(REALISTIC, localisation=None)):
        world = replace(queue.with_limit(1000.0), noise=noise)
        effects = apart.effects(world, trials=4)
        assert set(effects) >= {"waits", "detours"}
        assert [effects[name] for name in ("waits", "detours")] == 2 * [SourceEffect(incentive=0.0, seconds=0.0)]
        assert set(effects) <= {"waits", "detours", *sources_on(world)}


def test_one_robot_has_the_same_rows_shared_and_independent_and_no_source_of_others(tmp_path: Path) -> None:
    one = SMALL.replace(SMALL[SMALL.index("  uv2:"):SMALL.index("scenarios:")], "").replace(
        SMALL[SMALL.index("scenarios:"):SMALL.index("noise:")], "")
    options = Options(trials=16, rollouts=4, fidelity="kinematic")
    shared, independent = (measure(world_of(tmp_path, one + f"interaction: {how}\n"), options, None, quiet)
                           for how in ("shared", "independent"))
    for ours, theirs in zip(shared.executed, independent.executed, strict=True):
        for name in ("end", "incentive", "end_time_s", "fuel_used_s", "waited_s", "pois_reached"):
            assert_array_equal(getattr(ours, name), getattr(theirs, name))
    for plan in shared.summary.scenarios[0].plans.values():
        assert set(plan.sources) == {"wheels", "interplay"}


@pytest.mark.long
def test_missions_are_judged_alike_by_any_number_of_workers_and_again() -> None:
    ready = next(filter(None, (random_mission(seed, process="mission", noisy=True) for seed in range(20, 30))))
    judged = []
    with local_workers(2, "sva_bench.execution.execute") as executor:
        for where in (None, executor):
            draws = TwinDraws(ready.world, ready.costs, 3, where)
            judged += [draws.judge(ready.case.scenario, ready.case.plan, count) for count in (5, 12, 12)]
    for number, (bad, value) in enumerate(judged):
        assert_array_equal(bad, judged[1][0][:len(bad)], err_msg=str(number))
        assert_array_equal(value, judged[1][1][:len(value)], err_msg=str(number))


@pytest.mark.long
def test_calibrated_costs_rise_until_nobody_is_late_by_waiting() -> None:
    # Of S3's plan both robots come to one station at once, and the second has less time to spare than the first stands.
    shipped = load_world(WORLDS / "warehouse.yaml")
    world = replace(shipped, interaction="shared", noise=Noise(), scenarios=(shipped.scenario("S3"),))
    assert not world.noisy
    assert not as_planned(world)
    summary = measure(world, Options(trials=4, rollouts=1, fidelity="kinematic", calibrate=0.02), None, quiet).summary
    found = summary.scenarios[0].calibration
    assert found is not None
    assert (found.nominal.bad.share, found.bad.share, found.reached, found.draws) == (1.0, 0.0, True, 1)
    assert {tried.quantile for tried in found.curve} == {None, 0.5}  # nothing varies
    assert found.factor > 1
    assert found.promised < found.nominal.promised
