"""Places for sites on any ground: in the connected free region about a base, spread out or drawn at random.

All of it happens on a lattice, the half cells of an occupancy grid or a fine one laid over shapes: whatever is
connected on it can be driven, so no place lies beyond an outer wall that the base is inside of.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.spatial.distance import cdist

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.geometry.buckets import clearances
from sva_bench.geometry.cells import Cells, DistanceField, connected_region, distance_field
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.seeds import Stream, rng_for

Point = tuple[float, float]

CLEARANCE_MARGINS_M = (0.12, 0.06, 0.03)
"""Distance to obstacles that paths keep beyond the robot's radius; the first that connects all sites.

The follower cuts gentle corners by up to 0.05 m and tracks to 0.01 m: at 0.12 m no robot touches anything.
"""

APART_M = 0.5
"""Least distance from one placed site to another, where nothing else is asked for."""

_SURE_M = 2e-3  # places are rounded to millimetres, and the roadmap goes about corners in polygons
_FINEST_M, _PLACES = 0.05, 1_000_000  # finest lattice over shapes, and about how many places of it at most
_ENCLOSED = 0.25  # share of the largest free region from which on an enclosed one is taken for the inside of a building
_WORTH_SAYING = 0.05  # share of its region from which on a base outside an enclosed one is pointed out
_LOOSE, _TIGHTER, _CLOSEST_M = 0.8, 0.85, 0.25  # spacing tried first, in that of a square grid; then so much less
_CHUNK = 4096  # places looked at together


@dataclass(frozen=True, kw_only=True)
class Places:
    """Where the sites are [m]."""

    base: Point
    stations: tuple[Point, ...]
    pois: tuple[Point, ...]


class NoRoom(ValueError):
    """Sites that found no place."""

    def __init__(self, kind: Literal["base", "stations", "pois"], found: int, spacing_m: float) -> None:
        super().__init__(kind, found, spacing_m)
        self.kind, self.found, self.spacing_m = kind, found, spacing_m

    def __str__(self) -> str:
        if self.kind == "base":
            return "there is no room for a robot anywhere"
        what = "POIs" if self.kind == "pois" else "stations"
        return (f"there is room for {self.found or 'no'} {what} that a robot reaches from the base and that keep "
                f"{self.spacing_m:g} m from other sites")


def field_of(obstacles: Obstacles) -> DistanceField:
    """Distances on a lattice, between whose neighbours nothing is nearer than at the nearer of the two."""
    if obstacles.cells is not None:
        return distance_field(obstacles.cells)
    x0, y0, x1, y1 = obstacles.bounds_m.tolist()
    step = max(_FINEST_M, math.sqrt((x1 - x0) * (y1 - y0) / _PLACES))
    rows, columns = (max(math.ceil(length / (2 * step)), 1) for length in (y1 - y0, x1 - x0))
    frame = Cells(occupied=np.zeros((rows, columns), dtype=np.bool_), cell_m=2 * step, origin=np.array([x0, y0, 0.0]))
    shape = (2 * rows + 1, 2 * columns + 1)
    lattice = DistanceField(cells=frame, distance_m=np.zeros(shape, dtype=np.float32))
    index = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1).reshape(-1, 2)
    # Halfway to a neighbour it may be nearer by half a step.
    distance = np.maximum(clearances(obstacles, lattice.places(index)) - step / 2, 0.0)
    return DistanceField(cells=frame, distance_m=distance.reshape(shape).astype(np.float32))


def find_places(
    field: DistanceField, *, base: Point | None, radius_m: float, stations: int, pois: int, spacing_m: float | None,
    seed: int, others: Sequence[Point] = (), key: tuple[int, ...] = (),
) -> tuple[Places, float]:
    """Places in the connected free region about the base that a robot reaches, keeping as far from obstacles as can be.

    Stations are each the farthest from base and stations before it, by path length; POIs are drawn. So more of
    either leaves the first where they are.

    Args:
        field: The ground.
        base: The base; ``None`` = near the middle of the largest enclosed region.
        radius_m: Radius of the robot.
        stations, pois: How many.
        spacing_m: Least distance from one POI to the next and to all other sites; ``None`` = as wide as it easily goes.
            Stations keep no more than the usual distance from what was there before them.
        seed: Seed of the POIs.
        others: Sites that stand already, beside the base.
        key: Index of the stream that POIs are drawn from: of the map, where maps are to be independent samples.

    Returns:
        The places; and the spacing.

    Raises:
        NoRoom: If they don't fit.
    """
    missing = NoRoom("base", 0, 0.0)
    for margin in CLEARANCE_MARGINS_M:
        needed = radius_m + margin + _SURE_M
        here = _middle(field, needed) if base is None else base
        if here is None:
            continue
        region = _region_about(field, here, needed)
        if not region.any():
            continue
        area = float(region.sum()) * (field.cells.cell_m / 2) ** 2
        widest = _LOOSE * math.sqrt(area / (1 + stations + pois + len(others)))
        try:
            spread = _spread(field, region, stations, [here, *others],
                             _CLOSEST_M if spacing_m is None else min(spacing_m, APART_M))
            candidates = np.argwhere(region)
            candidates = candidates[rng_for(seed, Stream.DRAWN_PLACES, *key).permutation(len(candidates))]
            for spacing in _spacings(widest) if spacing_m is None else [spacing_m]:
                drawn = _drawn(field, candidates, pois, [here, *others, *spread], spacing)
                if len(drawn) == pois:
                    return Places(base=here, stations=spread, pois=drawn), spacing
            raise NoRoom("pois", len(drawn), spacing)
        except NoRoom as error:
            if (error.kind == "pois", error.found) >= (missing.kind == "pois", missing.found):
                missing = error
    raise missing


def _spacings(widest_m: float) -> list[float]:
    """Spacings to try one after the other, in steps of 0.05 m."""
    tried = [max(widest_m, _CLOSEST_M)]
    while tried[-1] > _CLOSEST_M:
        tried.append(max(tried[-1] * _TIGHTER, _CLOSEST_M))
    return [round(math.floor(spacing / 0.05 + 1e-9) * 0.05, 2) for spacing in tried]


def enclosed_beside(field: DistanceField, base: Point, radius_m: float) -> tuple[float, Point] | None:
    """An enclosed region beside that of a base which reaches the grid's rim: the base may be outside of all walls.

    Returns:
        Area of the largest one [m2], and a place near its middle; ``None`` if the base is enclosed itself, or all that
        is enclosed is small beside its region.
    """
    needed = radius_m + CLEARANCE_MARGINS_M[0] + _SURE_M
    parts, sizes, enclosed = _regions(field, needed)
    row, column = field.index_of(np.array([base]))[0].tolist()
    mine = int(parts[row, column])
    if mine == 0 or enclosed[mine] > 0 or enclosed.max() < _WORTH_SAYING * sizes[mine]:
        return None
    return float(enclosed.max()) * (field.cells.cell_m / 2) ** 2, _near_middle(field, parts == int(enclosed.argmax()))


def _middle(field: DistanceField, needed_m: float) -> Point | None:
    """The place nearest to the middle of the largest region that is enclosed by more than the grid's rim.

    What reaches the rim is the outside of a building's walls, unless all that is enclosed is small beside it.
    """
    parts, sizes, enclosed = _regions(field, needed_m)
    if not sizes.any():
        return None
    best = int(np.argmax(enclosed if enclosed.max() >= _ENCLOSED * sizes.max() else sizes))
    return _near_middle(field, parts == best)


def _near_middle(field: DistanceField, region: BoolArray) -> Point:
    index = np.argwhere(region)
    nearest = int(np.argmin(((index - index.mean(axis=0)) ** 2).sum(axis=1)))
    return _points(field, index[nearest:nearest + 1])[0]


def _regions(field: DistanceField, needed_m: float) -> tuple[NDArray[np.int32], IntArray, IntArray]:
    """Connected regions with so much room, by number from 1; their sizes; and those of the enclosed, 0 for others."""
    roomy = field.distance_m >= needed_m
    found, count = label(roomy)
    parts: NDArray[np.int32] = found.astype(np.int32, copy=False)
    sizes: IntArray = np.bincount(parts.ravel(), minlength=count + 1).astype(np.int64)
    sizes[0] = 0
    # A wall along the rim is a cell thick at least, which is two steps.
    width = math.floor(needed_m / (field.cells.cell_m / 2) + 1.5) + 1
    inner = np.zeros(parts.shape, dtype=np.bool_)
    inner[width:-width, width:-width] = True
    enclosed = sizes.copy()
    enclosed[np.unique(parts[~inner])] = 0
    return parts, sizes, enclosed


def _region_about(field: DistanceField, base: Point, needed_m: float) -> BoolArray:
    """Places that are connected to the base; none if there is too little room about it."""
    row, column = field.index_of(np.array([base]))[0].tolist()
    rows, columns = field.distance_m.shape
    # The nearest place may have less room than the base has, but not all places about it.
    around = [(r, c) for r in range(max(row - 1, 0), min(row + 2, rows)) for c in range(
        max(column - 1, 0), min(column + 2, columns)) if field.distance_m[r, c] >= needed_m]
    if not around:
        return np.zeros(field.distance_m.shape, dtype=np.bool_)
    places = field.places(np.array(around))
    start = places[int(np.argmin(np.hypot(*(places - np.array(base)).T)))]
    return connected_region(field, start, needed_m)


def _spread(
    field: DistanceField, region: BoolArray, count: int, taken: Sequence[Point], spacing_m: float
) -> tuple[Point, ...]:
    """Places that are each the farthest, by path length, from what is taken and from those before it."""
    if count == 0:
        return ()
    step = field.cells.cell_m / 2
    steps = np.full(region.shape, np.iinfo(np.int32).max, dtype=np.int32)
    found: list[Point] = []
    for row, column in _inside(field, region, taken):
        _reach(region, steps, row, column)
    for _ in range(count):
        row, column = map(int, np.unravel_index(int(np.argmax(np.where(region, steps, -1))), region.shape))
        if not region[row, column] or steps[row, column] * step < spacing_m:
            raise NoRoom("stations", len(found), spacing_m)
        found += _points(field, np.array([[row, column]]))
        _reach(region, steps, row, column)
    return tuple(found)


def _inside(field: DistanceField, region: BoolArray, places: Sequence[Point]) -> list[tuple[int, int]]:
    """The places of the region that are nearest to some points; none for points that are not by it."""
    found = []
    for point in places:
        row, column = field.index_of(np.array([point]))[0].tolist()
        near = [(r, c) for r in range(max(row - 1, 0), row + 2) for c in range(max(column - 1, 0), column + 2)
                if r < region.shape[0] and c < region.shape[1] and region[r, c]]
        found += near[:1]
    return found


@njit(cache=True)  # type: ignore[untyped-decorator]
def _reach(region: BoolArray, steps: NDArray[np.int32], row: int, column: int) -> None:
    """Lower the least number of steps to each place to that from one place more."""
    queue = np.empty((region.size, 2), dtype=np.int32)
    queue[0, 0], queue[0, 1] = row, column
    steps[row, column] = 0
    head, tail = 0, 1
    while head < tail:
        r, c = queue[head, 0], queue[head, 1]
        head += 1
        for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            y, x = r + dr, c + dc
            if 0 <= y < region.shape[0] and 0 <= x < region.shape[1] and region[y, x] and steps[y, x] > steps[r, c] + 1:
                steps[y, x] = steps[r, c] + 1
                queue[tail, 0], queue[tail, 1] = y, x
                tail += 1


def _drawn(
    field: DistanceField, candidates: IntArray, count: int, taken: Sequence[Point], spacing_m: float
) -> tuple[Point, ...]:
    """The first candidates that are far enough from what is taken and from those before them; fewer if there are."""
    found: list[Point] = []
    for begin in range(0, len(candidates), _CHUNK):
        if len(found) == count:
            break
        points = np.array(_points(field, candidates[begin:begin + _CHUNK]))
        points = points[(cdist(points, np.array([*taken, *found])) >= spacing_m).all(axis=1)]
        while len(points) and len(found) < count:
            found.append((float(points[0, 0]), float(points[0, 1])))
            points = points[np.hypot(*(points - points[0]).T) >= max(spacing_m, _SURE_M)]
    return tuple(found)


def _points(field: DistanceField, index: IntArray) -> list[Point]:
    places: FloatArray = np.round(field.places(index), 3) + 0.0
    return [(x, y) for x, y in places.tolist()]
