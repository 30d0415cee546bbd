"""The heuristic alone on the classes of long routes: how far its plan stays behind the best known one.

Run: ``python -m benchmarks.solver.heuristic [--seconds 2] [--seed 0] [name ...]``; a name picks the classes that begin
with it. Seconds are processor time of one core, after which a search ends; without, it ends by its rounds.
"""

from __future__ import annotations

import argparse
import math
import time
from statistics import mean

import numpy as np

from benchmarks.solver.classes import CASES, Case
from sva_bench.solver.routes.fronts import leg_tables
from sva_bench.solver.routes.heuristic import search

BEST = {
    "A-60": (3685.1244, 3109.8596, 3570.4571),
    "A-60-M4": (5819.3364, 5344.4937, 5561.7919),
    "A-100": (5486.5036, 4457.2406, 5391.9421),
    "A-200": (8147.93, 8291.5271, 8343.3751),
}
"""Proved optima by class and seed; of A-200 with seed 0 the best known value (bound 8174.05)."""
GOALS_PCT = {"A-60": 0.2, "A-60-M4": 0.2, "A-100": 0.5, "A-200": 0.8}


def measure(case: Case, seconds: float, seed: int) -> str:
    """A line of the table."""
    off, used = [], []
    for number, best in enumerate(BEST[case.name]):
        instance = case.instance(number)
        tables = leg_tables(instance)
        weights = np.array([v.incentives * v.availability for v in instance.vehicles])
        began = time.process_time()

        def stop(value: float, until: float = began + seconds) -> bool:  # noqa: ARG001
            return time.process_time() >= until

        found = search(tables, weights, None, tuple(() for _ in weights), seed=seed, stop=stop)
        used.append(time.process_time() - began)
        value = math.fsum(weights[m, j] for m, order in enumerate(found.orders) for j in order)
        off.append(100 * (best - value) / best)
    goal = GOALS_PCT[case.name]
    return (f"{case.name:8s} {'yes' if mean(off) <= goal else 'NO ':3s} mean {mean(off):6.3f} % off (goal {goal:g} %): "
            f"{', '.join(f'{share:.2f}' for share in off)} in {', '.join(f'{s:.2f}' for s in used)} s")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    for vehicles in (2, 4):  # compiles both searches
        measure(Case(name="A-60-M4", family="A", pois=60, vehicles=vehicles, limit_s=0), 0.0, 0)
    for case in CASES:
        if case.name in BEST and (not args.names or any(case.name.startswith(name) for name in args.names)):
            print(measure(case, args.seconds, args.seed), flush=True)


if __name__ == "__main__":
    main()
