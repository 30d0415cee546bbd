"""Occupancy grids: cells, a small cover by boxes, the distance transform, and connected regions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import label

from sva_bench.arrays import BoolArray, FloatArray, IntArray, frozen

MAX_BOXES = 50_000  # a compound body of 50 000 boxes takes physics 1.5 s and 200 MB to build


class TooManyBoxes(ValueError):
    """Occupied cells whose cover needs more than ``MAX_BOXES`` boxes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Cells:
    """An occupancy grid; everything outside it is occupied.

    Attributes:
        occupied: Shape (rows, columns); row 0 is the lowest, column 0 the leftmost in the grid's own frame.
        cell_m: Side of a cell [m].
        origin: x, y [m] of the grid's lower left corner, and the yaw [rad] of its own frame; shape (3,).
        unknown: Which of the occupied cells are unknown, taken as occupied; for display, shape (rows, columns).
            ``None`` where the map doesn't distinguish them.
    """

    occupied: BoolArray
    cell_m: float
    origin: FloatArray
    unknown: BoolArray | None = None

    def __post_init__(self) -> None:
        occupied = np.array(self.occupied, dtype=np.bool_)
        if occupied.ndim != 2 or occupied.size == 0:
            raise ValueError(f"expected rows and columns of cells, got shape {occupied.shape}")
        if not (self.cell_m > 0 and math.isfinite(self.cell_m)):
            raise ValueError(f"expected cells with a size, got {self.cell_m}")
        occupied.setflags(write=False)
        object.__setattr__(self, "occupied", occupied)
        if self.unknown is not None:
            unknown = np.array(self.unknown, dtype=np.bool_)
            if unknown.shape != occupied.shape or (unknown & ~occupied).any():
                raise ValueError("expected unknown cells among the occupied ones")
            unknown.setflags(write=False)
            object.__setattr__(self, "unknown", unknown)
        object.__setattr__(self, "origin", frozen(self.origin, (3,)))

    @property
    def size_m(self) -> tuple[float, float]:
        """Lengths along the grid's own x and y [m]."""
        rows, columns = self.occupied.shape
        return columns * self.cell_m, rows * self.cell_m

    def to_world(self, points: FloatArray) -> FloatArray:
        """World coordinates of points in the grid's own frame; both [m], shape (n, 2)."""
        x, y, yaw = self.origin.tolist()
        c, s = math.cos(yaw), math.sin(yaw)
        # Without yaw the origin is added alone, which is exact.
        turned = points if yaw == 0 else points @ np.array([[c, s], [-s, c]])
        result: FloatArray = turned + np.array([x, y])
        return result

    def from_world(self, points: FloatArray) -> FloatArray:
        """Coordinates in the grid's own frame of points of the world; both [m], shape (n, 2)."""
        x, y, yaw = self.origin.tolist()
        c, s = math.cos(yaw), math.sin(yaw)
        result: FloatArray = (points - np.array([x, y])) @ np.array([[c, -s], [s, c]])
        return result


def bounds_of(cells: Cells) -> FloatArray:
    """The axis-aligned bounding box of a grid: x_min, y_min, x_max, y_max [m], shape (4,)."""
    width, height = cells.size_m
    corners = cells.to_world(np.array([[0.0, 0], [width, 0], [width, height], [0, height]]))
    bounds: FloatArray = np.concatenate([corners.min(axis=0), corners.max(axis=0)])
    return bounds


def boxes_of(cells: Cells) -> FloatArray:
    """Boxes that cover exactly the occupied part of the grid's bounding box, as in ``Obstacles``; shape (k, 5).

    For a rotated grid four more boxes fill the bounding box outside the grid.

    Raises:
        TooManyBoxes: If the cover needs more than ``MAX_BOXES``.
    """
    yaw = float(cells.origin[2])
    spans = cover(cells.occupied) * cells.cell_m  # x0, y0, x1, y1
    if yaw != 0:
        (w, h), (left, low, right, top) = cells.size_m, bounds_of(cells)
        own = cells.from_world(np.array([[left, low], [right, low], [right, top], [left, top]]))
        t = float(max(-own.min(), (own - (w, h)).max())) + cells.cell_m  # beyond the farthest corner of the rectangle
        spans = np.concatenate([[(-t, -t, 0, h + t), (w, -t, w + t, h + t), (0, -t, w, 0), (0, h, w, h + t)], spans])
    centres = cells.to_world((spans[:, :2] + spans[:, 2:]) / 2)
    halves = (spans[:, 2:] - spans[:, :2]) / 2
    return np.column_stack([centres, halves, np.full(len(spans), yaw)])


