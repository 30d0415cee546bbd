"""Places for sites: connected to the base, apart from each other, and the same ones when there are more."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import label

from sva_bench.errors import BadFile
from sva_bench.geometry.buckets import clearances
from sva_bench.geometry.cells import Cells, distance_field
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.travel.times import plan_travel_times
from sva_bench.world.maps.ros import read_ros_map
from sva_bench.world.places import NoRoom, Point, field_of, find_places
from tests.oracles.worlds import random_obstacles
from tests.world.maps_for_tests import shared_map
from tests.worlds_for_tests import SITES, SMALL, world_of

RADIUS_M = 0.177
# A house with a free rim about it, two rooms joined by a door, and a closed closet.
HOUSE = """\
..............
.############.
.#....#..#..#.
.#.......#..#.
.#.......#..#.
.#....#..#..#.
.############.
.............."""


def grid(picture: str, cell_m: float = 0.5) -> Cells:
    rows = [[c == "#" for c in line] for line in picture.split()]
    return Cells(occupied=np.array(rows[::-1]), cell_m=cell_m, origin=np.zeros(3))


def place(field_or_cells: Cells, *, base: Point | None = None, stations: int = 2, pois: int = 3,
          spacing: float | None = 0.5, seed: int = 0) -> tuple[Point, list[Point], list[Point]]:
    found, _ = find_places(distance_field(field_or_cells), base=base, radius_m=RADIUS_M, stations=stations, pois=pois,
                           spacing_m=spacing, seed=seed)
    return found.base, list(found.stations), list(found.pois)


def test_the_base_is_in_the_middle_of_the_largest_room_that_walls_enclose() -> None:
    # The two rooms are columns 2 to 8, rows 2 to 5 from below: 1 to 4.5 m by 1 to 3 m. The rim is about as large.
    base, _, _ = place(grid(HOUSE))
    assert abs(base[0] - 2.75) < 0.5
    assert abs(base[1] - 2.0) < 0.5


def test_no_site_is_outside_the_walls_or_in_a_closed_closet() -> None:
    for seed in range(5):
        base, stations, pois = place(grid(HOUSE), seed=seed)
        for x, y in [base, *stations, *pois]:
            assert 1 < x < 4.5
            assert 1 < y < 3


def test_a_map_too_narrow_for_the_robot_has_no_room_for_a_base() -> None:
    # A corridor 0.4 m wide leaves 0.023 m on either side; a path keeps 0.03 m at least.
    with pytest.raises(NoRoom) as caught:
        place(grid("#######\n#.....#\n#######", 0.4))
    assert caught.value.kind == "base"


def test_a_map_without_outer_walls_has_its_base_in_the_middle_of_all() -> None:
    # A small closed closet is not the inside of a building.
    base, _, _ = place(grid("..........\n..........\n.####.....\n.#..#.....\n.####.....\n..........\n.........."))
    assert 1.5 < base[0] < 4.5


def test_each_station_is_the_farthest_place_by_path_length() -> None:
    # A U of corridors 1 m wide: from the left end, the farthest is the right end, though it is near across the wall.
    cells = grid("###########\n#..#######.\n#..####..#.\n#..####..#.\n#........#.\n#........##\n###########".replace(
        ".\n", "#\n"))
    _, (first,), _ = place(cells, base=(1.0, 2.5), stations=1, pois=0)
    assert first[0] > 3.5
    assert first[1] > 1.9


def test_more_sites_leave_the_first_where_they_are() -> None:
    cells = grid(HOUSE, 1.0)
    base, stations, pois = place(cells, stations=2, pois=4)
    assert place(cells, stations=2, pois=7) == (base, stations, place(cells, stations=2, pois=7)[2])
    assert place(cells, stations=2, pois=7)[2][:4] == pois
    assert place(cells, stations=4, pois=0)[1][:2] == stations


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_places_keep_their_distances_and_are_connected(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells = Cells(occupied=rng.random((24, 24)) < 0.2, cell_m=0.7,
                  origin=np.array([3.0, -2.0, rng.choice([0.0, 0.5])]))
    field = distance_field(cells)
    try:
        found, spacing = find_places(field, base=None, radius_m=RADIUS_M, stations=2, pois=5, spacing_m=None, seed=seed)
    except NoRoom:
        return
    places = np.array([found.base, *found.stations, *found.pois])
    rooms, _ = label(field.distance_m >= RADIUS_M + 0.03)
    at = field.index_of(places)
    assert len(set(rooms[at[:, 0], at[:, 1]].tolist())) == 1
    assert rooms[at[0, 0], at[0, 1]] > 0
    gaps = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) + 100 * np.eye(len(places))
    assert gaps[3:].min() >= spacing
    assert gaps.min() > 0.2


@settings(max_examples=4)
@given(st.integers(0, 1000))
def test_distances_on_a_lattice_over_shapes_are_never_too_large(seed: int) -> None:
    obstacles = random_obstacles(seed)
    field = field_of(obstacles)
    rng = np.random.default_rng(seed)
    rows, columns = (int(n) for n in field.distance_m.shape)
    index = np.column_stack([rng.integers(0, rows, 200), rng.integers(0, columns - 1, 200)])
    along = index + np.array([0, 1])
    here, beside = field.places(index), field.places(along)
    nearer = np.minimum(*(field.distance_m[i[:, 0], i[:, 1]] for i in (index, along)))
    between = here + rng.random((200, 1)) * (beside - here)
    assert (nearer <= np.maximum(clearances(obstacles, between), 0) + 1e-5).all()


PLACED = SMALL.replace(SITES, """\
  stations: {spread: 2, stop_s: 4}
  pois: {random: 4, seed: 7, min_spacing_m: 0.8}
