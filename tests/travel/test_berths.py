"""Berths and slots of robots that share a world."""

from __future__ import annotations

import logging
import pickle
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.choices import WorldFamily
from sva_bench.generate.terrain import DENSITY, random_places, random_terrain
from sva_bench.geometry.distances import clearance
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.model import BUILT_IN
from sva_bench.travel.berths import NoRoomForBerths, NoRoomForSlots, own_world, place_berths
from sva_bench.travel.narrowed import narrowed_by
from sva_bench.travel.near_field import near_field
from sva_bench.travel.roadmap import plan_paths
from sva_bench.travel.stand_ground import gap_of
from sva_bench.travel.times import UnreachableSite, plan_travel_times
from sva_bench.world.model import Robot, Site, World, nominal_of
from sva_bench.world.noise import LocalisationError, Noise
from sva_bench.world.places import field_of
from tests.oracles.distances import path_clearance
from tests.oracles.worlds import random_obstacles
from tests.worlds_for_tests import world_of

Point = tuple[float, float]
SMALL, LARGE = "turtlebot3_burger", "jackal"


def world_with(
    obstacles: Obstacles, base: Point, pois: Sequence[Point], models: Sequence[str], *, station: Point | None = None,
    slots: int = 1, noise: Noise = Noise(),  # noqa: B008 - frozen
) -> World:
    """A world of these sites and robots."""
    sites = [Site(name="base", kind="base", x_m=base[0], y_m=base[1], heading_rad=0.5)]
    if station is not None:
        sites.append(Site(name="r1", kind="station", x_m=station[0], y_m=station[1], heading_rad=0.0, slots=slots))
    sites += [Site(name=f"p{k}", kind="poi", x_m=x, y_m=y, heading_rad=0.0) for k, (x, y) in enumerate(pois, start=1)]
    robots = tuple(Robot(name=f"uv{k}", model=BUILT_IN[model], fuel_capacity_s=500.0, mission_limit_s=500.0,
                         availability=1.0, incentives={}) for k, model in enumerate(models, start=1))
    return World(name="shared", obstacles=obstacles, sites=tuple(sites), robots=robots,
                 scenarios=(nominal_of(robots),), plan_failure="mission", execute_failure="mission", margin=0.0,
                 noise=noise)


def random_shared(family: WorldFamily, seed: int, models: Sequence[str]) -> World:
    terrain = random_terrain(family, size_m=14.0, density=DENSITY[family], seed=seed)
    places = random_places(terrain.obstacles, stations=1, pois=6, seed=seed)
    return world_with(terrain.obstacles, places.base, places.pois, models, station=places.stations[0])


def rooms(*walls: tuple[float, float, float, float], wide: float = 12.0, high: float = 8.0) -> Obstacles:
    """A room with walls as boxes: x, y, half length, half width."""
    return Obstacles(bounds_m=np.array([0.0, 0, wide, high]), cylinders=np.empty((0, 3)),
                     boxes=np.array([(*wall, 0.0) for wall in walls], dtype=np.float64).reshape(-1, 5))


FOUR = ["turtlebot2"] * 4


@pytest.mark.spread(3)
@pytest.mark.parametrize("models", [FOUR, [SMALL, LARGE, "turtlebot2"]], ids=["alike", "of different sizes"])
@pytest.mark.parametrize("family", ["rooms", "aisles", "field", "maze"])
def test_berths_are_near_the_base_apart_and_clear_and_all_sites_are_reached(
    family: WorldFamily, models: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.ERROR)
    world = random_shared(family, 2, models)
    berths = place_berths(world)
    radius, base = max(robot.model.radius_m for robot in world.robots), (world.sites[0].x_m, world.sites[0].y_m)
    assert len(berths) == len(models)
    for berth in berths:
        assert np.hypot(berth[0] - base[0], berth[1] - base[1]) <= 3.0
        assert clearance(world.obstacles, *berth) >= radius + 0.12
        for site in world.sites[1:]:
            assert np.hypot(berth[0] - site.x_m, berth[1] - site.y_m) >= 2 * radius + 0.2
    for one, other in combinations(berths, 2):
        assert np.hypot(one[0] - other[0], one[1] - other[1]) >= 2 * radius + 0.2 + 0.12
    for number, robot in enumerate(world.robots):
        own = own_world(world, berths, number)
        times = plan_travel_times(own, robot.model)  # else UnreachableSite
        assert_allclose(times.path("base", "r1")[0], berths[number])
        assert own.sites[0].heading_rad == world.sites[0].heading_rad
        for neighbour, (x, y) in enumerate(berths):
            if neighbour == number:
                continue
            at = Obstacles(bounds_m=np.array([-99.0, -99, 99, 99]), boxes=np.empty((0, 5)),
                           cylinders=np.array([[x, y, 0.0]]))
            least = robot.model.radius_m + world.robots[neighbour].model.radius_m + 0.2 + 0.12
            for row in times.paths:
                for path in row:
                    assert path is None or path_clearance(at, path) >= least - 0.06 - 1e-6


