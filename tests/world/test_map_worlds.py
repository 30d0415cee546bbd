"""Worlds whose obstacles are a map: loaded, told wrong, run, and written out with all they need."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sva_bench.batch.folder import begin, settings_in, write_maps
from sva_bench.batch.grid import Grid, Point, grid_of
from sva_bench.errors import BadFile
from sva_bench.files.pretty import pretty_json
from sva_bench.solver.two_stage import SolveLimits
from sva_bench.study.inputs import about
from sva_bench.study.options import Options
from sva_bench.study.publish import report_again
from sva_bench.study.run import run
from sva_bench.travel.times import UnreachableSite, plan_travel_times
from sva_bench.world.load import load_world, world_as_dict
from sva_bench.world.model import World
from tests.world.maps_for_tests import write_pgm, write_ros_map
from tests.worlds_for_tests import world_of

TWO_ROOMS = """\
##########
#...#....#
#........#
#........#
#...#....#
#...#....#
##########"""
WORLD = """\
format: sva-bench/world@1
name: two-rooms
map: {ros: {file: map.yaml}}
sites:
  base: {at_m: [1, 1]}
  stations: {r1: {at_m: [4, 1]}}
  pois: {p1: {at_m: [1, 2.5]}, p2: {at_m: [4, 2.5]}}
robots:
  uv1: {model: turtlebot2, fuel_capacity_s: 60, mission_limit_s: 90, availability: 0.75, incentives: {p1: 1, p2: 2}}
noise: {wheel_gain_sd: 0.01}
"""
OCTILE = "type octile\nheight 3\nwidth 4\nmap\n....\n.@@.\n....\n"


def two_rooms(folder: Path, text: str = WORLD) -> World:
    write_ros_map(folder, TWO_ROOMS)
    return world_of(folder, text)


def test_a_map_is_a_world_of_boxes_within_its_rim(tmp_path: Path) -> None:
    world = two_rooms(tmp_path)
    np.testing.assert_array_equal(world.obstacles.bounds_m, [0, 0, 5, 3.5])
    assert world.obstacles.cells is not None
    assert len(world.obstacles.boxes) == 6
    again = tmp_path / "again.yaml"
    again.write_text(pretty_json(world_as_dict(world)))
    assert world_as_dict(load_world(again)) == world_as_dict(world)


def test_a_benchmark_map_is_a_world_in_metres_of_ones_choice(tmp_path: Path) -> None:
    (tmp_path / "a.map").write_text(OCTILE)
    world = world_of(tmp_path, WORLD.replace("ros: {file: map.yaml}", "movingai: {file: a.map, cell_m: 1.5}").replace(
        "[4, 1]", "[5.2, 0.7]").replace("[1, 2.5]", "[0.7, 3.8]").replace("[4, 2.5]", "[5.2, 3.8]"))
    np.testing.assert_array_equal(world.obstacles.bounds_m, [0, 0, 6, 4.5])
    assert world.map_source is not None
    assert world.map_source.section == {"movingai": {"file": "a.map", "cell_m": 1.5}}


@pytest.mark.parametrize(("old", "new", "key", "says"), [
    ("{ros: {file: map.yaml}}", "{}", "map", "exactly one of shapes, ros and movingai, found none"),
    ("{ros: {file: map.yaml}}", "{ros: {file: map.yaml}, movingai: {file: a.map}}", "map", "found ros and movingai"),
    ("{ros: {file: map.yaml}}", "{ros: }", "map", "nothing below 'ros'"),
    ("{ros: {file: map.yaml}}", "{gazebo: {file: map.yaml}}", "map.gazebo", "unknown key 'gazebo'"),
    ("{file: map.yaml}", "{}", "map.ros.file", "the key 'file' is missing"),
    ("file: map.yaml", "file: map.yaml, cell_m: 1", "map.ros.cell_m", "unknown key 'cell_m'"),
    ("file: map.yaml", "file: map.yaml, unknown: maybe", "map.ros.unknown", "'occupied' or 'free'"),
    ("file: map.yaml", "file: gone.yaml", "map.ros.file", "no such file"),
    ("file: map.yaml", "file: ../map.yaml", "map.ros.file", "outside the world's folder"),
    ("file: map.yaml", "file: /tmp/map.yaml", "map.ros.file", "no name relative to the world's folder"),
    ("[4, 2.5]", "[2.1, 2.5]", "sites.pois.p2.at_m", "inside an obstacle"),
    ("[4, 2.5]", "[5.5, 2.5]", "sites.pois.p2.at_m", "outside the bounds")])
