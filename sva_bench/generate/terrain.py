"""Random terrain with sites: rooms, a field, aisles or a maze, whose free space is connected for any built-in robot.

That holds by construction. Walls leave doors, or are those of a maze without closed cells; whatever else stands there
keeps a passage free around itself, so it disconnects nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import WorldFamily
from sva_bench.errors import BadInput
from sva_bench.files.printable import counted
from sva_bench.generate.mazes import maze_walls
from sva_bench.generate.rooms import room_walls
from sva_bench.geometry.distances import clearance, segment_distance
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.seeds import Stream, key_of, rng_for
from sva_bench.world.load import obstacles_of
from sva_bench.world.places import Places, Point
from sva_bench.world.schema import Shapes

Shape = Mapping[str, Any]
"""An obstacle as it stands in a world file."""

DENSITY: dict[WorldFamily, float] = {"rooms": 0.06, "field": 0.1, "aisles": 0.2, "maze": 0.8}
"""Density unless another is asked for. Of a maze, the share of the walls of one without loops; else of the area."""

PASSAGE_M = 0.8
"""Between things that don't touch: twice the widest built-in robot's radius and the 0.12 m paths keep, and more."""
SITE_ROOM_M = 0.45
"""From a site to the nearest obstacle: the widest built-in robot's radius, the 0.12 m that paths keep, and more."""
APART_M = 1.0
"""Between two sites, at least."""

_USUAL_M = 18.0  # side of a world whose rooms, racks and obstacles are of usual size; in larger ones they grow
_FURNITURE = 0.85  # size of furniture in that of obstacles in a field
_WALL_M = 0.2
_GRID_M = 0.1  # coordinates that people can read
_FULL = 0.3  # share of the area above which scattered things never leave passages
_FAILED = 25  # obstacles that found no place, after which there is none for more
_MISSING = 0.01  # share of the density that may be missing, for rounding
_TRIES = 400  # places tried for one obstacle, and for one site
_STREAMS = {"terrain": 0, "sites": 1}


@dataclass(frozen=True, eq=False, kw_only=True)
class Terrain:
    """Bounds and obstacles, as a world file describes them.

    Attributes:
        bounds_m: x_min, y_min, x_max, y_max.
        shapes: The obstacles.
        remarks: What to say above an obstacle, by its number.
    """

    bounds_m: tuple[float, float, float, float]
    shapes: tuple[Shape, ...]
    remarks: Mapping[int, str]

    @property
    def obstacles(self) -> Obstacles:
        """The same as arrays."""
        return _obstacles(self.bounds_m, self.shapes)


def random_terrain(family: WorldFamily, *, size_m: float, density: float, seed: int) -> Terrain:
    """Terrain of a family.

    Args:
        family: What stands there: walls with doors and furniture, scattered obstacles, racks, or a maze.
        size_m: Side of the square.
        density: Share of the area that furniture, obstacles or racks cover; of a maze, share of the walls of one
            without loops that are left standing.
        seed: Seed; each family, size and density draws otherwise from it.

    Raises:
        BadInput: If the density is too high for passages between the obstacles.
    """
    which = key_of(family, repr(float(size_m)), repr(float(density)))
    rng = rng_for(seed, Stream.RANDOM_WORLD, _STREAMS["terrain"], *which)
    scale = math.sqrt(max(size_m / _USUAL_M, 1.0))
    bounds = (0.0, 0.0, size_m, size_m)
    if family == "maze":
        if density > 1:
            raise BadInput(f"a density of {density:g} does not fit a maze: at 1 all the walls stand that leave no "
                           "place closed; choose at most 1")
        return Terrain(bounds_m=bounds, shapes=_walls(maze_walls(size_m, 3.0 * scale, density, rng)), remarks={
            0: "walls"})
    if family == "aisles":
        return Terrain(bounds_m=bounds, shapes=_racks(size_m, density, scale, rng), remarks={0: "racks"})
    walls = _walls(room_walls(size_m, 4.2 * scale, rng)) if family == "rooms" else ()
    scattered = _scattered(bounds, walls, density * size_m**2, scale * (_FURNITURE if walls else 1.0), rng)
    covered = sum(map(_area_m2, scattered)) / size_m**2
    if density - covered > _MISSING:
        raise BadInput(f"a density of {density:g} does not fit {'rooms' if walls else 'a field'} of {size_m:g} m with "
                       f"passages of {PASSAGE_M:g} m between the obstacles: there was no more room at {covered:.2f}; "
                       "choose a lower one")
    remarks = {0: "inner walls, with doors"} if walls else {}
    if scattered and walls:
        remarks[len(walls)] = "furniture"
    return Terrain(bounds_m=bounds, shapes=(*walls, *scattered), remarks=remarks)


