"""Drives: what robots drive, made once for all trials that share it, here or by workers, and put together to routes.

Under ``rollout`` the unit is a hop from site to site: driven once for each kind of robot, disturbance and pair of
sites, from rest in the origin's own pose, and composed into the routes of all plans. A robot stops at each site that it
comes through, also at those between the ends of a repaired leg, so a hop begins and ends alike wherever it stands.
Under ``kinematic`` and ``physics`` the unit is a whole route: by the twin, and for each trial by itself in physics, as
the check of what is composed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import Fidelity
from sva_bench.execution.case import Settings
from sva_bench.execution.corridor import solids_near, strayed
from sva_bench.execution.engines.engine import ENGINE_OF, ENGINES, Pose
from sva_bench.execution.following import downsampled, follow
from sva_bench.execution.legs import Hop, Leg
from sva_bench.execution.noise import NoiseDraw, draw_noise
from sva_bench.execution.outcome import Driven, Wait
from sva_bench.execution.screening import checked, wants_physics
from sva_bench.execution.shared.players import MissionKey, TeamDriven
from sva_bench.execution.touch import Touch, solid_at
from sva_bench.execution.waits import HopWait, waits_on
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.mission.plan import Route
from sva_bench.robot.disturbance import UNDISTURBED, Disturbance
from sva_bench.robot.model import RobotModel
from sva_bench.robot.twin import drive as drive_twin
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

TRACE_HZ = 20.0
_BACK_M = 0.3  # from the hull to a passage that a robot waits before
_CHUNK: Mapping[Fidelity, int] = {"kinematic": 16, "rollout": 8, "physics": 1}
"""Noise draws under which a worker drives a course at a time: a tenth of a second's work; handing it out is small."""

RouteKey = tuple[str, Route, int, int]
"""Robot, stops driven, rollout, and the trial under ``physics``, else 0: what a driven route depends on in a world."""

HopKey = tuple[str, Disturbance, str, str]
"""Kind of robot, disturbance, origin and destination: what a hop depends on in one world."""


@dataclass(eq=False, kw_only=True)
class Drives:
    """What was driven already, of the same world, seed and fidelity; it grows.

    Attributes:
        hops: Hops, by what they depend on.
        whole: Routes as they were driven whole.
        routes: Routes, driven whole or composed, with what the robot's tank holds and where it has to wait.
        missions: Missions of robots that share a world.
    """

    hops: dict[HopKey, Driven] = field(default_factory=dict)
    whole: dict[RouteKey, Driven] = field(default_factory=dict)
    routes: dict[RouteKey, Driven] = field(default_factory=dict)
    missions: dict[MissionKey, TeamDriven] = field(default_factory=dict)

    @property
    def of_missions(self) -> list[Driven]:
        """What each robot drove of the missions."""
        return [driven for mission in self.missions.values() for driven in mission.driven]


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


@dataclass(frozen=True, eq=False, kw_only=True)
class Chunk:
    """One course under some disturbances: what a worker is handed at a time.

    Attributes:
        keys: What each drive is of, length k.
        tasks: The drives; they differ in the disturbance, and in whether they are traced. Length k.
        what: For a person.
    """

    keys: tuple[RouteKey | HopKey, ...]
    tasks: tuple[DriveTask, ...]
    what: str


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


