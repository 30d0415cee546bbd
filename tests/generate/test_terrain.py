"""Random terrain and places for sites."""

from __future__ import annotations

from itertools import combinations
from typing import get_args

import numpy as np
import pytest

from sva_bench.choices import WorldFamily
from sva_bench.errors import BadInput
from sva_bench.generate.mazes import maze_walls
from sva_bench.generate.rooms import room_walls
from sva_bench.generate.terrain import APART_M, DENSITY, PASSAGE_M, SITE_ROOM_M, random_places, random_terrain
from sva_bench.travel.roadmap import surely_disconnected
from tests.oracles.distances import points_clearance, segment_clearance

FAMILIES: tuple[WorldFamily, ...] = get_args(WorldFamily)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("seed", [0, 1])
def test_all_free_places_hang_together_and_sites_have_room(family: WorldFamily, seed: int) -> None:
    obstacles = random_terrain(family, size_m=15, density=DENSITY[family], seed=seed).obstacles
    places = random_places(obstacles, stations=3, pois=12, seed=seed)
    sites = np.array([places.base, *places.stations, *places.pois])
    assert (points_clearance(obstacles, sites) >= SITE_ROOM_M - 1e-9).all()
    assert min(np.hypot(*(a - b)) for a, b in combinations(sites, 2)) >= APART_M - 1e-9
    # Anywhere that the widest built-in robot (0.22 m, paths 0.12 m off) has room, not the sites alone.
    anywhere = np.random.default_rng(seed).uniform(0, 15, (500, 2))
    free = anywhere[points_clearance(obstacles, anywhere) >= PASSAGE_M / 2]
    assert not surely_disconnected(obstacles, np.concatenate([sites, free]), 0.34).any()


@pytest.mark.parametrize("family", ["rooms", "field", "aisles"])
def test_density_is_the_share_of_the_area_that_is_covered(family: WorldFamily) -> None:
    terrain = random_terrain(family, size_m=20, density=0.08, seed=3)
    things = [shape for shape in terrain.shapes if "wall" not in shape]
    covered = sum(np.prod(s["size_m"]) if "box" in s else np.pi * s["radius_m"] ** 2 for s in things)
    assert covered / 400 == pytest.approx(0.08, abs=0.01)  # sizes are rounded to the decimetre


def test_scattered_obstacles_leave_a_passage_all_around() -> None:
    obstacles = random_terrain("field", size_m=12, density=0.12, seed=5).obstacles
    posts = obstacles.cylinders
    assert len(posts) > 1
    for one, other in combinations(posts, 2):
        assert np.hypot(*(one[:2] - other[:2])) - one[2] - other[2] >= PASSAGE_M - 1e-9
    for x, y, radius in posts:  # boxes by way of an independent distance
        boxes_only = type(obstacles)(bounds_m=obstacles.bounds_m, boxes=obstacles.boxes, cylinders=np.empty((0, 3)))
        assert segment_clearance(boxes_only, np.array([x, y]), np.array([x, y])) - radius >= PASSAGE_M - 1e-9


def test_a_maze_at_density_1_has_the_walls_of_one_without_loops() -> None:
    # 5 x 5 cells have 40 inner borders; a tree over 25 cells opens 24 and leaves 16 walls of 3 m.
    def length(density: float) -> float:
        lines = maze_walls(15.0, 3.0, density, np.random.default_rng(0))
        return float(sum(np.hypot(b[0] - a[0], b[1] - a[1]) for a, b in lines))

    assert length(1.0) == pytest.approx(16 * 3)
    assert length(0.5) == pytest.approx(8 * 3)
    assert length(0.0) == 0


def test_each_room_has_a_door_of_a_metre_at_least() -> None:
    lines = room_walls(20.0, 4.0, np.random.default_rng(1))
    assert lines
    by_line: dict[tuple[int, float], list[tuple[float, float]]] = {}
    for (ax, ay), (bx, by) in lines:
        by_line.setdefault((0, ax) if ax == bx else (1, ay), []).append((ay, by) if ax == bx else (ax, bx))
    gaps = [later[0] - earlier[1] for pieces in by_line.values()
            for earlier, later in zip(sorted(pieces), sorted(pieces)[1:], strict=False) if later[0] > earlier[1]]
    assert gaps
    assert min(gaps) >= 1.1 - 1e-9


@pytest.mark.parametrize("family", FAMILIES)
def test_the_same_seed_gives_the_same_terrain_and_another_another(family: WorldFamily) -> None:
    def shapes(seed: int) -> object:
        return random_terrain(family, size_m=12, density=DENSITY[family], seed=seed).shapes

    assert shapes(4) == shapes(4)
    assert shapes(4) != shapes(5)


def test_a_density_that_does_not_fit_is_refused() -> None:
    with pytest.raises(BadInput, match=r"no more room at 0\.\d\d; choose a lower one"):
        random_terrain("field", size_m=10, density=0.8, seed=0)
    with pytest.raises(BadInput, match=r"aisles of 12 m.*choose a lower one"):
        random_terrain("aisles", size_m=12, density=0.7, seed=0)
    with pytest.raises(BadInput, match="choose a higher one"):
        random_terrain("aisles", size_m=12, density=0.0, seed=0)


def test_sites_that_do_not_fit_are_refused() -> None:
    obstacles = random_terrain("field", size_m=10, density=0.1, seed=0).obstacles
    with pytest.raises(BadInput, match=r"5 stations and 300 POIs do not fit: there is room for \d+ sites"):
        random_places(obstacles, stations=5, pois=300, seed=0)
