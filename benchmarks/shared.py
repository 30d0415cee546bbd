"""Speed of missions in a shared world: planned, driven by the twin and in physics, and in trials by the thousand.

Processor time is told, for a shared machine; on two cores trials take about half of it.
Run: ``python -m benchmarks.shared [--trials N] [--part plan|twin|physics|trials ...]``.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from sva_bench.choices import FailureProcess, Fidelity
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.outcome import RobotFate
from sva_bench.execution.shared.execute import TeamTask, execute_team, ground_of, play_missions
from sva_bench.execution.shared.own_ways import Ways
from sva_bench.execution.shared.planning import first_order
from sva_bench.execution.shared.players import MissionKey, TeamDriven
from sva_bench.files.documents import parse_yaml
from sva_bench.generate.terrain import random_places, random_terrain
from sva_bench.mission.plan import Plan
from sva_bench.study.costs import plan_costs
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.load import world_of
from sva_bench.world.model import World

SIZE_M, DENSITY = 18.0, 0.1375  # about 30 obstacles
FEW = 4
ROLLOUTS = 32
PARTS = ("plan", "twin", "physics", "trials")
MISSIONS, IN_PHYSICS = 300, 4


def processor_s(work: Callable[[], Any]) -> tuple[float, Any]:
    """How long something takes, and what comes of it."""
    begun = time.process_time()
    made = work()
    return time.process_time() - begun, made


def world_with(robots: int, pois: int, failure: FailureProcess = "mission") -> World:
    """A field with 30 obstacles, as noisy as usual; of many robots sure of where they are, for berths to have room."""
    noise: Any = "realistic" if robots <= FEW else {"preset": "realistic", "localisation": None}
    terrain = random_terrain("field", size_m=SIZE_M, density=DENSITY, seed=2)
    places = random_places(terrain.obstacles, stations=1, pois=pois, seed=2)
    return world_of(parse_yaml(json.dumps({
        "format": "sva-bench/world@1", "name": "field", "interaction": "shared", "noise": noise,
        "failure": failure,
        "map": {"shapes": {"bounds_m": [0, 0, SIZE_M, SIZE_M], "obstacles": [dict(s) for s in terrain.shapes]}},
        "sites": {"base": {"at_m": list(places.base)}, "stations": {"r1": {"at_m": list(places.stations[0])}},
                  "pois": {f"p{k + 1}": {"at_m": list(place)} for k, place in enumerate(places.pois)}},
        "robots": {f"uv{k + 1}": {
            "model": "turtlebot2", "availability": 0.9, "mission_limit_s": 900, "fuel_capacity_s": 800,
            "incentives": {f"p{i + 1}": 10 for i in range(pois)}} for k in range(robots)}}), Path("field.yaml")))


def case_in(world: World) -> Case:
    """POIs dealt out in turn."""
    pois = [poi.name for poi in world.pois]
    count = len(world.robots)
    return Case(scenario=world.scenarios[0], planner="dealt", plan=Plan(routes={
        robot.name: ("base", *pois[k::count], "base") for k, robot in enumerate(world.robots)}))


def missions_of(world: World, costs: Mapping[str, FuelCosts], count: int, fidelity: Fidelity) -> TeamTask:
    """A task of missions in which nobody fails, each with noise of its own."""
    case = case_in(world)
    orders = tuple(orders_of(world, case, planned_legs(world, costs, [case])))
    routes, sure = tuple(own.route for own in orders), tuple(RobotFate() for _ in orders)
    return TeamTask(world=world, ground=ground_of(world, costs), orders=orders, seed=0, fidelity=fidelity,
                    keys=tuple(MissionKey(routes, sure, k) for k in range(count)), traced=(False,) * count)


def plan(robots: int, pois: int, least_s: float) -> None:
    """Print how long it takes to plan one mission in space and time."""
    world = world_with(robots, pois)
    costs = plan_costs(world, "prmstar", lambda *_: None)
    task = missions_of(world, costs, 1, "kinematic")
    taken = []
    for _ in range(3):
        ways_s, ways = processor_s(lambda: Ways(world, costs))
        order_s, order = processor_s(partial(first_order, ways, task.orders, (True,) * robots))
        assert order is not None
        taken.append((ways_s + order_s, ways_s, order_s))
    total_s, ways_s, order_s = min(taken)
    print(f"plan {robots} robots, {pois} POIs: {total_s:.2f} s (berths {ways_s:.2f}, ways and order {order_s:.2f}); "
          f"wanted {least_s:g}", flush=True)


def drive(fidelity: Fidelity, count: int) -> None:
    """Print how fast missions are played."""
    world = world_with(4, 20)
    task = missions_of(world, plan_costs(world, "prmstar", lambda *_: None), count, fidelity)
    play_missions(replace(task, keys=task.keys[:1], traced=task.traced[:1]))  # compiled code, ways and order
    taken_s, missions = processor_s(lambda: play_missions(task))
    clock_s = np.array([max(outcome.end_time_s for outcome in mission.robots) for mission in missions])
    print(f"{fidelity}, 4 robots, {len(world.obstacles.boxes) + len(world.obstacles.cylinders)} obstacles: "
          f"{count / taken_s:.1f} missions/s of {clock_s.mean():.0f} s each, {clock_s.sum() / taken_s:.0f} times real "
          f"time; {sum(mission.contacts for mission in missions)} contacts; wanted 100 missions/s in the twin, "
          "50 times real time in physics", flush=True)


def trials(failure: FailureProcess, count: int, wanted_min: float) -> None:
    """Print how long trials take at the fidelity of runs."""
    world = world_with(2, 20, failure)
    costs = plan_costs(world, "prmstar", lambda *_: None)
    settings = Settings(seed=0, trials=count, rollouts=ROLLOUTS, fidelity="rollout", recorded=False)
    known: dict[MissionKey, TeamDriven] = {}
    taken_s, (run,) = processor_s(
        lambda: execute_team(world, costs, [case_in(world)], settings, None, None, known))
    physics = sum(mission.in_physics for mission in known.values())
    print(f"trials {failure}, 2 robots, 20 POIs, {count} trials: {taken_s / 60:.1f} min of processor time, "
          f"{len(known)} missions played, {physics} in physics; {run.value.sum(axis=1).mean():.1f} earned; "
          f"wanted for 1000 {2 * wanted_min:g} min", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--part", choices=PARTS, nargs="*", default=PARTS)
    asked = parser.parse_args()
    if "plan" in asked.part:
        plan(4, 20, 0.3)
        plan(10, 20, 3.0)
    if "twin" in asked.part:
        drive("kinematic", MISSIONS)
    if "physics" in asked.part:
        drive("physics", IN_PHYSICS)
    if "trials" in asked.part:
        trials("mission", asked.trials, 3)
        trials("per_leg", asked.trials, 10)


if __name__ == "__main__":
    main()
