"""Whether calibrated plans hold their share on draws that had no part in making them: docs/calibration.md, a table.

Run: ``python -m benchmarks.calibration [WORLD ...]``; by default the shipped worlds and ten random ones, in scenario
S2, under ``noise: realistic``; a quarter of an hour of processor time.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import sva_bench as sb
from sva_bench.choices import PathPlanner
from sva_bench.execution.twin_draws import TwinDraws
from sva_bench.study.costs import plan_costs
from sva_bench.world.model import World
from sva_bench.world.noise import REALISTIC

SCENARIO, SHARE = "S2", "1%"
FRESH, DRAWS = 1000, 2000  # number of a set of draws that no calibration uses, and how many of it
PLANNER: PathPlanner = "prmstar"
FAMILIES = ("rooms", "field", "aisles", "maze")


def random_worlds(folder: Path) -> list[Path]:
    """Ten random worlds of all families."""
    paths = []
    for number in range(10):
        family = FAMILIES[number % len(FAMILIES)]
        paths.append(folder / f"{family}-{number}.yaml")
        subprocess.run([sys.executable, "-m", "sva_bench", "world", "random", "--family", family, "--pois", "10",
                        "--seed", str(number), "-o", str(paths[-1])], check=True, stdout=subprocess.DEVNULL)
    return paths


def measure(world: World) -> None:
    """Print a row of the table."""
    begun = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    result = sb.run(world, scenario=SCENARIO, calibrate=SHARE, trials=1, rollouts=1, fidelity="kinematic")
    (scenario,) = result.summary.scenarios
    found = scenario.calibration
    assert found is not None
    case = next(run.case for run in result.executed if run.case.role == "calibrated")
    bad, value = TwinDraws(world, plan_costs(world, PLANNER, lambda *_: None), FRESH, None).judge(
        case.scenario, case.plan, DRAWS)
    rung = "nominal" if found.quantile is None else f"q{100 * found.quantile:g}" + (
        f" x {found.factor:g}" if found.factor != 1 else "")
    took = resource.getrusage(resource.RUSAGE_SELF).ru_utime - begun
    price = 100 * (1 - found.promised / found.nominal.promised)
    print(f"| {world.name} | {100 * found.nominal.bad.share:.1f} | {rung} | {'yes' if found.reached else 'no'} | "
          f"{100 * found.bad.share:.2f} | {100 * bad.mean():.2f} | {price:.1f} | {found.nominal.executed:.1f} | "
          f"{value.mean():.1f} | {took:.0f} |", flush=True)


def main() -> None:
    """Measure worlds given, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="*", type=Path)
    given = parser.parse_args().worlds
    print("| world | nominal: bad % | costs | reached | bad % | on other draws % | promises less % | nominal earns | "
          "earns | processor s |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        shipped = sorted((Path(__file__).parents[1] / "worlds").glob("*.yaml"))
        for path in given or [*shipped, *random_worlds(Path(folder))]:
            world = sb.load_world(path)
            measure(world if path.stem == "three-halls" else replace(world, noise=REALISTIC))


if __name__ == "__main__":
    main()
