"""Times the solves of a small mission: 12 POIs, 5 stations, 2 robots, four availabilities of the second.

Run: ``python benchmarks/solver_small.py [first_seed [count [pois]]]``.
"""

from __future__ import annotations

import itertools
import sys
import time

import numpy as np

from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.solver.preprocess import shortest_paths
from sva_bench.solver.two_stage import knowledge_of, plan_deterministic, plan_nominal, plan_stochastic, wait_and_see

SPEED_M_S = 0.45
TURN_S = 3.0
SIDE_M = 18.0


def mission(seed: int, pois: int = 12, stations: int = 5, capacity_s: float = 110.0,
            limit_s: float = 260.0) -> Instance:
    """A random mission with directed, metric travel times."""
    rng = np.random.default_rng(seed)
    n = 1 + stations + pois
    at = rng.uniform(0, SIDE_M, size=(n, 2))
    distance = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    fuel = (distance / SPEED_M_S + TURN_S) * rng.uniform(1, 1.05, size=(n, n))
    np.fill_diagonal(fuel, 0.0)
    fuel = np.minimum(shortest_paths(fuel, -1), fuel)
    vehicles = []
    for name, most in (("uv1", 150.0), ("uv2", 170.0)):
        incentives = np.concatenate([np.zeros(1 + stations), rng.uniform(0, most, size=pois)])
        vehicles.append(Vehicle(name=name, fuel_capacity_s=capacity_s, mission_limit_s=limit_s, availability=1.0,
                                incentives=incentives, fuel_s=fuel))
    sites = ("base", *(f"r{k}" for k in range(1, stations + 1)), *(f"p{k}" for k in range(1, pois + 1)))
    return Instance(name=f"small-{seed}", sites=sites, base=0, stations=tuple(range(1, stations + 1)),
                    stop_s=np.zeros(n), vehicles=tuple(vehicles))


def main(first: int = 0, count: int = 5, pois: int = 12) -> None:
    """Print the seconds of each solve."""
    print("seed  total  nominal  | p2: stochastic  ties  wait-and-see  [RP, EEV, least, WS]")
    for seed in range(first, first + count):
        base, began = mission(seed, pois), time.perf_counter()
        known = knowledge_of(base)
        nominal = plan_nominal(base, known=known)
        lines = []
        for p in (1.0, 0.75, 0.25, 0.0):
            instance, marks = base.with_availability({"uv2": p}), [time.perf_counter()]
            stochastic = plan_stochastic(instance, known=known)
            marks.append(time.perf_counter())
            plans = plan_deterministic(instance, stochastic, nominal=nominal, known=known)
            marks.append(time.perf_counter())
            foresight = wait_and_see(instance, known=known)
            marks.append(time.perf_counter())
            seconds = " ".join(f"{b - a:6.2f}" for a, b in itertools.pairwise(marks))
            lines.append(f"        p2 {p:4.2f}: {seconds}  [{plans.stochastic.value:.2f}, {plans.most:.2f}, "
                         f"{plans.least:.2f}, {foresight or float('nan'):.2f}]  {plans.stochastic.status} "
                         f"{plans.plan.status}")
        print(f"{seed:4d} {time.perf_counter() - began:6.2f}  {nominal.runtime_s:6.2f}  {nominal.value:.2f}")
        print("\n".join(lines), flush=True)


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
