"""What every failure process must keep: its draws, its closed form and what it tells planners agree."""

from __future__ import annotations

import ast
import json
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sva_bench import mission as mission_room
from sva_bench.choices import FailureProcess
from sva_bench.errors import BadFile, BadInput
from sva_bench.mission import failures
from sva_bench.mission.failures import (
    NEVER,
    PROCESSES,
    FailureDraw,
    Failures,
    JointState,
    Process,
    Reliability,
    RouteProfile,
)
from sva_bench.mission.failures.per_leg import PerLegFailure
from sva_bench.mission.instance_file import read_instance
from sva_bench.world.load import load_world
from sva_bench.world.variants import adapted
from tests.worlds_for_tests import SMALL

TRIALS = 20_000
ROUTE = RouteProfile(incentives=(10.0, 20.0, 5.0), arrival_s=(30.0, 70.0, 90.0), home_s=120.0)
RELIABILITY = Reliability(availability=0.7, mission_limit_s=150.0)
JOINT = SMALL.replace("  half: {uv2: 0.5}\n", "  S1: {joint: [{probability: 1, available: []}]}\n")
PACKAGE = Path(mission_room.__file__).parents[1]

every_process = pytest.mark.parametrize("process", PROCESSES.values(), ids=list(PROCESSES))


def drawn(process: Process, *, seed: int = 3, trials: int = TRIALS, first: int = 0, pois: int = 3,
          reliability: Reliability = RELIABILITY, vehicles: tuple[str, ...] = ("a", "b")) -> Failures:
    return process.draw(FailureDraw(seed=seed, vehicles=vehicles, reliability=(reliability,) * len(vehicles),
                                    trials=trials, first=first, pois=pois))


def earned(failed: Failures, vehicle: int) -> np.ndarray:
    """Incentive of each trial on ``ROUTE``: that of the POIs reached before the failure."""
    arrival = np.array(ROUTE.arrival_s)
    reached = (np.arange(1, 4) < failed.before_poi[:, vehicle, None]) & (arrival < failed.lifetime_s[:, vehicle, None])
    total: np.ndarray = reached @ np.array(ROUTE.incentives)
    return total


@every_process
def test_a_process_goes_by_its_name(process: Process) -> None:
    assert PROCESSES[process.name] is process
    assert process.name in get_args(FailureProcess)
    assert process.how


@every_process
def test_the_mean_reward_of_a_route_is_its_closed_form(process: Process) -> None:
    # Standard deviation of the earnings is at most 35 / 2; four of them over sqrt(20000): 0.5.
    assert np.mean(earned(drawn(process), 0)) == pytest.approx(process.route_value(ROUTE, RELIABILITY), abs=0.5)


@every_process
def test_the_cost_of_a_loss_is_charged_for_what_failed_along_the_route(process: Process) -> None:
    priced = replace(RELIABILITY, loss_cost=10.0)
    failed = drawn(process, reliability=priced)
    before, lifetime = failed.before_poi[:, 0], failed.lifetime_s[:, 0]
    lost = np.mean(((before > 0) & (before <= 3)) | (lifetime < 120.0))
    # A share of 20000 trials, times 10: four standard deviations are 20 / sqrt(20000) = 0.15.
    free = process.route_value(ROUTE, RELIABILITY)
    assert free - process.route_value(ROUTE, priced) == pytest.approx(10.0 * lost, abs=0.15)


@every_process
def test_planning_terms_agree_with_the_closed_form(process: Process) -> None:
    terms = process.terms([Reliability(availability=1.0), RELIABILITY])
    survival = np.ones(2) if terms.survival is None else terms.survival
    left = np.exp(-terms.rate_of(1) * np.array(ROUTE.arrival_s))
    told = sum(terms.share[1] * survival[1]**k * left[k - 1] * e for k, e in enumerate(ROUTE.incentives, start=1))
    assert told == pytest.approx(process.route_value(ROUTE, RELIABILITY), rel=1e-12)


@every_process
def test_the_model_collapses_where_the_order_of_visits_makes_no_difference(process: Process) -> None:
    backwards = RouteProfile(incentives=ROUTE.incentives[::-1], arrival_s=ROUTE.arrival_s, home_s=ROUTE.home_s)
    same = process.route_value(backwards, RELIABILITY) == pytest.approx(process.route_value(ROUTE, RELIABILITY))
    terms = process.terms([RELIABILITY])
    assert process.collapses == same == (terms.survival is None and terms.rate is None)


@every_process
def test_a_certain_vehicle_never_fails_and_earns_all(process: Process) -> None:
    certain = Reliability(availability=1.0, mission_limit_s=150.0)
    failed = drawn(process, reliability=certain)
    assert np.all(failed.before_poi == NEVER)
    assert np.all(np.isinf(failed.lifetime_s))
    assert process.route_value(ROUTE, certain) == 35.0
    assert process.can_leave(certain)