def cover(occupied: BoolArray) -> FloatArray:
    """A small set of disjoint rectangles that covers exactly the occupied cells.

    Runs of a row are merged with equal runs above them; the same along columns; the smaller of the two is taken.

    Returns:
        x0, y0, x1, y1 in cells; shape (k, 4).

    Raises:
        TooManyBoxes: If there would be more than ``MAX_BOXES``.
    """
    across, along = _merged_runs(occupied, MAX_BOXES), _merged_runs(np.ascontiguousarray(occupied.T), MAX_BOXES)
    if min(len(across), len(along)) > MAX_BOXES:
        raise TooManyBoxes(f"more than {MAX_BOXES} boxes")
    best = across if len(across) <= len(along) else along[:, [1, 0, 3, 2]]
    spans: FloatArray = best.astype(np.float64)
    return spans


@njit(cache=True)  # type: ignore[untyped-decorator]
def _merged_runs(occupied: BoolArray, most: int) -> IntArray:
    """The rectangles of merged runs, shape (k, 4); it stops at ``most`` + 1."""
    rows, columns = occupied.shape
    found = np.empty((16, 4), dtype=np.int64)
    count = 0
    # The open rectangle that begins at a column: its right end and its lowest row; -1 = none.
    right = np.full(columns, -1, dtype=np.int64)
    bottom = np.zeros(columns, dtype=np.int64)
    for y in range(rows + 1):
        x = 0
        while x < columns:
            run_end = -1
            if y < rows and occupied[y, x] and (x == 0 or not occupied[y, x - 1]):
                run_end = x + 1
                while run_end < columns and occupied[y, run_end]:
                    run_end += 1
            if right[x] != run_end:
                if right[x] >= 0:
                    if count > most:
                        return found[:count].copy()
                    if count == len(found):
                        grown = np.empty((2 * count, 4), dtype=np.int64)
                        grown[:count] = found
                        found = grown
                    found[count, 0], found[count, 1], found[count, 2], found[count, 3] = x, bottom[x], right[x], y
                    count += 1
                right[x], bottom[x] = run_end, y
            x += 1
    return found[:count].copy()


@dataclass(frozen=True, eq=False, kw_only=True)
class DistanceField:
    """Distances from the nodes of a lattice to the nearest occupied cell, or to the grid's boundary.

    The nodes are the corners, the midpoints of the sides and the centres of all cells: a lattice of half cells. The
    nearest point of a square cell to a node is a node too, so the distances are exact; and on the line between two
    neighbouring nodes no point is nearer to an obstacle than the nearer node.

    Attributes:
        cells: The grid.
        distance_m: Shape (2 rows + 1, 2 columns + 1) [m]; 0 on occupied cells and their boundaries.
    """

    cells: Cells
    distance_m: NDArray[np.float32]

    def index_of(self, points: FloatArray) -> IntArray:
        """Row and column of the node nearest to each point of the world [m], shape (n, 2)."""
        steps = np.round(self.cells.from_world(points) / (self.cells.cell_m / 2)).astype(np.int64)
        rows, columns = self.distance_m.shape
        return np.column_stack([np.clip(steps[:, 1], 0, rows - 1), np.clip(steps[:, 0], 0, columns - 1)])

    def places(self, index: IntArray) -> FloatArray:
        """World coordinates of nodes given as rows and columns [m], shape (n, 2)."""
        return self.cells.to_world(index[:, ::-1].astype(np.float64) * (self.cells.cell_m / 2))


