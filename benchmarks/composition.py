"""Routes composed from legs driven once against the same routes driven whole, both in physics, per route and per leg.

    python benchmarks/composition.py [WORLD ...] [--draws 4]
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.execute import execute
from sva_bench.execution.executed import Executed
from sva_bench.study.costs import plan_costs
from sva_bench.study.options import Options
from sva_bench.study.planning import plan_scenarios
from sva_bench.world.load import load_world

WORLDS = Path(__file__).parents[1] / "worlds"


def leg_times(runs: list[Executed]) -> dict[tuple[str, str, int, str], list[float]]:
    """Times of the legs of each route, by scenario, planner, rollout and robot."""
    found: dict[tuple[str, str, int, str], list[float]] = {}
    for run in runs:
        for leg in run.legs:
            found.setdefault((run.case.scenario.name, run.case.planner, leg.rollout, leg.robot), []).append(
                leg.driven_s)
    return found


def errors(name: str, draws: int) -> tuple[FloatArray, FloatArray]:
    """Relative errors of a world's routes and legs under so many noise draws, no robot failing."""
    world = load_world(WORLDS / f"{name}.yaml")
    costs = plan_costs(world, "prmstar", lambda *_: None)
    planned = plan_scenarios(world, costs, Options(), lambda *_: None)
    sure = {robot.name: 1.0 for robot in world.robots}
    cases = [Case(scenario=replace(s, availability=sure, joint=None), planner=planner, plan=plan)
             for s in world.scenarios for planner, plan in (
                 ("stochastic", planned[s.name].stochastic), ("deterministic", planned[s.name].deterministic))]
    both = [leg_times(execute(world, costs, cases, Settings(seed=0, trials=draws, rollouts=draws, fidelity=fidelity)))
            for fidelity in ("rollout", "physics")]
    routes, legs = {}, {}
    for key, whole in both[1].items():
        composed = both[0][key]
        assert len(composed) == len(whole)
        routes[tuple(whole)] = sum(composed) / sum(whole) - 1  # routes that plans share count once
        legs.update({(a, b): a / b - 1 for a, b in zip(composed, whole, strict=True)})
    return np.array(list(routes.values())), np.array(list(legs.values()))


def main() -> None:
    """Print a line for each world."""
    parser = argparse.ArgumentParser()
    parser.add_argument("worlds", nargs="*", default=sorted(path.stem for path in WORLDS.glob("*.yaml")))
    parser.add_argument("--draws", type=int, default=4)
    told = parser.parse_args()
    print("| world | routes | mean % | sd % | worst % | legs | mean % | sd % | worst % |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for name in told.worlds:
        cells = [f"{len(x)} | {100 * x.mean():+.3f} | {100 * x.std():.3f} | {100 * np.abs(x).max():.2f}"
                 for x in errors(name, told.draws)]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
