"""Where robots that share a world can stand and drive, on a lattice: which places are connected, and what is near."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.geometry.cells import DistanceField
from sva_bench.geometry.clearance import CLEARANCE_MARGINS_M
from sva_bench.travel.near_field import near_field
from sva_bench.world.model import Site, World
from sva_bench.world.places import Point

HULLS_APART_M = 0.2
"""Gap between two hulls in the middle of their cells: a cell's length, and as much for tracking errors [m]."""
PREFERRED_ROOM_M = 1.0
"""From a hull to obstacles, beyond which one place is as good as another [m]."""
STEP_M = 0.1
"""From one candidate place to the next [m]."""
_AROUND = 3  # lattice steps about a site within which it joins the lattice


def gap_of(world: World) -> float:
    """Least gap between two hulls in the middle of their cells [m]; it grows with the error of localisation."""
    error = world.noise.localisation
    return HULLS_APART_M + (0.0 if error is None else 3 * math.sqrt(2) * error.sd_m)


@dataclass(frozen=True, eq=False, kw_only=True)
class StandGround:
    """Where the largest of a world's robots can be.

    Attributes:
        field: Distances to obstacles.
        radius_m, gap_m: Radius of the largest robot; gap between hulls [m].
        margin_m: The widest clearance margin at which the sites are connected, as far as a lattice shows.
        base: Place of the base [m].
        sites: Places of the other sites that are connected with it [m], shape (n, 2).
    """

    field: DistanceField
    radius_m: float
    gap_m: float
    margin_m: float
    base: Point
    sites: FloatArray

    @property
    def apart_m(self) -> float:
        """Distance of two robots of that radius whose hulls have the gap [m]."""
        return 2 * self.radius_m + self.gap_m

    def parts(self, blocked: Sequence[Point], reach_m: float) -> NDArray[np.int32]:
        """Connected parts of what is free if robots stand in some places, with a distance to keep from them."""
        roomy = self.field.distance_m >= self.radius_m + self.margin_m
        for place in blocked:
            rows, columns, near = self.window(place, reach_m)
            roomy[rows, columns] &= ~near
        found, _ = label(roomy)
        parts: NDArray[np.int32] = found.astype(np.int32, copy=False)
        return parts

    def part_at(self, parts: NDArray[np.int32], place: Point | FloatArray) -> int:
        """The connected part that a place belongs to; 0 = none."""
        row, column = self.field.index_of(np.array([place], dtype=np.float64))[0].tolist()
        around = parts[max(row - _AROUND, 0):row + _AROUND + 1, max(column - _AROUND, 0):column + _AROUND + 1]
        rows, columns = np.nonzero(around)
        if not len(rows):
            return 0
        nearest = np.argmin((rows - min(row, _AROUND)) ** 2 + (columns - min(column, _AROUND)) ** 2)
        return int(around[rows[nearest], columns[nearest]])

    def keeps_connected(self, places: Sequence[Point], reach_m: float) -> bool:
        """Whether with robots in all these places each site can be reached, and so can the places one by one."""
        parts = self.parts(places, reach_m)
        mine = {self.part_at(parts, site) for site in self.sites}
        if len(mine) > 1 or 0 in mine:
            return False
        for k, place in enumerate(places):
            parts = self.parts([*places[:k], *places[k + 1:]], reach_m)
            own = self.part_at(parts, place)
            if own == 0 or any(self.part_at(parts, site) != own for site in self.sites[:1]):
                return False
        return True

    def candidates(self, centre: Point, within_m: float, room_m: float) -> FloatArray:
        """Places near a centre that a robot reaches from it without going farther away, and their clearance.

        How far it drives is counted from node to node, in eight directions: up to 8 % too far.

        Args:
            centre: The centre [m].
            within_m: How near [m].
            room_m: Clearance of the places [m].

        Returns:
            x, y, clearance, how far a robot drives there [m], shape (n, 4).
        """
        parts = self.field.distance_m >= self.radius_m + self.margin_m
        rows, columns, near = self.window(centre, within_m)
        window = parts[rows, columns] & near
        found, _ = label(window)
        whole = np.zeros(parts.shape, dtype=np.int32)
        whole[rows, columns] = found
        own = self.part_at(whole, centre)
        step = self.field.cells.cell_m / 2
        every = max(round(STEP_M / step), 1)
        index = np.argwhere((whole == own) & (own > 0) & (self.field.distance_m >= room_m))
        index = index[(index % every == 0).all(axis=1)]
        places = np.round(self.field.places(index), 3) + 0.0
        driven_m = self._driven_m(window & (found == own), centre, rows, columns)
        return np.column_stack([places, self.field.distance_m[index[:, 0], index[:, 1]].astype(np.float64),
                                driven_m[index[:, 0] - rows.start, index[:, 1] - columns.start]])

    def _driven_m(self, free: BoolArray, centre: Point, rows: slice, columns: slice) -> FloatArray:
        """How far a robot drives from a centre to the free nodes of a window [m]; ``inf`` to others."""
        step_m = self.field.cells.cell_m / 2
        number = np.where(free, np.cumsum(free).reshape(free.shape) - 1, -1)
        ends, lengths = [], []
        for one, other, far in ((number[1:], number[:-1], 1.0), (number[:, 1:], number[:, :-1], 1.0),
                                (number[1:, 1:], number[:-1, :-1], math.sqrt(2)),
                                (number[1:, :-1], number[:-1, 1:], math.sqrt(2))):
            both = (one >= 0) & (other >= 0)
            ends.append(np.column_stack([one[both], other[both]]))
            lengths.append(np.full(int(both.sum()), far * step_m))
        driven_m = np.full(free.shape, np.inf)
        if free.any():
            joined, count = np.concatenate(ends), int(free.sum())
            graph = csr_array((np.concatenate(lengths), (joined[:, 0], joined[:, 1])), shape=(count, count))
            nodes = self.field.places(np.argwhere(free) + np.array([rows.start, columns.start]))
            away_m = np.hypot(*(nodes - np.array(centre)).T)
            begin = int(np.argmin(away_m))
            driven_m[free] = away_m[begin] + dijkstra(graph, directed=False, indices=np.array([begin]))[0]
        return driven_m

    def window(self, place: Point, reach_m: float) -> tuple[slice, slice, BoolArray]:
        """Rows and columns of a window about a place, and which of its nodes are within reach."""
        row, column = self.field.index_of(np.array([place], dtype=np.float64))[0].tolist()
        wide = math.ceil(reach_m / (self.field.cells.cell_m / 2)) + 2
        shape = self.field.distance_m.shape
        rows = slice(max(row - wide, 0), min(row + wide + 1, shape[0]))
        columns = slice(max(column - wide, 0), min(column + wide + 1, shape[1]))
        index = np.stack(np.meshgrid(np.arange(rows.start, rows.stop), np.arange(columns.start, columns.stop),
                                     indexing="ij"), axis=-1)
        places = self.field.places(index.reshape(-1, 2))
        near = np.hypot(*(places - np.array(place)).T) < reach_m
        return rows, columns, near.reshape(index.shape[:2])


@lru_cache(maxsize=4)
def stand_ground_of(world: World) -> StandGround:
    """Where the largest of a world's robots can be, at the widest margin at which all sites are connected."""
    radius, places = max(robot.model.radius_m for robot in world.robots), [point_of(site) for site in world.sites]
    field, gap = near_field(world.obstacles, radius + PREFERRED_ROOM_M), gap_of(world)
    for margin in CLEARANCE_MARGINS_M:
        ground = StandGround(field=field, radius_m=radius, gap_m=gap, margin_m=margin, base=places[0],
                         sites=np.empty((0, 2)))
        parts = ground.parts((), 0.0)
        own = ground.part_at(parts, places[0])
        connected = [place for place in places[1:] if own and ground.part_at(parts, place) == own]
        if len(connected) == len(places) - 1:
            break
    return replace(ground, sites=np.array(connected).reshape(-1, 2))


def point_of(site: Site) -> Point:
    """Where a site is [m]."""
    return site.x_m, site.y_m