def distance_field(cells: Cells) -> DistanceField:
    """Exact distances on the lattice of half cells.

    Source:
        Felzenszwalb & Huttenlocher (2012), "Distance transforms of sampled functions".
    """
    squared = _squared_distances(cells.occupied)
    return DistanceField(cells=cells, distance_m=np.sqrt(squared) * np.float32(cells.cell_m / 2))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _squared_distances(occupied: BoolArray) -> NDArray[np.float32]:
    """Squared distances in half cells; first along columns, then along rows by the lower envelope of parabolas."""
    rows, columns = occupied.shape
    height, width = 2 * rows + 1, 2 * columns + 1
    solid = np.zeros((height, width), dtype=np.bool_)
    for r in range(rows):
        for c in range(columns):
            if occupied[r, c]:
                solid[2 * r:2 * r + 3, 2 * c:2 * c + 3] = True
    solid[0, :] = True
    solid[-1, :] = True
    solid[:, 0] = True
    solid[:, -1] = True
    result = np.empty((height, width), dtype=np.float32)
    since = np.full(width, 0, dtype=np.int64)
    for y in range(height):
        for x in range(width):
            since[x] = 0 if solid[y, x] else since[x] + 1
            result[y, x] = since[x]
    since[:] = 0
    for y in range(height - 1, -1, -1):
        for x in range(width):
            since[x] = 0 if solid[y, x] else since[x] + 1
            if since[x] < result[y, x]:
                result[y, x] = since[x]
    at = np.empty(width, dtype=np.int64)
    begin = np.empty(width + 1)
    column = np.empty(width)
    for y in range(height):
        for x in range(width):
            column[x] = float(result[y, x]) ** 2
        k = 0
        at[0], begin[0], begin[1] = 0, -np.inf, np.inf
        for x in range(1, width):
            meet = ((column[x] + x * x) - (column[at[k]] + at[k] * at[k])) / (2 * (x - at[k]))
            while meet <= begin[k]:
                k -= 1
                meet = ((column[x] + x * x) - (column[at[k]] + at[k] * at[k])) / (2 * (x - at[k]))
            k += 1
            at[k], begin[k], begin[k + 1] = x, meet, np.inf
        k = 0
        for x in range(width):
            while begin[k + 1] < x:
                k += 1
            result[y, x] = (x - at[k]) ** 2 + column[at[k]]
    return result


def connected_region(field: DistanceField, point: FloatArray, radius_m: float) -> BoolArray:
    """Nodes that a robot can reach from a point along the lattice, of the shape of ``DistanceField.distance_m``.

    Conservative: passages less than a cell wider than the robot may be missed.

    Args:
        field: The distances.
        point: The point [m], shape (2,).
        radius_m: Radius of the robot [m].
    """
    row, column = field.index_of(np.asarray(point, dtype=np.float64)[None])[0].tolist()
    # float32 rounds by 1e-7 of the distance; 1e-6 covers it.
    roomy = field.distance_m >= radius_m * (1 - 1e-6)
    components, _ = label(roomy)
    component = components[row, column]
    region: BoolArray = (components == component) & (component > 0)
    return region


def convex_corners(cells: Cells) -> FloatArray:
    """Convex corners of the occupied area, about which shortest paths bend.

    Returns:
        Corner x, y in the grid's own frame [m], and the signs of the quadrant opposite to its cell: the corner's
        cell lies in the direction (-sx, -sy); shape (k, 4).
    """
    solid = np.pad(cells.occupied, 1, constant_values=True)
    found = []
    for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        # The lattice vertex (r, c) lies between rows r - 1 and r, columns c - 1 and c of the grid.
        def quarter(dx: int, dy: int) -> BoolArray:
            rows, columns = slice(None, -1) if dy < 0 else slice(1, None), slice(None, -1) if dx < 0 else slice(1, None)
            part: BoolArray = solid[rows, columns]
            return part

        corner = quarter(-sx, -sy) & ~quarter(sx, -sy) & ~quarter(-sx, sy)
        r, c = np.nonzero(corner)
        found.append(np.column_stack([c * cells.cell_m, r * cells.cell_m, np.full(len(r), sx), np.full(len(r), sy)]))
    return np.concatenate(found)