class Courses:
    """The drives behind the routes of a world: which they are, and how routes are put together from them."""

    def __init__(self, world: World, costs: Mapping[str, FuelCosts], settings: Settings) -> None:
        self._world, self._costs, self._settings = world, costs, settings
        self._numbers = {robot.name: number for number, robot in enumerate(world.robots)}
        # A worker needs the boxes alone; the twin drives through everything.
        self._solids = _NOWHERE if settings.fidelity == "kinematic" else replace(world.obstacles, cells=None)
        self._hops: dict[tuple[str, str, str], Hop] = {}
        self._may_wait = bool(world.passages) or world.noise.people is not None
        self._waited: dict[tuple[str, int, str, str], tuple[HopWait, ...]] = {}

    def chunks(self, wanted: Mapping[RouteKey, bool], known: Drives) -> list[Chunk]:
        """What has to be driven for some routes.

        Args:
            wanted: The routes, and whether each is traced.
            known: What was driven already.
        """
        size = _CHUNK[self._settings.fidelity]
        groups: dict[tuple[object, ...], list[tuple[RouteKey | HopKey, DriveTask]]] = {}
        if self._settings.fidelity == "rollout":
            for hop, (rollout, traced) in self._lacking(wanted, known).items():
                kind, disturbance, origin, destination = hop
                task = self._task(kind, origin, ((self._hop(kind, origin, destination),),), disturbance, traced)
                groups.setdefault((kind, origin, destination, rollout // size), []).append((hop, task))
        else:
            for key, traced in wanted.items():
                if key not in known.routes and key not in known.whole:
                    robot, route, rollout, trial = key
                    kind = self._kind(robot)
                    task = self._task(kind, route[0], self._legs(kind, route), self._drawn(key).disturbance, traced)
                    groups.setdefault((robot, route, rollout // size, trial), []).append((key, task))
        return [Chunk(keys=tuple(key for key, _ in group), tasks=tuple(task for _, task in group),
                      what=_what(group[0][0])) for group in groups.values()]

    def compose(self, wanted: Iterable[RouteKey], drives: Drives) -> None:
        """Put routes together from their hops, where they were not driven whole; ``drives`` receives them."""
        for key in wanted:
            if key not in drives.routes:
                drawn, kind = self._drawn(key), self._kind(key[0])
                driven = drives.whole[key] if key in drives.whole else composed(
                    [[drives.hops[kind, drawn.disturbance, a, b] for a, b in leg]
                     for leg in self._hops_of(kind, key[1])])
                drives.routes[key] = replace(driven, capacity=drawn.capacity, waits=self._waits(key, driven.leg_s))

    def _lacking(self, wanted: Mapping[RouteKey, bool], known: Drives) -> dict[HopKey, tuple[int, bool]]:
        """Hops that are not driven yet, or not traced: the first rollout that wants each, and whether it is traced."""
        lacking: dict[HopKey, tuple[int, bool]] = {}
        for key, traced in wanted.items():
            if key in known.routes:
                continue
            disturbance, kind = self._drawn(key).disturbance, self._kind(key[0])
            for leg in self._hops_of(kind, key[1]):
                for origin, destination in leg:
                    hop = kind, disturbance, origin, destination
                    rollout, before = lacking.get(hop, (key[2], False))
                    if hop not in known.hops or (traced and not len(known.hops[hop].pose)):
                        lacking[hop] = rollout, before or traced
        return lacking

    def _task(self, kind: str, origin: str, legs: tuple[Leg, ...], disturbance: Disturbance, traced: bool
              ) -> DriveTask:
        return DriveTask(obstacles=self._solids, model=self._costs[kind].times.model, legs=legs,
                         start=pose_at(self._world, self._costs[kind], origin),
                         fidelity=self._settings.fidelity, traced=traced, disturbance=disturbance)

    def _kind(self, robot: str) -> str:
        return self._world.kind_of(self._world.robots[self._numbers[robot]])

    def _drawn(self, key: RouteKey) -> NoiseDraw:
        return draw_noise(self._world.noise, self._settings.seed, key[2], self._numbers[key[0]])

    def _waits(self, key: RouteKey, leg_s: FloatArray) -> tuple[Wait, ...]:
        """The waits on each leg of a route, when by the share of the leg's way that lies before them."""
        if not self._may_wait:
            return ()
        robot, route, rollout, _ = key
        waits, kind = [], self._kind(robot)
        for leg, hops in enumerate(self._hops_of(kind, route)):
            met, way_m = [], 0.0
            for a, b in hops:
                met += [(way_m + wait.along_m, wait) for wait in self._hop_waits(robot, rollout, a, b)]
                way_m += sum(float(stretch.arc[-1]) for stretch in self._hop(kind, a, b))
            lasts_s = float(leg_s[leg]) if leg < len(leg_s) else 0.0
            waits += [Wait(leg=leg, lasts_s=wait.lasts_s, x_m=wait.x_m, y_m=wait.y_m, cause=wait.cause,
                           since_s=lasts_s * along_m / way_m) for along_m, wait in met]
        return tuple(waits)

    def _hop_waits(self, robot: str, rollout: int, origin: str, destination: str) -> tuple[HopWait, ...]:
        key, kind = (robot, rollout, origin, destination), self._kind(robot)
        if key not in self._waited:
            self._waited[key] = waits_on(
                self._hop(kind, origin, destination), (origin, destination), self._world.noise, self._world.passages,
                self._settings.seed, rollout, self._numbers[robot], self._costs[kind].times.model.radius_m + _BACK_M)
        return self._waited[key]

    def _hops_of(self, kind: str, route: Route) -> list[list[tuple[str, str]]]:
        """Ends of each hop of each leg."""
        return [list(pairwise(self._costs[kind].chain(*leg))) for leg in pairwise(route)]

    def _legs(self, kind: str, route: Route) -> tuple[Leg, ...]:
        return tuple(tuple(self._hop(kind, a, b) for a, b in leg) for leg in self._hops_of(kind, route))

    def _hop(self, kind: str, origin: str, destination: str) -> Hop:
        key = kind, origin, destination
        if key not in self._hops:
            self._hops[key] = self._costs[kind].times.course(origin, destination)
        return self._hops[key]


_NOWHERE = Obstacles(bounds_m=np.zeros(4), boxes=np.empty((0, 5)), cylinders=np.empty((0, 3)))


def pose_at(world: World, costs: FuelCosts, site: str) -> Pose:
    """How a robot of these costs stands at a site; where robots meet, at its own berth or slot there."""
    number = costs.times.number_of(site)
    place = world.sites[number]
    own = next((path[0] for path in costs.times.paths[number] if path is not None), None) if world.meets else None
    if own is None:
        return place.x_m, place.y_m, place.heading_rad
    return float(own[0]), float(own[1]), costs.times.headings_rad[number]


def _what(key: RouteKey | HopKey) -> str:
    """For a person: what is driven."""
    if isinstance(key[1], Disturbance):
        return f"drive of {key[0]} from {key[2]} to {key[3]}"
    return f"drive of {key[0]} under noise draw {key[2]}"


def composed(legs: Sequence[Sequence[Driven]]) -> Driven:
    """A route from the hops of its legs, each driven by itself; it ends where the robot gets stuck.

    Poses jump at stops by what a robot ends off its site: a centimetre and a hundredth of a radian.
    """
    times: list[float] = []
    touches: list[Touch] = []
    leg_of, clock, poses = [np.empty(0)], [np.empty(0)], [np.empty((0, 3))]
    physics_s, fault, stuck = 0.0, None, False
    for number, hops in enumerate(legs):
        total = 0.0
        for hop in hops:
            leg_of.append(np.full(len(hop.clock_s), float(number)))
            clock.append(total + hop.clock_s)
            poses.append(hop.pose)
            touches += [replace(touch, leg=number, since_s=total + touch.since_s) for touch in hop.touches]
            hop_s = float(hop.leg_s[0])
            total, physics_s, stuck = total + hop_s, physics_s + hop.in_physics * hop_s, hop.stuck
            if stuck:
                fault = hop.fault
                break
        times.append(total)
        if stuck:
            break
    return Driven(leg_s=np.array(times), stuck=stuck, touches=tuple(touches), fault=fault,
                  in_physics=physics_s / sum(times) if physics_s else 0.0,
                  leg_of=np.concatenate(leg_of), clock_s=np.concatenate(clock), pose=np.concatenate(poses))


def receive(drives: Drives, chunk: Chunk, driven: Sequence[Driven]) -> None:
    """Add what came of a chunk to what was driven."""
    for key, result in zip(chunk.keys, driven, strict=True):
        if isinstance(key[1], Disturbance):
            drives.hops[key] = result
        else:
            drives.whole[key] = result


def drive_all(
    chunks: Sequence[Chunk], drives: Drives, executor: Executor | None,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Make drives, here or by workers; ``drives`` receives them.

    Args:
        chunks: What to drive.
        drives: What was driven already.
        executor: Where drives run; ``None`` = here.
        progress: Called with the number of drives done and of all.
    """
    count, of = 0, sum(len(chunk.tasks) for chunk in chunks)

    def done(more: int) -> None:
        nonlocal count
        count += more
        if progress:
            progress(count, of)

    if executor is None:
        for chunk in chunks:
            driven = []
            for task in chunk.tasks:
                driven.append(drive_route(task))
                done(1)
            receive(drives, chunk, driven)
        return
    # The longest first, so that no worker is left with one at the end.
    order = sorted(chunks, key=_length_m, reverse=True)
    futures = {executor.submit(drive_tasks, chunk.tasks): chunk for chunk in order}
    try:
        for future in as_completed(futures):
            receive(drives, futures[future], future.result())
            done(len(futures[future].tasks))
    finally:
        for future in futures:
            future.cancel()


def _length_m(chunk: Chunk) -> float:
    """Way of all drives of a chunk."""
    return len(chunk.tasks) * sum(float(s.arc[-1]) for leg in chunk.tasks[0].legs for hop in leg for s in hop)
