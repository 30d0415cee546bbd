"""Random worlds: rotated boxes, walls in any direction, cylinders, and free places among them."""

from __future__ import annotations

import math

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.geometry.obstacles import Obstacles
from tests.oracles.distances import points_clearance


def random_obstacles(seed: int, *, size_m: float = 14.0, boxes: int = 10, walls: int = 8, cylinders: int = 8
                     ) -> Obstacles:
    """Obstacles all over a square; they may overlap each other and the bounds."""
    rng = np.random.default_rng([seed, 1])
    solids = [[*rng.uniform(0, size_m, 2), *rng.uniform(0.15, 0.9, 2), rng.uniform(-math.pi, math.pi)]
              for _ in range(boxes)]
    solids += [[*rng.uniform(0, size_m, 2), rng.uniform(0.5, 0.2 * size_m), 0.05, rng.uniform(-math.pi, math.pi)]
               for _ in range(walls)]
    posts = [[*rng.uniform(0, size_m, 2), rng.uniform(0.15, 0.6)] for _ in range(cylinders)]
    return Obstacles(bounds_m=np.array([0.0, 0.0, size_m, size_m]), boxes=np.array(solids).reshape(-1, 5),
                     cylinders=np.array(posts).reshape(-1, 3))


def free_places(obstacles: Obstacles, seed: int, count: int, clearance_m: float) -> FloatArray:
    """Random places at least so far from everything, shape (count, 2)."""
    rng = np.random.default_rng([seed, 2])
    found = np.empty((0, 2))
    while len(found) < count:
        tried = rng.uniform(obstacles.bounds_m[:2], obstacles.bounds_m[2:], (200, 2))
        found = np.concatenate([found, tried[points_clearance(obstacles, tried) >= clearance_m]])
    return found[:count]
