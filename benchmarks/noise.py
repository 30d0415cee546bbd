"""What each source of noise does to legs and routes of the shipped worlds, by the twin and in physics: docs/noise.md.

    python benchmarks/noise.py [--draws 16] [--only NAME ...] [--speed]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import Fidelity
from sva_bench.execution.driving import DriveTask, drive_route
from sva_bench.execution.noise import draw_noise
from sva_bench.execution.outcome import Driven
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.mission.plan_file import read_routes
from sva_bench.robot.disturbance import UNDISTURBED, Disturbance
from sva_bench.study.costs import plan_costs
from sva_bench.world.load import load_world
from sva_bench.world.noise import REALISTIC, LocalisationError, Noise

ROOT = Path(__file__).parents[1]
WORLDS = ("four-rooms", "maze", "open-field", "three-robots", "warehouse")
SHORT_S = 3.0  # legs that take less are left out of figures of legs
ERROR = REALISTIC.localisation
assert ERROR is not None
SOURCES: dict[str, Noise] = {
    "wheel gains 0.25 %": Noise(wheel_gain_sd=0.0025),
    "wheel gains 1 %": Noise(wheel_gain_sd=0.01),
    "speed gain 2 %": Noise(speed_gain_sd=0.02),
    "track 2 %": Noise(track_gain_sd=0.02),
    "track 5 %": Noise(track_gain_sd=0.05),
    "delay 50 ms": Noise(delay_s=(0.05, 0.05)),
    "delay 100 ms": Noise(delay_s=(0.1, 0.1)),
    "delay 30 to 120 ms": Noise(delay_s=(0.03, 0.12)),
    "localisation 3 cm": Noise(localisation=LocalisationError(sd_m=0.03, sd_deg=2.0, length_m=0.5)),
    "localisation 5 cm": Noise(localisation=ERROR),
    "payload 5 kg": Noise(payload_kg=(5.0, 5.0)),
    "realistic": replace(REALISTIC, capacity_sd=0.0),
}
FLOORS = {f"floors, friction {friction:g}": friction for friction in (0.15, 0.08, 0.05)}


def tasks() -> list[DriveTask]:
    """The route of the first robot in each shipped plan for S2."""
    found = []
    for name in WORLDS:
        world = load_world(ROOT / "worlds" / f"{name}.yaml")
        costs = plan_costs(world, "prmstar", lambda *_: None)
        routes = read_routes(ROOT / "plans" / f"{name}-S2.json", [robot.name for robot in world.robots],
                             [site.name for site in world.sites])
        robot = next(robot for robot in world.robots if routes.get(robot.name))
        fuel, base = costs[robot.model.name], world.sites[0]
        legs = tuple(tuple(fuel.times.course(a, b) for a, b in pairwise(fuel.chain(*leg)))
                     for leg in pairwise(routes[robot.name]))
        found.append(DriveTask(
            obstacles=replace(world.obstacles, cells=None), model=fuel.times.model,
            start=(base.x_m, base.y_m, base.heading_rad), legs=legs, fidelity="kinematic", traced=False))
    return found


def patched(obstacles: Obstacles, friction: float, number: int) -> Obstacles:
    """The same with patches of 0.5 to 1 m on a tenth of the floor, laid out in one of many ways."""
    rng = np.random.default_rng([7, number])
    (x0, y0, x1, y1), floors, covered = obstacles.bounds_m, [], 0.0
    while covered < 0.1 * (x1 - x0) * (y1 - y0):
        hx, hy = rng.uniform(0.25, 0.5, 2)
        floors.append([rng.uniform(x0, x1), rng.uniform(y0, y1), hx, hy, rng.uniform(0, np.pi), friction])
        covered += 4 * hx * hy
    return replace(obstacles, floors=np.array(floors))


def driven(task: DriveTask, fidelity: Fidelity, disturbance: Disturbance = UNDISTURBED) -> Driven:
    """A route driven whole."""
    return drive_route(replace(task, fidelity=fidelity, disturbance=disturbance))


def per_cent(values: Sequence[float] | FloatArray) -> str:
    """Mean and standard deviation of ratios, as deviations in per cent."""
    share = 100 * (np.array(values) - 1)
    return f"{share.mean():+.2f}; {share.std():.2f}"


def disturbed(name: str, task: DriveTask, rollout: int) -> DriveTask:
    """A task under a source of noise."""
    if name in FLOORS:
        return replace(task, obstacles=patched(task.obstacles, FLOORS[name], rollout))
    return replace(task, disturbance=draw_noise(SOURCES[name], 0, rollout, 0).disturbance)


def row_of(name: str, courses: Sequence[DriveTask], draws: int) -> str:
    """A source's row: deviations of legs and routes from those without noise, and of physics from the twin."""
    cells: list[str] = []
    clear: dict[tuple[int, int], dict[str, FloatArray]] = {}
    worst = 0.0
    fidelities: tuple[Fidelity, ...] = ("kinematic", "physics")
    for fidelity in fidelities:
        legs, routes, stuck, touched = [], [], 0, 0
        for number, task in enumerate(courses):
            calm = driven(task, fidelity).leg_s
            for rollout in range(draws):
                noisy = disturbed(name, task, rollout)
                found = driven(noisy, fidelity, noisy.disturbance)
                stuck, touched = stuck + found.stuck, touched + bool(found.touches)
                if not found.stuck:
                    legs += (found.leg_s[calm >= SHORT_S] / calm[calm >= SHORT_S]).tolist()
                    routes.append(found.leg_s.sum() / calm.sum())
                if not found.touches:
                    clear.setdefault((number, rollout), {})[fidelity] = found.leg_s
        worst = 100 * (max(legs) - 1)
        cells += [f"{100 * np.std(legs):.2f}", per_cent(routes)]
    pairs = [(times["physics"], times["kinematic"]) for times in clear.values() if len(times) == 2]
    apart = np.concatenate([(a / b)[b >= SHORT_S] for a, b in pairs])
    return (f"| {name} | {' | '.join(cells)} | {worst:+.0f} | {touched}, {stuck} of {len(courses) * draws} | "
            f"{per_cent(apart)} | {per_cent([a.sum() / b.sum() for a, b in pairs])} |")


