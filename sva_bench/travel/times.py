"""Travel times between sites: planned paths, timed by the kinematic twin."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray, IntArray, frozen_int
from sva_bench.errors import SvaBenchError
from sva_bench.robot.follower import Stretch, stretches
from sva_bench.robot.model import RobotModel
from sva_bench.robot.twin import drive
from sva_bench.travel.roadmap import PlannerName, plan_paths
from sva_bench.world.clearance import clearance
from sva_bench.world.model import World

_log = logging.getLogger(__name__)

CLEARANCE_MARGINS_M = (0.12, 0.06, 0.03)
"""Distance to obstacles that paths keep beyond the robot's radius; the first that connects all sites.

The follower cuts gentle corners by up to 0.05 m and tracks to 0.01 m: at 0.12 m no robot touches anything.
"""


class UnreachableSite(SvaBenchError):
    """No collision-free path joins two sites."""

    def __init__(self, origin: str, destination: str, radius_m: float) -> None:
        super().__init__(origin, destination, radius_m)  # facts, not text: picklable
        self.origin, self.destination, self.radius_m = origin, destination, radius_m

    def __str__(self) -> str:
        return (f"no path from {self.origin!r} to {self.destination!r} for a robot of radius {self.radius_m} m: "
                f"move one of them, or widen the passage between them in the world file")


class NeverArrives(SvaBenchError):
    """A path that the follower cannot finish with a robot's figures."""

    def __init__(self, model: str, origin: str, destination: str) -> None:
        super().__init__(model, origin, destination)
        self.model, self.origin, self.destination = model, origin, destination

    def __str__(self) -> str:
        return (f"robot model {self.model}: it never arrives from {self.origin!r} at {self.destination!r}; its speeds "
                f"and accelerations don't go together: change them in the world file")


@dataclass(frozen=True, eq=False, kw_only=True)
class TravelTimes:
    """Time that one kind of robot needs from each site to each other, and the path it takes.

    Attributes:
        sites: Site names, length n; an index into it is a site's identity.
        model: The robot.
        time_ms: Time from site i to site j [ms], shape (n, n), zero diagonal. Directed.
        paths: Path from site i to site j [m], shape (k, 2); ``None`` on the diagonal.
        headings_rad: Heading in which a robot stops at each site, length n.
        clearance_m: Distance that the paths keep from obstacles.
    """

    sites: tuple[str, ...]
    model: RobotModel
    time_ms: IntArray
    paths: tuple[tuple[FloatArray | None, ...], ...]
    headings_rad: tuple[float, ...]
    clearance_m: float

    def __post_init__(self) -> None:
        n = len(self.sites)
        object.__setattr__(self, "time_ms", frozen_int(self.time_ms, (n, n)))

    def path(self, origin: str, destination: str) -> FloatArray:
        """The path from one site to another."""
        path = self.paths[self.sites.index(origin)][self.sites.index(destination)]
        assert path is not None, "a site has no path to itself"
        return path

    def course(self, origin: str, destination: str) -> tuple[Stretch, ...]:
        """That path as the follower drives it."""
        heading = self.headings_rad[self.sites.index(destination)]
        return stretches(self.path(origin, destination), heading)


def plan_travel_times(world: World, model: RobotModel, planner: PlannerName = "prmstar") -> TravelTimes:
    """Plan a path between each pair of sites and time it.

    A robot starts in the origin's heading and stops in the destination's, so the time of a leg depends on its two
    ends alone: a matrix over sites is exact.

    Raises:
        UnreachableSite: If the model cannot get from the base to a site.
        NeverArrives: If the follower cannot drive a path with the model's figures.

    Source:
        ``f'`` of section 5.2 of the paper.
    """
    points = np.array([(site.x_m, site.y_m) for site in world.sites])
    room = min(clearance(world.obstacles, x, y) for x, y in points)
    lost = None
    for margin in CLEARANCE_MARGINS_M:
        if room < model.radius_m + margin and margin != CLEARANCE_MARGINS_M[-1]:
            continue  # a site stands closer to an obstacle than such a path may come
        kept = min(model.radius_m + margin, room)
        paths = plan_paths(world.obstacles, points, kept, planner=planner)
        lost = _unreachable(world, paths)
        if lost is None:
            if margin != CLEARANCE_MARGINS_M[0]:
                _log.warning("%s: a site or a passage is narrow; all paths keep %.3f m from obstacles, where %.3f m "
                             "would be safer", model.name, kept, model.radius_m + CLEARANCE_MARGINS_M[0])
            return TravelTimes(
                sites=tuple(site.name for site in world.sites), model=model, clearance_m=kept,
                headings_rad=tuple(site.heading_rad for site in world.sites),
                time_ms=_times_ms(world, model, paths), paths=tuple(map(tuple, paths)))
    assert lost is not None
    raise UnreachableSite(*lost, model.radius_m)


def _unreachable(world: World, paths: list[list[FloatArray | None]]) -> tuple[str, str] | None:
    for j, site in enumerate(world.sites[1:], start=1):
        if paths[0][j] is None or paths[j][0] is None:
            return world.sites[0].name, site.name
    for i, origin in enumerate(world.sites):  # only a noisy planner misses one of these
        for j, site in enumerate(world.sites):
            if i != j and paths[i][j] is None:
                return origin.name, site.name
    return None


def _times_ms(world: World, model: RobotModel, paths: list[list[FloatArray | None]]) -> IntArray:
    n = len(world.sites)
    times = np.zeros((n, n), dtype=np.int64)
    for i, origin in enumerate(world.sites):
        for j, destination in enumerate(world.sites):
            path = paths[i][j]
            if path is None:
                continue
            pose = np.array([origin.x_m, origin.y_m, origin.heading_rad])
            time_s, _ = drive(model, stretches(path, destination.heading_rad), pose)
            if not math.isfinite(time_s):
                raise NeverArrives(model.name, origin.name, destination.name)
            times[i, j] = max(round(time_s * 1000), 1)  # the model needs a positive cost between different sites
    return times
