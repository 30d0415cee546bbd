"""Worlds made of maps: a file that runs, with the map beside it; and one clear complaint where that can't be."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.mission.certify import expected_value
from sva_bench.study.costs import plan_costs
from sva_bench.study.options import Options
from sva_bench.study.planning import plan_scenarios
from sva_bench.world.load import load_world
from tests.commands_for_tests import sva_bench
from tests.world.maps_for_tests import SHARED, shared_map, write_ros_map

ROOMS = """\
??##############
?##......#.....#
?#.............#
?#.......#.....#
?####.####.....#
?#.......#.....#
?#.............#
?#.......#.....#
?###############"""
FEW = ("--pois", "5", "--stations", "2")
ROS = ["turtlebot_stage/maze", "turtlebot3/map", "aws_small_house/map", "turtlebot_stdr/simple_rooms",
       "turtlebot_stdr/sparse_obstacles"]


def from_map(*arguments: object) -> int:
    return run_command_line(["world", "from-map", *map(str, arguments)])


def test_a_map_becomes_a_self_contained_world(tmp_path: Path) -> None:
    source, target = tmp_path / "source", tmp_path / "target"
    source.mkdir()
    target.mkdir()
    write_ros_map(source, ROOMS)
    assert from_map(source / "map.yaml", *FEW, "-o", target / "rooms.yaml") == 0
    text = (target / "rooms.yaml").read_text()
    copies = {name: (source / name).read_bytes() for name in ("map.yaml", "map.pgm")}
    assert {path.name: path.read_bytes() for path in (target / "rooms-map").iterdir()} == copies
    for path in source.iterdir():
        path.unlink()  # nothing is read from there any more

    world = load_world(target / "rooms.yaml")
    assert [site.name for site in world.sites] == ["base", "r1", "r2", "p1", "p2", "p3", "p4", "p5"]
    assert [scenario.name for scenario in world.scenarios] == ["S1", "S2", "S3", "S4"]
    assert "world from-map map.yaml" in text.splitlines()[0]
    assert max(map(len, text.splitlines())) <= 120
    # Made again of its own copy, it is the same.
    assert from_map(target / "rooms-map" / "map.yaml", *FEW, "-o", target / "rooms.yaml") == 0
    assert (target / "rooms.yaml").read_text() == text
    assert {path.name: path.read_bytes() for path in (target / "rooms-map").iterdir()} == copies

    costs = plan_costs(world, "prmstar", lambda *_: None)
    planned = plan_scenarios(world, costs, Options(), lambda *_: None)
    everything = sum(max(robot.incentives.get(poi.name, 0.0) for robot in world.robots) for poi in world.pois)
    assert 0.3 * everything < expected_value(planned["S1"].instance, planned["S1"].stochastic) < everything


def test_another_map_of_the_same_size_has_other_places_and_incentives_from_a_seed(tmp_path: Path) -> None:
    # One wall cell has moved: as many places are free as before, so that the same numbers would choose the same ones.
    moved = ROOMS.replace("?#.............#\n?#.......#.....#\n?####", "?#.......#.....#\n?#.............#\n?####")
    assert moved != ROOMS
    worlds = []
    for number, cells in enumerate((ROOMS, moved)):
        folder = tmp_path / str(number)
        folder.mkdir()
        write_ros_map(folder, cells)
        assert from_map(folder / "map.yaml", *FEW, "-o", folder / "w.yaml") == 0
        worlds.append(load_world(folder / "w.yaml"))
    one, other = ({(site.x_m, site.y_m) for site in world.pois} for world in worlds)
    assert len(one & other) <= 2
    assert all(a.incentives != b.incentives for a, b in zip(worlds[0].robots, worlds[1].robots, strict=True))


def test_the_base_may_be_chosen(tmp_path: Path) -> None:
    write_ros_map(tmp_path, ROOMS)
    arguments = (tmp_path / "map.yaml", *FEW, "-o", tmp_path / "rooms.yaml", "--base", 7.0, 0.9, "--min-spacing", 0.7)
    assert from_map(*arguments) == 0
    base = load_world(tmp_path / "rooms.yaml").sites[0]
    assert (base.x_m, base.y_m) == (7, 0.9)
    assert "--base 7 0.9 --min-spacing 0.7" in (tmp_path / "rooms.yaml").read_text().splitlines()[1]


@pytest.mark.parametrize(("arguments", "says"), [
    (("map.yaml", "--pois", "100", "--min-spacing", "1", "-o", "w.yaml"), "there is room for"),
    (("map.yaml", "--base", "0.1", "0.1", "-o", "w.yaml"), "there is no room at the base"),
    (("gone.yaml", "-o", "w.yaml"), "no such file"),
    (("map.pgm", "-o", "w.yaml"), "a map is the YAML file of a ROS map"),
    (("map.yaml", "-o", "map.yaml"), "this is what is read"),
    (("map.yaml", "-o", "gone/w.yaml"), "there is no such folder"),
    (("map.yaml", "-o", "a b.yaml"), "the world is named after its file"),
    (("map.yaml", "--cell-m", "2", "-o", "w.yaml"), "--cell-m belongs to MovingAI maps"),
    (("a.map", "--unknown", "free", "-o", "w.yaml"), "--unknown belongs to ROS maps"),
    (("map.yaml", "--pois", "5", "--robots", "3", "-o", "w.yaml"), "3 robots and 5 POIs leave nothing to decide"),
])
def test_a_mission_that_does_not_fit_is_an_error_and_leaves_no_file(
    arguments: tuple[str, ...], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    write_ros_map(tmp_path, ROOMS)
    before = sorted(path.name for path in tmp_path.iterdir())
    monkeypatch.chdir(tmp_path)
    assert from_map(*arguments) == 2
    assert says in " ".join(capsys.readouterr().err.split())
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_a_map_of_a_metre_has_no_room_for_a_robot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert from_map(shared_map("ros/nav1_tests/testmap.yaml"), "-o", tmp_path / "w.yaml") == 2
    assert "for a robot of radius 0.177 m, there is room for no" in " ".join(capsys.readouterr().err.split())


@pytest.mark.long
@pytest.mark.parametrize("name", [*(f"ros/{name}.yaml" for name in ROS), *(
    f"movingai/{path.name}" for path in sorted((SHARED / "movingai").glob("*.map")))])
def test_every_shared_map_becomes_a_world_that_runs(name: str, tmp_path: Path) -> None:
    path = shared_map(name)
    made = sva_bench("world", "from-map", path, "--pois", 20, "--stations", 5, "--robots", 2, "-o", "world.yaml",
                     cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    world = load_world(tmp_path / "world.yaml")
    done = sva_bench("run", "world.yaml", "--fidelity", "kinematic", "--trials", 200, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    scenarios = {scenario["name"]: scenario for scenario in json.loads(done.stdout)["scenarios"]}
    assert list(scenarios) == ["S1", "S2", "S3", "S4"]
    everything = sum(max(robot.incentives.get(poi.name, 0.0) for robot in world.robots) for poi in world.pois)
    assert 0.5 * everything < scenarios["S1"]["plans"]["stochastic"]["expected"] < everything
    assert max(scenarios[name]["vss"]["modelled"] for name in ("S3", "S4")) > 0
    (run,) = (tmp_path / "runs").iterdir()
    routes = json.loads((run / "plans" / "S1-stochastic.json").read_text())["routes"]
    assert all(len(route) > 3 for route in routes.values())  # no robot fetches one point and goes home
