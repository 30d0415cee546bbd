"""Plans for other programs: Nav2 waypoints, GeoJSON, CSV."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from sva_bench.choices import ExportFormat
from sva_bench.errors import BadInput, nearest
from sva_bench.files.pretty import pretty_json
from sva_bench.mission.plan import Plan
from sva_bench.mission.plan_csv import routes_as_csv
from sva_bench.study.costs import grounds_of
from sva_bench.study.pictures import routes_of
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import Site, World

_DIGITS = 6  # of lengths [m] and of quaternions


@dataclass(frozen=True, eq=False, kw_only=True)
class Exported:
    """What is exported: a plan in a world.

    Attributes:
        world: The world.
        costs: Its fuel costs, with the paths between sites.
        plan: The plan.
        robot: The only robot that is wanted; ``None``: all that leave.
    """

    world: World
    costs: Mapping[str, FuelCosts]
    plan: Plan
    robot: str | None = None

    def robots(self) -> list[str]:
        """Names of the robots that are exported.

        Raises:
            BadInput: If the one that is wanted isn't there, or stays home.
        """
        leaving = [robot.name for robot in self.world.robots if len(self.plan.route(robot.name)) > 2]
        if self.robot is None:
            return leaving
        if self.robot not in [robot.name for robot in self.world.robots]:
            raise BadInput(f"--robot {self.robot[:64]}: there is none of that name; "
                           f"{nearest(self.robot, [robot.name for robot in self.world.robots])}")
        if self.robot not in leaving:
            raise BadInput(f"--robot {self.robot}: it stays home in this plan; leave out --robot, or name one of "
                           f"{', '.join(leaving) or 'none: nobody leaves'}")
        return [self.robot]


def as_nav2(exported: Exported) -> str:
    """Waypoints as RViz's panel of Nav2 saves and loads them: position, and orientation as w, x, y, z.

    One robot's file is such a file; of several, each robot's stands under its name. Stops and refuelling are up to
    whoever follows them.
    """
    robots, lines = exported.robots(), [f"# {exported.world.name}: stops of a plan, in the map's frame [m]"]
    for robot in robots:
        alone = len(robots) == 1
        lines += [] if alone else [f"{robot}:"]
        pad = "" if alone else "  "
        lines.append(f"{pad}waypoints:")
        sites = _sites_of(exported, robot)
        for number, name in enumerate(exported.plan.route(robot)[1:]):
            site = sites[name]
            half = math.remainder(site.heading_rad, 2 * math.pi) / 2
            lines += [f"{pad}  waypoint{number}:  # {name}",
                      f"{pad}    pose: [{_written(site.x_m)}, {_written(site.y_m)}, 0.0]",
                      f"{pad}    orientation: [{_written(math.cos(half))}, 0.0, 0.0, {_written(math.sin(half))}]"]
    return "\n".join(lines if robots else [*lines, "waypoints: {}"]) + "\n"


def as_geojson(exported: Exported) -> str:
    """Sites as points and legs along their planned paths as lines; coordinates are metres in the map's frame."""
    robots = exported.robots()
    visits = {name: robot for robot in robots for name in exported.plan.route(robot)[1:-1]}
    features = []
    for site in exported.world.sites:
        worth = {robot.name: robot.incentives[site.name] for robot in exported.world.robots
                 if site.name in robot.incentives}
        features.append(_feature("Point", _place(site.x_m, site.y_m), {
            "name": site.name, "kind": site.kind, "stop_s": site.stop_s,
            **({"incentives": worth, "visited_by": visits.get(site.name)} if site.kind == "poi" else {})}))
    kinds = {robot.name: exported.world.kind_of(robot) for robot in exported.world.robots}
    for robot, legs in routes_of(exported.world, exported.costs, exported.plan).items():
        cost = exported.costs[kinds[robot]]
        origin = exported.plan.route(robot)[0] if robot in robots else ""
        for number, leg in enumerate(legs if robot in robots else ()):
            sites = cost.times.sites
            planned_s = float(cost.cost_s[sites.index(origin), sites.index(leg.destination)])
            features.append(_feature("LineString", [_place(x, y) for x, y in leg.path.tolist()], {
                "robot": robot, "leg": number, "origin": origin, "destination": leg.destination,
                "planned_s": round(planned_s, 3)}))
            origin = leg.destination
    return pretty_json({"type": "FeatureCollection", "name": exported.world.name, "units": "m",
                        "frame": "the map's", "features": features})


def as_csv(exported: Exported) -> str:
    """Routes as columns ``robot, stop, site``, which ``certify`` and ``execute`` read."""
    return routes_as_csv({robot: exported.plan.route(robot) for robot in exported.robots()})


EXPORTS: dict[ExportFormat, Callable[[Exported], str]] = {"nav2": as_nav2, "geojson": as_geojson, "csv": as_csv}
"""How a plan is written for others; to add one, add its word to ``choices.ExportFormat`` and its function here."""


def _sites_of(exported: Exported, robot: str) -> dict[str, Site]:
    """The sites as they are to a robot: where robots meet, its base is its berth."""
    kind = next(exported.world.kind_of(r) for r in exported.world.robots if r.name == robot)
    return {site.name: site for site in grounds_of(exported.world)[kind].world.sites}


def _feature(kind: str, coordinates: Any, properties: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": dict(properties)}


def _place(x: float, y: float) -> list[float]:
    return [round(x, _DIGITS) + 0.0, round(y, _DIGITS) + 0.0]


def _written(value: float) -> str:
    return repr(round(value, _DIGITS) + 0.0)
