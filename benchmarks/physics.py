"""How much faster than real time one robot is driven in physics, on one core.

    python benchmarks/physics.py
"""

from __future__ import annotations

import statistics
import time
from itertools import pairwise
from pathlib import Path

from sva_bench.execution.driving import DriveTask, drive_route
from sva_bench.travel.times import plan_travel_times
from sva_bench.world.load import load_world

ROUTE = ("base", "p3", "p5", "p6", "r3", "p4", "p1", "p2", "base")
RUNS = 5


def main() -> None:
    """Print the median ratio of simulated to processor time."""
    world = load_world(Path(__file__).parents[1] / "worlds" / "four-rooms.yaml")
    model = world.robots[0].model
    times = plan_travel_times(world, model)
    base = world.sites[0]
    task = DriveTask(
        obstacles=world.obstacles, model=model, start=(base.x_m, base.y_m, base.heading_rad),
        legs=tuple((times.course(a, b),) for a, b in pairwise(ROUTE)),
        fidelity="physics", traced=False)
    drive_route(task)  # compiles
    ratios = []
    for _ in range(RUNS):
        begun = time.process_time()
        driven = drive_route(task)
        ratios.append(driven.leg_s.sum() / (time.process_time() - begun))
    print(f"physics of one robot on {driven.leg_s.sum():.0f} s of four-rooms: median {statistics.median(ratios):.0f} "
          f"times real time, of {min(ratios):.0f} to {max(ratios):.0f}; target 80")


if __name__ == "__main__":
    main()
