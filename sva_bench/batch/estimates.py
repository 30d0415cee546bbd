"""Estimates of a grid's cost before it is run, refined by the cache's content."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sva_bench.analysis.calibration import LEAST_DRAWS, draws_for
from sva_bench.batch.cache import Cache
from sva_bench.batch.folder import units_in
from sva_bench.batch.grid import Grid, Point
from sva_bench.batch.jobs import DriveJob, PlansJob, TravelTimesJob
from sva_bench.batch.reactions import ReactionsJob
from sva_bench.batch.strands import strand
from sva_bench.study.options import Options, reactions_of
from sva_bench.workers.engine import Job
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import World

# Measured on a core of a shared virtual machine, over the shipped worlds: within a factor of two of each, cold.
_PATHS_S, _PLANS_S, _CALIBRATION_S, _REACTION_S, _ROW_S = 1.0, 1.2, 9.0, 2.5, 1.5e-6
_UNIT_S = 0.15
"""Of a unit, whatever its trials: reading what is cached, facts, its table and its share of the summary."""
_STARTED_S = 4.5
"""Of this process and a worker, which load their libraries: most of it where all is cached."""
_REAL_TIME = 800.0
"""Speed of physics relative to real time."""
_TWIN_TIME = 8000.0
_USUAL_MISSION_S = 600.0
_USUAL_POIS = 16  # of the shipped worlds, at least
_OWN_LEGS = 0.3  # share of the legs of all plans that are driven anew: plans have legs in common
_IN_PHYSICS = 0.19  # share of them that is driven in physics, up to rollouts
_DRIVEN = 0.5  # share of the mission limit that a robot drives, failures considered
_ROW_BYTES = 5.0


@dataclass(frozen=True, kw_only=True)
class StrandCost:
    """One point and seed: units, rows, bytes on disk, and processor time [s]."""

    point: Point
    seed: int
    units: int
    rows: int
    disk_bytes: float
    processor_s: float


def estimates(grid: Grid, cache: Cache, folder: Path, progress: OnProgress = lambda *_: None) -> list[StrandCost]:
    """Estimated cost of the remaining units of each point and seed."""
    done = frozenset(units_in(folder)) if folder.is_dir() else frozenset()
    seen: set[str] = set()
    listed: list[StrandCost] = []
    of = len(grid.points) * len(grid.seeds)
    for point, seed in grid.strands():
        progress("estimating", len(listed), of)
        listed.append(_estimate(grid, point, seed, done, cache, seen))
    return listed


def total_s(listed: Sequence[StrandCost]) -> float:
    """Estimated processor time of all of them with one worker process [s]."""
    return sum(e.processor_s for e in listed) + (_STARTED_S if any(e.units for e in listed) else 0.0)


def _estimate(grid: Grid, point: Point, seed: int, done: frozenset[str], cache: Cache, seen: set[str]) -> StrandCost:
    world = point.world
    left = [count for first, count in grid.ranges() if grid.unit_name(point, seed, first) not in done]
    rows = sum(left) * len(world.scenarios) * (2 if grid.options.calibrate is None else 3) * len(world.robots)
    seconds = rows * _ROW_S + len(left) * _UNIT_S
    if grid.options.fidelity == "physics":
        seconds += rows * _DRIVEN * _mission_s(point) / _REAL_TIME
    steps = strand(grid, point, seed, done)
    jobs: Sequence[Job] | None = next(steps, None)
    while jobs and jobs[0].kept:
        results = []
        for job in jobs:
            key = job.key
            found = cache.get(job, key)
            if found is None and key not in seen:
                seconds += _seconds(job)
            seen.add(key)
            results.append(found)
        if any(result is None for result in results):
            seconds += _beyond(jobs[0], point, grid, planned=f"plans of {point.name}" in seen)
            seen.add(f"plans of {point.name}")
            break
        jobs = steps.send(results)
    steps.close()
    return StrandCost(point=point, seed=seed, units=len(left), rows=rows, disk_bytes=rows * _ROW_BYTES,
                    processor_s=seconds)


def _seconds(job: Job) -> float:
    if isinstance(job, TravelTimesJob):
        return _PATHS_S
    if isinstance(job, PlansJob):
        return (_plans_s(job.world) + _calibration_s(job.options)) * len(job.world.scenarios)
    if isinstance(job, ReactionsJob):
        return _reactions_s(job.world, job.options)
    assert isinstance(job, DriveJob)
    task = job.tasks[0]
    driving_s = float(np.hypot(*np.diff(task.course, axis=0).T).sum()) / task.model.followed_speed_m_s
    return len(job.tasks) * driving_s / (_REAL_TIME if task.fidelity == "physics" else _TWIN_TIME)


def _plans_s(world: World) -> float:
    """Estimated processor time to solve a scenario [s]; few POIs are planned in no time."""
    return _PLANS_S * min(1.0, (len(world.pois) / _USUAL_POIS) ** 2)


def _calibration_s(options: Options) -> float:
    """Estimated processor time to calibrate a scenario's plan [s]."""
    return 0.0 if options.calibrate is None else _CALIBRATION_S * draws_for(options.calibrate) / LEAST_DRAWS


def _reactions_s(world: World, options: Options) -> float:
    return _REACTION_S * len(world.scenarios) * len(reactions_of(world, options)) * (2 if options.anticipate else 1)


def _beyond(job: Job, point: Point, grid: Grid, *, planned: bool) -> float:
    """Estimated processor time of the steps after one whose result isn't cached [s].

    Args:
        job: A job of that step.
        point, grid: What it is of.
        planned: Whether another seed of the point counts its plans, which all seeds share.
    """
    scenarios = len(point.world.scenarios)
    plans = 0.0
    if isinstance(job, TravelTimesJob) and not planned:
        plans = (_plans_s(point.world) + _calibration_s(grid.options)) * scenarios
    if not isinstance(job, ReactionsJob):
        plans += _reactions_s(point.world, grid.options)
    if isinstance(job, DriveJob | ReactionsJob) or grid.options.fidelity == "physics":
        return plans
    rollouts = min(grid.options.rollouts, grid.options.trials) if point.world.noisy else 1
    # A stochastic plan for each scenario and about one deterministic plan for all.
    driving_s = _OWN_LEGS * (scenarios + 1) * len(point.world.robots) * rollouts * _mission_s(point)
    in_physics = 0.0 if grid.options.fidelity == "kinematic" else _IN_PHYSICS
    return plans + driving_s * (1 / _TWIN_TIME + in_physics / _REAL_TIME)


def _mission_s(point: Point) -> float:
    limits = [robot.mission_limit_s for robot in point.world.robots]
    return sum(limit if math.isfinite(limit) else _USUAL_MISSION_S for limit in limits) / len(limits)
