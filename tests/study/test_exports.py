"""Plans for other programs: read back by parsers of those formats, and compared with plan and world."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

from sva_bench.errors import BadInput
from sva_bench.mission.plan import Plan
from sva_bench.mission.plan_file import read_plan
from sva_bench.study.costs import plan_costs
from sva_bench.study.exports import EXPORTS, Exported, as_csv, as_geojson, as_nav2
from sva_bench.study.given_plans import without_times
from sva_bench.world.load import load_world
from sva_bench.world.model import World
from tests.worlds_for_tests import SMALL


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    path = tmp_path_factory.mktemp("world") / "small.yaml"
    path.write_text(SMALL)
    world = load_world(path)
    pois, base = [site.name for site in world.pois], world.sites[0].name
    plan = Plan(routes={"uv1": (base, *pois[:2], base), "uv2": (base, pois[2], base)})
    return Exported(world=world, costs=plan_costs(world, "prmstar", lambda *_: None), plan=plan)


def only(exported: Exported, robot: str | None) -> Exported:
    return Exported(world=exported.world, costs=exported.costs, plan=exported.plan, robot=robot)


def placed(world: World, name: str) -> tuple[float, float, float]:
    site = next(site for site in world.sites if site.name == name)
    return site.x_m, site.y_m, site.heading_rad


def check_waypoints(exported: Exported, robot: str, waypoints: dict[str, Any]) -> None:
    stops = exported.plan.route(robot)[1:]
    assert list(waypoints) == [f"waypoint{k}" for k in range(len(stops))]
    for name, waypoint in zip(stops, waypoints.values(), strict=True):
        x, y, yaw = placed(exported.world, name)
        assert waypoint["pose"] == pytest.approx([x, y, 0.0], abs=1e-6)
        w, _, _, z = waypoint["orientation"]
        assert math.remainder(2 * math.atan2(z, w) - yaw, 2 * math.pi) == pytest.approx(0, abs=1e-5)


def test_nav2_waypoints_are_the_stops_with_their_headings(exported: Exported) -> None:
    for robot, written in YAML(typ="safe").load(as_nav2(exported)).items():
        check_waypoints(exported, robot, written["waypoints"])
    check_waypoints(exported, "uv2", YAML(typ="safe").load(as_nav2(only(exported, "uv2")))["waypoints"])


def test_geojson_has_all_sites_and_legs_from_stop_to_stop(exported: Exported) -> None:
    features = json.loads(as_geojson(exported))["features"]
    points = {f["properties"]["name"]: f for f in features if f["geometry"]["type"] == "Point"}
    assert set(points) == {site.name for site in exported.world.sites}
    legs = [f for f in features if f["geometry"]["type"] == "LineString"]
    for robot in ("uv1", "uv2"):
        route, mine = exported.plan.route(robot), [f for f in legs if f["properties"]["robot"] == robot]
        assert [(f["properties"]["origin"], f["properties"]["destination"]) for f in mine] == list(
            itertools.pairwise(route))
        for leg in mine:
            path = np.array(leg["geometry"]["coordinates"])
            assert path[0] == pytest.approx(placed(exported.world, leg["properties"]["origin"])[:2], abs=1e-6)
            assert path[-1] == pytest.approx(placed(exported.world, leg["properties"]["destination"])[:2], abs=1e-6)
            length = float(np.hypot(*np.diff(path, axis=0).T).sum())
            assert leg["properties"]["planned_s"] > length / 0.65  # no robot is faster than its top speed
    assert points[exported.plan.route("uv2")[1]]["properties"]["visited_by"] == "uv2"


def test_csv_is_read_as_the_same_plan(exported: Exported, tmp_path: Path) -> None:
    (tmp_path / "plan.csv").write_text(as_csv(exported))
    assert read_plan(tmp_path / "plan.csv", without_times(exported.world)).drives_like(exported.plan)


def test_a_robot_that_stays_home_or_is_unknown_is_refused(exported: Exported) -> None:
    with pytest.raises(BadInput, match="did you mean 'uv"):
        as_nav2(only(exported, "uv9"))
    home = Exported(world=exported.world, costs=exported.costs, plan=Plan(routes={}), robot="uv1")
    with pytest.raises(BadInput, match="stays home"):
        as_nav2(home)


@pytest.mark.parametrize("to", EXPORTS)
def test_a_plan_in_which_nobody_leaves_is_written_too(exported: Exported, to: str) -> None:
    nobody = Exported(world=exported.world, costs=exported.costs, plan=Plan(routes={"uv1": ()}))
    written = EXPORTS[to](nobody)  # type: ignore[index]
    if to == "nav2":
        assert YAML(typ="safe").load(written) == {"waypoints": {}}
    elif to == "geojson":
        assert len(json.loads(written)["features"]) == len(exported.world.sites)
    else:
        assert written == "robot,stop,site\n"
