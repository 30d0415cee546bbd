"""How often intervals over maps hold the truth, on the VSS of random instances: two tables of docs/statistics.md.

The instances of the paper's three families are the population of maps; samples of them, with replacement, are batches:
first of modelled VSS, then of VSS as executed in trials whose failures all maps of a batch share.

    python -m benchmarks.coverage_maps [--seeds N] [--rounds N]
"""

from __future__ import annotations

import argparse
import math
from typing import Literal

import numpy as np
from scipy.stats import t as student_t

from sva_bench.analysis.moments import figure_of
from sva_bench.analysis.statistics import estimate, sample_mean
from sva_bench.arrays import FloatArray
from sva_bench.batch.map_samples import over_maps
from sva_bench.generate.instances import random_instance
from sva_bench.solver.two_stage import SolveLimits, knowledge_of, plan_deterministic, plan_nominal, plan_stochastic

FAMILIES: tuple[Literal["A", "B", "C"], ...] = ("A", "B", "C")
AVAILABILITIES = (0.75, 0.25, 0.0)
MAPS = (5, 10, 20, 40)
TRIALS = (50, 200, 1000)


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


def by_robot(seeds: int, availability: float) -> tuple[FloatArray, FloatArray]:
    """What the stochastic plan has more on each robot than the deterministic one, and the robots' availabilities.

    Returns:
        Shapes (instances, robots) and (robots,).
    """
    rows, available = [], np.zeros(0)
    for seed in range(seeds):
        for family in FAMILIES:
            instance = random_instance(family, pois=10, vehicles=2, availability=availability, fuel_multiple=None,
                                       tau=None, directed=False, seed=seed)
            stochastic = plan_stochastic(instance, SolveLimits())
            nominal = plan_nominal(instance, SolveLimits())
            pair = plan_deterministic(instance, stochastic, SolveLimits(), nominal=nominal)
            rows.append([float(v.incentives @ [(site in pair.stochastic.routes[v.name])
                                               - (site in pair.plan.routes[v.name]) for site in instance.sites])
                         for v in instance.vehicles])
            available = np.array([vehicle.availability for vehicle in instance.vehicles])
    return np.array(rows), available


def coverage_of_trials(differences: FloatArray, available: FloatArray, maps: int, trials: int, rounds: int
                       ) -> tuple[float, float]:
    """Share of batches whose interval over maps holds the mean: that of maps alone, and ours."""
    rng, truth = np.random.default_rng([maps, trials]), float((differences @ available).mean())
    most, one_draw = float(np.abs(differences).sum(axis=1).max()), np.zeros(trials, dtype=np.int64)
    alone, ours = [], []
    for _ in range(rounds):
        drawn = (rng.random((len(available), trials)) < available[:, None]).astype(np.float64)
        met = differences[rng.integers(len(differences), size=maps)] @ drawn
        own = [[estimate(figure_of(each, (-most, most), np.zeros(trials), (0.0, 0.0), one_draw, noisy=False))]
               for each in met]
        found, plain = over_maps(own, sure=False), sample_mean(met.mean(axis=1).tolist())
        if found.ci95 is not None and plain.ci95 is not None:
            ours.append(found.ci95[0] <= truth <= found.ci95[1])
            alone.append(plain.ci95[0] <= truth <= plain.ci95[1])
    return 100 * float(np.mean(alone)), 100 * float(np.mean(ours))


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
    print()
    print("| availability | trials | " + " | ".join(f"{n} maps" for n in MAPS) + " |")
    print("| ---: | ---: | " + " | ".join("---:" for _ in MAPS) + " |")
    for availability in AVAILABILITIES[:2]:
        differences, available = by_robot(told.seeds, availability)
        for trials in TRIALS:
            cells = [f"{ours:.1f} ({alone:.1f})" for alone, ours in (
                coverage_of_trials(differences, available, maps, trials, told.rounds // 4) for maps in MAPS)]
            print(f"| {100 * availability:.0f} % | {trials} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