@every_process
def test_a_hopeless_vehicle_earns_nothing_and_leaves_only_if_it_can_fail_on_the_way(process: Process) -> None:
    hopeless = Reliability(availability=0.0, mission_limit_s=150.0)
    failed = drawn(process, trials=100, reliability=hopeless)
    assert np.all(earned(failed, 0) == 0)
    assert process.route_value(ROUTE, hopeless) == 0.0
    assert process.can_leave(hopeless) == bool(np.any(failed.before_poi[:, 0] > 0))


@every_process
def test_no_route_and_no_poi_is_worth_nothing(process: Process) -> None:
    empty = RouteProfile(incentives=(), arrival_s=(), home_s=0.0)
    assert process.route_value(empty, RELIABILITY) == 0.0


@every_process
def test_trials_and_vehicles_are_drawn_by_key(process: Process) -> None:
    whole, later = drawn(process, trials=100), drawn(process, trials=60, first=40)
    alone, longer = drawn(process, trials=100, vehicles=("a",)), drawn(process, trials=100, pois=5)
    assert_array_equal(whole.before_poi[40:], later.before_poi)
    assert_array_equal(whole.lifetime_s[40:], later.lifetime_s)
    assert_array_equal(whole.before_poi[:, 0], alone.before_poi[:, 0])
    # Draws for more POIs than the route has leave its own as they are.
    assert_array_equal(np.where(whole.before_poi <= 3, whole.before_poi, NEVER),
                       np.where(longer.before_poi <= 3, longer.before_poi, NEVER))
    assert not (np.array_equal(whole.before_poi[:, 0], whole.before_poi[:, 1])
                and np.array_equal(whole.lifetime_s[:, 0], whole.lifetime_s[:, 1]))


@every_process
def test_a_more_reliable_vehicle_fails_no_earlier(process: Process) -> None:
    safer = drawn(process, reliability=Reliability(availability=0.9, mission_limit_s=150.0))
    weaker = drawn(process)
    assert np.all(safer.before_poi >= weaker.before_poi)
    assert np.all(safer.lifetime_s >= weaker.lifetime_s)


def test_draws_are_those_of_earlier_versions() -> None:
    # Rows of stored runs rest on them.
    mission = drawn(PROCESSES["mission"], seed=7, trials=8)
    per_leg = drawn(PROCESSES["per_leg"], seed=7, trials=8)
    assert np.minimum(mission.before_poi, 9).T.tolist() == [[0, 9, 0, 9, 9, 9, 9, 9], [9, 9, 0, 0, 9, 0, 9, 9]]
    assert np.minimum(per_leg.before_poi, 9).T.tolist() == [[1, 3, 1, 3, 9, 2, 2, 9], [9, 2, 1, 1, 9, 1, 3, 2]]


class TestAProcessWithoutJointDistributions:
    """A process that refuses them is refused wherever one is given."""

    @pytest.fixture(autouse=True)
    def independent(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(failures, "PROCESSES", {**PROCESSES, "per_leg": PerLegFailure(joint=False)})

    def test_in_a_world(self, tmp_path: Path) -> None:
        path = tmp_path / "w.yaml"
        path.write_text(JOINT + "failure: per_leg\n")
        with pytest.raises(BadFile, match=r"scenarios\.S1\.joint: under per_leg robots fail independently"):
            load_world(path)

    def test_on_the_command_line(self, tmp_path: Path) -> None:
        path = tmp_path / "w.yaml"
        path.write_text(JOINT)
        with pytest.raises(BadInput, match="scenario S1: under per_leg robots fail independently"):
            adapted(load_world(path), execute_failure="per_leg")

    def test_in_an_instance(self, tmp_path: Path) -> None:
        path = tmp_path / "i.json"
        path.write_text(json.dumps({
            "format": "sva-bench/instance@1", "name": "i", "sites": ["base"], "base": "base", "fuel_s": [[0]],
            "vehicles": [{"name": "a", "fuel_capacity_s": None, "mission_limit_s": None}], "failure": "per_leg",
            "joint_availability": [{"probability": 1.0, "available": ["a"]}]}))
        with pytest.raises(BadFile, match="joint_availability: under per_leg vehicles fail independently"):
            read_instance(path)


def test_no_other_module_compares_names_of_processes() -> None:
    names = set(get_args(FailureProcess))
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Compare | ast.Match):
                words = {n.value for n in ast.walk(node) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
                assert not words & names, f"{path}:{node.lineno}: let the process say it (mission/failures/)"


def test_joint_states_with_one_outcome_decide_all_trials() -> None:
    asked = FailureDraw(seed=1, vehicles=("a", "b"), reliability=(RELIABILITY,) * 2, trials=50, pois=3,
                        joint=(JointState(probability=1.0, available=frozenset({"a"})),))
    failed = PROCESSES["mission"].draw(asked)
    assert np.all(failed.before_poi[:, 0] == NEVER)
    assert np.all(failed.before_poi[:, 1] == 0)