def random_places(obstacles: Obstacles, *, stations: int, pois: int, seed: int) -> Places:
    """Places for a base near a corner, and for stations and POIs spread over the terrain.

    Raises:
        BadInput: If there is no room for so many.
    """
    rng = rng_for(seed, Stream.RANDOM_WORLD, _STREAMS["sites"], *obstacles.key())
    x0, y0, x1, y1 = obstacles.bounds_m.tolist()
    corner = ((x0, y0), (x1, y0), (x0, y1), (x1, y1))[int(rng.integers(4))]
    found: list[Point] = []

    def near_corner(place: Point) -> float:
        return -math.dist(place, corner)

    def far_from_others(place: Point) -> float:
        return min(math.dist(place, other) for other in found)

    def add(worth: Callable[[Point], float], candidates: int) -> None:
        best: Point | None = None
        for _ in range(candidates):
            place = _free_place(obstacles, found, rng)
            if place is not None and (best is None or worth(place) > worth(best)):
                best = place
        if best is None:
            raise BadInput(f"{counted(stations, 'station')} and {pois} POIs do not fit: there is room for "
                           f"{counted(len(found), 'site')} that keep {APART_M:g} m from each other and {SITE_ROOM_M:g} "
                           "m from obstacles; choose fewer, or a larger or emptier world")
        found.append(best)

    # Of a few places the one farthest from all others: sites spread out without standing in a grid.
    add(near_corner, 40)
    for _ in range(stations):
        add(far_from_others, 20)
    for _ in range(pois):
        add(far_from_others, 6)
    return Places(base=found[0], stations=tuple(found[1:stations + 1]), pois=tuple(found[stations + 1:]))


def _free_place(obstacles: Obstacles, others: Sequence[Point], rng: np.random.Generator) -> Point | None:
    """A random place with room for a robot and away from others; ``None`` if none turns up."""
    low, high = obstacles.bounds_m[:2], obstacles.bounds_m[2:]
    for _ in range(_TRIES):
        x, y = (_to_grid(value) for value in rng.uniform(low, high))
        if all(math.dist((x, y), other) >= APART_M for other in others) and clearance(obstacles, x, y) >= SITE_ROOM_M:
            return x, y
    return None


def _walls(lines: Sequence[tuple[Point, Point]]) -> tuple[Shape, ...]:
    return tuple({"wall": [list(a), list(b)], "thickness_m": _WALL_M} for a, b in lines)


def _racks(size_m: float, density: float, scale: float, rng: np.random.Generator) -> tuple[Shape, ...]:
    """Rows of racks, cut by cross aisles; a rack is missing here and there.

    Rows are as many as fit the density best; what rounding leaves is made up by the racks' depth.
    """
    edge, cross, narrowest = 1.4 * scale, 1.6 * scale, 1.2 * math.sqrt(scale)
    cuts = int(rng.integers(1, max(round(size_m / scale / 8), 1) + 1))
    length = _to_grid((size_m - 2 * edge - cuts * cross) / (cuts + 1))
    wanted_m2, depth = density * size_m**2, float(rng.uniform(0.7, 1.1)) * scale
    ideal = wanted_m2 / (depth * length * (cuts + 1))
    missing = rng.random((200, cuts + 1)) < 0.1
    missing[:, int(rng.integers(cuts + 1))] = False  # each row keeps a rack
    turned = bool(rng.random() < 0.5)
    for rows in sorted(range(1, 200), key=lambda rows: (abs(rows - ideal), rows)):
        racks = int((~missing[:rows]).sum())
        deep = round(wanted_m2 / (racks * length), 2)
        aisle = (size_m - rows * deep) / (rows + 1)
        if length >= 1 and 0.3 <= deep <= 2.4 * scale and aisle >= narrowest:
            break
    else:
        raise BadInput(f"a density of {density:g} does not fit aisles of {size_m:g} m: racks are 0.3 to "
                       f"{2.4 * scale:.1f} m deep, and aisles at least {narrowest:.1f} m wide; choose a "
                       f"{'lower' if ideal > 1 else 'higher'} one")
    shapes = []
    for row in range(rows):
        across = _rounded(aisle + row * (deep + aisle) + deep / 2)
        for bay in range(cuts + 1):
            along = _rounded(edge + bay * (length + cross) + length / 2)
            if not missing[row, bay]:
                shapes.append({"box": [across, along] if turned else [along, across],
                               "size_m": [deep, length] if turned else [length, deep]})
    return tuple(shapes)


