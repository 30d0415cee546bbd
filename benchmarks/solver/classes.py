"""Times the solver on the classes that its speed is promised for: median over seeds, process time of one core.

Run: ``python -m benchmarks.solver.classes [name ...]``; a name picks the classes that begin with it.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from sva_bench.choices import FailureProcess, InstanceFamily
from sva_bench.generate.instances import random_instance
from sva_bench.mission.instance import Instance
from sva_bench.solver.routes.fronts import leg_tables
from sva_bench.solver.routes.heuristic import search
from sva_bench.solver.two_stage import SolveLimits, plan_stochastic


@dataclass(frozen=True, kw_only=True)
class Case:
    """One class: what is to be reached, by when."""

    name: str
    family: InstanceFamily
    pois: int
    vehicles: int
    limit_s: float
    gap_pct: float = 0.0
    directed: bool = False
    failure: FailureProcess = "mission"
    seeds: int = 3

    def instance(self, seed: int) -> Instance:
        """The instance of a seed."""
        made = random_instance(self.family, pois=self.pois, vehicles=self.vehicles, availability=0.75, seed=seed,
                               directed=self.directed)
        return replace(made, failure=self.failure)


CASES = (
    Case(name="A-30", family="A", pois=30, vehicles=2, limit_s=10),
    Case(name="A-60", family="A", pois=60, vehicles=2, limit_s=10),
    Case(name="A-100", family="A", pois=100, vehicles=2, limit_s=90),
    Case(name="A-200", family="A", pois=200, vehicles=2, limit_s=180),
    Case(name="A-60-M4", family="A", pois=60, vehicles=4, limit_s=90),
    Case(name="B-30", family="B", pois=30, vehicles=2, limit_s=4),
    Case(name="B-40", family="B", pois=40, vehicles=2, limit_s=40),
    Case(name="B-60", family="B", pois=60, vehicles=2, limit_s=300),
    Case(name="C-40-M4", family="C", pois=40, vehicles=4, limit_s=4),
    Case(name="C-60-M4", family="C", pois=60, vehicles=4, limit_s=10),
    Case(name="C-60-M8", family="C", pois=60, vehicles=8, limit_s=180),
    Case(name="directed-A-30", family="A", pois=30, vehicles=2, limit_s=4, directed=True),
    Case(name="directed-B-30", family="B", pois=30, vehicles=2, limit_s=4, directed=True),
    Case(name="directed-B-40", family="B", pois=40, vehicles=2, limit_s=40, directed=True),
    Case(name="directed-A-60", family="A", pois=60, vehicles=2, limit_s=90, gap_pct=0.5, directed=True),
    Case(name="per-leg-A-30", family="A", pois=30, vehicles=2, limit_s=10, failure="per_leg"),
    Case(name="hazard-A-30", family="A", pois=30, vehicles=2, limit_s=10, failure="hazard"),
    Case(name="per-leg-C-30", family="C", pois=30, vehicles=2, limit_s=10, failure="per_leg"),
)
GRACE = 1.5  # a solve is stopped at so many times its limit, so that a miss has a figure


def measure(case: Case) -> str:
    """A line of the table."""
    seconds, gaps, off = [], [], []
    for seed in range(case.seeds):
        instance = case.instance(seed)
        began = time.process_time()
        plan = plan_stochastic(instance, SolveLimits(
            time_limit_s=GRACE * case.limit_s if case.gap_pct == 0 else case.limit_s))
        seconds.append(time.process_time() - began)
        assert plan.value is not None
        assert plan.bound is not None
        gaps.append(0.0 if plan.status == "optimal" else 100 * (plan.bound - plan.value) / plan.value)
        if case.failure == "mission":
            off.append(100 * (plan.value - alone(instance)) / plan.value)
    reached = median(gaps) <= case.gap_pct and (case.gap_pct > 0 or median(seconds) <= case.limit_s)
    goal = "proved" if case.gap_pct == 0 else f"gap {case.gap_pct:g} %"
    return (f"{case.name:14s} {goal:9s} in {case.limit_s:4g} s: {'yes' if reached else 'NO ':3s}  median "
            f"{median(seconds):6.1f} s, gap {median(gaps):.2f} %  ({', '.join(f'{s:.1f}' for s in seconds)} s)"
            + (f"  heuristic alone {median(off):.2f} % off" if off else ""))


def alone(instance: Instance) -> float:
    """Value of the heuristic's plan."""
    weights = np.array([v.incentives * v.availability for v in instance.vehicles])
    found = search(leg_tables(instance), weights, None, tuple(() for _ in instance.vehicles))
    return float(sum(weights[m, j] for m, order in enumerate(found.orders) for j in order))


def main(names: list[str]) -> None:
    """Print the table."""
    for warm in (Case(name="", family="B", pois=12, vehicles=2, limit_s=9),
                 Case(name="", family="A", pois=8, vehicles=2, limit_s=9, directed=True, failure="per_leg")):
        plan_stochastic(warm.instance(0))
    for case in CASES:
        if not names or any(case.name.startswith(name) for name in names):
            print(measure(case), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
