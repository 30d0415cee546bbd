"""What coordination is worth: the shipped worlds under each interaction, for the table of docs/shared-worlds.md.

The stochastic plan of each scenario, made for robots that leave from berths, is executed by the twin, in the same
trials and noise draws, without noise and under ``noise: realistic``. Processor time is that of the execution.
Run: ``python -m benchmarks.interaction [WORLD ...]``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sva_bench.choices import INTERACTIONS, Interaction
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Drives
from sva_bench.execution.execute import execute
from sva_bench.execution.executed import Executed
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.shared.execute import Wanted, ground_of, play_all
from sva_bench.execution.shared.players import MissionKey, TeamDriven
from sva_bench.execution.shared.unfailed import unfailed_keys
from sva_bench.mission.plan import Plan
from sva_bench.solver.two_stage import plan_stochastic
from sva_bench.study.costs import instance_of, plan_costs
from sva_bench.study.libraries import load_libraries
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.load import load_world
from sva_bench.world.model import World
from sva_bench.world.noise import REALISTIC, Noise

WORLDS = Path(__file__).parents[1] / "worlds"
SHIPPED = ("four-rooms", "maze", "open-field", "three-robots", "warehouse")
TRIALS, ROLLOUTS = 1000, 32
HEAD = ("world", "scenario", "promised", "independent", "uncoordinated", "shared", "missions with a contact %",
        "waits s", "detours", "time %", *(f"{name} processor s" for name in INTERACTIONS))


@dataclass(frozen=True, eq=False, kw_only=True)
class Played:
    """A scenario's stochastic plan, executed under one interaction.

    Attributes:
        run: What came of it.
        longer_pct: How much longer the team's routes take than if each robot were alone, nobody failing.
        processor_s: Processor time of the execution.
    """

    run: Executed
    longer_pct: float
    processor_s: float

    @property
    def value(self) -> float:
        """Mean value of the team."""
        return float(self.run.value.sum(axis=1).mean())


def played(world: World, costs: Mapping[str, FuelCosts], plans: Mapping[str, Plan]) -> list[Played]:
    """The plan of each scenario, executed."""
    settings = Settings(seed=0, trials=TRIALS, rollouts=ROLLOUTS if world.noisy else 1, fidelity="kinematic",
                        recorded=False)
    found = []
    for scenario in world.scenarios:
        case, drives = Case(scenario=scenario, planner="stochastic", plan=plans[scenario.name]), Drives()
        begun = time.process_time()
        (run,) = execute(world, costs, [case], settings, None, None, drives)
        took = time.process_time() - begun
        found.append(Played(run=run, processor_s=took,
                            longer_pct=_longer_pct(world, costs, case, settings, drives.missions)))
    return found


def _longer_pct(world: World, costs: Mapping[str, FuelCosts], case: Case, settings: Settings,
                known: Mapping[MissionKey, TeamDriven]) -> float:
    if not world.meets:
        return 0.0
    orders = orders_of(world, case, planned_legs(world, costs, [case]))
    keys = unfailed_keys(world, [case], orders, settings.rollouts)
    together, alone = dict(known), dict[MissionKey, TeamDriven]()
    for missions, by_themselves in ((together, False), (alone, True)):
        play_all(world, ground_of(world, costs), settings, [Wanted(orders, key) for key in keys], None, None, missions,
                 alone=by_themselves)
    ours, theirs = (sum(float(driven.leg_s.sum() + driven.waited_s.sum()) for key in keys
                        for driven in missions[key].driven) for missions in (together, alone))
    return 100 * (ours / theirs - 1)


def rows(path: Path, noise: Noise) -> list[list[str]]:
    """The rows of a world, one of each scenario."""
    found: dict[Interaction, Sequence[Played]] = {}
    worlds = {name: replace(load_world(path), interaction=name, noise=noise) for name in INTERACTIONS}
    costs = {name: plan_costs(world, "prmstar", lambda *_: None) for name, world in worlds.items()}
    plans = {scenario.name: plan_stochastic(instance_of(worlds["shared"], costs["shared"], scenario))
             for scenario in worlds["shared"].scenarios}
    for name, world in worlds.items():
        found[name] = played(world, costs[name], plans)
    told = []
    for number, scenario in enumerate(load_world(path).scenarios):
        alone, apart, ours = (found[name][number] for name in ("independent", "uncoordinated", "shared"))
        assert apart.run.meetings is not None
        assert ours.run.meetings is not None
        assert not ours.run.meetings.contacts.any()
        told.append([path.stem, scenario.name, f"{plans[scenario.name].value or 0:.1f}",
                     f"{alone.value:.1f}", f"{apart.value:.1f}", f"{ours.value:.1f}",
                     f"{100 * np.mean(apart.run.meetings.contacts > 0):.1f}",
                     f"{ours.run.meetings.waited_s.mean():.1f}", f"{ours.run.meetings.detours.mean():.2f}",
                     f"{ours.longer_pct:+.1f}", *(f"{found[name][number].processor_s:.2f}" for name in INTERACTIONS)])
    return told


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="*", default=SHIPPED)
    load_libraries()
    for name, noise in (("without noise", Noise()), ("noise: realistic", REALISTIC)):
        print(f"{TRIALS} trials, {name}\n| {' | '.join(HEAD)} |\n| {' | '.join(['---'] * len(HEAD))} |")
        for world in parser.parse_args().worlds:
            for row in rows(WORLDS / f"{world}.yaml", noise):
                print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