def test_berths_are_the_same_every_time() -> None:
    assert place_berths(random_shared("rooms", 1, FOUR)) == place_berths(random_shared("rooms", 1, FOUR))


def test_a_robot_alone_has_the_base_itself_and_the_world_as_it_is(tmp_path: Path) -> None:
    world = world_of(tmp_path)
    alone = replace(world, robots=world.robots[:1])
    berths = place_berths(alone)
    assert berths == ((alone.sites[0].x_m, alone.sites[0].y_m),)
    assert own_world(alone, berths, 0) is alone


def test_berths_keep_farther_apart_where_localisation_is_uncertain() -> None:
    noise = Noise(localisation=LocalisationError(sd_m=0.1, sd_deg=0.0, length_m=0.5))
    sure = world_with(rooms(), (6, 4), [(1, 1), (11, 7)], FOUR)
    unsure = replace(sure, noise=noise)
    assert gap_of(unsure) == pytest.approx(0.2 + 3 * 2**0.5 * 0.1)
    least = [min(np.hypot(a[0] - b[0], a[1] - b[1]) for a, b in combinations(place_berths(world), 2))
             for world in (sure, unsure)]
    assert least[0] >= 0.354 + 0.2
    assert least[1] >= 0.354 + gap_of(unsure)


def test_a_base_in_a_doorway_leaves_the_doorway_free() -> None:
    # A wall at x = 6 with a door of 1 m about the base; whoever stood in it would shut off one side.
    obstacles = rooms((6, 1.75, 0.1, 1.75), (6, 6.25, 0.1, 1.75))
    world = world_with(obstacles, (6, 4), [(1, 1), (11, 7)], FOUR)
    berths = place_berths(world)
    assert min(abs(x - 6) for x, _ in berths) >= 0.4  # beside it, by the wall
    for number in range(4):
        plan_travel_times(own_world(world, berths, number), world.robots[number].model)


def test_no_room_for_berths_is_an_error_that_says_what_to_change() -> None:
    # The base is in a corridor 1 m wide: a robot that stands in it shuts it.
    obstacles = rooms((6, 1.75, 6, 1.75), (6, 6.25, 6, 1.75))
    world = world_with(obstacles, (6, 4), [(1, 4), (11, 4)], ["turtlebot2"] * 3)
    with pytest.raises(NoRoomForBerths, match=r"no room for 3 berths: .*none can stand .* move the base") as said:
        place_berths(world)
    assert str(pickle.loads(pickle.dumps(said.value))) == str(said.value)


def test_more_robots_than_there_is_room_for_are_refused_with_their_number() -> None:
    world = world_with(rooms(wide=4.0, high=4.0), (2, 2), [(0.6, 0.6)], ["turtlebot2"] * 30)
    with pytest.raises(NoRoomForBerths, match="no room for 30 berths") as said:
        place_berths(world)
    assert 3 <= said.value.found < 30


def test_robots_share_the_slots_of_a_station_by_number() -> None:
    world = world_with(rooms(), (2, 4), [(1, 1), (11, 7)], FOUR, station=(9, 4), slots=3)
    berths = place_berths(world)
    places = [(own.sites[1].x_m, own.sites[1].y_m) for own in (own_world(world, berths, k) for k in range(4))]
    assert places[0] == places[3] == (9, 4)
    for one, other in combinations(places[:3], 2):
        assert np.hypot(one[0] - other[0], one[1] - other[1]) >= 2 * 0.177 + 0.2 + 0.1
    for place in places:
        assert clearance(world.obstacles, *place) >= 0.297
        assert np.hypot(place[0] - 9, place[1] - 4) <= 1.5


def test_a_station_of_one_slot_stays_where_it_is() -> None:
    world = world_with(rooms(), (2, 4), [(1, 1)], FOUR, station=(9, 4))
    own = own_world(world, place_berths(world), 1)
    assert own.sites[1:] == world.sites[1:]
    assert_array_equal(own.obstacles.boxes, world.obstacles.boxes)
    assert len(own.obstacles.cylinders) == 3