""")


def test_a_world_of_shapes_may_leave_its_sites_to_us(tmp_path: Path) -> None:
    world = world_of(tmp_path, PLACED)
    assert [site.name for site in world.sites] == ["base", "r1", "r2", "p1", "p2", "p3", "p4"]
    assert [site.stop_s for site in world.stations] == [4, 4]
    assert world.robots[0].incentives == {"p1": 10, "p2": 20, "p3": 30, "p4": 40}
    plan_travel_times(world, world.robots[0].model)
    assert [(s.x_m, s.y_m) for s in world_of(tmp_path, PLACED).sites] == [(s.x_m, s.y_m) for s in world.sites]
    others = world_of(tmp_path, PLACED.replace("seed: 7", "seed: 8"))
    assert [(s.x_m, s.y_m) for s in others.stations] == [(s.x_m, s.y_m) for s in world.stations]
    assert [(s.x_m, s.y_m) for s in others.pois] != [(s.x_m, s.y_m) for s in world.pois]


def test_placed_sites_keep_their_distance_from_those_in_the_file(tmp_path: Path) -> None:
    world = world_of(tmp_path, PLACED.replace("{spread: 2, stop_s: 4}", "{depot: {at_m: [3.2, 5.2]}}"))
    (depot,) = world.stations
    assert depot.name == "depot"
    assert min(math.dist((depot.x_m, depot.y_m), (s.x_m, s.y_m)) for s in world.pois) >= 0.8


def test_more_stations_than_fit_are_refused() -> None:
    room = Obstacles(bounds_m=np.array([0.0, 0.0, 3.0, 3.0]), boxes=np.empty((0, 5)), cylinders=np.empty((0, 3)))
    with pytest.raises(NoRoom, match=r"stations that a robot reaches .* keep 0\.5 m") as caught:
        find_places(field_of(room), base=(1.5, 1.5), radius_m=0.2, stations=100, pois=0, spacing_m=0.8, seed=0)
    assert 4 < caught.value.found < 100


@pytest.mark.parametrize(("old", "new", "key", "says"), [
    ("random: 4", "random: 400", "sites.pois", "POIs that a robot reaches from the base and that keep 0.8 m"),
    # Stations keep their own distance: what is asked of POIs is no matter of theirs.
    ("min_spacing_m: 0.8", "min_spacing_m: 6", "sites.pois", "no POIs .* keep 6 m .* a smaller min_spacing_m"),
    ("random: 4, seed: 7", "random: 4", "sites.pois.seed", "the key 'seed' is missing"),
    ("random: 4", "random: many", "sites.pois.random", "expected an integer"),
    ("random: 4", "random: 4, spacing: 1", "sites.pois.spacing", "unknown key 'spacing'; did you mean 'min_spacing_m'"),
    ("spread: 2", "spread: 0", "sites.stations.spread", "expected at least 1"),
    ("[0.8, 0.8]", "[0.1, 0.8]", "sites.base.at_m", "doesn't fit there"),
    ("{p1: 10,", "{p5: 10,", "robots.uv1.incentives.p5", "there is no POI 'p5'"),
    ("{random: 4, seed: 7, min_spacing_m: 0.8}", "{random: {at_m: [2.2, 0.8]}, p1: {x: 1, y: 2}}", "sites.pois.p1.x",
     "unknown key 'x'"),
])
def test_an_error_in_placed_sites_names_its_key(tmp_path: Path, old: str, new: str, key: str, says: str
                                                            ) -> None:
    assert old in PLACED
    with pytest.raises(BadFile, match=says) as caught:
        world_of(tmp_path, PLACED.replace(old, new))
    assert caught.value.key == key
    assert caught.value.line is not None


def test_no_site_is_beyond_the_outer_wall_of_the_papers_map() -> None:
    path = shared_map("ros/turtlebot_stage/maze.yaml")
    cells, _ = read_ros_map(path.parent, path.name)
    # What a point reaches from the rim, at the level of cells: the outside of the outer wall.
    parts, _ = label(~cells.occupied)
    outside = set(parts[[0, -1]].ravel().tolist() + parts[:, [0, -1]].ravel().tolist()) - {0}
    assert outside
    for seed in range(3):
        base, stations, pois = place(cells, stations=5, pois=20, spacing=None, seed=seed)
        column, row = np.floor(np.array([base, *stations, *pois]) / cells.cell_m).astype(int).T
        inside = set(parts[row, column].tolist())
        assert len(inside) == 1
        assert not inside & (outside | {0})
