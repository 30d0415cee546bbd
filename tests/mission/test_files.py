"""Instance and plan files: there and back, and complaints that name line and key."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sva_bench.errors import BadFile, BadInput
from sva_bench.mission.failures import JointState
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.mission.instance_file import instance_as_dict, read_instance, write_instance
from sva_bench.mission.plan import Plan
from sva_bench.mission.plan_file import plan_as_dict, read_plan, write_plan

TINY: dict[str, Any] = {
    "format": "sva-bench/instance@1", "name": "tiny", "sites": ["base", "r1", "p1", "p2"], "base": "base",
    "stations": ["r1"], "fuel_s": [[0, 5, 4, 7], [5, 0, 3, None], [4, 3, 0, 6], [7, 3, 6, 0]],
    "vehicles": [{"name": "uv1", "fuel_capacity_s": 12, "mission_limit_s": None, "availability": 1.0,
                  "incentives": {"p1": 10, "p2": 4}}],
}


def changed(change: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(json.dumps(TINY))
    change(data)
    return data


def written(folder: Path, data: object) -> Path:
    path = folder / "file.json"
    path.write_text(json.dumps(data, indent=1), encoding="utf-8")
    return path


def test_an_instance_file_has_the_content_of_the_instance(tmp_path: Path) -> None:
    instance = read_instance(written(tmp_path, TINY))
    robot = instance.vehicles[0]
    assert (instance.base, instance.stations, instance.pois) == (0, (1,), (2, 3))
    assert robot.mission_limit_s == math.inf
    assert robot.fuel_s[1, 3] == math.inf
    assert_array_equal(robot.incentives, [0, 0, 10, 4])
    assert_array_equal(instance.stop_s, np.zeros(4))
    assert instance.failure == "mission"


@pytest.mark.parametrize("shared", [True, False])
def test_an_instance_comes_back_from_its_file_as_it_was(tmp_path: Path, shared: bool) -> None:
    rng = np.random.default_rng(0)
    fuel = rng.uniform(1, 9, size=(4, 4))
    np.fill_diagonal(fuel, 0)
    fuel[2, 3] = np.inf
    robots = tuple(
        Vehicle(name=name, fuel_capacity_s=11.5, mission_limit_s=math.inf, availability=0.5,
                incentives=np.array([0, 0.1, 0, 7.0]), fuel_s=fuel if shared else fuel * k)
        for k, name in enumerate(("a", "b"), start=1))
    instance = Instance(
        name="there and back", sites=("x", "p1", "base", "p2"), base=2, stations=(0,),
        stop_s=np.array([3.0, 0, 0, 1.5]), vehicles=robots, failure="mission",
        joint=(JointState(probability=0.5, available=frozenset("ab")),
               JointState(probability=0.5, available=frozenset())))
    path = tmp_path / "instance.json"
    write_instance(path, instance)
    again = read_instance(path)
    assert instance_as_dict(again) == instance_as_dict(instance)
    assert ("fuel_s" in instance_as_dict(instance)) is shared
    for one, other in zip(instance.vehicles, again.vehicles, strict=True):
        assert_array_equal(one.fuel_s, other.fuel_s)
        assert_array_equal(one.incentives, other.incentives)
    assert again.joint == instance.joint


@pytest.mark.parametrize(("change", "key", "words"), [
    (lambda d: d["vehicles"][0].update(fuel_capcity_s=3), "vehicles[0].fuel_capcity_s", "fuel_capacity_s"),
    (lambda d: d["fuel_s"].pop(), "fuel_s", "expected 4 rows"),
    (lambda d: d["fuel_s"][2].pop(), "fuel_s[2]", "expected 4 entries"),
    (lambda d: d["fuel_s"][1].__setitem__(1, 3), "fuel_s[1][1]", "diagonal must be 0"),
    (lambda d: d["fuel_s"][1].__setitem__(2, -3), "fuel_s[1][2]", ""),
    (lambda d: d.update(stop_s=[1, 2]), "stop_s", "expected 4 entries"),
    (lambda d: d["sites"].__setitem__(3, "p1"), "sites[3]", "is a duplicate"),
    (lambda d: d["vehicles"].append(d["vehicles"][0]), "vehicles[1]", "is a duplicate"),
    (lambda d: d["vehicles"][0].update(availability=1.5), "vehicles[0].availability", "1"),
    (lambda d: d["vehicles"][0].pop("availability"), "vehicles[0]", "'availability' is missing"),
    (lambda d: d["vehicles"][0].update(availability=None), "vehicles[0].availability", "a probability, found null"),
    (lambda d: d["vehicles"][0].update(mtbf_s=-1), "vehicles[0].mtbf_s", "at least 0"),
    (lambda d: d["vehicles"][0].update(loss_cost=-1), "vehicles[0].loss_cost", "at least 0"),
    (lambda d: (d.update(failure="hazard"), d["vehicles"][0].update(availability=0.5, mission_limit_s=None)),
     "vehicles[0].availability", "set mission_limit_s or mtbf_s of the vehicle"),
    (lambda d: d["vehicles"][0]["incentives"].update(r1=3), "vehicles[0].incentives.r1", "no POI"),
    (lambda d: d.update(base="bse"), "base", "did you mean 'base'?"),
    (lambda d: d.update(stations=["base"]), "stations", "never refuel there"),
    (lambda d: d.pop("fuel_s"), "vehicles[0]", "there is no fuel_s"),
    (lambda d: d.update(joint_availability=[{"probability": 0.5, "available": ["uv1"]}]), "joint_availability",
     "add up to 0.5"),
    (lambda d: d.update(joint_availability=[{"probability": 0.5, "available": ["uv1"]},
                                            {"probability": 0.5, "available": []}]), "vehicles[0].availability",
     "marginal"),
    (lambda d: d.update(joint_availability=[{"probability": 1, "available": ["uv2"]}]),
     "joint_availability[0].available[0]", "did you mean 'uv1'?"),
    (lambda d: d.update(format="sva-bench/instance@2"), "format", "sva-bench/instance@1"),
])
def test_a_wrong_instance_is_refused_with_its_line_and_key(
        tmp_path: Path, change: Callable[[dict[str, Any]], object], key: str, words: str) -> None:
    with pytest.raises(BadFile) as caught:
        read_instance(written(tmp_path, changed(change)))
    assert caught.value.key == key, str(caught.value)
    assert words in caught.value.problem
    assert caught.value.line is not None
    assert caught.value.line >= 1


def test_lifetimes_and_costs_of_losses_are_read_and_written_where_given(tmp_path: Path) -> None:
    plain = read_instance(written(tmp_path, TINY))
    assert not {"mtbf_s", "loss_cost"} & set(instance_as_dict(plain)["vehicles"][0])
    lasting = read_instance(written(tmp_path, changed(lambda d: (
        d.update(failure="hazard"), d["vehicles"][0].update(mtbf_s=0, loss_cost=2.5)))))
    vehicle = instance_as_dict(lasting)["vehicles"][0]
    assert (vehicle["mtbf_s"], vehicle["loss_cost"]) == (0.0, 2.5)
    write_instance(tmp_path / "again.json", lasting)
    assert instance_as_dict(read_instance(tmp_path / "again.json")) == instance_as_dict(lasting)


def test_a_mean_time_to_failure_says_the_availability_where_none_is_given(tmp_path: Path) -> None:
    for limit, availability in ((None, 1.0), (30, math.exp(-0.5))):
        def only_mean(data: dict[str, Any], limit_s: int | None = limit) -> None:
            data["vehicles"][0].pop("availability")
            data["vehicles"][0].update(mtbf_s=60, mission_limit_s=limit_s)

        (vehicle,) = read_instance(written(tmp_path, changed(only_mean))).vehicles
        assert vehicle.availability == pytest.approx(availability)


def test_another_availability_replaces_the_mean_time_to_failure(tmp_path: Path) -> None:
    lasting = read_instance(written(tmp_path, changed(lambda d: (
        d.update(failure="hazard"), d["vehicles"][0].update(mtbf_s=60, mission_limit_s=30)))))
    name = lasting.vehicles[0].name
    assert lasting.with_availability({name: 0.5}).vehicles[0].mtbf_s is None
    assert lasting.with_availability({}).vehicles[0].mtbf_s == 60.0
    endless = replace(lasting, vehicles=(replace(lasting.vehicles[0], mission_limit_s=math.inf),))
    with pytest.raises(BadInput, match="set mission_limit_s or mtbf_s of the vehicle"):
        endless.with_availability({name: 0.5})


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity"])
def test_numbers_that_are_none_are_refused(tmp_path: Path, number: str) -> None:
    path = tmp_path / "instance.json"
    path.write_text(json.dumps(TINY).replace("[4, 3, 0, 6]", f"[4, {number}, 0, 6]"), encoding="utf-8")
    with pytest.raises(BadFile, match="is not a number"):
        read_instance(path)


def test_the_complaint_names_the_line_of_the_key(tmp_path: Path) -> None:
    path = tmp_path / "instance.json"
    path.write_text('{"format": "sva-bench/instance@1", "name": "t",\n "sites": ["base"], "base": "base",\n'
                    ' "fuel_s": [[0]],\n "vehicles": [],\n "statoins": []}', encoding="utf-8")
    with pytest.raises(BadFile) as caught:
        read_instance(path)
    assert (caught.value.line, caught.value.key) == (5, "statoins")
    assert "did you mean 'stations'?" in str(caught.value)


def test_a_plan_comes_back_from_its_file_as_it_was(tmp_path: Path) -> None:
    instance = read_instance(written(tmp_path, TINY))
    plan = Plan(routes={"uv1": ("base", "p1", "base")}, instance="tiny", objective="stochastic", method="expected",
                status="optimal", value=10.0, bound=10.0, fuel_s={"uv1": 8.0}, runtime_s=0.1, seed=0,
                details={"anything": [1, {"goes": None}]})
    path = tmp_path / "plan.json"
    write_plan(path, plan)
    assert plan_as_dict(read_plan(path, instance)) == plan_as_dict(plan)


def test_a_plan_by_hand_needs_only_routes(tmp_path: Path) -> None:
    instance = read_instance(written(tmp_path, TINY))
    path = tmp_path / "plan.json"
    for home in ([], ["base"]):
        path.write_text(json.dumps({"format": "sva-bench/plan@1", "routes": {"uv1": home}}), encoding="utf-8")
        plan = read_plan(path, instance)
        assert plan.route("uv1") == ()
        assert (plan.value, plan.status) == (None, None)


@pytest.mark.parametrize(("data", "key", "words"), [
    ({"routes": {"uv2": []}}, "routes.uv2", "did you mean 'uv1'?"),
    ({"routes": {"uv1": ["base", "p3", "base"]}}, "routes.uv1[1]", "there is no site 'p3'"),
    ({"routes": {}, "stauts": "optimal"}, "stauts", "status"),
    ({"routes": {}, "status": "best"}, "status", ""),
    ({}, "routes", "missing"),
])
def test_a_wrong_plan_is_refused_with_its_line_and_key(
        tmp_path: Path, data: dict[str, Any], key: str, words: str) -> None:
    instance = read_instance(written(tmp_path, TINY))
    with pytest.raises(BadFile) as caught:
        read_plan(written(tmp_path, {"format": "sva-bench/plan@1", **data}), instance)
    assert caught.value.key == key, str(caught.value)
    assert words in caught.value.problem
    assert caught.value.line is not None


def energetic(data: dict[str, Any]) -> None:
    data.update(charge_rate={"r1": 4}, time_s=[[0, 6, 5, 8], [6, 0, 2, None], [5, 2, 0, 6], [9, 3, 7, 0]])
    data["vehicles"][0].update(idle_share=0.25)


def test_energy_comes_back_from_its_file_as_it_was(tmp_path: Path) -> None:
    plain = read_instance(written(tmp_path, TINY))
    assert not {"charge_rate", "time_s"} & set(instance_as_dict(plain))
    assert "idle_share" not in instance_as_dict(plain)["vehicles"][0]
    instance = read_instance(written(tmp_path, changed(energetic)))
    assert instance.charge_rate is not None
    assert_array_equal(instance.charge_rate, [math.inf, 4, math.inf, math.inf])
    vehicle = instance.vehicles[0]
    assert (vehicle.idle_share, vehicle.leg_time_s[3, 0], vehicle.fuel_s[3, 0]) == (0.25, 9.0, 7.0)
    write_instance(tmp_path / "again.json", instance)
    again = read_instance(tmp_path / "again.json")
    assert instance_as_dict(again) == instance_as_dict(instance)
    assert_array_equal(again.charging, instance.charging)


def test_a_vehicle_s_own_times_replace_the_common_ones(tmp_path: Path) -> None:
    def two(data: dict[str, Any]) -> None:
        energetic(data)
        own = [[0 if i == j else None if cost is None else 1 for j, cost in enumerate(row)]
               for i, row in enumerate(data["fuel_s"])]
        data["vehicles"].append(data["vehicles"][0] | {"name": "uv2", "time_s": own})
    instance = read_instance(written(tmp_path, changed(two)))
    assert [v.leg_time_s[0, 1] for v in instance.vehicles] == [6.0, 1.0]
    write_instance(tmp_path / "again.json", instance)
    assert [v.leg_time_s[0, 1] for v in read_instance(tmp_path / "again.json").vehicles] == [6.0, 1.0]


@pytest.mark.parametrize(("change", "key", "words"), [
    (lambda d: d.update(charge_rate={"r2": 4}), "charge_rate.r2", "no station"),
    (lambda d: d.update(charge_rate={"p1": 4}), "charge_rate.p1", "no station"),
    (lambda d: d.update(charge_rate={"r1": 0}), "charge_rate.r1", "at least 1e-06"),
    (lambda d: d.update(charge_rate={"r1": -1}), "charge_rate.r1", "at least 1e-06"),
    (lambda d: d["vehicles"][0].update(idle_share=1.5), "vehicles[0].idle_share", "at most 1"),
    (lambda d: d["vehicles"][0].update(idle_share=-0.5), "vehicles[0].idle_share", "at least 0"),
    (lambda d: d["time_s"].pop(), "time_s", "expected 4 rows"),
    (lambda d: d["time_s"][1].pop(), "time_s[1]", "expected 4 entries"),
    (lambda d: d["time_s"][0].__setitem__(1, -1), "time_s[0][1]", "at least 0"),
    (lambda d: d["time_s"][0].__setitem__(0, 1), "time_s[0][0]", "the diagonal must be 0"),
    (lambda d: d["time_s"][0].__setitem__(1, None), "time_s[0][1]", "null in one of fuel_s and time_s alone"),
])
def test_energy_that_makes_no_sense_is_refused(
    tmp_path: Path, change: Callable[[dict[str, Any]], object], key: str, words: str,
) -> None:
    def both(data: dict[str, Any]) -> None:
        energetic(data)
        change(data)
    with pytest.raises(BadFile) as refused:
        read_instance(written(tmp_path, changed(both)))
    assert refused.value.key == key
    assert words in str(refused.value)
