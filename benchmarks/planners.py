"""The planners compared, on time and on the lengths of their paths against the optimum.

    python -m benchmarks.planners
"""

from __future__ import annotations

import time
from typing import get_args

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import PathPlanner
from sva_bench.travel.roadmap import plan_paths
from tests.oracles.visibility import shortest_lengths
from tests.oracles.worlds import free_places, random_obstacles

WORLDS, SITES, CLEARANCE_M = (2, 3, 5, 7, 11, 13), 12, 0.297


def measure(planner: PathPlanner) -> tuple[float, FloatArray, int]:
    """Processor time of a world [s], the ratios of all its paths to the optimum, and the pairs that it missed."""
    taken, missed, ratios = 0.0, 0, []
    for seed in WORLDS:
        obstacles = random_obstacles(seed)
        points = free_places(obstacles, seed, SITES, CLEARANCE_M)
        optimum = shortest_lengths(obstacles, points, CLEARANCE_M)
        begun = time.process_time()
        paths = plan_paths(obstacles, points, CLEARANCE_M, planner=planner)
        taken += time.process_time() - begun
        for i, row in enumerate(paths):
            for j, path in enumerate(row):
                if i != j and np.isfinite(optimum[i, j]):
                    missed += path is None
                    if path is not None:
                        ratios.append(float(np.hypot(*np.diff(path, axis=0).T).sum()) / optimum[i, j])
    return taken / len(WORLDS), np.array(ratios), missed


def main() -> None:
    """Print a row for each planner."""
    plan_paths(random_obstacles(0), free_places(random_obstacles(0), 0, 3, CLEARANCE_M), CLEARANCE_M)  # compiles
    print(f"{SITES} sites among 26 obstacles, {len(WORLDS)} worlds; ratio of a path's length to the optimum")
    for planner in get_args(PathPlanner):
        taken, ratios, missed = measure(planner)
        print(f"{planner:16} {taken:6.2f} s a world, mean {ratios.mean():.4f}, worst {ratios.max():.3f}, "
              f"{missed} pairs missed", flush=True)


if __name__ == "__main__":
    main()
