"""One robot's course driven: by the twin, in physics, or by the twin and in physics where that may matter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import Fidelity
from sva_bench.execution.corridor import solids_near, strayed
from sva_bench.execution.engines.engine import ENGINE_OF, ENGINES, Pose
from sva_bench.execution.following import downsampled, follow
from sva_bench.execution.legs import Hop, Leg
from sva_bench.execution.outcome import Driven
from sva_bench.execution.screening import checked, wants_physics
from sva_bench.execution.touch import solid_at
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.disturbance import UNDISTURBED, Disturbance
from sva_bench.robot.model import RobotModel
from sva_bench.robot.twin import drive as drive_twin

TRACE_HZ = 20.0


@dataclass(frozen=True, eq=False, kw_only=True)
class DriveTask:
    """One robot's course under one disturbance: all that a worker needs.

    Attributes:
        obstacles: What it can hit.
        model: The robot.
        start: Where it stands at rest: x, y [m], yaw [rad].
        legs: What it drives.
        fidelity: By the twin or in physics.
        traced: Whether poses are kept.
        disturbance: How it differs from its model.
    """

    obstacles: Obstacles
    model: RobotModel
    start: Pose
    legs: tuple[Leg, ...]
    fidelity: Fidelity
    traced: bool
    disturbance: Disturbance = UNDISTURBED

    @property
    def course(self) -> FloatArray:
        """Vertices of all its legs [m], shape (n, 2)."""
        return np.concatenate([np.array([self.start[:2]]), *(s.path for leg in self.legs for hop in leg for s in hop)])


def drive_route(task: DriveTask) -> Driven:
    """Drive a course, in physics or by the twin."""
    return drive_tasks((task,))[0]


def drive_tasks(tasks: Sequence[DriveTask]) -> tuple[Driven, ...]:
    """Drive one course under some disturbances, in physics among the obstacles near it.

    A robot that leaves the corridor might have met what was left out: its drive is made again among all obstacles.

    Args:
        tasks: The drives; they have their course, model and obstacles in common.
    """
    first = tasks[0]
    if first.fidelity == "kinematic":
        return tuple(_drive_legs(task, _twin_driver(task), []) for task in tasks)
    course = first.course
    near = solids_near(first.obstacles, course, first.model.radius_m)
    return tuple(_screened(task, near, course) if first.fidelity == "rollout" else _in_physics(task, near, course)
                 for task in tasks)


def _in_physics(task: DriveTask, near: Obstacles, course: FloatArray) -> Driven:
    poses: list[Pose] = []
    driven = _in_engine(task, near, poses)
    return _in_engine(task, task.obstacles, []) if strayed(poses, course) else driven


def _screened(task: DriveTask, near: Obstacles, course: FloatArray) -> Driven:
    """Drive by the twin, and in physics where that may make a difference, or to check the twin."""
    traced = replace(task, traced=True)
    poses: list[Pose] = []
    twin = _drive_legs(traced, _twin_driver(traced), poses)
    if twin.stuck or wants_physics(near, task.model, task.disturbance, np.array(poses).reshape(-1, 3)):
        return _in_physics(task, near, course)
    if checked(task.model, task.disturbance, course):
        return replace(_in_physics(task, near, course), twin_s=float(twin.leg_s.sum()))
    return twin if task.traced else replace(twin, leg_of=np.empty(0), clock_s=np.empty(0), pose=np.empty((0, 3)))


HopDriver = Callable[[Hop, list[Pose]], tuple[float, bool]]
"""Drives a hop and adds its poses to a list: driving time [s], and whether it arrived."""


def _twin_driver(task: DriveTask) -> HopDriver:
    pose = task.disturbance.start(task.start)

    def drive(hop: Hop, poses: list[Pose]) -> tuple[float, bool]:
        time_s, trace = drive_twin(task.model, hop, pose, task.disturbance, traced=task.traced)
        poses.extend((x, y, yaw) for x, y, yaw in trace.tolist())
        return (time_s, True) if np.isfinite(time_s) else (0.0, False)

    return drive


def _in_engine(task: DriveTask, near: Obstacles, poses: list[Pose]) -> Driven:
    """Drive in physics among some of the obstacles."""
    x, y, yaw = task.disturbance.start(task.start).tolist()
    with ENGINES[ENGINE_OF[task.fidelity]](near, task.model, (x, y, yaw), task.disturbance) as engine:

        def drive(hop: Hop, kept: list[Pose]) -> tuple[float, bool]:
            return follow(engine, task.model, hop, kept, task.disturbance)

        driven = _drive_legs(task, drive, poses)
        until_s = np.cumsum(driven.leg_s)
        # A touch is looked for at the end of a control step, so one that ends a leg is not later than the leg.
        legs = np.minimum(np.searchsorted(until_s, [touch.since_s - 1e-9 for touch in engine.touches]),
                          len(until_s) - 1)
        return replace(driven, in_physics=1.0, fault=engine.fault, touches=tuple(
            replace(touch, leg=leg, since_s=touch.since_s - (float(until_s[leg - 1]) if leg else 0.0),
                    solid=solid_at(task.obstacles, touch.x_m, touch.y_m))
            for leg, touch in zip(legs.tolist(), engine.touches, strict=True)))


def _drive_legs(task: DriveTask, drive: HopDriver, poses: list[Pose]) -> Driven:
    """Drive leg by leg until the end or until the robot is stuck; ``poses`` receives each of them."""
    times, at = [], []
    arrived = True
    for leg in task.legs:
        total, begun = 0.0, len(poses)
        for hop in leg:
            time_s, arrived = drive(hop, poses)
            total += time_s
            if not arrived:
                break
        times.append(total)
        at.append(downsampled(poses[begun:] if task.traced else [], TRACE_HZ))
        if not arrived:
            break
    return Driven(
        leg_s=np.array(times), stuck=not arrived,
        leg_of=np.concatenate([np.empty(0), *(np.full(len(clock), float(leg)) for leg, (clock, _) in enumerate(at))]),
        clock_s=np.concatenate([np.empty(0), *(clock for clock, _ in at)]),
        pose=np.concatenate([np.empty((0, 3)), *(pose for _, pose in at)]))
