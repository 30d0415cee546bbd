"""Occupancy grids as worlds: reading, travel times and physics by size of the map.

    python benchmarks/maps.py [CELLS ...]
"""

from __future__ import annotations

import resource
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

from sva_bench.arrays import FloatArray
from sva_bench.execution.driving import DriveTask, drive_route
from sva_bench.geometry.buckets import longest_view_heading
from sva_bench.geometry.cells import Cells, bounds_of, boxes_of, connected_region, distance_field
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.model import BUILT_IN
from sva_bench.travel.fuel import fuel_costs
from sva_bench.travel.times import plan_travel_times
from sva_bench.world.maps.ros import read_ros_map
from sva_bench.world.model import Site, World
from sva_bench.world.noise import Noise

CELL_M, ROOM, DOOR = 0.05, 100, 24  # cells: rooms of 5 m with doors of 1.2 m
SITES, RUNS = 25, 3
TARGETS = {400: (0.2, 5.0), 1000: (None, 20.0), 2000: (None, None)}  # s: reading, travel times


def office(cells: int, seed: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """Rooms with doors, furniture, and the ragged walls and speckles of a real map; 0 is black."""
    rng = np.random.default_rng(seed)
    level = np.full((cells, cells), 254, dtype=np.uint8)
    for at in range(0, cells, ROOM):
        for vertical in (False, True):
            view = level.T if vertical else level
            wall = view[at:at + 3]
            wall[:] = 0
            wall[:, rng.random(cells) < 0.1] = 205  # gaps that the scanner left
            for room in range(0, cells, ROOM):
                door = room + int(rng.integers(10, ROOM - DOOR - 10))
                wall[:, door:door + DOOR] = 254
    level[[0, -1]], level[:, [0, -1]] = 0, 0
    for _ in range(cells * cells // 8000):
        x, y = rng.integers(0, cells, 2)
        w, h = rng.integers(3, 16, 2)
        level[y:y + h, x:x + w] = 0
    speckles = rng.integers(0, cells, (cells * cells // 20_000, 2))
    level[speckles[:, 0], speckles[:, 1]] = 0
    return level


def map_world(cells: Cells, seed: int) -> World:
    """Sites all over the largest part that a TurtleBot2 reaches."""
    obstacles = Obstacles(bounds_m=bounds_of(cells), boxes=boxes_of(cells), cylinders=np.empty((0, 3)), cells=cells)
    field, rng = distance_field(cells), np.random.default_rng(seed)
    shape = field.distance_m.shape
    roomy = np.flatnonzero(field.distance_m >= 0.35)
    start = field.places(np.array(np.unravel_index(roomy[len(roomy) // 2], shape))[None])[0]
    reached = np.flatnonzero(connected_region(field, start, 0.35))
    chosen = np.unravel_index(rng.choice(reached, SITES, replace=False), shape)
    places: FloatArray = field.places(np.column_stack(chosen))
    sites = [Site(name=f"p{k}" if k else "base", kind="poi" if k else "base", x_m=x, y_m=y,
                  heading_rad=longest_view_heading(obstacles, x, y)) for k, (x, y) in enumerate(places.tolist())]
    return World(name="office", obstacles=obstacles, sites=tuple(sites), robots=(), scenarios=(),
                 plan_failure="mission", execute_failure="mission", margin=0.01, noise=Noise())


def measure(size: int) -> None:
    """Print what a map of so many cells squared takes."""
    model, read_s, times_s, ratios = BUILT_IN["turtlebot2"], [], [], []
    for seed in range(RUNS):
        with tempfile.TemporaryDirectory() as folder:
            Image.fromarray(office(size, seed)).save(Path(folder, "map.pgm"))
            Path(folder, "map.yaml").write_text(
                f"image: map.pgm\nresolution: {CELL_M}\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n"
                "free_thresh: 0.196\n")
            begun = time.process_time()
            cells, _ = read_ros_map(Path(folder), "map.yaml")
            boxes = boxes_of(cells)
            read_s.append(time.process_time() - begun)
        world = map_world(cells, seed)
        begun = time.process_time()
        costs = fuel_costs(plan_travel_times(world, model), world.margin)
        times_s.append(time.process_time() - begun)
        base = world.sites[0]
        longest = world.sites[1 + int(np.argmax(costs.repaired_ms[0, 1:]))].name
        task = DriveTask(
            obstacles=world.obstacles, model=model, start=(base.x_m, base.y_m, base.heading_rad),
            legs=((costs.times.course("base", longest),), (costs.times.course(longest, "base"),)),
            fidelity="physics", traced=False)
        begun = time.process_time()
        driven = drive_route(task)
        ratios.append(driven.leg_s.sum() / (time.process_time() - begun))
        assert not driven.stuck
    target_read, target_times = TARGETS.get(size, (None, None))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(f"{size} x {size} cells ({len(boxes)} boxes): reading {statistics.median(read_s):.3f} s (target "
          f"{target_read}), travel times of {SITES} sites {statistics.median(times_s):.2f} s of {min(times_s):.2f} to "
          f"{max(times_s):.2f} (target {target_times}), physics {statistics.median(ratios):.0f} times real time "
          f"(target 40 at 1000), at most {peak} MB so far", flush=True)


def main() -> None:
    """Print the figures of each size; the first compiles."""
    sizes = [int(word) for word in sys.argv[1:]] or [400, 1000, 2000]
    measure(200)
    for size in sizes:
        measure(size)


if __name__ == "__main__":
    main()