@pytest.mark.parametrize("seed", [2, 3])
def test_distances_that_matter_are_exact_less_half_a_step(seed: int) -> None:
    obstacles = random_obstacles(seed)
    found, exact = near_field(obstacles, 1.2), field_of(obstacles)
    assert_allclose(np.minimum(found.distance_m, 1.2), np.minimum(exact.distance_m, 1.2), atol=1e-6)


def test_slots_in_a_dead_end_are_refused() -> None:
    # The station is at the end of a corridor 1 m wide: who stands before it shuts it.
    obstacles = rooms((9, 1.75, 3, 1.75), (9, 6.25, 3, 1.75))
    world = world_with(obstacles, (3, 4), [(1, 1)], FOUR, station=(11.3, 4), slots=2)
    with pytest.raises(NoRoomForSlots, match="r1: no room for 2 slots: of so many robots, 1 can stand") as said:
        own_world(world, place_berths(world), 1)
    assert str(pickle.loads(pickle.dumps(said.value))) == str(said.value)


def test_no_slot_is_behind_a_wall_beside_the_station() -> None:
    # A wall 0.4 m east of the station ends 0.5 m north of it: who drives round it is within 1.5 m all the time.
    world = world_with(rooms((9.4, 2.25, 0.02, 2.25)), (2, 4), [(1, 1), (11.5, 7)], FOUR, station=(9, 4), slots=4)
    berths = place_berths(world)
    places = np.array([(own.sites[1].x_m, own.sites[1].y_m) for own in (own_world(world, berths, k) for k in range(4))])
    for path, away in zip(plan_paths(world.obstacles, places, 0.29)[0][1:], np.hypot(*(places[1:] - places[0]).T),
                          strict=True):
        assert path is not None
        assert np.hypot(*np.diff(path, axis=0).T).sum() <= 1.5 * away + 0.1


WALLED_IN = (rooms((6, 1.75, 6, 1.75), (6, 6.25, 6, 1.75), (8, 4, 0.1, 0.6)), (4, 4))  # a corridor that is walled up


def test_a_site_that_nobody_reaches_is_told_before_berths_that_find_no_room() -> None:
    obstacles, base = WALLED_IN
    world = world_with(obstacles, base, [(1, 4), (11, 4)], ["turtlebot2"] * 3)
    with pytest.raises(UnreachableSite, match="no path from 'base' to 'p2'"):
        place_berths(world)


@pytest.mark.long
def test_a_site_that_nobody_reaches_is_told_before_slots_that_find_no_room() -> None:
    # The station is in a cell of its own, 1 m wide.
    obstacles = rooms((9, 4.6, 0.6, 0.1), (9, 3.4, 0.6, 0.1), (9.6, 4, 0.1, 0.7), (8.4, 4, 0.1, 0.7))
    world = world_with(obstacles, (3, 4), [(1, 1)], ["turtlebot2"] * 2, station=(9, 4), slots=2)
    with pytest.raises(UnreachableSite, match="no path from 'base' to 'r1'"):
        own_world(world, place_berths(world), 1)


def test_berths_that_narrow_the_only_door_are_told_of_with_its_width() -> None:
    def door_of(wide: float) -> World:
        deep = (8 - wide) / 4
        return world_with(rooms((6, deep, 0.1, deep), (6, 8 - deep, 0.1, deep)), (6, 4), [(1, 1), (11, 7)], FOUR)

    # Beside a door of 1.4 m stand robots 1.4 m apart, so that there is 1.05 m between their hulls.
    world = door_of(1.4)
    found = narrowed_by(world, place_berths(world))
    assert found is not None
    assert (found.one, found.other) == ("p1", "p2")
    assert found.with_m == pytest.approx(1.4 - 0.354, abs=0.1)
    assert found.with_m < found.without_m <= found.abreast_m == pytest.approx(1.15, abs=0.01)
    for wide in (0.8, 3.0):  # as narrow without them; as wide as two robots need with them
        assert narrowed_by(door_of(wide), place_berths(door_of(wide))) is None


def test_berths_in_an_open_place_narrow_no_way() -> None:
    world = world_with(rooms(), (6, 4), [(1, 1), (11, 7)], FOUR)
    assert narrowed_by(world, place_berths(world)) is None
    alone = replace(world, robots=world.robots[:1])
    assert narrowed_by(alone, place_berths(alone)) is None
