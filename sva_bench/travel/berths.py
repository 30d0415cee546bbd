"""Places of their own for robots that share a world: berths at the base, and slots at stations.

Each robot sees its own world: the base is at its berth, a station with several slots is at its slot, and the berths of
the others stand in the way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.errors import SvaBenchError
from sva_bench.files.printable import counted
from sva_bench.geometry.cells import DistanceField
from sva_bench.geometry.clearance import CLEARANCE_MARGINS_M
from sva_bench.travel.near_field import near_field
from sva_bench.world.model import Site, World
from sva_bench.world.places import Point

HULLS_APART_M = 0.2
"""Gap between two hulls in the middle of their cells: a cell's length, and as much for tracking errors [m]."""
PASSING_M = 0.12
"""How much farther than that paths keep from the berths of others [m]: corners are cut by less."""
_WITHIN_M = 3.0  # berths are so near to the base
_ROOM_M = 0.155  # from the hull of a robot in its berth to obstacles: more than paths keep
_APART_M, _BASE_M, _SITE_M = 0.6, 0.25, 0.15  # from berth to berth, base and other sites, beyond hulls and their gap
_CLOSER = (1.0, 0.5)  # shares of the first of these that are tried
_SLOT_M, _SLOT_WITHIN_M = 0.15, 1.5  # from slot to slot, likewise; and at most from the station
_PREFERRED_ROOM_M = 1.0  # from a hull to obstacles, beyond which one place is as good as another
_STEP_M = 0.1  # of candidate places
_PREFERRED_M = (0.25, 1.0, -0.25)  # what a metre from the base is worth in metres of clearance: choices that are tried
_AROUND = 3  # lattice steps about a site within which it joins the lattice
_MOST_TRIED = 100  # candidates of each choice; those beside one that failed are passed over


class NoRoomForBerths(SvaBenchError):
    """The robots of a shared world don't fit about its base."""

    def __init__(self, world: str, wanted: int, found: int, radius_m: float, gap_m: float) -> None:
        super().__init__(world, wanted, found, radius_m, gap_m)  # facts, not text: picklable
        self.world, self.wanted, self.found = world, wanted, found
        self.radius_m, self.gap_m = radius_m, gap_m

    def __str__(self) -> str:
        wide = "" if self.gap_m <= HULLS_APART_M else (
            f" (they keep {self.gap_m:.2f} m between hulls, because localisation is uncertain)")
        return (f"{self.world}: no room for {self.wanted} berths: of robots of radius {self.radius_m:g} m that share "
                f"this world, {self.found or 'none'} can stand within {_WITHIN_M:g} m of the base clear of obstacles, "
                f"sites and each other without shutting anybody off from a site{wide}; move the base to a more open "
                "place, widen the passages about it, or take fewer or smaller robots")


class NoRoomForSlots(SvaBenchError):
    """Robots don't fit about a station as many at a time as it has slots."""

    def __init__(self, world: str, station: str, wanted: int, found: int) -> None:
        super().__init__(world, station, wanted, found)
        self.world, self.station, self.wanted, self.found = world, station, wanted, found

    def __str__(self) -> str:
        return (f"{self.world}: {self.station}: no room for {self.wanted} slots: {counted(self.found, 'robot')} can "
                f"stand within {_SLOT_WITHIN_M:g} m of it without blocking each other; lower its slots, or move it to "
                "a more open place")


def gap_of(world: World) -> float:
    """Least gap between two hulls in the middle of their cells [m]; it grows with the error of localisation."""
    error = world.noise.localisation
    return HULLS_APART_M + (0.0 if error is None else 3 * math.sqrt(2) * error.sd_m)


def place_berths(world: World) -> tuple[Point, ...]:
    """A berth for each robot near the base, preferably along walls; a robot alone has the base itself.

    With robots in all berths each site can be reached, and so can each berth.

    Raises:
        NoRoomForBerths: If there is none for all.
    """
    if len(world.robots) == 1:
        return (_point(world.sites[0]),)
    ground = _ground_of(world)
    most: list[Point] = []
    for closer in _CLOSER:
        for weight in _PREFERRED_M:
            found = _berths(ground, len(world.robots), closer, weight)
            if len(found) == len(world.robots):
                return tuple(found)
            most = max(most, found, key=len)
    raise NoRoomForBerths(world.name, len(world.robots), len(most), ground.radius_m, ground.gap_m)


