"""Ways of robots that share a world: between their sites, cut into cells, and round robots that stand in the way.

Each robot has sites of its own: its berth is its base, and of a station with several slots it uses one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.execution.engines.engine import Pose
from sva_bench.execution.legs import Leg
from sva_bench.execution.shared.lanes import CELL_M, Cut, Order, cut
from sva_bench.mission.plan import Route
from sva_bench.robot.follower import CONTROL_HZ, Stretch, arc_lengths, stretches
from sva_bench.robot.model import RobotModel
from sva_bench.travel.alternatives import Ways as Lines
from sva_bench.travel.alternatives import alternatives, way_round, ways_among
from sva_bench.travel.berths import own_world, place_berths
from sva_bench.travel.fuel import FuelCosts
from sva_bench.travel.stand_ground import gap_of
from sva_bench.world.model import World

_STANDS_OFF_M = 0.08  # between the hull of a robot that stands and one that goes by
_ROUNDING_M = 0.01  # by which ways round somebody keep farther off than ways are asked to when they are looked at again
_STEP_S = 1.0 / CONTROL_HZ
_SDS = 3.0  # of a localisation error that both robots may have
_BESIDE = tuple((ring, k) for ring in (0.52, 0.62) for k in range(8))  # places beside a site that is taken
_MOST_ASIDE = 5  # places for a robot to step aside to that are tried


@dataclass(frozen=True, eq=False, kw_only=True)
class Disc:
    """A robot that stands for good.

    Attributes:
        x_m, y_m: Where [m].
        radius_m: Radius of its hull [m].
        name: Its name.
    """

    x_m: float
    y_m: float
    radius_m: float
    name: str


class Ways:
    """The ways of a world's robots; what is asked for twice is made once.

    Args:
        world: The world.
        costs: Fuel costs by robot.

    Attributes:
        gap_m: Least gap between two hulls in cells that exclude each other [m].
        orders: Plans in space and time made already, by the routes of the robots.
    """

    def __init__(self, world: World, costs: Mapping[str, FuelCosts]) -> None:
        self._costs = [costs[world.kind_of(robot)] for robot in world.robots]
        berths = place_berths(world)
        self._own = [own_world(world, berths, number) for number in range(len(world.robots))]
        self._sites = [{site.name: site for site in own.sites} for own in self._own]
        self.orders: dict[tuple[Route, ...], Order | None] = {}
        self._shortest: dict[tuple[int, str, str], Cut] = {}
        self._candidates: dict[tuple[int, str, str], tuple[Cut, ...]] = {}
        self._lines: dict[int, Lines] = {}
        located = world.noise.localisation
        self._off_m = 0.0 if located is None else _SDS * located.sd_m
        self.gap_m = gap_of(world)

    def model(self, robot: int) -> RobotModel:
        """A robot's figures."""
        return self._costs[robot].times.model

    def start(self, robot: int) -> Pose:
        """The pose in which a robot stands at its berth."""
        return self.pose(robot, self._own[robot].sites[0].name)

    def pose(self, robot: int, site: str) -> Pose:
        """The pose in which a robot stands at one of its sites."""
        at = self._sites[robot][site]
        return at.x_m, at.y_m, at.heading_rad

    def hops(self, robot: int, origin: str, destination: str) -> list[tuple[str, str]]:
        """Ends of the hops of a leg."""
        return list(pairwise(self._costs[robot].chain(origin, destination)))

    def candidates(self, robot: int, origin: str, destination: str) -> tuple[Cut, ...]:
        """The ways of a leg, the shortest first; nobody is led another one unless others are in the way."""
        key = robot, origin, destination
        if key not in self._candidates:
            self._candidates[key] = self._find_candidates(robot, origin, destination)
        return self._candidates[key]

    def _find_candidates(self, robot: int, origin: str, destination: str) -> tuple[Cut, ...]:
        shortest, hops = self.shortest(robot, origin, destination), self.hops(robot, origin, destination)
        if len(hops) > 1:  # a robot stops at the sites between
            return (shortest,)
        heading, times = self._sites[robot][destination].heading_rad, self._costs[robot].times
        others = alternatives(self._lines_of(robot), times.path(origin, destination))[1:]
        return (shortest, *(_no_sooner(cut(self.model(robot), (stretches(path, heading),), self.pose(robot, origin)),
                                       shortest.lasts_s) for path in others))

    def _lines_of(self, robot: int) -> Lines:
        if robot not in self._lines:
            own = self._own[robot]
            self._lines[robot] = ways_among(
                own.obstacles, np.array([(site.x_m, site.y_m) for site in own.sites]),
                self._costs[robot].times.clearance_m)
        return self._lines[robot]

    def shortest(self, robot: int, origin: str, destination: str) -> Cut:
        """The way of a leg that a robot takes if nobody is in its way."""
        key = robot, origin, destination
        if key not in self._shortest:
            course = self._costs[robot].times.course
            leg = tuple(course(a, b) for a, b in self.hops(robot, origin, destination))
            self._shortest[key] = cut(self.model(robot), leg, self.pose(robot, origin))
        return self._shortest[key]

    def site_at(self, robot: int, site: str, way: Cut) -> str | None:
        """The site at which a way ends; ``None`` if it ends beside it."""
        x, y, _ = self.pose(robot, site)
        end_x, end_y = way.leg[-1][-1].path[-1].tolist()
        return site if math.hypot(end_x - x, end_y - y) < 1e-6 else None

    def rest(self, robot: int, leg: Leg, arc_m: float, yaw: float) -> Cut:
        """What is left of a leg.

        Args:
            robot: The robot's position in its team.
            leg: The leg.
            arc_m: How far along it the robot stands [m].
            yaw: Its heading [rad].
        """
        left: list[tuple[Stretch, ...]] = []
        for hop in leg:
            ahead: list[Stretch] = []
            for stretch in hop:
                length = float(stretch.arc[-1])
                if arc_m >= length and not ahead and not left and (stretch is not leg[-1][-1]):
                    arc_m -= length
                    continue
                ahead.append(stretch if ahead or left else _from(stretch, min(arc_m, length)))
            if ahead:
                left.append(tuple(ahead))
        x, y = left[0][0].path[0]
        return cut(self.model(robot), tuple(left), (float(x), float(y), yaw))

    def blocked(self, robot: int, way: Cut, discs: Sequence[Disc], *, more_m: float = 0.0, passed_m: float = 0.0
                ) -> Disc | None:
        """The first of some standing robots that is in the way.

        Args:
            robot: The robot's position in its team.
            way: The way.
            discs: Who stands for good.
            more_m: How much farther than it has to be a way is to be from them [m].
            passed_m: How much of the way is behind it [m].
        """
        place_m = way.place_m[max(int(passed_m / CELL_M) - 1, 0):]
        for disc in discs:
            apart = np.hypot(place_m[:, 0] - disc.x_m, place_m[:, 1] - disc.y_m)
            if float(apart.min(initial=math.inf)) < self._passes_at(robot, disc) + more_m:
                return disc
        return None

    def round(self, robot: int, begin: Pose, destination: str, discs: Sequence[Disc]) -> Cut | None:
        """A way round standing robots to a site, or to a place beside it if somebody stands there.

        Args:
            robot: The robot's position in its team.
            begin: Where it stands.
            destination: The site.
            discs: Who stands for good.

        Returns:
            The way; ``None`` if there is none.
        """
        path = self._path_to(robot, begin[:2], destination, discs)
        heading = self.pose(robot, destination)[2]
        return None if path is None else cut(self.model(robot), (stretches(path, heading),), begin)

    def aside(self, robot: int, begin: Pose, destination: str, discs: Sequence[Disc]) -> tuple[Cut, ...]:
        """Ways to a site by way of a place where a robot can let others pass: its berth, or a site near by.

        Args:
            robot, begin, destination, discs: As of ``round``.
        """
        berth, *others = self._own[robot].sites
        others.sort(key=lambda site: math.dist(begin[:2], (site.x_m, site.y_m)))
        heading = self.pose(robot, destination)[2]
        found: list[Cut] = []
        for site in (berth, *others):
            place = site.x_m, site.y_m
            if site.name == destination or len(found) == _MOST_ASIDE or self._taken(robot, place, discs):
                continue
            there = self._path(robot, begin[:2], place, discs)
            on = None if there is None else self._path_to(robot, place, destination, discs)
            if there is not None and on is not None:
                found.append(cut(self.model(robot), (
                    stretches(there, site.heading_rad), stretches(on, heading)), begin))
        return tuple(found)

    def _path_to(self, robot: int, begin: tuple[float, float], destination: str, discs: Sequence[Disc]
                 ) -> FloatArray | None:
        """A path round standing robots to a site or beside it."""
        x, y, _ = self.pose(robot, destination)
        taken = self._taken(robot, (x, y), discs)
        beside = [(x + ring * math.cos(k * math.pi / 4), y + ring * math.sin(k * math.pi / 4)) for ring, k in _BESIDE]
        for place in beside if taken else [(x, y)]:
            if not self._taken(robot, place, discs):
                path = self._path(robot, begin, place, discs)
                if path is not None:
                    return path
        return None

    def _path(self, robot: int, begin: tuple[float, float], end: tuple[float, float], discs: Sequence[Disc]
              ) -> FloatArray | None:
        """A path round standing robots to a place."""
        clearance = self._costs[robot].times.clearance_m
        around = np.array([(disc.x_m, disc.y_m, self._passes_at(robot, disc) - clearance + _ROUNDING_M)
                           for disc in discs]).reshape(-1, 3)
        return way_round(self._own[robot].obstacles, np.array(begin), np.array(end), clearance, around)

    def _taken(self, robot: int, place: tuple[float, float], discs: Sequence[Disc]) -> bool:
        """Whether somebody stands too near to a place."""
        return any(math.dist(place, (disc.x_m, disc.y_m)) < self._passes_at(robot, disc) + _ROUNDING_M
                   for disc in discs)

    def _passes_at(self, robot: int, disc: Disc) -> float:
        """How near a robot's middle may come to that of one that stands [m]."""
        return self.model(robot).radius_m + disc.radius_m + _STANDS_OFF_M + self._off_m


def _no_sooner(way: Cut, lasts_s: float) -> Cut:
    """A way of a leg, planned to take longer than the shortest one does even where turns are fewer on it."""
    if way.lasts_s > lasts_s:
        return way
    longer = (lasts_s + _STEP_S) / way.lasts_s
    return replace(way, enter_s=way.enter_s * longer, lasts_s=way.lasts_s * longer)


def _from(stretch: Stretch, arc_m: float) -> Stretch:
    """A stretch from an arc length on."""
    if arc_m <= 0:
        return stretch
    path, arc = stretch.path, stretch.arc
    begin = np.array([[np.interp(arc_m, arc, path[:, axis]) for axis in (0, 1)]])
    rest: FloatArray = np.ascontiguousarray(np.concatenate([begin, path[arc > arc_m + 1e-9]]))
    if len(rest) < 2:
        rest = np.repeat(begin, 2, axis=0)
    return Stretch(rest, arc_lengths(rest), stretch.heading_rad)
