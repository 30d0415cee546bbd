"""Placement of sites: in the connected free region about a base, spread out or drawn at random.

Places are nodes of a lattice, the half cells of an occupancy grid or a fine one laid over shapes: whatever is
connected on it can be driven, so no place is outside walls that enclose the base.
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
from sva_bench.geometry.clearance import CLEARANCE_MARGINS_M
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.seeds import Stream, rng_for

Point = tuple[float, float]


APART_M = 0.5
"""Default of the least distance between placed sites [m]."""

_SURE_M = 2e-3  # covers the rounding of places to millimetres, and the roadmap's polygons about corners
_FINEST_M, _PLACES = 0.05, 1_000_000  # finest lattice step over shapes, and about the greatest number of nodes
_ENCLOSED = 0.25  # least share of the largest free region at which an enclosed one counts as a building's inside
_WORTH_SAYING = 0.05  # least share of the base's region at which an enclosed one gives a warning
_LOOSE, _TIGHTER, _CLOSEST_M = 0.8, 0.85, 0.25  # first spacing tried, relative to a square grid's; factor; least
_CHUNK = 4096  # candidates tested together


@dataclass(frozen=True, kw_only=True)
class Places:
    """Places of the sites, as x, y [m]."""

    base: Point
    stations: tuple[Point, ...]
    pois: tuple[Point, ...]


class NoRoom(ValueError):
    """No free place for some sites."""

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
    """Distances to obstacles at the nodes of a lattice: lower bounds on the lines between neighbouring nodes."""
    if obstacles.cells is not None:
        return distance_field(obstacles.cells)
    x0, y0, x1, y1 = obstacles.bounds_m.tolist()
    step = max(_FINEST_M, math.sqrt((x1 - x0) * (y1 - y0) / _PLACES))
    rows, columns = (max(math.ceil(length / (2 * step)), 1) for length in (y1 - y0, x1 - x0))
    frame = Cells(occupied=np.zeros((rows, columns), dtype=np.bool_), cell_m=2 * step, origin=np.array([x0, y0, 0.0]))
    shape = (2 * rows + 1, 2 * columns + 1)
    lattice = DistanceField(cells=frame, distance_m=np.zeros(shape, dtype=np.float32))
    index = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1).reshape(-1, 2)
    # Halfway to a neighbour an obstacle may be nearer by half a step.
    distance = np.maximum(clearances(obstacles, lattice.places(index)) - step / 2, 0.0)
    return DistanceField(cells=frame, distance_m=distance.reshape(shape).astype(np.float32))


def find_places(
    field: DistanceField, *, base: Point | None, radius_m: float, stations: int, pois: int, spacing_m: float | None,
    seed: int, others: Sequence[Point] = (), key: tuple[int, ...] = (),
) -> tuple[Places, float]:
    """Places in the free region connected with the base, at the widest clearance margin at which they fit.

    Each station is the place farthest from the base and the stations before it, by path length; POIs are drawn at
    random. So with more of either, the first ones stay in place.

    Args:
        field: Distances to obstacles.
        base: The base [m]; ``None`` = near the middle of the largest enclosed region.
        radius_m: Radius of the robot [m].
        stations, pois: Number of each.
        spacing_m: Least distance of POIs from each other and all other sites [m]; ``None`` = as wide as easily fits.
            Stations keep at most ``APART_M`` from other sites.
        seed: Seed of the POIs.
        others: Sites with given places, besides the base [m].
        key: Key of the POIs' random stream, such as of the map, so that maps are independent samples.

    Returns:
        The places; and the spacing [m].

    Raises:
        NoRoom: If there are too few free places.
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
                drawn = _greedily_drawn(field, candidates, pois, [here, *others, *spread], spacing)
                if len(drawn) == pois:
                    return Places(base=here, stations=spread, pois=drawn), spacing
            raise NoRoom("pois", len(drawn), spacing)
        except NoRoom as error:
            if (error.kind == "pois", error.found) >= (missing.kind == "pois", missing.found):
                missing = error
    raise missing


def _spacings(widest_m: float) -> list[float]:
    """Decreasing spacings to try [m], multiples of 0.05 m."""
    tried = [max(widest_m, _CLOSEST_M)]
    while tried[-1] > _CLOSEST_M:
        tried.append(max(tried[-1] * _TIGHTER, _CLOSEST_M))
    return [round(math.floor(spacing / 0.05 + 1e-9) * 0.05, 2) for spacing in tried]


