"""Times and weighs recordings of a mission of ten minutes with four robots: of one plan, and of two compared.

Run: ``python benchmarks/recording.py``.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from sva_bench.execution.outcome import Assignment, Driven, Trace, trace_of
from sva_bench.execution.rules import settle
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.recording.about import About
from sva_bench.recording.record import Side, record, record_pair
from sva_bench.robot.model import BUILT_IN
from sva_bench.world.model import Robot, Scenario, Site, World
from sva_bench.world.noise import Noise

ROBOTS, POIS, LEG_S, MISSION_S, POSES_HZ = 4, 40, 60.0, 600.0, 20
SPEED_M_S, SIDE_M = 0.5, 40.0
MOST_S, MOST_MB = 0.2, 4.0
MOST_COMPARED_S = 0.4


def world() -> World:
    """A square hall with POIs on a grid and forty boxes."""
    rng = np.random.default_rng(0)
    centers, halves, yaws = rng.uniform(1, SIDE_M - 1, (40, 2)), rng.uniform(0.3, 1.0, (40, 2)), rng.uniform(0, 3, 40)
    boxes = np.column_stack([centers, halves, yaws])
    at = rng.uniform(1, SIDE_M - 1, size=(POIS, 2)).tolist()
    sites = (Site(name="base", kind="base", x_m=2.0, y_m=2.0, heading_rad=0.0),
             *(Site(name=f"p{k}", kind="poi", x_m=x, y_m=y, heading_rad=0.0) for k, (x, y) in enumerate(at)))
    robots = tuple(
        Robot(name=f"uv{k}", model=BUILT_IN["turtlebot2"], fuel_capacity_s=700.0, mission_limit_s=900.0,
              availability=1.0, incentives={site.name: 50.0 for site in sites[1:]}) for k in range(ROBOTS))
    return World(
        name="hall", obstacles=Obstacles(bounds_m=np.array([0, 0, SIDE_M, SIDE_M]), boxes=boxes,
                                         cylinders=np.zeros((0, 3))), sites=sites, robots=robots,
        scenarios=(Scenario(name="nominal", availability={robot.name: 1.0 for robot in robots}),),
        plan_failure="mission", execute_failure="mission", margin=0.0, noise=Noise())


def trace(world: World, k: int) -> Trace:
    """Robot ``k`` on a meandering drive of ten minutes past ten sites."""
    rng = np.random.default_rng(k)
    legs, per_leg = round(MISSION_S / LEG_S), round(LEG_S * POSES_HZ)
    yaw = np.cumsum(rng.normal(0, 0.03, legs * per_leg))  # turns all the time: nothing to compress away
    x = SIDE_M / 2 + np.cumsum(np.cos(yaw)) * SPEED_M_S / POSES_HZ
    y = SIDE_M / 2 + np.cumsum(np.sin(yaw)) * SPEED_M_S / POSES_HZ
    driven = Driven(
        leg_s=np.full(legs, LEG_S), stuck=False, leg_of=np.repeat(np.arange(legs), per_leg),
        clock_s=np.tile(np.arange(1, per_leg + 1) / POSES_HZ, legs), pose=np.stack([x, y, yaw], axis=1))
    robot = world.robots[k]
    route = ("base", *(f"p{k * (legs - 1) + j}" for j in range(legs - 1)), "base")
    orders = Assignment(
        robot=robot.name, route=route, stations=frozenset(), incentives=robot.incentives,
        stop_s={site.name: 0.0 for site in world.sites}, fuel_capacity_s=robot.fuel_capacity_s,
        mission_limit_s=robot.mission_limit_s)
    planned = np.stack([x, y], axis=1)[::10]
    return trace_of(orders, driven, settle(orders, driven), (float(x[0]), float(y[0]), 0.0), planned)


def side(planner: str, traces: list[Trace]) -> Side:
    """One of two plans: each robot drives as in the other."""
    about = About(scenario="nominal", planner=planner, trial=0, seed=0, fidelity="rollout")
    return Side(about=about, traces=traces, routes={trace.orders.robot: trace.orders.route for trace in traces})


def measured(write: Callable[[Path], None]) -> tuple[float, float, float]:
    """Medians of five of elapsed and of processor time [s], and the size [MB]."""
    elapsed, busy = [], []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hall.rrd"
        for _ in range(5):
            began, began_busy = time.perf_counter(), time.process_time()
            write(path)
            elapsed.append(time.perf_counter() - began)
            busy.append(time.process_time() - began_busy)
        return statistics.median(elapsed), statistics.median(busy), path.stat().st_size / 1e6


def main() -> None:
    """Print times and sizes."""
    hall = world()
    traces = [trace(hall, k) for k in range(ROBOTS)]
    sides = [side(planner, traces) for planner in ("stochastic", "deterministic")]
    missed = False
    for name, most_s, most_mb, write in (
            ("one plan", MOST_S, MOST_MB, partial(record, world=hall, traces=traces, title="ten minutes, four robots")),
            ("two plans", MOST_COMPARED_S, 2 * MOST_MB,
             partial(record_pair, world=hall, sides=sides, title="compared"))):
        elapsed_s, busy_s, size_mb = measured(write)
        print(f"{name:9s}  {elapsed_s:.3f} s (at most {most_s} s), {busy_s:.3f} s of processor time, {size_mb:.2f} MB "
              f"(at most {most_mb:g} MB)")
        missed |= elapsed_s > most_s or size_mb > most_mb
    if missed:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