def _scattered(
    bounds: tuple[float, float, float, float], walls: Sequence[Shape], area_m2: float, scale: float,
    rng: np.random.Generator,
) -> tuple[Shape, ...]:
    """Boxes and posts that cover an area, each with a passage all around; less where no more fit."""
    area_m2 = min(area_m2, _FULL * (bounds[2] - bounds[0]) * (bounds[3] - bounds[1]))
    drawn: list[Shape] = []
    while (left := area_m2 - sum(map(_area_m2, drawn))) > 0.1:
        drawn.append(_random_shape(left, scale, rng))
    remaining = sorted(drawn, key=_area_m2, reverse=True)  # the large ones while there is room
    placed: list[Shape] = []
    failed = 0
    while remaining:
        obstacles = _obstacles(bounds, [*walls, *placed])
        shape = remaining.pop(0)
        for _ in range(_TRIES):
            at = [_to_grid(value) for value in rng.uniform(bounds[:2], bounds[2:])]
            moved = {**shape, next(iter(shape)): at}
            if _gap_m(obstacles, moved) >= PASSAGE_M:
                placed.append(moved)
                break
        else:  # two of half its size replace it, unless they would be too small or too many tries failed
            failed += 1
            if _area_m2(shape) < 0.2 or failed == _FAILED:
                break
            remaining = sorted([*remaining, *_halves(shape)], key=_area_m2, reverse=True)
    return tuple(sorted(placed, key=lambda shape: ("cylinder" in shape, -_area_m2(shape))))


def _random_shape(most_m2: float, scale: float, rng: np.random.Generator) -> Shape:
    """A random box or post of at most about a given area."""
    radius = _rounded(float(rng.uniform(0.3, 0.7)) * scale, 0.05)
    size = [_rounded(float(rng.uniform(*sides)) * scale, 0.1) for sides in ((0.8, 2.6), (0.6, 1.6))]
    yaw = 5 * int(rng.integers(-17, 19))
    post = bool(rng.random() < 0.4)
    shape: Shape = {"cylinder": [0.0, 0.0], "radius_m": radius} if post else {
        "box": [0.0, 0.0], "size_m": size, "yaw_deg": yaw}
    if _area_m2(shape) > most_m2 + 0.2:
        shape = {"cylinder": [0.0, 0.0], "radius_m": max(_rounded(math.sqrt(most_m2 / math.pi), 0.05), 0.1)}
    return shape


def _halves(shape: Shape) -> tuple[Shape, Shape]:
    """Two shapes of half the area each, but for rounding."""
    if "cylinder" in shape:
        half = {**shape, "radius_m": _rounded(shape["radius_m"] / math.sqrt(2))}
    else:
        long, short = max(shape["size_m"]), min(shape["size_m"])
        half = {**shape, "size_m": [_rounded(long / 2), short]}
    return half, half


def _area_m2(shape: Shape) -> float:
    if "cylinder" in shape:
        return float(math.pi * shape["radius_m"] ** 2)
    return float(shape["size_m"][0] * shape["size_m"][1])


def _gap_m(obstacles: Obstacles, shape: Shape) -> float:
    """Distance from a shape to the nearest obstacle or outer wall [m], exact where it is a passage."""
    if "cylinder" in shape:
        return clearance(obstacles, *shape["cylinder"]) - float(shape["radius_m"])
    (x, y), (length, width), yaw = shape["box"], shape["size_m"], math.radians(shape["yaw_deg"])
    upper_bound = clearance(obstacles, x, y) - float(min(length, width)) / 2
    if upper_bound < PASSAGE_M:
        return upper_bound  # no exact distance, but an upper bound, and too little
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    half = np.array([[length, width], [-length, width], [-length, -width], [length, -width]]) / 2
    corners: FloatArray = half @ turn.T + (x, y)
    o = obstacles
    return min(float(segment_distance(o.bounds_m, o.boxes, o.cylinders, *a, *b, -math.inf))
               for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True))


def _obstacles(bounds: tuple[float, float, float, float], shapes: Sequence[Shape]) -> Obstacles:
    return obstacles_of(Shapes.model_validate({"bounds_m": list(bounds), "obstacles": [dict(s) for s in shapes]}))


def _to_grid(value: float) -> float:
    return _rounded(value, _GRID_M)


def _rounded(value: float, step: float = 0.01) -> float:
    """The nearest multiple of a step, without floating-point residue."""
    return round(round(value / step) * step, 6)
