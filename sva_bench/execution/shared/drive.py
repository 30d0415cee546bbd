"""A mission of a team driven: by the joint twin, in physics, or by the twin and in physics where that may matter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import Fidelity
from sva_bench.execution.corridor import solids_near, strayed
from sva_bench.execution.known_team import Team
from sva_bench.execution.noise import NoiseDraw
from sva_bench.execution.outcome import Assignment, RobotFate
from sva_bench.execution.screening import checked, wants_physics
from sva_bench.execution.shared.driver import Member, TeamDriver
from sva_bench.execution.shared.lanes import Order
from sva_bench.execution.shared.mission import SharedMission
from sva_bench.execution.shared.own_ways import Ways
from sva_bench.execution.shared.players import TeamDriven
from sva_bench.execution.shared.reacting import ReactingMission
from sva_bench.execution.shared.team_bullet import TeamBullet
from sva_bench.execution.shared.team_twin import TeamTwin
from sva_bench.world.model import World

_FEW = 200  # obstacles that physics holds all; of more, those near the ways


@dataclass(frozen=True, eq=False, kw_only=True)
class TeamRun:
    """One mission: all that it depends on.

    Attributes:
        world: The world.
        ways: The ways of its robots.
        orders: Each robot's orders.
        fates: When each fails.
        drawn: How each differs from its model.
        order: The plan in space and time; ``None`` = nobody coordinates them.
        noise_index: Seed and number of the noise draw, for what robots meet on their ways.
        alone: Whether robots neither heed nor touch each other.
        switches: Whether robots may be let go before others that are late.
        team: What the team does about news; ``None`` if it keeps its orders.
    """

    world: World
    ways: Ways
    orders: Sequence[Assignment]
    fates: Sequence[RobotFate]
    drawn: Sequence[NoiseDraw]
    order: Order | None
    noise_index: tuple[int, int]
    alone: bool = False
    switches: bool = True
    team: Team | None = None


def drive_team(run: TeamRun, fidelity: Fidelity, *, traced: bool) -> TeamDriven:
    """Play one mission.

    Args:
        run: The mission.
        fidelity: By the twin, in physics, or by the twin, and in physics where that may make a difference.
        traced: Whether poses are kept.
    """
    members = [Member(model=run.ways.model(number), disturbance=mine.disturbance,
                      start=_pose(mine.disturbance.start(run.ways.start(number)))) for number, mine in
               enumerate(run.drawn)]
    if fidelity == "kinematic":
        return _played(run, TeamTwin(members, traced=traced), traced=traced)
    twin = _played(run, TeamTwin(members, traced=True), traced=True)
    if fidelity == "physics" or _wants_physics(run, twin):
        return _in_physics(run, members, twin, traced=traced)
    if _checked(run, twin):
        return replace(_in_physics(run, members, twin, traced=traced),
                       twin_s=sum(float(driven.leg_s.sum()) for driven in twin.driven))
    return twin if traced else _without_poses(twin)


def _pose(pose: FloatArray) -> tuple[float, float, float]:
    x, y, yaw = pose.tolist()
    return x, y, yaw


def _played(run: TeamRun, driver: TeamDriver, *, traced: bool) -> TeamDriven:
    with driver:
        if run.team is None:
            mission = SharedMission(run.world, run.ways, run.orders, run.fates, run.drawn, run.order, driver,
                                    run.noise_index, alone=run.alone, switches=run.switches)
        else:
            mission = ReactingMission(run.world, run.ways, run.team, run.fates, run.drawn, run.order, driver,
                                      run.noise_index)
        return replace(mission.play(), traced=traced)


def _in_physics(run: TeamRun, members: Sequence[Member], twin: TeamDriven, *, traced: bool) -> TeamDriven:
    """Drive in physics, among the obstacles near where the twins were; among all if a robot leaves these."""
    solids = replace(run.world.obstacles, cells=None)
    near, course = solids, np.concatenate([poses[:, :2] for poses in _poses(run, twin)])
    few = len(solids.boxes) + len(solids.cylinders) <= _FEW
    if not few:
        near = solids_near(solids, course, max(member.model.radius_m for member in members))
    driven = _played(run, TeamBullet(near, members, traced=traced or not few), traced=True)
    if not few and any(strayed([_pose(pose) for pose in poses], course) for poses in _poses(run, driven)):
        driven = _played(run, TeamBullet(solids, members, traced=traced), traced=True)
    return replace(driven if traced else _without_poses(driven), in_physics=True)


def _poses(run: TeamRun, mission: TeamDriven) -> list[FloatArray]:
    """Where each robot was, its berth first, shape (poses, 3) each."""
    return [np.concatenate([[run.ways.start(number)], *(part.pose for parts in trail for part in parts)])
            for number, trail in enumerate(mission.trails)]


def _wants_physics(run: TeamRun, twin: TeamDriven) -> bool:
    """Whether something may happen in a mission that the twins know nothing of."""
    return twin.contacts > 0 or any(
        len(poses) > 1 and wants_physics(run.world.obstacles, run.ways.model(number), mine.disturbance, poses)
        for number, (poses, mine) in enumerate(zip(_poses(run, twin), run.drawn, strict=True)))


def _checked(run: TeamRun, twin: TeamDriven) -> bool:
    """Whether a mission is one of the sample that checks the twins."""
    first = next((number for number, stops in enumerate(twin.stops) if len(stops) > 1), None)
    return first is not None and checked(
        run.ways.model(first), run.drawn[first].disturbance, np.concatenate(_poses(run, twin)))


def _without_poses(mission: TeamDriven) -> TeamDriven:
    return replace(mission, traced=False, trails=tuple(
        tuple(tuple(replace(part, since_s=np.empty(0), pose=np.empty((0, 3))) for part in parts) for parts in trail)
        for trail in mission.trails))
