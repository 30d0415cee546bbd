"""A mission of a team driven: by the joint twin, in physics, or by the twin with physics where that may matter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sva_bench.choices import Fidelity
from sva_bench.execution.noise import NoiseDraw
from sva_bench.execution.outcome import Assignment, RobotFate
from sva_bench.execution.shared.driver import Member
from sva_bench.execution.shared.lanes import Order
from sva_bench.execution.shared.mission import SharedMission
from sva_bench.execution.shared.own_ways import Ways
from sva_bench.execution.shared.players import TeamDriven
from sva_bench.execution.shared.team_twin import TeamTwin
from sva_bench.world.model import World


def drive_team(
    world: World, ways: Ways, orders: Sequence[Assignment], fates: Sequence[RobotFate], drawn: Sequence[NoiseDraw],
    order: Order | None, noise_index: tuple[int, int], fidelity: Fidelity, *, traced: bool,
) -> TeamDriven:
    """Play one mission.

    Args:
        world: The world.
        ways: The ways of its robots.
        orders, fates, drawn, order, noise_index: As of ``SharedMission``.
        fidelity: By the twin, in physics, or by the twin and in physics where that may make a difference.
        traced: Whether poses are kept.
    """
    members = [Member(model=ways.model(number), start=tuple(mine.disturbance.start(ways.start(number)).tolist()),
                      disturbance=mine.disturbance) for number, mine in enumerate(drawn)]
    with TeamTwin(members, traced=traced) as driver:
        played = SharedMission(world, ways, orders, fates, drawn, order, driver, noise_index).play()
    return replace(played, traced=traced)