def test_an_error_in_a_map_world_names_its_key(tmp_path: Path, old: str, new: str, key: str, says: str
                                                           ) -> None:
    with pytest.raises(BadFile, match=says) as caught:
        two_rooms(tmp_path, WORLD.replace(old, new))
    assert caught.value.key == key
    assert caught.value.line is not None


def test_a_run_keeps_the_maps_files_and_is_another_run_with_another_map(tmp_path: Path) -> None:
    world = two_rooms(tmp_path)
    options = Options(trials=4, rollouts=1, limits=SolveLimits(), fidelity="rollout")
    done = run(world, options, tmp_path / "runs", None, lambda *_: None)
    manifest = json.loads((done.folder / "manifest.json").read_text())
    assert manifest["world"]["map"] == {"ros": {"file": "map.yaml", "unknown": "occupied"}}
    for name in ("map.yaml", "map.pgm"):
        assert (done.folder / "map" / name).read_bytes() == (tmp_path / name).read_bytes()
    # The manifest's world, put beside the map's files, is the world that was run.
    report = (done.folder / "report.html").read_bytes()
    assert report_again(done.folder).read_bytes() == report  # it needs no file but the run's own
    (done.folder / "map" / "world.yaml").write_text(pretty_json(manifest["world"]))
    again = load_world(done.folder / "map" / "world.yaml")
    np.testing.assert_array_equal(again.obstacles.boxes, world.obstacles.boxes)
    write_pgm(tmp_path / "map.pgm", np.where(np.eye(7, 10), 254, 254))  # no wall is left
    other = load_world(tmp_path / "world.yaml")

    def grid(of: World) -> Grid:
        return Grid(points=[Point(world=of, planner="prmstar")], seeds=[0], options=options, unit_trials=10)

    assert grid(other).settings() != grid(world).settings()
    # A batch folder has the map, so the manifest's settings are all that it takes to go on.
    (tmp_path / "batch").mkdir()
    begin(tmp_path / "batch", grid(world).settings(), resume=False)
    write_maps(tmp_path / "batch", grid(world).map_files())
    held = grid_of(*settings_in(tmp_path / "batch"))
    assert held.settings() == grid(world).settings()
    assert run(other, options, tmp_path / "runs", None, lambda *_: None).folder != done.folder


def test_the_error_of_a_narrow_door_names_the_largest_robot_that_fits(tmp_path: Path) -> None:
    # The door is two cells of 0.5 m wide; a path keeps 0.03 m beside the robot at least.
    world = two_rooms(tmp_path)
    wide = replace(world.robots[0].model, radius_m=0.49, track_m=0.5)
    with pytest.raises(UnreachableSite, match=r"that gets there has a radius of 0\.469 m") as caught:
        plan_travel_times(world, wide)
    assert caught.value.destinations == ("r1", "p2")
    plan_travel_times(world, replace(wide, radius_m=caught.value.widest_m))


def test_where_no_site_is_reachable_the_error_suggests_to_move_the_base(tmp_path: Path) -> None:
    world = two_rooms(tmp_path, WORLD.replace("[1, 2.5]", "[4, 1.8]"))  # all sites but the base are beyond the door
    wide = replace(world.robots[0].model, radius_m=0.49, track_m=0.5)
    with pytest.raises(BadFile, match="no path from 'base' to 'r1', 'p1', 'p2'") as caught, about(
            tmp_path / "world.yaml"):
        plan_travel_times(world, wide)
    assert caught.value.key == "sites.base"
