"""Travel times between sites: planned paths, timed by the kinematic twin."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray, IntArray, frozen_int
from sva_bench.choices import PathPlanner
from sva_bench.errors import BadInput, SvaBenchError, UnknownName, nearest
from sva_bench.files.printable import counted
from sva_bench.geometry.clearance import CLEARANCE_MARGINS_M
from sva_bench.geometry.distances import clearance
from sva_bench.geometry.passages import widest_passage
from sva_bench.robot.follower import Stretch, stretches
from sva_bench.robot.model import RobotModel
from sva_bench.robot.twin import leg_times
from sva_bench.travel.roadmap import plan_paths
from sva_bench.world.model import World

_log = logging.getLogger(__name__)

_ROUNDING = 1e-3  # the roadmap's polygons about arcs need passages wider than the clearance by so much
_NAMED = 10  # sites that a complaint names


class UnreachableSite(SvaBenchError):
    """No collision-free path joins some sites to others."""

    def __init__(self, origin: str, destinations: Sequence[str], radius_m: float, widest_m: float) -> None:
        super().__init__(origin, destinations, radius_m, widest_m)  # facts, not text: picklable
        self.origin, self.destinations = origin, tuple(destinations)
        self.radius_m, self.widest_m = radius_m, widest_m

    def __str__(self) -> str:
        names = ", ".join(map(repr, self.destinations[:_NAMED]))
        more = f" and {len(self.destinations) - _NAMED} more" if len(self.destinations) > _NAMED else ""
        fits = (f"the largest robot that gets there has a radius of {self.widest_m:.3f} m" if self.widest_m > 0
                else "no robot fits through, however small")
        return (f"no path from {self.origin!r} to {names}{more} for a robot of radius {self.radius_m} m; {fits}: "
                f"move {'it' if len(self.destinations) == 1 else 'them'}, or widen the passages between them")


class NeverArrives(SvaBenchError):
    """A path that the follower cannot finish with a robot's figures."""

    def __init__(self, model: str, origin: str, destination: str) -> None:
        super().__init__(model, origin, destination)
        self.model, self.origin, self.destination = model, origin, destination

    def __str__(self) -> str:
        return (f"robot model {self.model}: it never arrives at {self.destination!r} from {self.origin!r}; its speeds "
                f"and accelerations don't go together: change them in the world file")


@dataclass(frozen=True, eq=False, kw_only=True)
class TravelTimes:
    """Travel times of one robot model between sites, and its paths.

    Attributes:
        sites: Site names, length n; an index into it is a site's identity.
        model: The robot.
        time_ms: Time from site i to site j [ms], shape (n, n), zero diagonal. Directed.
        paths: Path from site i to site j [m], shape (k, 2); ``None`` on the diagonal.
        headings_rad: Heading in which a robot stops at each site, length n.
        clearance_m: Distance that the paths keep from obstacles [m].
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

    def __repr__(self) -> str:
        return (f"TravelTimes({self.model.name}: {counted(len(self.sites), 'site')}, up to "
                f"{self.time_ms.max(initial=0) / 1000:.1f} s)")

    def path(self, origin: str, destination: str) -> FloatArray:
        """The path from one site to another [m], shape (k, 2).

        Raises:
            UnknownName: If there is no such site.
            BadInput: If they are the same.
        """
        path = self.paths[self.number_of(origin)][self.number_of(destination)]
        if path is None:
            raise BadInput(f"{origin!r} has no path to itself; name two sites")
        return path

    def number_of(self, site: str) -> int:
        """A site's index.

        Raises:
            UnknownName: If there is no such site.
        """
        if site not in self.sites:
            raise UnknownName(f"there is no site {site!r}; {nearest(str(site), list(self.sites))}")
        return self.sites.index(site)

    def course(self, origin: str, destination: str) -> tuple[Stretch, ...]:
        """That path as the stretches that the follower drives."""
        heading = self.headings_rad[self.number_of(destination)]
        return stretches(self.path(origin, destination), heading)


def plan_travel_times(world: World, model: RobotModel, planner: PathPlanner = "prmstar") -> TravelTimes:
    """Paths between all pairs of sites, and their times by the kinematic twin.

    A robot starts in the origin's heading and stops in the destination's, so the time of a leg depends on its two
    ends alone: a matrix over sites is exact.

    Raises:
        UnreachableSite: If the model cannot get from the base to a site.
        NeverArrives: If the follower cannot drive a path with the model's figures.

    Source:
        ``f'`` of section 5.2 of the paper.
    """
    if model.followed_speed_m_s < model.max_speed_m_s:
        _log.warning("%s: its accelerations let it keep to a path at up to %.2f m/s, not at its max_speed_m_s of %g; "
                     "it is planned and driven at that; higher accelerations would let it be faster", model.name,
                     model.followed_speed_m_s, model.max_speed_m_s)
    points = np.array([(site.x_m, site.y_m) for site in world.sites])
    room = min(clearance(world.obstacles, x, y) for x, y in points)
    lost = None
    for margin in CLEARANCE_MARGINS_M:
        if room < model.radius_m + margin and margin != CLEARANCE_MARGINS_M[-1]:
            continue  # a site is nearer to an obstacle than such a path may be
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
    origin, destinations = lost
    raise UnreachableSite(world.sites[origin].name, [world.sites[j].name for j in destinations], model.radius_m,
                          _largest_radius(world, points[[origin, *destinations]], room))


def _unreachable(world: World, paths: list[list[FloatArray | None]]) -> tuple[int, list[int]] | None:
    """The first site that some others have no path from or to, and those; ``None`` if all are connected."""
    for i in range(len(world.sites)):
        lost = [j for j in range(len(world.sites)) if j != i and (paths[i][j] is None or paths[j][i] is None)]
        if lost:
            return i, lost
    return None


def _largest_radius(world: World, points: FloatArray, room: float) -> float:
    """Radius of the largest robot that can get between the points [m], rounded down to millimetres."""
    widest = widest_passage(world.obstacles, points) * (1 - _ROUNDING) - 2e-4
    radius = min(widest - CLEARANCE_MARGINS_M[-1], room)
    return max(math.floor(radius * 1000) / 1000, 0.0)


def _times_ms(world: World, model: RobotModel, paths: list[list[FloatArray | None]]) -> IntArray:
    n = len(world.sites)
    times = np.zeros((n, n), dtype=np.int64)
    for i, origin in enumerate(world.sites):
        pose = np.array([origin.x_m, origin.y_m, origin.heading_rad])
        courses = {j: stretches(path, world.sites[j].heading_rad)
                   for j, path in enumerate(paths[i]) if path is not None}
        for j, time_s in zip(courses, leg_times(model, list(courses.values()), pose).tolist(), strict=True):
            if not math.isfinite(time_s):
                raise NeverArrives(model.name, origin.name, world.sites[j].name)
            times[i, j] = max(round(time_s * 1000), 1)  # the model needs a positive cost between different sites
    return times