def speed(courses: Sequence[DriveTask]) -> None:
    """Print how long the noisy twin and physics take."""
    loud = [draw_noise(SOURCES["realistic"], 0, rollout, 0).disturbance for rollout in range(16)]
    driven(courses[0], "kinematic", loud[0])  # compiles
    for what, disturbances in (("without noise", [UNDISTURBED] * 16), ("noisy", loud)):
        begun, rolled = time.process_time(), 0.0
        for task in courses:
            for disturbance in disturbances:
                rolled += driven(task, "kinematic", disturbance).leg_s.sum()
        each = (time.process_time() - begun) / (len(courses) * len(disturbances))
        print(f"twin, {what}: {1000 * each:.2f} ms a route of {rolled / 80:.0f} s; target 2", flush=True)
    for what, disturbance in (("without noise", UNDISTURBED), ("noisy", loud[0])):
        ratios = []
        for task in courses:
            begun = time.process_time()
            ratios.append(driven(task, "physics", disturbance).leg_s.sum() / (time.process_time() - begun))
        print(f"physics, {what}: {min(ratios):.0f} to {max(ratios):.0f} times real time; target 300", flush=True)
    task = courses[0]
    few = np.inf
    for count in (30, 600):
        crowded = replace(task, obstacles=crowd(task, count))
        spent = []
        for _ in range(3):
            begun = time.process_time()
            driven(crowded, "physics", loud[0])
            spent.append(time.process_time() - begun)
        few = min(few, min(spent))
        print(f"physics among {count} boxes: {min(spent):.3f} s, {min(spent) / few:.2f} times that of 30; target 1.5",
              flush=True)


def crowd(task: DriveTask, count: int) -> Obstacles:
    """A map with so many boxes, none of them within half a metre of a course."""
    rng = np.random.default_rng(3)
    (x0, y0, x1, y1), course = task.obstacles.bounds_m, task.course
    dense = np.concatenate([np.linspace(a, b, 20) for a, b in pairwise(course)])
    boxes: list[list[float]] = []
    while len(boxes) < count:
        x, y = rng.uniform(x0, x1), rng.uniform(y0, y1)
        if np.hypot(dense[:, 0] - x, dense[:, 1] - y).min() > 0.5:
            boxes.append([x, y, 0.1, 0.1, rng.uniform(0, np.pi)])
    return replace(task.obstacles, boxes=np.array(boxes), cylinders=np.empty((0, 3)))


def main() -> None:
    """Print a row for each source, or figures of speed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--draws", type=int, default=16)
    parser.add_argument("--only", nargs="*", default=[*SOURCES, *FLOORS])
    parser.add_argument("--speed", action="store_true")
    told = parser.parse_args()
    courses = tasks()
    if told.speed:
        speed(courses)
        return
    print("| source | twin: leg sd % | route mean; sd % | physics: leg sd % | route mean; sd % | worst leg % | routes "
          "that touch, stick | clear routes, physics against twin: leg mean; sd % | route mean; sd % |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for name in told.only:
        print(row_of(name, courses, told.draws), flush=True)


if __name__ == "__main__":
    main()
