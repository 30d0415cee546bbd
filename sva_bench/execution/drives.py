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
from sva_bench.execution.driving import DriveTask, drive_route, drive_tasks
from sva_bench.execution.engines.engine import Pose
from sva_bench.execution.legs import Hop, Leg
from sva_bench.execution.noise import NoiseDraw, draw_noise
from sva_bench.execution.outcome import Driven, Wait
from sva_bench.execution.shared.players import MissionKey, TeamDriven
from sva_bench.execution.touch import Touch
from sva_bench.execution.waits import HopWait, waits_on
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.mission.plan import Route
from sva_bench.robot.disturbance import Disturbance
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

_BACK_M = 0.3  # from the hull to a passage that a robot waits before
_CHUNK: Mapping[Fidelity, int] = {"kinematic": 16, "rollout": 8, "physics": 1}
"""Noise draws under which a worker drives a course at a time: a tenth of a second's work; handing it out is small."""

RouteKey = tuple[str, Route, int, int]
"""Robot, stops driven, rollout, and the trial under ``physics``, else 0: what a driven route depends on in a world."""

HopKey = tuple[str, Disturbance, str, str]
"""Kind of robot, disturbance, origin and destination: what a hop depends on in one world."""

Watch = Callable[[str, Driven], None]
"""What follows drives as they are made."""


@dataclass(eq=False, kw_only=True)
class Drives:
    """What was driven already, of the same world, seed and fidelity; it grows.

    Attributes:
        hops: Hops, by what they depend on.
        whole: Routes as they were driven whole.
        routes: Routes, driven whole or composed, with what the robot's tank holds and where it has to wait.
        missions: Missions of robots that share a world.
        watch: Told of each drive whose poses are kept, as it is made: the robot or kind of robot, and the drive.
    """

    hops: dict[HopKey, Driven] = field(default_factory=dict)
    whole: dict[RouteKey, Driven] = field(default_factory=dict)
    routes: dict[RouteKey, Driven] = field(default_factory=dict)
    missions: dict[MissionKey, TeamDriven] = field(default_factory=dict)
    watch: Watch | None = None

    @property
    def of_missions(self) -> list[Driven]:
        """What each robot drove of the missions."""
        return [driven for mission in self.missions.values() for driven in mission.driven]


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
        if drives.watch is not None and len(result.pose):
            drives.watch(key[0], result)


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
