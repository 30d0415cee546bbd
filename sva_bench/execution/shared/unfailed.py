"""Missions of a team in which nobody fails by draw: what noise and other robots leave of each route."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from sva_bench.choices import End
from sva_bench.execution.case import Case
from sva_bench.execution.margins import Margins, margins_of
from sva_bench.execution.outcome import Assignment, Driven, RobotFate
from sva_bench.execution.shared.players import MissionKey, TeamDriven
from sva_bench.mission.failures import NEVER, process_of
from sva_bench.world.model import World

BAD: frozenset[End] = frozenset({"out_of_fuel", "late", "stuck"})
"""Ends that no failure drawn is behind."""
_LEAST_SHORT_S = 1e-3  # a robot that ran dry on a leg had so much of it ahead of it at least


def unfailed_keys(world: World, cases: Sequence[Case], orders: Sequence[Assignment], draws: int) -> list[MissionKey]:
    """The mission under each noise draw from which every robot leaves that may, and nobody fails on its way.

    Args:
        world: The world.
        cases: A plan, in the scenarios in some of which a robot may leave.
        orders: The orders of its robots.
        draws: How many draws, from the first on.
    """
    process = process_of(world.execute_failure)
    fates = tuple(RobotFate(NEVER if any(process.can_leave(case.scenario.reliability(robot)) for case in cases) else 0)
                  for robot in world.robots)
    routes = tuple(own.route for own in orders)
    return [MissionKey(routes, fates, draw) for draw in range(draws)] if any(
        own.route and fate.before_poi for own, fate in zip(orders, fates, strict=True)) else []


def leavers(key: MissionKey) -> list[int]:
    """The robots that leave their berths in a mission, if nobody fails on its way; else none."""
    routes, fates = key.routes, key.fates
    sent = [number for number, route in enumerate(routes) if route]
    if any(fates[number].before_poi not in (0, NEVER) or np.isfinite(fates[number].lifetime_s) for number in sent):
        return []
    return [number for number in sent if fates[number].before_poi == NEVER]


def margins_of_missions(orders: Sequence[Assignment], missions: Iterable[tuple[MissionKey, TeamDriven]]
                        ) -> tuple[Margins, ...]:
    """Margins of each robot's route where nobody fails by draw, waits for others on the clock; none of robots that
    stay home.

    Of each noise draw the mission counts from which most robots leave, this robot among them.

    Args:
        orders: The robots' orders.
        missions: Missions of their routes.
    """
    most: dict[tuple[int, int], tuple[int, TeamDriven]] = {}
    for key, mission in missions:
        mine = leavers(key)
        for number in mine:
            at = number, key.rollout
            if at not in most or most[at][0] < len(mine):
                most[at] = len(mine), mission
    return tuple(margins_of(number, own, [
        _as_ordered(own, most[at][1], number) for at in sorted(most) if at[0] == number])
        for number, own in enumerate(orders) if own.route)


def as_ordered_until(orders: Assignment, stops: Sequence[str]) -> int:
    """How many legs a robot was sent on as it was ordered before it was sent elsewhere."""
    return next((k for k, (a, b) in enumerate(zip(stops, orders.route, strict=False)) if a != b), len(stops)) - 1


def _as_ordered(orders: Assignment, mission: TeamDriven, number: int) -> Driven:
    """What a robot drove of its route.

    From a stop on that it left out, since somebody stood there, it drove nothing of it. A leg that it ran dry on takes
    what it was planned to take, and so do those after it.
    """
    driven, stops, outcome = mission.driven[number], mission.stops[number], mission.robots[number]
    leg_s, kept = driven.leg_s.tolist(), as_ordered_until(orders, stops)
    if kept < len(leg_s):
        return replace(driven, leg_s=np.array(leg_s[:kept + 1]), stuck=True)
    if outcome.end == "out_of_fuel" and len(leg_s) > outcome.stops_reached:
        leg = len(leg_s) - 1
        planned_s = orders.planned_s[leg] if orders.planned_s else 0.0
        rest = orders.planned_s[leg + 1:]  # as where robots do not meet: their routes are driven to the end
        return replace(driven, leg_s=np.array([*leg_s[:leg], max(leg_s[leg] + _LEAST_SHORT_S, planned_s), *rest]))
    return driven
