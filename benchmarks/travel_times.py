"""All travel times of a world with 25 sites and 30 obstacles: planning, twin and repair together.

    python benchmarks/travel_times.py
"""

from __future__ import annotations

import statistics
import time

import numpy as np

from sva_bench.geometry.buckets import longest_view_heading
from sva_bench.geometry.distances import clearance
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.model import BUILT_IN
from sva_bench.travel.fuel import fuel_costs
from sva_bench.travel.times import plan_travel_times
from sva_bench.world.model import Site, World
from sva_bench.world.noise import Noise

SITES, OBSTACLES, RUNS = 25, 30, 5


def random_world(seed: int) -> World:
    """A field of 20 m with boxes and cylinders, and sites where a TurtleBot2 fits."""
    rng = np.random.default_rng(seed)
    boxes = [[*rng.uniform(1, 19, 2), *rng.uniform(0.2, 1.0, 2), rng.uniform(0, np.pi)] for _ in range(OBSTACLES // 2)]
    cylinders = [[*rng.uniform(1, 19, 2), rng.uniform(0.2, 0.7)] for _ in range(OBSTACLES // 2)]
    obstacles = Obstacles(bounds_m=np.array([0.0, 0.0, 20.0, 20.0]), boxes=np.array(boxes),
                          cylinders=np.array(cylinders))
    sites: list[Site] = []
    while len(sites) < SITES:
        x, y = rng.uniform(0.5, 19.5, 2)
        if clearance(obstacles, x, y) > 0.35:
            sites.append(Site(name=f"p{len(sites)}" if sites else "base", kind="poi" if sites else "base",
                              x_m=float(x), y_m=float(y), heading_rad=longest_view_heading(obstacles, x, y)))
    return World(name="random", obstacles=obstacles, sites=tuple(sites), robots=(), scenarios=(),
                 plan_failure="mission", execute_failure="mission", margin=0.01, noise=Noise())


def main() -> None:
    """Print the median time and its range."""
    model = BUILT_IN["turtlebot2"]
    fuel_costs(plan_travel_times(random_world(99), model), 0.01)  # compiles
    taken = []
    for seed in range(RUNS):
        world = random_world(seed)
        begun = time.process_time()
        costs = fuel_costs(plan_travel_times(world, model), world.margin)
        taken.append(time.process_time() - begun)
    print(f"travel times of {SITES} sites ({costs.pairs} pairs): median {statistics.median(taken):.2f} s of "
          f"{min(taken):.2f} to {max(taken):.2f} s; target 2 s")


if __name__ == "__main__":
    main()
