"""A mission small enough to follow by hand: two POIs and a station on a line, three robots."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.execution.outcome import Assignment, Driven, RobotFate, Trace, trace_of
from sva_bench.execution.rules import settle
from sva_bench.execution.team_trace import NewsHeard, Rerouted
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.mission.failures import NEVER
from sva_bench.robot.model import BUILT_IN
from sva_bench.world.model import Robot, Scenario, Site, World
from sva_bench.world.noise import Noise

BASE = (1.0, 1.0, 0.0)
WORLD = World(
    name="line",
    obstacles=Obstacles(bounds_m=np.array([0, 0, 8, 4]), boxes=np.array([[4.0, 3.0, 0.5, 0.25, 0.3]]),
                        cylinders=np.array([[6.0, 3.0, 0.3]])),
    sites=(Site(name="base", kind="base", x_m=1.0, y_m=1.0, heading_rad=0.0),
           Site(name="r1", kind="station", x_m=5.0, y_m=1.0, heading_rad=0.0, stop_s=2.0),
           Site(name="p1", kind="poi", x_m=3.0, y_m=1.0, heading_rad=0.0),
           Site(name="p2", kind="poi", x_m=7.0, y_m=1.0, heading_rad=0.0)),
    robots=tuple(Robot(name=name, model=BUILT_IN["turtlebot2"], fuel_capacity_s=fuel, mission_limit_s=60.0,
                       availability=0.5, incentives={"p1": 30.0, "p2": 12.5})
                 for name, fuel in (("uv1", 20.0), ("uv2", 20.0), ("uv3", math.inf))),
    scenarios=(Scenario(name="nominal", availability={"uv1": 0.5, "uv2": 0.5, "uv3": 0.5}),),
    plan_failure="mission", execute_failure="mission", margin=0.0, noise=Noise(),
)
TOUR = ("base", "p1", "r1", "p2", "base")


def trace(robot: str, route: tuple[str, ...] = TOUR, *, fails_before: int = NEVER, limit_s: float = 60.0,
          fuel_s: float | None = None, stuck: bool = False) -> Trace:
    """A drive at 1 m/s along the line, posed at 20 Hz; nothing but the legs takes time, bar 2 s at r1."""
    at = {site.name: np.array([site.x_m, site.y_m]) for site in WORLD.sites}
    me = next(r for r in WORLD.robots if r.name == robot)
    poses, leg_of, clock, leg_s = [np.zeros((0, 3))], [np.zeros(0)], [np.zeros(0)], []
    for leg, (a, b) in enumerate(pairwise(route)):
        length = float(np.linalg.norm(at[b] - at[a]))
        share = np.arange(1, round(length * 20) + 1)[:, None] / round(length * 20)
        yaw = math.atan2(*(at[b] - at[a])[::-1])
        poses.append(np.hstack([at[a] + share * (at[b] - at[a]), np.full((len(share), 1), yaw)]))
        leg_of.append(np.full(len(share), leg))
        clock.append(share[:, 0] * length)
        leg_s.append(length)
    driven = Driven(leg_s=np.array(leg_s), stuck=stuck, leg_of=np.concatenate(leg_of), clock_s=np.concatenate(clock),
                    pose=np.concatenate(poses))
    orders = Assignment(
        robot=robot, route=route, stations=frozenset({"r1"}), incentives=me.incentives,
        stop_s={site.name: site.stop_s for site in WORLD.sites},
        fuel_capacity_s=me.fuel_capacity_s if fuel_s is None else fuel_s, mission_limit_s=limit_s)
    planned = np.array([at[site] for site in route]).reshape(-1, 2)
    return trace_of(orders, driven, settle(orders, driven, RobotFate(fails_before)), BASE, planned)


def mission_with_news() -> tuple[list[Trace], list[NewsHeard]]:
    """uv1 fails at the base, which uv2 learns after 4 s, on its way to r1; it takes over p2 and comes home after 14 s.

    uv3 was to stay at the base, and is sent to p1 in the place of uv1.
    """
    at = {site.name: np.array([site.x_m, site.y_m]) for site in WORLD.sites}

    def path(*stops: str) -> FloatArray:
        return np.array([at[site] for site in stops]).reshape(-1, 2)

    later = trace("uv3", ("base", "p1", "base"))
    later = replace(later, time_s=np.append(0.0, 4.0 + later.time_s), pose=np.vstack([later.pose[:1], later.pose]),
                    fuel_s=np.append(later.fuel_s[0], later.fuel_s), outcome=replace(
                        later.outcome, end_time_s=8.0,
                        events=tuple(replace(e, time_s=e.time_s + 4.0) for e in later.outcome.events)))
    news = NewsHeard(time_s=4.0, failed=("uv1",), learned=("uv2", "uv3"), rerouted=(
        Rerouted(robot="uv2", taken=("p2",), dropped=("p1",), old=path("r1", "p1", "base"),
                 new=path("r1", "p2", "base")),
        Rerouted(robot="uv3", taken=("p1",), dropped=(), old=path(), new=path("base", "p1", "base"))))
    return [trace("uv1", fails_before=0), trace("uv2", ("base", "r1", "p2", "base")), later], [news]