def enclosed_beside(field: DistanceField, base: Point, radius_m: float) -> tuple[float, Point] | None:
    """The largest enclosed region, if a base's own region reaches the grid's boundary: it may be outside the building.

    Returns:
        Area of that region [m2], and a place near its middle; ``None`` if the base's region is enclosed, or all
        enclosed ones are small relative to it.
    """
    needed = radius_m + CLEARANCE_MARGINS_M[0] + _SURE_M
    components, sizes, enclosed = _regions(field, needed)
    row, column = field.index_of(np.array([base]))[0].tolist()
    component = int(components[row, column])
    if component == 0 or enclosed[component] > 0 or enclosed.max() < _WORTH_SAYING * sizes[component]:
        return None
    largest = components == int(enclosed.argmax())
    return float(enclosed.max()) * (field.cells.cell_m / 2) ** 2, _near_middle(field, largest)


def _middle(field: DistanceField, needed_m: float) -> Point | None:
    """The place nearest to the middle of the largest enclosed region; ``None`` if there is no free node.

    A region that reaches the grid's boundary is outside the building, unless all enclosed ones are relatively small.
    """
    components, sizes, enclosed = _regions(field, needed_m)
    if not sizes.any():
        return None
    best = int(np.argmax(enclosed if enclosed.max() >= _ENCLOSED * sizes.max() else sizes))
    return _near_middle(field, components == best)


def _near_middle(field: DistanceField, region: BoolArray) -> Point:
    index = np.argwhere(region)
    nearest = int(np.argmin(((index - index.mean(axis=0)) ** 2).sum(axis=1)))
    return _points(field, index[nearest:nearest + 1])[0]


def _regions(field: DistanceField, needed_m: float) -> tuple[NDArray[np.int32], IntArray, IntArray]:
    """Connected regions of nodes with this clearance, numbered from 1; their sizes; sizes of enclosed ones, else 0."""
    has_room = field.distance_m >= needed_m
    found, count = label(has_room)
    components: NDArray[np.int32] = found.astype(np.int32, copy=False)
    sizes: IntArray = np.bincount(components.ravel(), minlength=count + 1).astype(np.int64)
    sizes[0] = 0
    # A wall along the boundary is at least a cell thick, which is two steps.
    width = math.floor(needed_m / (field.cells.cell_m / 2) + 1.5) + 1
    inner = np.zeros(components.shape, dtype=np.bool_)
    inner[width:-width, width:-width] = True
    enclosed = sizes.copy()
    enclosed[np.unique(components[~inner])] = 0
    return components, sizes, enclosed


def _region_about(field: DistanceField, base: Point, needed_m: float) -> BoolArray:
    """Nodes connected with the base, of the field's shape; none if there is too little room about it."""
    row, column = field.index_of(np.array([base]))[0].tolist()
    rows, columns = field.distance_m.shape
    # The nearest node may have less clearance than the base, but not all nodes about it.
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
    """Places, each the farthest by path length from the sites taken and from the places before it."""
    if count == 0:
        return ()
    step = field.cells.cell_m / 2
    steps = np.full(region.shape, np.iinfo(np.int32).max, dtype=np.int32)
    found: list[Point] = []
    for row, column in _nodes_near(field, region, taken):
        _update_steps(region, steps, row, column)
    for _ in range(count):
        row, column = map(int, np.unravel_index(int(np.argmax(np.where(region, steps, -1))), region.shape))
        if not region[row, column] or steps[row, column] * step < spacing_m:
            raise NoRoom("stations", len(found), spacing_m)
        found += _points(field, np.array([[row, column]]))
        _update_steps(region, steps, row, column)
    return tuple(found)


def _nodes_near(field: DistanceField, region: BoolArray, places: Sequence[Point]) -> list[tuple[int, int]]:
    """A node of the region beside each point, as row and column; none for points that aren't beside it."""
    found = []
    for point in places:
        row, column = field.index_of(np.array([point]))[0].tolist()
        near = [(r, c) for r in range(max(row - 1, 0), row + 2) for c in range(max(column - 1, 0), column + 2)
                if r < region.shape[0] and c < region.shape[1] and region[r, c]]
        found += near[:1]
    return found


@njit(cache=True)  # type: ignore[untyped-decorator]
def _update_steps(region: BoolArray, steps: NDArray[np.int32], row: int, column: int) -> None:
    """Update the least number of steps from a set of nodes to each node by one more node, in place."""
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


def _greedily_drawn(
    field: DistanceField, candidates: IntArray, count: int, taken: Sequence[Point], spacing_m: float
) -> tuple[Point, ...]:
    """The first ``count`` candidates that keep the spacing from taken sites and those before; fewer if too few do."""
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
