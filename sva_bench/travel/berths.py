"""Places of their own for robots that share a world: berths at the base, and slots at stations.

Each robot sees its own world: the base is at its berth, a station with several slots is at its slot, and the berths of
the others stand in the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.errors import SvaBenchError
from sva_bench.travel.stand_ground import (
    HULLS_APART_M,
    PREFERRED_ROOM_M,
    STEP_M,
    StandGround,
    gap_of,
    point_of,
    stand_ground_of,
)
from sva_bench.travel.times import plan_travel_times
from sva_bench.world.model import World
from sva_bench.world.places import Point

PASSING_M = 0.12
"""How much farther than that paths keep from the berths of others [m]: corners are cut by less."""
_WITHIN_M = 3.0  # berths are so near to the base
_ROOM_M = 0.155  # from the hull of a robot in its berth to obstacles: more than paths keep
_APART_M, _BASE_M, _SITE_M = 0.6, 0.25, 0.15  # from berth to berth, base and other sites, beyond hulls and their gap
_CLOSER = (1.0, 0.5)  # shares of the first of these that are tried
_SLOT_M, _SLOT_WITHIN_M = 0.15, 1.5  # from slot to slot, likewise; and at most from the station,
_SLOT_DETOUR = 1.5  # from which one drives so many times the distance as the crow flies, at most
_PREFERRED_M = (0.25, 1.0, -0.25)  # what a metre from the base is worth in metres of clearance: choices that are tried
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
        return (f"{self.world}: {self.station}: no room for {self.wanted} slots: of so many robots, {self.found} can "
                f"stand within {_SLOT_WITHIN_M:g} m of it, not behind a wall, without blocking the way of another; "
                "lower its slots, or move it to a more open place")


def place_berths(world: World) -> tuple[Point, ...]:
    """A berth for each robot near the base, preferably along walls; a robot alone has the base itself.

    With robots in all berths each site can be reached, and so can each berth.

    Raises:
        NoRoomForBerths: If there is none for all.
        UnreachableSite: If that is because robots can't get from the base to some site.
    """
    if len(world.robots) == 1:
        return (point_of(world.sites[0]),)
    ground = stand_ground_of(world)
    most: list[Point] = []
    for closer in _CLOSER:
        for weight in _PREFERRED_M:
            found = _berths(ground, len(world.robots), closer, weight)
            if len(found) == len(world.robots):
                return tuple(found)
            most = max(most, found, key=len)
    _refuse_unreachable(world)
    raise NoRoomForBerths(world.name, len(world.robots), len(most), ground.radius_m, ground.gap_m)


def own_world(world: World, berths: Sequence[Point], number: int) -> World:
    """The world as one of its robots sees it.

    Args:
        world: The world.
        berths: Berth of each robot, from ``place_berths``.
        number: The robot's index.

    Raises:
        NoRoomForSlots: If a station has more slots than there is room for.
        UnreachableSite: If that is because robots can't get from the base to some site.
    """
    if len(world.robots) == 1:
        return world
    margin, gap = stand_ground_of(world).margin_m, gap_of(world)
    # Paths keep radius and margin from obstacles, so radii, gap and PASSING_M from the berths of others.
    taken = [(*berth, robot.model.radius_m + gap + PASSING_M - margin)
             for other, (berth, robot) in enumerate(zip(berths, world.robots, strict=True)) if other != number]
    obstacles = replace(world.obstacles, cylinders=np.concatenate([world.obstacles.cylinders, taken]))
    places = _slots(world, tuple(berths))
    sites = [replace(world.sites[0], x_m=berths[number][0], y_m=berths[number][1])]
    for site in world.sites[1:]:
        x, y = places[site.name][number % site.slots] if site.name in places else point_of(site)
        sites.append(replace(site, x_m=x, y_m=y))
    return replace(world, obstacles=obstacles, sites=tuple(sites))


def _refuse_unreachable(world: World) -> None:
    """Refuse a world in which the widest robot can't get everywhere, berths or not.

    Raises:
        UnreachableSite: If there is such a site.
    """
    plan_travel_times(world, max((robot.model for robot in world.robots), key=lambda model: model.radius_m))


def _berths(ground: StandGround, count: int, closer: float, weight: float) -> list[Point]:
    """Up to so many berths, each the best of those that fit beside the ones before.

    Args:
        ground: Where robots can be.
        count: How many.
        closer: Share of the usual space between two that they keep.
        weight: What a metre from the base is worth in metres of clearance.
    """
    every = ground.candidates(ground.base, _WITHIN_M, ground.radius_m + _ROOM_M)
    away = np.hypot(*(every[:, :2] - ground.base).T)
    room = np.minimum(every[:, 2], ground.radius_m + PREFERRED_ROOM_M)
    every = every[np.argsort(room + weight * away, kind="stable")]
    passing = ground.apart_m + PASSING_M
    every = _farther(every, [ground.base], ground.apart_m + _BASE_M)
    every = _farther(every, ground.sites.tolist(), ground.apart_m + max(_SITE_M, PASSING_M))
    return _greedy(ground, every, count, ground.apart_m + max(closer * _APART_M, PASSING_M + 0.03), passing, ())


@lru_cache(maxsize=4)
def _slots(world: World, berths: tuple[Point, ...]) -> dict[str, tuple[Point, ...]]:
    """The places of the slots of each station that has several, by name."""
    taken = [*berths, *(point_of(site) for site in world.sites[1:])]
    found: dict[str, tuple[Point, ...]] = {}
    for site in world.sites[1:]:
        if site.slots == 1:
            continue
        ground, here = stand_ground_of(world), point_of(site)
        every = ground.candidates(here, _SLOT_WITHIN_M, ground.radius_m + ground.margin_m)
        away = np.hypot(*(every[:, :2] - here).T)
        beside = every[:, 3] <= _SLOT_DETOUR * away + STEP_M
        every = every[beside][np.argsort(away[beside], kind="stable")]
        spacing = ground.apart_m + _SLOT_M
        every = _farther(every, [place for place in taken if place != here], ground.apart_m + _SITE_M)
        every = _farther(every, [here], spacing)
        # Better if all other sites stay connected with robots in all slots; the slots do in any case.
        rest = [place for place in ground.sites.tolist() if tuple(place) != here]
        for kept in ([ground.base, *rest], [ground.base]):
            among = replace(ground, sites=np.array(kept))
            places = [here, *_greedy(among, every, site.slots - 1, spacing, ground.apart_m, (here,))]
            if len(places) == site.slots:
                break
        if len(places) < site.slots:
            _refuse_unreachable(world)
            raise NoRoomForSlots(world.name, site.name, site.slots, len(places))
        found[site.name] = tuple(places)
        taken += places[1:]
    return found


def _greedy(
    ground: StandGround, every: FloatArray, count: int, spacing_m: float, reach_m: float, before: Sequence[Point]
) -> list[Point]:
    """The first candidates that keep a spacing and leave everything connected; at most ``count``."""
    found: list[Point] = []
    for _ in range(_MOST_TRIED):
        if len(found) == count or not len(every):
            break
        place = (float(every[0, 0]), float(every[0, 1]))
        connected = ground.keeps_connected([*before, *found, place], reach_m)
        found += [place] if connected else []
        every = _farther(every[1:], [place], spacing_m if connected else STEP_M * 1.5)
    return found


def _farther(every: FloatArray, places: Sequence[Point], least_m: float) -> FloatArray:
    """Those candidates that keep a distance from some places."""
    for place in places:
        every = every[np.hypot(*(every[:, :2] - place).T) >= least_m]
    return every
