"""stub until merged"""
import math
from dataclasses import replace
import numpy as np
from sva_bench.geometry.distances import clearance
def place_berths(world):
    base = world.sites[0]
    found = []
    for ring in (0.8, 1.2, 1.6, 2.0, 2.6):
        for k in range(16):
            p = (base.x_m + ring * math.cos(k * math.pi / 8), base.y_m + ring * math.sin(k * math.pi / 8))
            if clearance(world.obstacles, *p) > 0.35 and all(math.dist(p, q) >= 1.15 for q in found) and all(math.dist(p, (s.x_m, s.y_m)) > 0.8 for s in world.sites):
                found.append(p)
            if len(found) == len(world.robots):
                return tuple(found)
    raise ValueError
def own_world(world, berths, number):
    base = replace(world.sites[0], x_m=berths[number][0], y_m=berths[number][1])
    others = [(x, y, 0.5) for k, (x, y) in enumerate(berths) if k != number]
    o = world.obstacles
    return replace(world, sites=(base, *world.sites[1:]), obstacles=replace(o, cylinders=np.concatenate([o.cylinders, np.array(others).reshape(-1, 3)])))
