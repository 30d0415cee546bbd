"""How often intervals over maps hold the truth, on the modelled VSS of random instances: a table of docs/statistics.md.

The instances of the paper's three families are the population of maps; samples of them, with replacement, are batches.

    python -m benchmarks.coverage_maps [--seeds N] [--rounds N]
"""

from __future__ import annotations

import argparse
import math
from typing import Literal

import numpy as np
from scipy.stats import t as student_t

from sva_bench.analysis.statistics import sample_mean
from sva_bench.arrays import FloatArray
from sva_bench.generate.instances import random_instance
from sva_bench.solver.two_stage import SolveLimits, knowledge_of, plan_deterministic, plan_nominal, plan_stochastic

FAMILIES: tuple[Literal["A", "B", "C"], ...] = ("A", "B", "C")
AVAILABILITIES = (0.75, 0.25, 0.0)
MAPS = (5, 10, 20, 40)


def vss_pct(seeds: int) -> FloatArray:
    """Modelled VSS in per cent of each instance under each availability, shape (instances, availabilities)."""
    rows = []
    for seed in range(seeds):
        for family in FAMILIES:
            known = nominal = None
            row = []
            for availability in AVAILABILITIES:
                instance = random_instance(family, pois=10, vehicles=2, availability=availability, fuel_multiple=None,
                                           tau=None, directed=False, seed=seed)
                known = known or knowledge_of(instance)
                nominal = nominal or plan_nominal(instance, SolveLimits(), known=known)
                stochastic = plan_stochastic(instance, SolveLimits(), known=known)
                pair = plan_deterministic(instance, stochastic, SolveLimits(), nominal=nominal, known=known)
                value = stochastic.value or 0.0
                row.append(100 * (value - pair.most) / value if value else 0.0)
            rows.append(row)
    return np.array(rows)


def coverage(population: FloatArray, maps: int, rounds: int) -> tuple[float, float, float]:
    """Share of samples of so many maps whose interval holds the mean: by Student's t, by ours; and without interval."""
    rng, truth = np.random.default_rng([maps, len(population)]), float(population.mean())
    plain, ours, none = [], [], 0
    for _ in range(rounds):
        sample = rng.choice(population, maps)
        found = sample_mean(sample.tolist())
        if found.ci95 is None:
            none += 1
            continue
        half = student_t.ppf(0.975, maps - 1) * sample.std(ddof=1) / math.sqrt(maps)
        plain.append(abs(sample.mean() - truth) <= half)
        ours.append(found.ci95[0] <= truth <= found.ci95[1])
    return 100 * float(np.mean(plain)), 100 * float(np.mean(ours)), 100 * none / rounds


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=150)
    parser.add_argument("--rounds", type=int, default=4000)
    told = parser.parse_args()
    figures = vss_pct(told.seeds)
    print("| availability | maps without VSS | mean VSS | " + " | ".join(f"{n} maps" for n in MAPS) + " |")
    print("| ---: | ---: | ---: | " + " | ".join("---:" for _ in MAPS) + " |")
    for column, availability in enumerate(AVAILABILITIES):
        population = figures[:, column]
        cells = [f"{ours:.1f} (t: {plain:.1f})" for plain, ours, _ in (
            coverage(population, maps, told.rounds) for maps in MAPS)]
        print(f"| {100 * availability:.0f} % | {100 * np.mean(population < 1e-9):.0f} % | {population.mean():.1f} % | "
              + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
