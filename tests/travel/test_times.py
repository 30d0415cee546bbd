from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sva_bench.errors import BadInput, ExitCode
from sva_bench.geometry.clearance import CLEARANCE_MARGINS_M
from sva_bench.robot.model import BUILT_IN
from sva_bench.robot.twin import drive
from sva_bench.travel.times import UnreachableSite, plan_travel_times
from sva_bench.world.load import load_world
from sva_bench.world.model import World
from tests.oracles.distances import path_clearance
from tests.worlds_for_tests import SMALL, world_of

TURTLEBOT = BUILT_IN["turtlebot2"]


def room_with_a_door(folder: Path, width_m: float) -> World:
    """Two rooms: base and p1 on the left, p2 on the right, behind a door of so many metres."""
    return world_of(folder, f"""\
format: sva-bench/world@1
name: door
map:
  shapes:
    bounds_m: [0, 0, 4, 3]
    obstacles:
      - {{wall: [[2, 0], [2, {1.5 - width_m / 2}]], thickness_m: 0.1}}
      - {{wall: [[2, {1.5 + width_m / 2}], [2, 3]], thickness_m: 0.1}}
sites:
  base: {{at_m: [0.6, 1.0]}}
  pois: {{p1: {{at_m: [0.6, 2.2]}}, p2: {{at_m: [3.4, 1.0]}}}}
robots:
  uv1: {{model: turtlebot2, incentives: {{p1: 1, p2: 1}}}}
""")


def test_a_leg_takes_what_the_twin_takes_from_heading_to_heading(tmp_path: Path) -> None:
    world = world_of(tmp_path)
    times = plan_travel_times(world, TURTLEBOT)
    base, p2 = world.sites[0], next(site for site in world.sites if site.name == "p2")
    pose = np.array([base.x_m, base.y_m, base.heading_rad])
    time_s, _ = drive(TURTLEBOT, times.course("base", "p2"), pose)
    i, j = times.sites.index("base"), times.sites.index("p2")
    assert times.time_ms[i, j] == round(1000 * time_s)
    # The follower stops within 0.01 m of the end, and turns to within 0.02 rad.
    assert np.hypot(pose[0] - p2.x_m, pose[1] - p2.y_m) < 0.02
    assert abs(np.angle(np.exp(1j * (pose[2] - p2.heading_rad)))) < 0.021


def test_times_are_positive_directed_and_at_least_path_length_over_top_speed(tmp_path: Path) -> None:
    world = world_of(tmp_path)
    times = plan_travel_times(world, TURTLEBOT)
    n = len(world.sites)
    assert_array_equal(np.diag(times.time_ms), 0)
    assert np.all(times.time_ms[~np.eye(n, dtype=bool)] > 0)
    assert not np.array_equal(times.time_ms, times.time_ms.T)
    places = np.array([(site.x_m, site.y_m) for site in world.sites])
    crow = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    # The last centimetre of a stretch is not driven.
    assert np.all(times.time_ms / 1000 >= (crow - 0.01) / TURTLEBOT.max_speed_m_s)


def test_planning_again_gives_equal_times(tmp_path: Path) -> None:
    first, second = (plan_travel_times(world_of(tmp_path), TURTLEBOT) for _ in range(2))
    assert_array_equal(first.time_ms, second.time_ms)
    for a, b in zip(sum(first.paths, ()), sum(second.paths, ()), strict=True):
        if a is None or b is None:
            assert a is b is None
        else:
            assert_array_equal(a, b)


def test_a_wide_door_is_passed_with_the_widest_margin(tmp_path: Path) -> None:
    times = plan_travel_times(room_with_a_door(tmp_path, 0.8), TURTLEBOT)
    assert times.clearance_m == pytest.approx(TURTLEBOT.radius_m + CLEARANCE_MARGINS_M[0])


def test_a_narrow_door_is_passed_with_a_smaller_margin(tmp_path: Path) -> None:
    # A door of 0.5 m leaves (0.5 - 2 x 0.177) / 2 = 0.073 m on each side: less than 0.12, more than 0.06.
    world = room_with_a_door(tmp_path, 0.5)
    times = plan_travel_times(world, TURTLEBOT)
    assert times.clearance_m == pytest.approx(TURTLEBOT.radius_m + 0.06)
    assert path_clearance(world.obstacles, times.path("base", "p2")) >= times.clearance_m - 1e-6


def test_a_door_too_narrow_leaves_a_site_unreachable_and_the_error_names_it(tmp_path: Path) -> None:
    # A door of 0.3 m is narrower than the robot's 0.354 m.
    with pytest.raises(UnreachableSite) as caught:
        plan_travel_times(room_with_a_door(tmp_path, 0.3), TURTLEBOT)
    assert (caught.value.origin, caught.value.destinations) == ("base", ("p2",))
    assert "'p2'" in str(caught.value)
    assert "widen the passage" in str(caught.value)
    # Half of the door less the least margin: 0.15 - 0.03 m. Among shapes it is found to a step of 0.02 m.
    assert 0.1 <= caught.value.widest_m <= 0.12
    assert f"has a radius of {caught.value.widest_m:.3f} m" in str(caught.value)
    plan_travel_times(room_with_a_door(tmp_path, 0.3), replace(
        TURTLEBOT, radius_m=caught.value.widest_m, track_m=caught.value.widest_m))
    assert caught.value.exit_code == ExitCode.BAD_INPUT
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


@pytest.mark.long  # it takes the planner long to be sure that there is no way
def test_a_slim_robot_passes_where_a_wide_one_does_not(tmp_path: Path) -> None:
    # 0.45 m: 0.12 m on each side of a burger of radius 0.105, 0.005 m on each side of a waffle of radius 0.22.
    world = room_with_a_door(tmp_path, 0.45)
    plan_travel_times(world, BUILT_IN["turtlebot3_burger"])
    with pytest.raises(UnreachableSite):
        plan_travel_times(world, BUILT_IN["turtlebot3_waffle"])


def test_a_site_near_a_wall_narrows_the_margin_of_all_paths(tmp_path: Path) -> None:
    # 0.2 m from the bounds: 0.023 m beyond the robot's radius is all there is.
    world = world_of(tmp_path, SMALL.replace("p3: {at_m: [5.2, 5.2]}", "p3: {at_m: [5.8, 5.2]}"))
    times = plan_travel_times(world, TURTLEBOT)
    assert times.clearance_m == pytest.approx(0.2)


def test_a_site_has_no_path_to_itself(tmp_path: Path) -> None:
    times = plan_travel_times(room_with_a_door(tmp_path, 0.8), TURTLEBOT)
    assert times.paths[0][0] is None
    with pytest.raises(BadInput, match="'base' has no path to itself; name two sites"):
        times.path("base", "base")


def test_times_of_a_symmetric_world_are_the_same_again_and_again() -> None:
    # The maze is full of ties; with a site twice in the roadmap, chance broke them in one of five plannings.
    world = load_world(Path(__file__).parents[2] / "worlds" / "maze.yaml")
    times = [plan_travel_times(world, world.robots[0].model).time_ms for _ in range(5)]
    assert all(np.array_equal(times[0], again) for again in times)