def own_world(world: World, berths: Sequence[Point], number: int) -> World:
    """The world as one of its robots sees it.

    Args:
        world: The world.
        berths: Berth of each robot, from ``place_berths``.
        number: The robot's index.

    Raises:
        NoRoomForSlots: If a station has more slots than there is room for.
    """
    if len(world.robots) == 1:
        return world
    margin, gap = _ground_of(world).margin_m, gap_of(world)
    # Paths keep radius and margin from obstacles, so radii, gap and PASSING_M from the berths of others.
    taken = [(*berth, robot.model.radius_m + gap + PASSING_M - margin)
             for other, (berth, robot) in enumerate(zip(berths, world.robots, strict=True)) if other != number]
    obstacles = replace(world.obstacles, cylinders=np.concatenate([world.obstacles.cylinders, taken]))
    places = _slots(world, tuple(berths))
    sites = [replace(world.sites[0], x_m=berths[number][0], y_m=berths[number][1])]
    for site in world.sites[1:]:
        x, y = places[site.name][number % site.slots] if site.name in places else _point(site)
        sites.append(replace(site, x_m=x, y_m=y))
    return replace(world, obstacles=obstacles, sites=tuple(sites))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Ground:
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
            rows, columns, near = self._near(place, reach_m)
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

        Args:
            centre: The centre [m].
            within_m: How near [m].
            room_m: Clearance of the places [m].

        Returns:
            x, y, clearance [m], shape (n, 3).
        """
        parts = self.field.distance_m >= self.radius_m + self.margin_m
        rows, columns, near = self._near(centre, within_m)
        window = parts[rows, columns] & near
        found, _ = label(window)
        whole = np.zeros(parts.shape, dtype=np.int32)
        whole[rows, columns] = found
        own = self.part_at(whole, centre)
        step = self.field.cells.cell_m / 2
        every = max(round(_STEP_M / step), 1)
        index = np.argwhere((whole == own) & (own > 0) & (self.field.distance_m >= room_m))
        index = index[(index % every == 0).all(axis=1)]
        places = np.round(self.field.places(index), 3) + 0.0
        return np.column_stack([places, self.field.distance_m[index[:, 0], index[:, 1]].astype(np.float64)])

    def _near(self, place: Point, reach_m: float) -> tuple[slice, slice, BoolArray]:
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
def _ground_of(world: World) -> _Ground:
    """Where the largest of a world's robots can be, at the widest margin at which all sites are connected."""
    radius, places = max(robot.model.radius_m for robot in world.robots), [_point(site) for site in world.sites]
    field, gap = near_field(world.obstacles, radius + _PREFERRED_ROOM_M), gap_of(world)
    for margin in CLEARANCE_MARGINS_M:
        ground = _Ground(field=field, radius_m=radius, gap_m=gap, margin_m=margin, base=places[0],
                         sites=np.empty((0, 2)))
        parts = ground.parts((), 0.0)
        own = ground.part_at(parts, places[0])
        connected = [place for place in places[1:] if own and ground.part_at(parts, place) == own]
        if len(connected) == len(places) - 1:
            break
    return replace(ground, sites=np.array(connected).reshape(-1, 2))


def _berths(ground: _Ground, count: int, closer: float, weight: float) -> list[Point]:
    """Up to so many berths, each the best of those that fit beside the ones before.

    Args:
        ground: Where robots can be.
        count: How many.
        closer: Share of the usual space between two that they keep.
        weight: What a metre from the base is worth in metres of clearance.
    """
    every = ground.candidates(ground.base, _WITHIN_M, ground.radius_m + _ROOM_M)
    away = np.hypot(*(every[:, :2] - ground.base).T)
    room = np.minimum(every[:, 2], ground.radius_m + _PREFERRED_ROOM_M)
    every = every[np.argsort(room + weight * away, kind="stable")]
    passing = ground.apart_m + PASSING_M
    every = _farther(every, [ground.base], ground.apart_m + _BASE_M)
    every = _farther(every, ground.sites.tolist(), ground.apart_m + max(_SITE_M, PASSING_M))
    return _greedy(ground, every, count, ground.apart_m + max(closer * _APART_M, PASSING_M + 0.03), passing, ())


@lru_cache(maxsize=4)
def _slots(world: World, berths: tuple[Point, ...]) -> dict[str, tuple[Point, ...]]:
    """The places of the slots of each station that has several, by name."""
    taken = [*berths, *(_point(site) for site in world.sites[1:])]
    found: dict[str, tuple[Point, ...]] = {}
    for site in world.sites[1:]:
        if site.slots == 1:
            continue
        ground, here = _ground_of(world), _point(site)
        every = ground.candidates(here, _SLOT_WITHIN_M, ground.radius_m + ground.margin_m)
        every = every[np.argsort(np.hypot(*(every[:, :2] - here).T), kind="stable")]
        spacing = ground.apart_m + _SLOT_M
        every = _farther(every, [place for place in taken if place != here], ground.apart_m + _SITE_M)
        every = _farther(every, [here], spacing)
        # Better if all other sites stay connected with robots in all slots; the slots do in any case.
        rest = [place for place in ground.sites.tolist() if tuple(place) != here]
        for kept in ([ground.base, *rest], [ground.base]):
            beside = replace(ground, sites=np.array(kept))
            places = [here, *_greedy(beside, every, site.slots - 1, spacing, ground.apart_m, (here,))]
            if len(places) == site.slots:
                break
        if len(places) < site.slots:
            raise NoRoomForSlots(world.name, site.name, site.slots, len(places))
        found[site.name] = tuple(places)
        taken += places[1:]
    return found


def _greedy(
    ground: _Ground, every: FloatArray, count: int, spacing_m: float, reach_m: float, before: Sequence[Point]
) -> list[Point]:
    """The first candidates that keep a spacing and leave everything connected; at most ``count``."""
    found: list[Point] = []
    for _ in range(_MOST_TRIED):
        if len(found) == count or not len(every):
            break
        place = (float(every[0, 0]), float(every[0, 1]))
        connected = ground.keeps_connected([*before, *found, place], reach_m)
        found += [place] if connected else []
        every = _farther(every[1:], [place], spacing_m if connected else _STEP_M * 1.5)
    return found


def _farther(every: FloatArray, places: Sequence[Point], least_m: float) -> FloatArray:
    """Those candidates that keep a distance from some places."""
    for place in places:
        every = every[np.hypot(*(every[:, :2] - place).T) >= least_m]
    return every


def _point(site: Site) -> Point:
    return site.x_m, site.y_m
